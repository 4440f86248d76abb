//! A map of this engine as plain data, and back.
//!
//! Voxels with their moments and what was published of them, the slots of blocks, patches and clusters, and who the
//! clusters are. Patches, joins, sums, footprints and outlines follow from these and are found again.

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
use crate::engine::saved::{RestoreError, ensure};

/// All of a [`Consistent`](super::Consistent) but its parameters and the scans that it has taken in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedConsistent {
    pub(super) grid: SavedGrid,
    pub(super) surfaces: SavedSurfaces,
    /// Where the sensor stands, and since which scan.
    pub(super) standpoint: (Isometry3<f64>, u64),
    /// The slot of the block at which forgetting goes on.
    pub(super) next: u64,
}

/// The blocks with their slots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedGrid {
    /// By ascending slot.
    pub(super) blocks: Vec<(u32, SavedBlock)>,
    /// Slots without a block, as there were while slots were kept; none is written.
    pub(super) free: Vec<u32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedBlock {
    key: BlockKey,
    voxels: Vec<SavedVoxel>,
    changed: bool,
    drifted: u32,
    points: u32,
    unknown: u32,
    published: u64,
    begun: u64,
    seen: u64,
    /// The states of its dense voxels, by ascending cell.
    pub(super) states: Vec<SavedState>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedVoxel {
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

impl SavedConsistent {
    /// The number of the block at which forgetting goes on among those that are restored.
    pub(super) fn next(&self, blocks: &[(u32, &SavedBlock)]) -> Result<usize, RestoreError> {
        let slots = self.grid.blocks.len() + self.grid.free.len();
        ensure(self.next <= slots as u64, || {
            format!("forgetting goes on at block {} of {slots}", self.next)
        })?;
        Ok(blocks.partition_point(|(slot, _)| u64::from(*slot) < self.next))
    }
}

impl SavedGrid {
    /// `states` gives what the surfaces know of a block.
    pub(super) fn of(grid: &Grid, states: impl Fn(BlockIndex) -> Vec<SavedState>) -> Self {
        let blocks = grid.blocks().map(|(slot, block)| (slot.0, SavedBlock::of(block, states(slot))));
        Self { blocks: blocks.collect(), free: Vec::new() }
    }

    /// The blocks that have voxels, each with the slot that it had, ascending: without gaps they get the slots from 0 on. What else
    /// is said of slots takes no memory.
    pub(super) fn taken(&self) -> Result<Vec<(u32, &SavedBlock)>, RestoreError> {
        ensure(self.blocks.is_sorted_by(|a, b| a.0 < b.0), || {
            format!("the slots of {} blocks are out of order", self.blocks.len())
        })?;
        let taken = self.blocks.iter().filter(|(_, block)| !block.voxels.is_empty());
        Ok(taken.map(|(slot, block)| (*slot, block)).collect())
    }

    /// The grid of the blocks that are [`taken`](Self::taken).
    pub(super) fn restore(
        blocks: &[(u32, &SavedBlock)],
        params: &Params,
        sequence: u64,
    ) -> Result<Grid, RestoreError> {
        let blocks = blocks.iter().map(|(_, block)| block.restore(params, sequence));
        Grid::of(params, blocks.collect::<Result<_, _>>()?)
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
        let mut block = Block::new(key);
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
    fn slots_that_no_voxel_is_worth_take_no_memory() {
        let empty = SavedBlock::of(&Block::new([1, 2, 3]), Vec::new());
        let blocks = (0..1000).map(|slot| (7 * slot, empty.clone())).collect();
        let grid = SavedGrid { blocks, free: (0..=1 << 18).collect() };
        let taken = grid.taken().unwrap();
        assert!(taken.is_empty());
        assert_eq!(SavedGrid::restore(&taken, &Params::default(), 1).unwrap().slots(), 0);
    }

    #[test]
    fn blocks_whose_slots_are_out_of_order_are_refused() {
        let block = SavedBlock::of(&Block::new([1, 2, 3]), Vec::new());
        for slots in [[1, 0], [4, 4]] {
            let blocks = slots.map(|slot| (slot, block.clone())).to_vec();
            let refused = SavedGrid { blocks, free: Vec::new() }.taken().unwrap_err().to_string();
            assert!(refused.ends_with("the slots of 2 blocks are out of order"), "{refused}");
        }
    }
}
