//! A graph in trees whose components are searched anew each time, and the one under test held equal to it.

use std::collections::{BTreeMap, BTreeSet};

use super::super::{Batch, ComponentId, End, Flow, Graph, NodeId, Outcome};

pub(super) type Partition = BTreeSet<BTreeSet<NodeId>>;

#[derive(Clone, Debug, Default)]
pub(super) struct Naive {
    pub(super) weights: BTreeMap<NodeId, u64>,
    pub(super) edges: BTreeSet<(NodeId, NodeId)>,
}

impl Naive {
    fn apply(&mut self, batch: &Batch, added: &[NodeId]) {
        for node in &batch.remove {
            self.weights.remove(node);
            self.edges.retain(|(one, other)| one != node && other != node);
        }
        for &(one, other) in &batch.disconnect {
            self.edges.remove(&(one, other));
            self.edges.remove(&(other, one));
        }
        self.weights.extend(added.iter().copied().zip(batch.add.iter().map(|&weight| u64::from(weight))));
        let node = |end| match end {
            End::Old(node) => node,
            End::New(at) => added[at as usize],
        };
        for &(one, other) in &batch.connect {
            self.edges.insert((node(one), node(other)));
            self.edges.insert((node(other), node(one)));
        }
    }

    fn neighbours(&self, node: NodeId) -> Vec<NodeId> {
        let of_node = self.edges.range((node, NodeId(0))..=(node, NodeId(u32::MAX)));
        of_node.map(|&(_, other)| other).collect()
    }

    fn partition(&self) -> Partition {
        let mut left: BTreeSet<NodeId> = self.weights.keys().copied().collect();
        let mut partition = BTreeSet::new();
        while let Some(first) = left.pop_first() {
            let (mut component, mut open) = (BTreeSet::from([first]), vec![first]);
            while let Some(node) = open.pop() {
                let new = self.neighbours(node).into_iter().filter(|&node| component.insert(node));
                open.extend(new);
            }
            left.retain(|node| !component.contains(node));
            partition.insert(component);
        }
        partition
    }
}

/// Components with their nodes, kept by outcomes alone.
type Shadow = BTreeMap<ComponentId, BTreeSet<NodeId>>;

#[derive(Clone, Debug, Default)]
pub(super) struct Held {
    pub(super) graph: Graph,
    pub(super) naive: Naive,
    shadow: Shadow,
}

impl Held {
    /// Applies a batch to all and compares what can be compared.
    pub(super) fn apply(&mut self, batch: &Batch) -> Outcome {
        let before = self.clone();
        let outcome = self.graph.apply(batch);
        let mut again = before.graph.clone();
        assert_eq!(again.apply(batch), outcome, "the same batch, another outcome");
        assert_eq!(again.expanded, self.graph.expanded);
        let added: Vec<NodeId> = outcome.added.iter().map(|&(node, _)| node).collect();
        self.naive.apply(batch, &added);
        follow(&mut self.shadow, &outcome);
        assert_eq!(partition(&self.graph), self.naive.partition());
        self.check_state();
        check_flows(&before, self, &outcome);
        check_slots(&outcome);
        check_order(before.graph, batch, &added, &self.naive.partition());
        outcome
    }

    /// Everything that the graph holds, against the trees.
    fn check_state(&self) {
        let graph = &self.graph;
        let ids: Vec<ComponentId> = graph.components().collect();
        assert_eq!(ids, self.shadow.keys().copied().collect::<Vec<_>>());
        for (&component, nodes) in &self.shadow {
            let mut listed = graph.nodes(component).to_vec();
            listed.sort_unstable();
            assert_eq!(listed, nodes.iter().copied().collect::<Vec<_>>());
            assert_eq!(
                graph.weight(component),
                nodes.iter().map(|node| self.naive.weights[node]).sum::<u64>()
            );
            for (place, &node) in graph.nodes(component).iter().enumerate() {
                assert_eq!((graph.component(node), graph.node(node).place as usize), (component, place));
                assert_eq!(graph.neighbours(node), self.naive.neighbours(node));
            }
        }
        assert!(graph.nodes.iter().all(|node| node.element.is_none() && node.walk.is_none()));
        assert_eq!(graph.nodes.len(), self.naive.weights.len() + graph.free_nodes.len());
        assert_eq!(graph.components.len(), ids.len() + graph.free_components.len());
    }
}

fn partition(graph: &Graph) -> Partition {
    graph.components().map(|component| graph.nodes(component).iter().copied().collect()).collect()
}

/// Applies an outcome to a partition; every word of it must be true of the partition.
fn follow(shadow: &mut Shadow, outcome: &Outcome) {
    let before: BTreeSet<ComponentId> = shadow.keys().copied().collect();
    for (node, from) in &outcome.gone {
        assert!(shadow.get_mut(from).unwrap().remove(node));
    }
    for moved in &outcome.moved {
        assert_ne!(moved.from, moved.to);
        assert!(shadow.get_mut(&moved.from).unwrap().remove(&moved.node));
        assert!(shadow.entry(moved.to).or_default().insert(moved.node));
    }
    for (node, to) in &outcome.added {
        assert!(shadow.entry(*to).or_default().insert(*node));
    }
    let empty: Vec<ComponentId> =
        shadow.iter().filter(|(_, nodes)| nodes.is_empty()).map(|(&id, _)| id).collect();
    assert_eq!(empty, outcome.removed);
    shadow.retain(|_, nodes| !nodes.is_empty());
    let new: Vec<ComponentId> = shadow.keys().filter(|id| !before.contains(id)).copied().collect();
    let mut created = outcome.created.clone();
    created.sort_unstable();
    assert_eq!(new, created);
}

/// Flows are those of the nodes that stayed; a component that has none stayed as it was but for new nodes.
fn check_flows(before: &Held, after: &Held, outcome: &Outcome) {
    let mut naive: BTreeMap<(ComponentId, ComponentId), u64> = BTreeMap::new();
    for (&from, nodes) in &before.shadow {
        for node in nodes.iter().filter(|&&node| outcome.gone.iter().all(|gone| gone.0 != node)) {
            *naive.entry((from, after.graph.component(*node))).or_default() += before.naive.weights[node];
        }
    }
    let told: BTreeSet<ComponentId> = outcome.flows.iter().map(|flow| flow.from).collect();
    let (expected, others): (Vec<_>, Vec<_>) =
        naive.into_iter().partition(|((from, _), _)| told.contains(from));
    let expected: Vec<Flow> =
        expected.into_iter().map(|((from, to), weight)| Flow { from, to, weight }).collect();
    assert_eq!(outcome.flows, expected);
    for ((from, to), _) in others {
        assert_eq!(from, to);
        assert!(outcome.flows.iter().all(|flow| flow.to != to));
    }
}

/// A component keeps its slot in one of its parts unless it is merged away; without a split, the heaviest keeps it.
fn check_slots(outcome: &Outcome) {
    let flows = &outcome.flows;
    for flow in flows {
        let stays = flows.iter().any(|other| (other.from, other.to) == (flow.from, flow.from));
        assert_ne!(stays, outcome.removed.contains(&flow.from));
    }
    if flows.windows(2).all(|pair| pair[0].from != pair[1].from) {
        for to in flows.iter().map(|flow| flow.to) {
            let of_merge = flows.iter().filter(|flow| flow.to == to);
            let heaviest = of_merge.max_by_key(|flow| (flow.weight, std::cmp::Reverse(flow.from))).unwrap();
            assert_eq!(heaviest.from, to);
        }
    }
}

/// The same batch backwards gives the same partition.
fn check_order(mut graph: Graph, batch: &Batch, added: &[NodeId], expected: &Partition) {
    let last = batch.add.len() as u32;
    let turn = |end| match end {
        End::New(at) => End::New(last - 1 - at),
        End::Old(_) => end,
    };
    let turned = Batch {
        remove: batch.remove.iter().rev().copied().collect(),
        add: batch.add.iter().rev().copied().collect(),
        disconnect: batch.disconnect.iter().rev().map(|&(one, other)| (other, one)).collect(),
        connect: batch.connect.iter().rev().map(|&(one, other)| (turn(other), turn(one))).collect(),
    };
    let outcome = graph.apply(&turned);
    let names: BTreeMap<NodeId, NodeId> =
        outcome.added.iter().rev().map(|&(node, _)| node).zip(added.iter().copied()).collect();
    let named = |nodes: BTreeSet<NodeId>| nodes.iter().map(|node| *names.get(node).unwrap_or(node)).collect();
    assert_eq!(partition(&graph).into_iter().map(named).collect::<Partition>(), *expected);
}
