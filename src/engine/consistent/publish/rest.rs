//! Blocks that the sensor has left are at rest: what their dense voxels hold is what was published of them, so that the grid
//! and the surfaces share one copy of it, and what the others hold is as little.
//!
//! A block is at rest [`REST`] scans after the last that put a point into it, once everything that was put there is
//! published. The moments of its voxels are rounded to states by that, to 2^-16 of a voxel; what a state has no place for is kept
//! beside it. It wakes when a scan puts a point into it or looks through it, and holds the same then. So a map of ten million voxels takes 90 bytes for each, and
//! the work follows the blocks that come into view and leave it.

use std::collections::VecDeque;
use std::sync::Arc;

use super::baseline::Baseline;
use crate::engine::consistent::block::{BlockIndex, Cell, Voxel};
use crate::engine::consistent::clearing::Clearance;
use crate::engine::consistent::grid::moves::Moves;
use crate::engine::consistent::state::State;
use crate::engine::consistent::sums::Moments;

/// Scans without a point after which a block is to rest.
pub(crate) const REST: u64 = 64;

/// What a block at rest keeps of its voxels.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    /// The dense ones, as the surfaces have them.
    dense: Arc<Vec<State>>,
    /// The others.
    others: Box<[State]>,
    /// Of the few that have such, ascending: what a state does not hold.
    beside: Box<[Beside]>,
}

/// What a voxel holds beside its state.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beside {
    cell: Cell,
    /// How often it was seen through.
    clearance: Clearance,
    /// See [`Moments`].
    weight_behind: u32,
}

impl Beside {
    /// `None` where there is nothing.
    fn of(voxel: &Voxel) -> Option<Self> {
        let Voxel { cell, clearance, moments: Moments { weight_behind, .. }, .. } = *voxel;
        let is_something = clearance != Clearance::default() || weight_behind > 0;
        is_something.then_some(Self { cell, clearance, weight_behind })
    }
}

impl Rest {
    /// What is kept of the voxels of a block, ascending; `dense` are the dense ones as they would be published now.
    pub(crate) fn new(voxels: &[Voxel], dense: Arc<Vec<State>>) -> Self {
        let is_dense = |voxel: &Voxel| dense.binary_search_by_key(&voxel.cell, State::cell).is_ok();
        Self {
            others: voxels.iter().filter(|voxel| !is_dense(voxel)).map(State::new).collect(),
            beside: voxels.iter().filter_map(Beside::of).collect(),
            dense,
        }
    }

    /// The voxels, ascending, in a block into which the scan `seen` put a point last.
    pub(crate) fn voxels(&self, seen: u64) -> Vec<Voxel> {
        let mut voxels = Vec::with_capacity(self.dense.len() + self.others.len());
        voxels.extend(self.dense.iter().map(|state| published(state, seen)));
        voxels.extend(self.others.iter().map(|state| voxel(state, seen)));
        voxels.sort_unstable_by_key(|voxel| voxel.cell);
        let mut beside = self.beside.iter().peekable();
        for voxel in &mut voxels {
            if let Some(&Beside { clearance, weight_behind, .. }) =
                beside.next_if(|beside| beside.cell == voxel.cell)
            {
                voxel.clearance = clearance;
                voxel.moments.weight_behind = weight_behind;
            }
        }
        voxels
    }
}

/// A voxel that was never published, in a block into which the scan `seen` put a point last.
fn voxel(state: &State, seen: u64) -> Voxel {
    let mut voxel = Voxel::new(state.cell());
    (voxel.count, voxel.moments, voxel.hit) = (state.count, Moments::of(state), seen as u32);
    voxel
}

/// A voxel that was published as it is, in a block into which the scan `seen` put a point last.
fn published(state: &State, seen: u64) -> Voxel {
    let mut voxel = voxel(state, seen);
    voxel.baseline = Baseline::of(&voxel.moments);
    voxel
}

/// The blocks that the sensor has left, until they are to rest.
#[derive(Clone, Debug, Default)]
pub(crate) struct Leaving {
    /// Each with the scan at which it is to rest, ascending.
    blocks: VecDeque<(u64, BlockIndex)>,
    /// The blocks that the scan before put points into, ascending.
    seen: Vec<BlockIndex>,
}

impl Leaving {
    /// What the sensor has left of these blocks after the scan `sequence`: they are awake, each with the scan that put a point into
    /// it last.
    pub(crate) fn restore(awake: impl Iterator<Item = (u64, BlockIndex)>, sequence: u64) -> Self {
        let (seen, left): (Vec<_>, Vec<_>) = awake.partition(|(seen, _)| *seen == sequence);
        let mut blocks: Vec<_> = left.into_iter().map(|(seen, block)| (seen + REST, block)).collect();
        blocks.sort_unstable();
        Self { blocks: blocks.into(), seen: seen.into_iter().map(|(_, block)| block).collect() }
    }

    /// Follows a scan that put points into the blocks `seen` (ascending) and woke others.
    pub(crate) fn follow(&mut self, seen: &[BlockIndex], woken: &[BlockIndex], sequence: u64) {
        let left = self.seen.iter().filter(|block| seen.binary_search(block).is_err());
        self.blocks.extend(left.map(|&block| (sequence - 1 + REST, block)));
        self.seen.clear();
        self.seen.extend_from_slice(seen);
        self.blocks.extend(woken.iter().map(|&block| (sequence - 1 + REST, block)));
    }

    /// Names blocks by the places that they have now.
    pub(crate) fn rename(&mut self, moves: &Moves) {
        self.blocks.retain_mut(|(_, block)| moves.try_rename(block));
        moves.rename(&mut self.seen);
        self.seen.sort_unstable();
    }

    /// The next block that is to rest after this scan, if it has not been seen since.
    pub(crate) fn pop(&mut self, sequence: u64) -> Option<BlockIndex> {
        let is_time = self.blocks.front().is_some_and(|(time, _)| *time <= sequence);
        if is_time { self.blocks.pop_front().map(|(_, block)| block) } else { None }
    }
}
