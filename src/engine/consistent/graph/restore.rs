//! A graph as it was: its nodes and edges, in the slots that they had.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::{ComponentId, Graph, NodeId, NodeLists};
use crate::engine::consistent::lists::by::Place;
use crate::engine::saved::{RestoreError, ensure};

/// Which slots nodes and components have, and in which order the free ones are given. The order of a component's nodes
/// counts as well: it decides which part keeps the slot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Slots {
    pub(super) free_nodes: Vec<NodeId>,
    /// The nodes of each slot.
    pub(super) components: NodeLists,
    pub(super) free_components: Vec<ComponentId>,
}

impl Slots {
    /// Slots of components, living or free.
    pub(crate) const fn components(&self) -> usize {
        self.components.len()
    }
}

impl Graph {
    /// Slots of nodes, taken or free.
    pub(crate) fn node_slots(&self) -> usize {
        self.nodes.len()
    }

    /// The graph of these nodes and edges (in one direction or both) in the slots of `slots`.
    pub(crate) fn restore(
        slots: &Slots,
        weights: &BTreeMap<NodeId, u32>,
        edges: &[(NodeId, NodeId)],
    ) -> Result<Self, RestoreError> {
        let nodes = weights.len() + slots.free_nodes.len();
        ensure_all("nodes", nodes, weights.keys().copied(), &slots.free_nodes)?;
        let living =
            (0..).map(ComponentId).zip(slots.components.iter()).filter(|(_, nodes)| !nodes.is_empty());
        let living = living.map(|(slot, _)| slot);
        ensure_all("components", slots.components.len(), living, &slots.free_components)?;
        let mut graph = Self {
            free_nodes: slots.free_nodes.clone(),
            free_components: slots.free_components.clone(),
            ..Self::default()
        };
        graph.nodes.set_len(nodes);
        graph.components.set_len(slots.components.len());
        weights.iter().for_each(|(&node, &weight)| graph.node_mut(node).weight = weight);
        for (component, nodes) in (0..).map(ComponentId).zip(slots.components.iter()) {
            for &node in nodes {
                let known = weights.contains_key(&node);
                ensure(known && graph.node(node).component.is_none(), || {
                    format!("{node:?} of {component:?} is not there or in two of them")
                })?;
                graph.enter(node, component);
            }
        }
        graph.link(edges);
        graph.ensure_connected()?;
        Ok(graph)
    }

    fn link(&mut self, edges: &[(NodeId, NodeId)]) {
        for &(a, b) in edges {
            self.node_mut(a).neighbours.push(b);
            self.node_mut(b).neighbours.push(a);
        }
        for node in (0..self.nodes.len()).map(NodeId::at) {
            let neighbours = &mut self.node_mut(node).neighbours;
            neighbours.sort_unstable();
            neighbours.dedup();
        }
    }

    /// Each component hangs together, and no edge leads out of it.
    fn ensure_connected(&self) -> Result<(), RestoreError> {
        for (id, component) in self.components.each() {
            let mut reached: BTreeSet<_> = component.nodes.first().copied().into_iter().collect();
            let mut open: Vec<_> = reached.iter().copied().collect();
            while let Some(node) = open.pop() {
                open.extend(self.neighbours(node).iter().filter(|&&other| reached.insert(other)));
            }
            let inside = |node: &NodeId| self.node(*node).component == Some(id);
            let hangs = reached.len() == component.nodes.len() && reached.iter().all(inside);
            ensure(hangs, || {
                format!(
                    "component {} has {} nodes, {} hang together",
                    id.0,
                    component.nodes.len(),
                    reached.len()
                )
            })?;
        }
        let alone = self.nodes.iter().filter(|node| node.component.is_none()).count();
        ensure(alone == self.free_nodes.len(), || {
            format!("{alone} nodes in no component, {} of them free", self.free_nodes.len())
        })
    }
}

/// Slots that are taken and free ones are all that there are, each once.
fn ensure_all<T: Place + Ord>(
    name: &str,
    slots: usize,
    taken: impl Iterator<Item = T>,
    free: &[T],
) -> Result<(), RestoreError> {
    let mut all: Vec<_> = taken.chain(free.iter().copied()).collect();
    all.sort_unstable();
    let each_once = all.len() == slots && all.iter().enumerate().all(|(slot, taken)| slot == taken.place());
    ensure(each_once, || {
        format!(
            "{} of {slots} slots of {name}, {} of them free, overlap or leave gaps",
            all.len(),
            free.len()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three nodes, two of them joined, in slots 0, 1 and 3; slot 2 is free, as is component 1.
    fn slots() -> Slots {
        let components = lists([&[3], &[], &[1, 0]]);
        Slots { free_nodes: vec![NodeId(2)], components, free_components: vec![ComponentId(1)] }
    }

    fn lists(components: [&[u32]; 3]) -> NodeLists {
        components.into_iter().map(|nodes| nodes.iter().copied().map(NodeId)).collect()
    }

    fn restore(slots: &Slots, edges: &[(u32, u32)]) -> Result<Graph, RestoreError> {
        let weights = [0, 1, 3].map(|node| (NodeId(node), 5)).into();
        let edges: Vec<_> = edges.iter().map(|&(a, b)| (NodeId(a), NodeId(b))).collect();
        Graph::restore(slots, &weights, &edges)
    }

    #[test]
    fn a_graph_has_the_slots_that_it_had() {
        let graph = restore(&slots(), &[(0, 1), (1, 0)]).unwrap();
        assert_eq!(graph.freeze().slots_taken(), slots());
        assert_eq!(graph.neighbours(NodeId(0)), [NodeId(1)]);
        assert_eq!((graph.component(NodeId(3)), graph.weight(ComponentId(2))), (ComponentId(0), 10));
    }

    #[test]
    fn slots_that_contradict_the_nodes_or_each_other_are_refused() {
        let other = |change: &dyn Fn(&mut Slots)| {
            let mut slots = slots();
            change(&mut slots);
            restore(&slots, &[(0, 1)]).unwrap_err()
        };
        let nodes = |nodes: &[u32]| nodes.iter().copied().map(NodeId).collect();
        other(&|slots| slots.free_nodes = vec![]);
        other(&|slots| slots.free_nodes = nodes(&[2, 2]));
        other(&|slots| slots.free_nodes = nodes(&[2, 4, 6]));
        other(&|slots| slots.free_components = vec![]);
        // A find of the fuzzer: the free slot was beyond the list.
        other(&|slots| slots.free_components = vec![ComponentId(1), ComponentId(3)]);
        other(&|slots| slots.components = lists([&[2], &[], &[1, 0]]));
        other(&|slots| slots.components = lists([&[3, 3], &[], &[1, 0]]));
        other(&|slots| slots.components = lists([&[9], &[], &[1, 0]]));
        other(&|slots| slots.components = lists([&[3], &[], &[1]]));
        assert!(restore(&slots(), &[]).is_err(), "it does not hang together");
        assert!(restore(&slots(), &[(0, 1), (1, 3)]).is_err(), "an edge leads out");
    }
}
