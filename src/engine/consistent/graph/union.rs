//! Steps 1 and 2: the batch's nodes and edges go and come, and what joins them near by is united.

use super::{End, Graph, Node, NodeId};
use crate::engine::consistent::lists::by::Place;

/// The nodes of a batch: new ones, those that lost a neighbour, ends of new edges; with a union-find over them.
///
/// Elements of one class are connected once the batch is applied. A class's root is its least element, so classes do
/// not depend on the order of the unions.
#[derive(Debug, Default)]
pub(super) struct BatchUnion {
    pub(super) nodes: Vec<NodeId>,
    /// Whether it stayed and lost a neighbour.
    pub(super) terminal: Vec<bool>,
    parents: Vec<u32>,
}

impl BatchUnion {
    /// The root of an element's class.
    pub(super) fn root(&mut self, mut element: u32) -> u32 {
        while self.parents[element as usize] != element {
            let above = self.parents[self.parents[element as usize] as usize];
            self.parents[element as usize] = above;
            element = above;
        }
        element
    }

    pub(super) fn unite(&mut self, one: u32, other: u32) {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one.max(other) as usize] = one.min(other);
    }

    pub(super) fn unite_all(&mut self, elements: &[u32]) {
        elements.windows(2).for_each(|pair| self.unite(pair[0], pair[1]));
    }

    /// Whether one component's elements are seen to be connected: if its terminals are, or if it has none. Then all
    /// are united.
    pub(super) fn unite_if_whole(&mut self, elements: &[u32]) -> bool {
        let mut terminals = elements.iter().filter(|&&element| self.terminal[element as usize]).copied();
        let whole = match terminals.next() {
            Some(first) => {
                let rest: Vec<u32> = terminals.collect();
                let root = self.root(first);
                rest.into_iter().all(|element| self.root(element) == root)
            }
            None => true,
        };
        if whole {
            self.unite_all(elements);
        }
        whole
    }
}

impl Graph {
    /// The node's element, made when it is first asked for.
    fn element(&mut self, node: NodeId, union: &mut BatchUnion) -> u32 {
        self.node(node).element.unwrap_or_else(|| {
            let element = union.nodes.len() as u32;
            union.nodes.push(node);
            union.terminal.push(false);
            union.parents.push(element);
            self.node_mut(node).element = Some(element);
            element
        })
    }

    fn make_terminal(&mut self, node: NodeId, union: &mut BatchUnion) {
        let element = self.element(node, union);
        union.terminal[element as usize] = true;
    }

    /// Takes nodes out of their components and out of their neighbours' lists.
    pub(super) fn remove(
        &mut self,
        nodes: &[NodeId],
        union: &mut BatchUnion,
    ) -> Vec<(NodeId, super::ComponentId)> {
        // All leave before any neighbour is looked at: a neighbour that goes too is no terminal.
        let gone = nodes.iter().map(|&node| (node, self.leave(node))).collect();
        for &node in nodes {
            for neighbour in std::mem::take(&mut self.node_mut(node).neighbours) {
                if self.node(neighbour).component.is_some() {
                    self.forget(neighbour, node);
                    self.make_terminal(neighbour, union);
                }
            }
        }
        gone
    }

    /// Takes edges away. Those of nodes that went are gone already.
    pub(super) fn disconnect(&mut self, edges: &[(NodeId, NodeId)], union: &mut BatchUnion) {
        for &(one, other) in edges {
            if self.forget(one, other) {
                self.forget(other, one);
                self.make_terminal(one, union);
                self.make_terminal(other, union);
            }
        }
    }

    /// Whether `neighbour` was in the node's list, from which it is taken.
    fn forget(&mut self, node: NodeId, neighbour: NodeId) -> bool {
        let neighbours = &mut self.node_mut(node).neighbours;
        neighbours.binary_search(&neighbour).map(|at| neighbours.remove(at)).is_ok()
    }

    /// Gives slots to new nodes, which are in no component yet.
    pub(super) fn add(&mut self, weights: &[u32], union: &mut BatchUnion) -> Vec<NodeId> {
        let give = |&weight| {
            let id = self.free_nodes.pop().unwrap_or(NodeId::at(self.nodes.len()));
            *self.nodes.grow_to(id) = Node { weight, ..Node::default() };
            self.element(id, union);
            id
        };
        weights.iter().map(give).collect()
    }

    pub(super) fn connect(&mut self, edges: &[(End, End)], added: &[NodeId], union: &mut BatchUnion) {
        for &(one, other) in edges {
            let [one, other] = [one, other].map(|end| self.resolve(end, added));
            assert!(one != other, "{one:?} cannot be joined to itself");
            for (node, neighbour) in [(one, other), (other, one)] {
                let neighbours = &mut self.node_mut(node).neighbours;
                if let Err(at) = neighbours.binary_search(&neighbour) {
                    neighbours.insert(at, neighbour);
                }
                self.element(node, union);
            }
        }
    }

    fn resolve(&self, end: End, added: &[NodeId]) -> NodeId {
        match end {
            End::Old(node) => {
                assert!(self.node(node).component.is_some(), "{node:?} is not in the graph");
                node
            }
            End::New(at) => added[at as usize],
        }
    }

    /// Unites what an edge among the batch's nodes joins.
    pub(super) fn unite_neighbours(&self, union: &mut BatchUnion) {
        for element in 0..union.nodes.len() as u32 {
            for &neighbour in self.neighbours(union.nodes[element as usize]) {
                if let Some(other) = self.node(neighbour).element {
                    union.unite(element, other);
                }
            }
        }
    }
}
