//! Step 3: a component whose terminals are not united near by is searched from all of them in lockstep.

use std::collections::VecDeque;

use super::union::BatchUnion;
use super::{ComponentId, Graph, NodeId};

/// Nodes of one component before the batch that are together afterwards.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) from: ComponentId,
    /// Any element of the part.
    pub(super) element: u32,
    pub(super) weight: u64,
    pub(super) extent: Extent,
}

#[derive(Debug)]
pub(super) enum Extent {
    /// These nodes: a search came to its end in them.
    Searched(Vec<NodeId>),
    /// All others of the component.
    Rest,
}

/// A search from one class of elements; its nodes are those in `done` and in `pending`.
#[derive(Debug)]
struct Walk {
    /// The walk that took it in; itself while there is none.
    parent: u32,
    element: u32,
    /// False while it holds no terminal: then it only waits to be met.
    runs: bool,
    done: Vec<NodeId>,
    pending: VecDeque<NodeId>,
    weight: u64,
}

/// The search of one component.
struct Search<'a> {
    graph: &'a mut Graph,
    component: ComponentId,
    walks: Vec<Walk>,
    /// Walks that run and were not taken in.
    running: usize,
}

impl Graph {
    /// What the batch left of each component that it touched.
    pub(super) fn parts(&mut self, union: &mut BatchUnion) -> Vec<Part> {
        let mut members: Vec<(ComponentId, u32)> =
            (0..).zip(&union.nodes).filter_map(|(e, &node)| Some((self.node(node).component?, e))).collect();
        members.sort_unstable();
        let (mut parts, mut apart) = (Vec::new(), Vec::new());
        for chunk in members.chunk_by(|one, other| one.0 == other.0) {
            let component = chunk[0].0;
            let elements: Vec<u32> = chunk.iter().map(|&(_, element)| element).collect();
            if union.unite_if_whole(&elements) {
                parts.push(self.whole(component, elements[0]));
            } else {
                apart.push((component, elements));
            }
        }
        // What was whole at a glance may have joined the terminals of these.
        for (component, elements) in apart {
            if union.unite_if_whole(&elements) {
                parts.push(self.whole(component, elements[0]));
            } else {
                let mut search = Search::new(self, component, &elements, union);
                search.run(union);
                search.finish(&elements, union, &mut parts);
            }
        }
        parts
    }

    fn whole(&self, from: ComponentId, element: u32) -> Part {
        Part { from, element, weight: self.weight(from), extent: Extent::Rest }
    }
}

impl<'a> Search<'a> {
    /// A walk for each class of the component's elements.
    fn new(graph: &'a mut Graph, component: ComponentId, elements: &[u32], union: &mut BatchUnion) -> Self {
        let mut classes: Vec<(u32, u32)> = elements.iter().map(|&e| (union.root(e), e)).collect();
        classes.sort_unstable();
        let mut walks = Vec::new();
        for class in classes.chunk_by(|one, other| one.0 == other.0) {
            let number = walks.len() as u32;
            let pending: VecDeque<NodeId> = class.iter().map(|&(_, e)| union.nodes[e as usize]).collect();
            pending.iter().for_each(|&node| graph.node_mut(node).walk = Some(number));
            let runs = class.iter().any(|&(_, e)| union.terminal[e as usize]);
            let element = class[0].0;
            walks.push(Walk { parent: number, element, runs, done: Vec::new(), pending, weight: 0 });
        }
        let running = walks.iter().filter(|walk| walk.runs).count();
        Self { graph, component, walks, running }
    }

    fn root(&self, mut walk: u32) -> u32 {
        while self.walks[walk as usize].parent != walk {
            walk = self.walks[walk as usize].parent;
        }
        walk
    }

    /// Walks in turn, one node each, until a single one runs.
    fn run(&mut self, union: &mut BatchUnion) {
        let all = 0..self.walks.len() as u32;
        let mut turns: VecDeque<u32> = all.filter(|&walk| self.walks[walk as usize].runs).collect();
        while self.running > 1
            && let Some(number) = turns.pop_front()
        {
            let walk = &mut self.walks[number as usize];
            if walk.parent != number {
                continue;
            }
            if let Some(node) = walk.pending.pop_front() {
                self.expand(number, node, union);
                turns.push_back(number);
            } else {
                walk.runs = false;
                self.running -= 1;
            }
        }
    }

    fn expand(&mut self, number: u32, node: NodeId, union: &mut BatchUnion) {
        #[cfg(test)]
        {
            self.graph.expanded += 1;
        }
        let slot = self.graph.node_mut(node);
        let neighbours = std::mem::take(&mut slot.neighbours);
        let walk = &mut self.walks[number as usize];
        walk.weight += u64::from(slot.weight);
        walk.done.push(node);
        for &neighbour in &neighbours {
            let slot = self.graph.node_mut(neighbour);
            if slot.component != Some(self.component) {
                continue;
            }
            if let Some(other) = slot.walk {
                self.meet(number, other, union);
            } else {
                slot.walk = Some(number);
                self.walks[number as usize].pending.push_back(neighbour);
            }
        }
        self.graph.node_mut(node).neighbours = neighbours;
    }

    /// Takes in the walk that `other` belongs to by now. It has not come to its end, or it would hold the node that is
    /// being expanded.
    fn meet(&mut self, number: u32, other: u32, union: &mut BatchUnion) {
        let other = self.root(other);
        if other == number {
            return;
        }
        let taken = &mut self.walks[other as usize];
        taken.parent = number;
        self.running -= usize::from(taken.runs);
        let (mut done, mut pending) = (std::mem::take(&mut taken.done), std::mem::take(&mut taken.pending));
        let (weight, element) = (taken.weight, taken.element);
        let walk = &mut self.walks[number as usize];
        union.unite(walk.element, element);
        walk.weight += weight;
        // The longer lists stay in place.
        if done.len() > walk.done.len() {
            std::mem::swap(&mut done, &mut walk.done);
        }
        if pending.len() > walk.pending.len() {
            std::mem::swap(&mut pending, &mut walk.pending);
        }
        walk.done.append(&mut done);
        walk.pending.append(&mut pending);
    }

    /// The parts, and no trace of the search in the nodes.
    fn finish(self, elements: &[u32], union: &mut BatchUnion, parts: &mut Vec<Part>) {
        let Self { graph, component: from, walks, .. } = self;
        let mut rest = graph.whole(from, elements[0]);
        // Where no walk that ended was, there is the rest: walks that were never met too.
        let mut of_rest = Vec::new();
        for (number, walk) in (0..).zip(walks) {
            if walk.parent != number {
                continue;
            }
            walk.done.iter().chain(&walk.pending).for_each(|&node| graph.node_mut(node).walk = None);
            if walk.pending.is_empty() && !walk.runs {
                rest.weight -= walk.weight;
                let extent = Extent::Searched(walk.done);
                parts.push(Part { from, element: walk.element, weight: walk.weight, extent });
            } else {
                of_rest.push(walk.element);
            }
        }
        union.unite_all(&of_rest);
        rest.element = of_rest.first().copied().unwrap_or(rest.element);
        parts.push(rest);
    }
}
