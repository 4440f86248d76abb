//! A map of this engine as plain data, and back.
//!
//! Voxels with their moments and what was published of them, the slots of blocks, patches and clusters, and who the
//! clusters are. Patches, joins, sums, footprints and outlines follow from these and are found again.

pub(crate) mod version1;

use std::collections::BTreeSet;

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::block::{Block, BlockIndex, BlockKey, CELLS, Cell, EDGE, Voxel};
use super::grid::Grid;
use super::noise::Noise;
use super::published::Published;
use super::state::{Plain, State};
use super::sums::Moments;
use super::surfaces::SavedSurfaces;
use super::view::Clearance;
use crate::engine::key::GRID_REACH;
use crate::engine::params::{MAX_POINTS, Params};
use crate::engine::saved::{RestoreError, ensure, in_slots};

/// Slots of blocks beyond the number of voxels. A slot takes 0.6 KB and a few bytes of a file, so that files would be worth some
/// hundred times their length; a map that had so many blocks at once (100,000 square metres at 8 cm) still has as many voxels.
const MOST_SPARE: usize = 1 << 18;

/// All of a [`Consistent`](super::Consistent) but its parameters and the scans that it has taken in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedConsistent<V = SavedVoxel> {
    pub(super) grid: SavedGrid<V>,
    pub(super) surfaces: SavedSurfaces,
    /// Where the sensor stands, and since which scan.
    pub(super) standpoint: (Isometry3<f64>, u64),
    /// The block at which forgetting goes on.
    pub(super) next: u64,
}

/// The blocks with their slots, and the slots without a block.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedGrid<V = SavedVoxel> {
    pub(super) blocks: Vec<(u32, SavedBlock<V>)>,
    free: Vec<u32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedBlock<V = SavedVoxel> {
    key: BlockKey,
    voxels: Vec<V>,
    changed: bool,
    drifted: u32,
    points: u32,
    unknown: u32,
    published: u64,
    begun: u64,
    seen: u64,
    /// Of its dense voxels, by ascending cell.
    pub(super) states: Vec<SavedState>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedVoxel {
    cell: Cell,
    count: u32,
    moments: Moments,
    published: Published,
    hit: u64,
    clearance: Clearance,
}

/// A dense voxel as the surfaces know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedState {
    cell: Cell,
    /// It has become dense since its block was published.
    pub(super) admitted: bool,
    /// `None` where it is as it would be published now.
    state: Option<Plain>,
}

impl SavedState {
    /// `now` is what it would be published as.
    pub(super) fn of(state: &State, now: &State, admitted: bool, noise: &Noise) -> Self {
        Self { cell: state.cell(), admitted, state: (now != state).then(|| Plain::of(state, noise)) }
    }

    /// The state of a dense voxel of this block.
    pub(super) fn restore(&self, grid: &Grid, block: &Block, noise: &Noise) -> Result<State, RestoreError> {
        let voxel = if self.cell.index() < CELLS { block.voxel(self.cell) } else { None };
        let voxel = voxel.filter(|voxel| grid.is_dense(voxel));
        let Some(voxel) = voxel else {
            return Err(RestoreError::Contradiction(format!(
                "{:?} of {:?} is not dense",
                self.cell, block.key
            )));
        };
        let Some(state) = &self.state else { return Ok(State::new(voxel)) };
        let restored = state.state(noise).filter(|_| state.cell == self.cell);
        restored.ok_or_else(|| RestoreError::Contradiction(format!("an impossible state: {state:?}")))
    }
}

impl SavedGrid {
    /// `states` gives what the surfaces know of a block.
    pub(super) fn of(grid: &Grid, states: impl Fn(BlockIndex) -> Vec<SavedState>) -> Self {
        let free: BTreeSet<_> = grid.free().iter().copied().collect();
        let taken = grid.blocks().filter(|(slot, _)| !free.contains(slot));
        Self {
            blocks: taken.map(|(slot, block)| (slot.0, SavedBlock::of(block, states(slot)))).collect(),
            free: grid.free().iter().map(|free| free.0).collect(),
        }
    }

    pub(super) fn restore(&self, params: &Params, sequence: u64) -> Result<Grid, RestoreError> {
        let slots = self.blocks.len() + self.free.len();
        let voxels = self.blocks.iter().map(|(_, block)| block.voxels.len()).sum::<usize>();
        ensure(slots <= MOST_SPARE + voxels, || {
            format!("{slots} slots of blocks for {voxels} voxels: at most {MOST_SPARE} more")
        })?;
        let slots = in_slots("block", &self.blocks, slots)?;
        let blocks =
            slots.into_iter().map(|block| block.map(|block| block.restore(params, sequence)).transpose());
        Grid::of(params, blocks.collect::<Result<_, _>>()?, &self.free)
    }
}

impl SavedBlock {
    fn of(block: &Block, states: Vec<SavedState>) -> Self {
        let voxel = |voxel: &Voxel| SavedVoxel {
            cell: voxel.cell,
            count: voxel.count,
            moments: voxel.moments,
            published: voxel.published,
            hit: voxel.hit.into(),
            clearance: voxel.clearance,
        };
        Self {
            key: block.key,
            voxels: block.voxels().iter().map(voxel).collect(),
            changed: block.changed,
            drifted: block.drifted,
            points: block.points,
            unknown: block.unknown,
            published: block.published(),
            begun: block.begun(),
            seen: block.seen,
            states,
        }
    }

    fn restore(&self, params: &Params, sequence: u64) -> Result<Block, RestoreError> {
        let key = self.key;
        let reach = GRID_REACH / EDGE;
        ensure(key.iter().all(|i| (-reach..reach).contains(i)), || format!("block {key:?} is out of reach"))?;
        let scans = [self.published, self.begun, self.seen];
        let few =
            self.drifted as usize <= CELLS && self.unknown <= self.points && self.points <= MAX_POINTS / 4;
        ensure(few && scans.iter().all(|&scan| scan <= sequence), || {
            format!(
                "block {key:?} counts what cannot be: scans {scans:?}, {} drifted, {} of {} points unknown",
                self.drifted, self.unknown, self.points
            )
        })?;
        let mut block = Block::new();
        block.begin(key);
        for voxel in &self.voxels {
            let is_new = voxel.cell.index() < CELLS && block.restore(voxel.restore(sequence)?);
            ensure(is_new, || format!("{:?} of block {key:?} is there twice or outside", voxel.cell))?;
        }
        block.dense = block.awake().iter().filter(|voxel| voxel.count >= params.min_points()).count() as u32;
        (block.changed, block.drifted, block.seen) = (self.changed, self.drifted, self.seen);
        (block.points, block.unknown) = (self.points, self.unknown);
        block.note_begun(self.begun, self.published);
        ensure(self.states.len() == block.dense as usize, || {
            format!("block {key:?} has {} dense voxels and states of {}", block.dense, self.states.len())
        })?;
        Ok(block)
    }
}

impl SavedVoxel {
    fn restore(&self, sequence: u64) -> Result<Voxel, RestoreError> {
        let possible = (1..=MAX_POINTS).contains(&self.count)
            && self.moments.is_possible()
            && self.published.is_possible()
            && self.hit <= sequence;
        ensure(possible, || format!("an impossible voxel after {sequence} scans: {self:?}"))?;
        Ok(Voxel {
            cell: self.cell,
            count: self.count,
            moments: self.moments,
            published: self.published,
            hit: self.hit as u32,
            clearance: self.clearance,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_that_no_voxel_is_worth_are_refused_before_memory_is_taken() {
        let grid = SavedGrid { blocks: Vec::new(), free: (0..=MOST_SPARE as u32).collect() };
        let refused = grid.restore(&Params::default(), 1).unwrap_err().to_string();
        assert!(refused.ends_with("262145 slots of blocks for 0 voxels: at most 262144 more"), "{refused}");
    }
}
