//! A graph as it was: its nodes and edges, in the slots that they had.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::{Component, ComponentId, Graph, Node, NodeId};
use crate::engine::saved::{RestoreError, ensure};

/// Which slots nodes and components have, and in which order the free ones are given. The order of a component's nodes
/// counts as well: it decides which part keeps the slot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Slots {
    free_nodes: Vec<u32>,
    /// The nodes of each slot.
    components: Vec<Vec<u32>>,
    free_components: Vec<u32>,
}

impl Slots {
    /// Slots of components, living or free.
    pub(crate) const fn components(&self) -> usize {
        self.components.len()
    }
}

impl Graph {
    /// Slots of nodes, taken or free.
    pub(crate) const fn node_slots(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn slots_taken(&self) -> Slots {
        let nodes = |component: &Component| component.nodes.iter().map(|node| node.0).collect();
        Slots {
            free_nodes: self.free_nodes.iter().map(|node| node.0).collect(),
            components: self.components.iter().map(nodes).collect(),
            free_components: self.free_components.iter().map(|component| component.0).collect(),
        }
    }

    /// The graph of these nodes and edges (in one direction or both) in the slots of `slots`.
    pub(crate) fn restore(
        slots: &Slots,
        weights: &BTreeMap<NodeId, u32>,
        edges: &[(NodeId, NodeId)],
    ) -> Result<Self, RestoreError> {
        ensure_all("nodes", weights.keys().map(|node| node.0), &slots.free_nodes)?;
        let living = (0..).zip(&slots.components).filter(|(_, nodes)| !nodes.is_empty());
        ensure_all("components", living.map(|(slot, _)| slot), &slots.free_components)?;
        let free =
            Node { weight: 0, component: None, place: 0, element: None, walk: None, neighbours: vec![] };
        let mut graph = Self {
            nodes: vec![free; weights.len() + slots.free_nodes.len()],
            components: vec![Component::default(); slots.components.len()],
            free_nodes: slots.free_nodes.iter().copied().map(NodeId).collect(),
            free_components: slots.free_components.iter().copied().map(ComponentId).collect(),
        };
        weights.iter().for_each(|(&node, &weight)| graph.node_mut(node).weight = weight);
        for (component, nodes) in (0..).map(ComponentId).zip(&slots.components) {
            for &node in nodes {
                let known = weights.contains_key(&NodeId(node));
                ensure(known && graph.node(NodeId(node)).component.is_none(), || {
                    format!("node {node} of {component:?} is not there or in two of them")
                })?;
                graph.enter(NodeId(node), component);
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
        for node in &mut self.nodes {
            node.neighbours.sort_unstable();
            node.neighbours.dedup();
        }
    }

    /// Each component hangs together, and no edge leads out of it.
    fn ensure_connected(&self) -> Result<(), RestoreError> {
        for (slot, component) in self.components.iter().enumerate() {
            let mut reached: BTreeSet<_> = component.nodes.first().copied().into_iter().collect();
            let mut open: Vec<_> = reached.iter().copied().collect();
            while let Some(node) = open.pop() {
                open.extend(self.neighbours(node).iter().filter(|&&other| reached.insert(other)));
            }
            let inside = |node: &NodeId| self.node(*node).component == Some(ComponentId(slot as u32));
            let hangs = reached.len() == component.nodes.len() && reached.iter().all(inside);
            ensure(hangs, || {
                format!(
                    "component {slot} has {} nodes, {} hang together",
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

/// Slots that are taken and free ones are all slots from 0 on, each once.
fn ensure_all(name: &str, taken: impl Iterator<Item = u32>, free: &[u32]) -> Result<(), RestoreError> {
    let mut all: Vec<_> = taken.chain(free.iter().copied()).collect();
    all.sort_unstable();
    let each_once = (0..).zip(&all).all(|(slot, &taken): (u32, _)| slot == taken);
    ensure(each_once, || {
        format!("{} slots of {name}, {} of them free, overlap or leave gaps", all.len(), free.len())
    })
}
