//! Connected components of a sparse graph whose nodes and edges come and go.
//!
//! # Definition
//!
//! A [`Graph`] is simple and undirected; each node has a weight. A [`Batch`] takes nodes and edges away and brings new
//! ones. With N and E before it, N' = (N \ `remove`) + `add`, and E' is (E \ `disconnect`) + `connect` without the edges
//! of nodes that went. After it two nodes have the same [`ComponentId`] exactly if a path of E' joins them, and the
//! weight of a component is the sum over its nodes. The [`Outcome`] says what became of the components before.
//!
//! # Which component keeps its slot
//!
//! A component that is cut keeps its slot for the part whose search was still running when the others had come to their
//! end: mostly the one of most nodes, whatever it weighs. Where parts of several components come together, the slot of
//! the heaviest stays, and the lower slot of two equal ones. A part without a slot gets a new one; a component without
//! a node that stayed is removed. No slot that a batch frees is given again in that batch. Lasting ids are for the
//! caller to decide: [`Outcome::flows`] holds the weights for it.
//!
//! # How, and what it costs
//!
//! 1. Nodes and edges go; the nodes that stay and lost a neighbour are *terminals*. Nodes and edges come.
//! 2. A union-find over the nodes of the batch (new nodes, terminals, ends of new edges) unites what is joined by an
//!    edge among them, and the nodes of a component that lost nothing. Every node of a component that lost something
//!    reaches one of its terminals, so a component whose terminals are united is whole. Costs the edges at these nodes.
//!    Where a block of patches is replaced by the like, it ends here.
//! 3. Otherwise the groups of terminals that are still apart search the component in lockstep, breadth first, one node
//!    each in turn, and only among its old nodes: new ones are in the union-find. Groups that meet unite, a group
//!    without a node left is a part, and the last group is not searched to its end. Parts of `s_1 <= ... <= s_k` nodes
//!    cost at most `s_1 + ... + s_(k-1)` expansions and `s_(k-1) + 1` in the last, if each has one group of terminals.
//!    Groups that belong together walk until they meet: a few steps around a hole in a surface, but the whole of a long
//!    cycle that is opened at one place.
//! 4. Labels move: those of nodes in parts that were searched to their end, and in the lighter of merged components.
//!
//! So a batch costs what it names with its neighbours, the smaller sides of cuts, the ways around them and the lighter
//! sides of merges, never the size of a component; but after [`Graph::freeze`], once for each page of components that it changes, the
//! components there with all their nodes. A node's neighbours are a sorted vector: a change at a node of degree d costs O(d). Nothing is hashed. A node takes 56 bytes and 4 for each neighbour, beside 4 in its component.
//!
//! # Why not Holm, de Lichtenberg and Thorup
//!
//! Their structure answers any deletion in amortised O(log^2 n), opened cycles too, by a hierarchy of spanning forests
//! with Euler tours in balanced trees: several words per node and level, a level per edge, and logarithms on every
//! insertion. Patches have few neighbours, most deletions come with their replacement and never reach step 3, and
//! splits are rare and small; the long way around is the only thing that the search pays dearly, and surfaces seldom
//! have one. A polylogarithm that is paid always is not worth its memory here.
//!
//! # What is measured, and what else could be
//!
//! Tests count the nodes that step 3 expanded (`Graph::expanded`). Beside them one could count the neighbours it read (hubs
//! make one expansion dear; a lockstep over edges would even that out), the groups per search, the expansions that
//! ended in a meeting and not in a split (the price of ways around), and the labels moved back and forth by components
//! that merge and split in turn.

mod assign;
mod frozen;
mod lists;
mod restore;
mod search;
#[cfg(test)]
mod tests;
mod union;

use serde::{Deserialize, Serialize};

pub(crate) use self::frozen::FrozenGraph;
pub(crate) use self::lists::NodeLists;
pub(crate) use self::restore::Slots;
use self::union::BatchUnion;
use super::lists::by::Place;
use super::lists::shared::Shared;

/// A node's slot; given again after its removal, from the next batch on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub(crate) struct NodeId(pub(crate) u32);

impl Place for NodeId {
    fn at(place: usize) -> Self {
        Self(place as u32)
    }

    fn place(self) -> usize {
        self.0 as usize
    }
}

/// A component's slot; given again after its removal, from the next batch on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub(crate) struct ComponentId(pub(crate) u32);

impl ComponentId {
    pub(crate) const MIN: Self = Self(u32::MIN);
    pub(crate) const MAX: Self = Self(u32::MAX);
}

impl Place for ComponentId {
    fn at(place: usize) -> Self {
        Self(place as u32)
    }

    fn place(self) -> usize {
        self.0 as usize
    }
}

/// An end of an edge that comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// A node that was there before the batch and stays.
    Old(NodeId),
    /// The node at this place of [`Batch::add`].
    New(u32),
}

/// What changes at once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Batch {
    /// Nodes that go, each once, with all their edges.
    pub(crate) remove: Vec<NodeId>,
    /// Weights of the nodes that come.
    pub(crate) add: Vec<u32>,
    /// Edges that go. A set: either direction, naming one twice or one that is not there changes nothing.
    pub(crate) disconnect: Vec<(NodeId, NodeId)>,
    /// Edges that are there afterwards, whatever `disconnect` says. A set as well.
    pub(crate) connect: Vec<(End, End)>,
}

/// A node that stayed and whose component changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Moved {
    pub(crate) node: NodeId,
    pub(crate) from: ComponentId,
    pub(crate) to: ComponentId,
}

/// How much of a component before the batch is in which one after it, over the nodes that stayed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Flow {
    pub(crate) from: ComponentId,
    pub(crate) to: ComponentId,
    pub(crate) weight: u64,
}

/// What became of the components. Applied to a copy of the partition before, `gone`, `moved` and `added` give the one
/// after.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outcome {
    /// Components that were not there before; [`Graph::nodes`] lists their nodes.
    pub(crate) created: Vec<ComponentId>,
    /// Components that are no longer there, ascending: empty or merged away.
    pub(crate) removed: Vec<ComponentId>,
    /// Each node that stayed and changed its component.
    pub(crate) moved: Vec<Moved>,
    /// Each node that went and its component before, in the order of [`Batch::remove`].
    pub(crate) gone: Vec<(NodeId, ComponentId)>,
    /// Each node that came and its component, in the order of [`Batch::add`].
    pub(crate) added: Vec<(NodeId, ComponentId)>,
    /// All flows of each component that the batch touched, by ascending `from`, then `to`: several of one `from` are a
    /// split, several of one `to` a merge.
    pub(crate) flows: Vec<Flow>,
}

#[derive(Clone, Debug, Default)]
struct Node {
    weight: u32,
    /// None if the slot is free, and for a new node until its batch is done.
    component: Option<ComponentId>,
    /// Where it stands in its component's nodes.
    place: u32,
    /// Its element in the union-find of the batch that is being applied.
    element: Option<u32>,
    /// The walk of the search under way that reached it.
    walk: Option<u32>,
    /// Ascending.
    neighbours: Vec<NodeId>,
}

/// Lives while it has nodes.
#[derive(Clone, Debug, Default)]
struct Component {
    nodes: Vec<NodeId>,
    weight: u64,
}

/// An undirected graph and its connected components.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    /// In pages, so that a list that grows does not pause to copy itself; none is frozen.
    nodes: Shared<NodeId, Node>,
    components: Shared<ComponentId, Component>,
    free_nodes: Vec<NodeId>,
    free_components: Vec<ComponentId>,
    /// Nodes that searches have expanded so far.
    #[cfg(test)]
    expanded: u64,
}

impl Graph {
    /// The component of a node that is there.
    pub(crate) fn component(&self, node: NodeId) -> ComponentId {
        let Some(component) = self.node(node).component else { unreachable!("{node:?} is not in the graph") };
        component
    }

    /// The nodes of a component, in an order that the batches determine; none if it does not live.
    pub(crate) fn nodes(&self, component: ComponentId) -> &[NodeId] {
        self.components.get(component).map_or(&[], |slot| &slot.nodes)
    }

    /// The sum of the weights of a component's nodes.
    pub(crate) fn weight(&self, component: ComponentId) -> u64 {
        self.components.get(component).map_or(0, |slot| slot.weight)
    }

    /// The living components, ascending.
    #[cfg(test)]
    pub(crate) fn components(&self) -> impl Iterator<Item = ComponentId> {
        self.components.each().filter(|(_, slot)| !slot.nodes.is_empty()).map(|(component, _)| component)
    }

    /// The nodes that share an edge with this one, ascending.
    pub(crate) fn neighbours(&self, node: NodeId) -> &[NodeId] {
        &self.node(node).neighbours
    }

    /// Applies a batch and says what became of the components.
    ///
    /// # Panics
    ///
    /// If the batch names a node that is not there, removes one twice, joins one to itself or to one that it removes.
    /// The graph is of no use afterwards.
    pub(crate) fn apply(&mut self, batch: &Batch) -> Outcome {
        let mut union = BatchUnion::default();
        let gone = self.remove(&batch.remove, &mut union);
        self.disconnect(&batch.disconnect, &mut union);
        let added = self.add(&batch.add, &mut union);
        self.connect(&batch.connect, &added, &mut union);
        self.unite_neighbours(&mut union);
        let parts = self.parts(&mut union);
        let mut outcome = Outcome { gone, ..Outcome::default() };
        self.assign(parts, &added, &mut union, &mut outcome);
        self.release(&union, &mut outcome);
        outcome
    }

    fn node(&self, node: NodeId) -> &Node {
        &self.nodes[node]
    }

    fn node_mut(&mut self, node: NodeId) -> &mut Node {
        &mut self.nodes[node]
    }

    fn component_mut(&mut self, component: ComponentId) -> &mut Component {
        &mut self.components[component]
    }

    /// Takes a node out of its component.
    fn leave(&mut self, node: NodeId) -> ComponentId {
        let from = self.component(node);
        let Node { weight, place, .. } = *self.node(node);
        let component = self.component_mut(from);
        component.weight -= u64::from(weight);
        component.nodes.swap_remove(place as usize);
        if let Some(&last) = component.nodes.get(place as usize) {
            self.node_mut(last).place = place;
        }
        self.node_mut(node).component = None;
        from
    }

    /// Puts a node that is in no component into one.
    fn enter(&mut self, node: NodeId, to: ComponentId) {
        let weight = self.node(node).weight;
        let component = self.component_mut(to);
        component.weight += u64::from(weight);
        component.nodes.push(node);
        let place = component.nodes.len() as u32 - 1;
        let slot = self.node_mut(node);
        (slot.component, slot.place) = (Some(to), place);
    }
}
