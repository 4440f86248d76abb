//! Blocks that the sensor has left are at rest: what their dense voxels hold is what was published of them, so that the grid
//! and the surfaces share one copy of it.
//!
//! A block is at rest [`REST`] scans after the last that put a point into it, once everything that was put there is
//! published. The moments of its dense voxels are rounded to their states by that, to 2^-16 of a voxel. It wakes when a scan
//! puts a point into it or looks through it, and holds the same then. So a map of ten million voxels takes 156 bytes
//! for each, and the work follows the blocks that come into view and leave it.

use std::collections::VecDeque;
use std::sync::Arc;

use super::block::{BlockIndex, Voxel};
use super::published::Published;
use super::state::State;
use super::sums::Moments;
use super::view::Clearance;

/// Scans without a point after which a block is to rest.
pub(super) const REST: u64 = 64;

/// What a block at rest keeps of its dense voxels.
#[derive(Clone, Debug)]
pub(super) struct Rest {
    /// As the surfaces have them.
    states: Arc<Vec<State>>,
    /// Points and weight of each.
    weights: Box<[[u32; 2]]>,
    /// Votes of those that were seen through, by their places.
    votes: Box<[(u16, Clearance)]>,
}

impl Rest {
    /// Of the dense voxels of a block, ascending; `states` are these as they would be published now.
    pub(super) fn new(dense: &[Voxel], states: Arc<Vec<State>>) -> Self {
        debug_assert!(dense.iter().map(|voxel| voxel.cell).eq(states.iter().map(|state| state.cell)));
        let votes = (0..).zip(dense).map(|(place, voxel)| (place, voxel.clearance));
        Self {
            states,
            weights: dense.iter().map(|voxel| [voxel.moments.points, voxel.moments.weight]).collect(),
            votes: votes.filter(|(_, votes)| *votes != Clearance::default()).collect(),
        }
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.states.len()
    }

    /// The voxels, ascending, in a block into which the scan `seen` put a point last.
    pub(super) fn voxels(&self, seen: u64) -> impl Iterator<Item = Voxel> {
        let mut votes = self.votes.iter().peekable();
        (0..).zip(self.states.iter().zip(&self.weights)).map(move |(place, (state, &[points, weight]))| {
            let moments = Moments::of(state, points, weight);
            Voxel {
                cell: state.cell,
                count: state.count,
                published: Published::of(&moments),
                moments,
                hit: seen as u32,
                clearance: votes.next_if(|(of, _)| *of == place).map_or(Clearance::default(), |vote| vote.1),
            }
        })
    }
}

/// The blocks that the sensor has left, until they are to rest.
#[derive(Clone, Debug, Default)]
pub(super) struct Leaving {
    /// Each with the scan at which it is to rest, ascending.
    blocks: VecDeque<(u64, BlockIndex)>,
    /// The blocks that the scan before put points into, ascending.
    seen: Vec<BlockIndex>,
}

impl Leaving {
    /// Of blocks that are awake, each with the scan that put a point into it last, after the scan `sequence`.
    pub(super) fn restore(awake: impl Iterator<Item = (u64, BlockIndex)>, sequence: u64) -> Self {
        let (seen, left): (Vec<_>, Vec<_>) = awake.partition(|(seen, _)| *seen == sequence);
        let mut blocks: Vec<_> = left.into_iter().map(|(seen, block)| (seen + REST, block)).collect();
        blocks.sort_unstable();
        Self { blocks: blocks.into(), seen: seen.into_iter().map(|(_, block)| block).collect() }
    }

    /// Follows a scan that put points into the blocks `seen` (ascending) and woke others.
    pub(super) fn follow(&mut self, seen: &[BlockIndex], woken: &[BlockIndex], sequence: u64) {
        let left = self.seen.iter().filter(|block| seen.binary_search(block).is_err());
        self.blocks.extend(left.map(|&block| (sequence - 1 + REST, block)));
        self.seen.clear();
        self.seen.extend_from_slice(seen);
        self.blocks.extend(woken.iter().map(|&block| (sequence - 1 + REST, block)));
    }

    /// The next block that is to rest after this scan, if it has not been seen since.
    pub(super) fn pop(&mut self, sequence: u64) -> Option<BlockIndex> {
        let is_time = self.blocks.front().is_some_and(|(time, _)| *time <= sequence);
        if is_time { self.blocks.pop_front().map(|(_, block)| block) } else { None }
    }
}
