//! Which nodes hang together, as it was after a batch.

use super::restore::Slots;
use super::{Component, ComponentId, Graph, NodeId};
use crate::engine::consistent::lists::shared::Shared;

/// The components of a [`Graph`], with their slots. It shares with the graph what no batch has changed since.
#[derive(Clone, Debug)]
pub(crate) struct FrozenGraph {
    components: Shared<ComponentId, Component>,
    free_nodes: Vec<NodeId>,
    free_components: Vec<ComponentId>,
}

impl Graph {
    /// As it is now.
    pub(crate) fn freeze(&self) -> FrozenGraph {
        FrozenGraph {
            components: self.components.clone(),
            free_nodes: self.free_nodes.clone(),
            free_components: self.free_components.clone(),
        }
    }
}

impl FrozenGraph {
    /// Each node that is there, with its component.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (NodeId, ComponentId)> {
        self.components.each().flat_map(|(at, component)| component.nodes.iter().map(move |&node| (node, at)))
    }

    pub(crate) fn slots_taken(&self) -> Slots {
        Slots {
            free_nodes: self.free_nodes.clone(),
            components: self.components.iter().map(|component| component.nodes.iter().copied()).collect(),
            free_components: self.free_components.clone(),
        }
    }

    /// What part of its pages is shared with another.
    #[cfg(test)]
    pub(crate) fn shared_with(&self, other: &Self) -> f64 {
        self.components.shared_with(&other.components)
    }
}
