//! Graphs to begin with, and random changes to them.

use proptest::prelude::*;

use super::super::{Batch, End, NodeId, Outcome};
use super::naive::Naive;

/// A graph of nodes of weight 1.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Path(u32),
    Cycle(u32),
    Grid(u32, u32),
    /// The number of cliques, and that of nodes in each; one edge between each and the next.
    Cliques(u32, u32),
    /// Paths of one length that meet in one node.
    Star(u32, u32),
}

impl Shape {
    /// The batch that makes it.
    pub(super) fn batch(self) -> Batch {
        let (count, edges): (u32, Vec<(u32, u32)>) = match self {
            Self::Path(n) => (n, (1..n).map(|at| (at - 1, at)).collect()),
            Self::Cycle(n) => (n, (0..n).map(|at| (at, (at + 1) % n)).collect()),
            Self::Grid(w, h) => {
                let right = (0..w * h).filter(|at| at % w != 0).map(|at| (at - 1, at));
                (w * h, right.chain((w..w * h).map(|at| (at - w, at))).collect())
            }
            Self::Cliques(k, m) => {
                let inner = (0..k * m).flat_map(|at| (at / m * m..at).map(move |other| (other, at)));
                (k * m, inner.chain((1..k).map(|clique| (clique * m - 1, clique * m))).collect())
            }
            Self::Star(k, m) => {
                let above = |at: u32| if at.is_multiple_of(m) { 0 } else { at };
                (k * m + 1, (0..k * m).map(|at| (above(at), at + 1)).collect())
            }
        };
        let connect = edges.into_iter().map(|(one, other)| (End::New(one), End::New(other))).collect();
        Batch { add: vec![1; count as usize], connect, ..Batch::default() }
    }
}

pub(super) fn shape() -> impl Strategy<Value = Shape> {
    prop_oneof![
        (1u32..60).prop_map(Shape::Path),
        (3u32..60).prop_map(Shape::Cycle),
        (2u32..9, 2u32..9).prop_map(|(w, h)| Shape::Grid(w, h)),
        (1u32..8, 2u32..6).prop_map(|(k, m)| Shape::Cliques(k, m)),
        (1u32..7, 1u32..12).prop_map(|(k, m)| Shape::Star(k, m)),
    ]
}

/// Numbers that become nodes and edges modulo what there is.
#[derive(Clone, Debug)]
pub(super) struct Change {
    remove: Vec<usize>,
    /// Weight, and neighbours among the nodes that stay and the new ones before.
    add: Vec<(u32, Vec<usize>)>,
    disconnect: Vec<usize>,
    connect: Vec<(usize, usize)>,
}

pub(super) fn change() -> impl Strategy<Value = Change> {
    use proptest::collection::vec;
    let add = (0u32..5, vec(any::<usize>(), 0..4));
    (
        vec(any::<usize>(), 0..5),
        vec(add, 0..5),
        vec(any::<usize>(), 0..5),
        vec((any::<usize>(), any::<usize>()), 0..4),
    )
        .prop_map(|(remove, add, disconnect, connect)| Change { remove, add, disconnect, connect })
}

impl Change {
    pub(super) fn batch(&self, naive: &Naive) -> Batch {
        let mut staying: Vec<NodeId> = naive.weights.keys().copied().collect();
        let mut batch = Batch { add: self.add.iter().map(|add| add.0).collect(), ..Batch::default() };
        let edges: Vec<_> = naive.edges.iter().copied().collect();
        if !edges.is_empty() {
            batch.disconnect = self.disconnect.iter().map(|at| edges[at % edges.len()]).collect();
        }
        for at in &self.remove {
            if !staying.is_empty() {
                batch.remove.push(staying.remove(at % staying.len()));
            }
        }
        let mut ends: Vec<End> = staying.into_iter().map(End::Old).collect();
        for (new, (_, neighbours)) in (0..).zip(&self.add) {
            let joined = neighbours.iter().filter(|_| !ends.is_empty());
            batch.connect.extend(joined.map(|at| (End::New(new), ends[at % ends.len()])));
            ends.push(End::New(new));
        }
        for (one, other) in self.connect.iter().filter(|_| !ends.is_empty()) {
            let (one, other) = (ends[one % ends.len()], ends[other % ends.len()]);
            if one != other {
                batch.connect.push((one, other));
            }
        }
        batch
    }
}

/// A map of patches in which blocks are segmented anew: planar, with necks and holes.
#[derive(Debug)]
pub(super) struct Patches {
    width: usize,
    cells: Vec<Option<NodeId>>,
    /// Cells whose nodes the batch under way brings.
    awaited: Vec<usize>,
}

/// A block to be segmented anew: a corner, its size, and which of its patches and edges there are.
#[derive(Clone, Debug)]
pub(super) struct Block {
    corner: (usize, usize),
    size: (usize, usize),
    weights: Vec<Option<u32>>,
    edges: Vec<bool>,
}

pub(super) fn block() -> impl Strategy<Value = Block> {
    use proptest::collection::vec;
    (
        (any::<usize>(), any::<usize>()),
        (1usize..7, 1usize..7),
        vec(proptest::option::weighted(0.8, 0u32..9), 36),
        vec(proptest::bool::weighted(0.8), 84),
    )
        .prop_map(|(corner, size, weights, edges)| Block { corner, size, weights, edges })
}

impl Patches {
    pub(super) fn new((width, height): (usize, usize)) -> Self {
        Self { width, cells: vec![None; width * height], awaited: Vec::new() }
    }

    pub(super) fn batch(&mut self, block: &Block) -> Batch {
        let (width, height) = (self.width, self.cells.len() / self.width);
        let (left, top) = (block.corner.0 % width, block.corner.1 % height);
        let (right, bottom) = ((left + block.size.0).min(width), (top + block.size.1).min(height));
        let inside: Vec<usize> =
            (top..bottom).flat_map(|y| (left..right).map(move |x| y * width + x)).collect();
        let mut batch = Batch {
            remove: inside.iter().filter_map(|&cell| self.cells[cell].take()).collect(),
            ..Batch::default()
        };
        for (&cell, &weight) in inside.iter().zip(&block.weights) {
            if let Some(weight) = weight {
                batch.add.push(weight);
                self.awaited.push(cell);
            }
        }
        let end = |cell: usize| {
            let new = self.awaited.iter().position(|&other| other == cell).map(|at| End::New(at as u32));
            new.or(self.cells[cell].map(End::Old))
        };
        let mut wanted = block.edges.iter().cycle();
        for &cell in &inside {
            let after = [(cell % width + 1 < width, cell + 1), (cell / width + 1 < height, cell + width)];
            let before = [
                (cell % width == left && left > 0, cell.wrapping_sub(1)),
                (cell / width == top && top > 0, cell.wrapping_sub(width)),
            ];
            for (_, other) in after.into_iter().chain(before).filter(|pair| pair.0) {
                if let (Some(one), Some(other), Some(true)) = (end(cell), end(other), wanted.next()) {
                    batch.connect.push((one, other));
                }
            }
        }
        batch
    }

    pub(super) fn take(&mut self, outcome: &Outcome) {
        for (cell, &(node, _)) in self.awaited.drain(..).zip(&outcome.added) {
            self.cells[cell] = Some(node);
        }
    }
}
