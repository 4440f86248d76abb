//! Step 4: slots for the components after the batch, and labels for the nodes that come into another one.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::search::{Extent, Part};
use super::union::BatchUnion;
use super::{ComponentId, Flow, Graph, Moved, NodeId, Outcome};
use crate::engine::consistent::lists::by::Place;

/// What one component before the batch gives to one after it.
#[derive(Debug, Default)]
struct Share {
    weight: u64,
    /// Whether the part is in it that was not searched.
    rest: bool,
}

impl Graph {
    /// Labels every node of the batch's components anew where it has to be.
    pub(super) fn assign(
        &mut self,
        parts: Vec<Part>,
        added: &[NodeId],
        union: &mut BatchUnion,
        outcome: &mut Outcome,
    ) {
        // By root and component before.
        let mut shares: BTreeMap<(u32, ComponentId), Share> = BTreeMap::new();
        for part in &parts {
            let share = shares.entry((union.root(part.element), part.from)).or_default();
            share.weight += part.weight;
            share.rest |= matches!(part.extent, Extent::Rest);
        }
        let slots = self.slots(&shares, union, outcome);
        let flows =
            shares.iter().map(|(&(root, from), share)| Flow { from, to: slots[&root], weight: share.weight });
        outcome.flows = flows.collect();
        outcome.flows.sort_unstable_by_key(|flow| (flow.from, flow.to));
        self.relabel(parts, &slots, union, outcome);
        for &node in added {
            let Some(element) = self.node(node).element else { continue };
            let to = slots[&union.root(element)];
            self.enter(node, to);
            outcome.added.push((node, to));
        }
    }

    /// The slot of each class by its root: that of the heaviest component whose rest is in it, or a new one.
    fn slots(
        &mut self,
        shares: &BTreeMap<(u32, ComponentId), Share>,
        union: &mut BatchUnion,
        outcome: &mut Outcome,
    ) -> BTreeMap<u32, ComponentId> {
        let mut slots = BTreeMap::new();
        for root in 0..union.nodes.len() as u32 {
            if union.root(root) != root {
                continue;
            }
            let of_class = shares.range((root, ComponentId::MIN)..=(root, ComponentId::MAX));
            let heirs = of_class.filter(|(_, share)| share.rest);
            let heir = heirs.max_by_key(|&(&(_, from), share)| (share.weight, Reverse(from)));
            let slot = if let Some((&(_, from), _)) = heir {
                from
            } else {
                let slot = self.new_component();
                outcome.created.push(slot);
                slot
            };
            slots.insert(root, slot);
        }
        slots
    }

    fn new_component(&mut self) -> ComponentId {
        self.free_components.pop().unwrap_or_else(|| {
            self.components.push(super::Component::default());
            ComponentId::at(self.components.len() - 1)
        })
    }

    fn relabel(
        &mut self,
        parts: Vec<Part>,
        slots: &BTreeMap<u32, ComponentId>,
        union: &mut BatchUnion,
        outcome: &mut Outcome,
    ) {
        // Parts that were searched leave first: then what is left in a component is its rest.
        let mut rests = Vec::new();
        for part in parts {
            let (from, to) = (part.from, slots[&union.root(part.element)]);
            match part.extent {
                _ if from == to => {}
                Extent::Searched(nodes) => self.move_all(&nodes, from, to, outcome),
                Extent::Rest => rests.push((from, to)),
            }
        }
        for (from, to) in rests {
            let nodes = self.nodes(from).to_vec();
            self.move_all(&nodes, from, to, outcome);
        }
    }

    fn move_all(&mut self, nodes: &[NodeId], from: ComponentId, to: ComponentId, outcome: &mut Outcome) {
        for &node in nodes {
            self.leave(node);
            self.enter(node, to);
            outcome.moved.push(Moved { node, from, to });
        }
    }

    /// Frees what went, for the next batch.
    pub(super) fn release(&mut self, union: &BatchUnion, outcome: &mut Outcome) {
        union.nodes.iter().for_each(|&node| self.node_mut(node).element = None);
        self.free_nodes.extend(outcome.gone.iter().map(|&(node, _)| node));
        let before = outcome.gone.iter().map(|&(_, from)| from);
        let before = before.chain(outcome.moved.iter().map(|moved| moved.from));
        outcome.removed = before.filter(|&component| self.nodes(component).is_empty()).collect();
        outcome.removed.sort_unstable();
        outcome.removed.dedup();
        outcome.removed.iter().for_each(|&component| self.component_mut(component).nodes = Vec::new());
        self.free_components.extend(&outcome.removed);
    }
}
