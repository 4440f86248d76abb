//! A map of this engine as plain data, and back.
//!
//! Voxels with their moments and what was published of them, by blocks in the order of the grid's list, the slots of patches
//! and clusters, and who the clusters are. Joins, sums, footprints and outlines follow from these and are found again.

use serde::{Deserialize, Serialize};

use super::block::{Block, BlockKey, CELLS, Cell, EDGE, Voxel};
use super::clearing::Clearance;
use super::grid::Grid;
use super::publish::baseline::Baseline;
use super::publish::news::News;
use super::publish::standpoint::Standpoint;
use super::state::State;
use super::sums::Moments;
use super::surfaces::SavedSurfaces;
use crate::engine::key::GRID_REACH;
use crate::engine::params::{MAX_POINTS, Params};
use crate::engine::saved::{RestoreError, ensure};

/// All of a [`Consistent`](super::Consistent) but its parameters and the scans that it has taken in. The blocks `B` are a list of
/// [`SavedBlock`], or what is written as one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedConsistent<B = Vec<SavedBlock>> {
    /// In the order of the grid's list.
    pub(super) blocks: B,
    pub(super) surfaces: SavedSurfaces,
    pub(super) standpoint: Standpoint,
    /// The number of the block at which forgetting goes on.
    pub(super) next: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedBlock {
    key: BlockKey,
    voxels: Vec<SavedVoxel>,
    news: News,
    /// The states of its dense voxels, by ascending cell.
    pub(super) states: Vec<SavedState>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedVoxel {
    cell: Cell,
    count: u32,
    moments: Moments,
    baseline: Baseline,
    hit: u32,
    clearance: Clearance,
}

/// A dense voxel as the surfaces know it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedState {
    cell: Cell,
    /// It has become dense since its block was published.
    pub(super) admitted: bool,
    /// `None` where it is as it would be published now.
    state: Option<Box<State>>,
}

impl SavedState {
    /// `now` is what it would be published as.
    pub(super) fn of(state: &State, now: &State, admitted: bool) -> Self {
        Self { cell: state.cell(), admitted, state: (now != state).then(|| Box::new(state.clone())) }
    }

    /// The state of a dense voxel of this block.
    pub(super) fn restore(&self, grid: &Grid, block: &Block) -> Result<State, RestoreError> {
        let voxel = if self.cell.index() < CELLS { block.voxel(self.cell) } else { None };
        let voxel = voxel.filter(|voxel| grid.is_dense(voxel));
        let Some(voxel) = voxel else {
            return Err(RestoreError::Contradiction(format!(
                "{:?} of {:?} is not dense",
                self.cell, block.key
            )));
        };
        let Some(state) = &self.state else { return Ok(State::new(voxel)) };
        ensure(state.is_possible() && state.cell() == self.cell, || {
            format!("an impossible state: {state:?}")
        })?;
        Ok(State::clone(state))
    }
}

impl SavedBlock {
    /// `states` is what the surfaces know of its dense voxels.
    pub(super) fn of(block: &Block, states: Vec<SavedState>) -> Self {
        let voxel = |voxel: &Voxel| SavedVoxel {
            cell: voxel.cell,
            count: voxel.count,
            moments: voxel.moments,
            baseline: voxel.baseline,
            hit: voxel.hit,
            clearance: voxel.clearance,
        };
        Self {
            key: block.key,
            voxels: block.voxels().iter().map(voxel).collect(),
            news: block.news.saved(),
            states,
        }
    }

    pub(super) fn restore(&self, params: &Params, sequence: u64) -> Result<Block, RestoreError> {
        let key = self.key;
        ensure(!self.voxels.is_empty(), || format!("block {key:?} has no voxel"))?;
        let reach = GRID_REACH / EDGE;
        ensure(key.iter().all(|i| (-reach..reach).contains(i)), || format!("block {key:?} is out of reach"))?;
        self.news.check(key, sequence)?;
        let mut block = Block::new(key);
        for voxel in &self.voxels {
            let is_new = voxel.cell.index() < CELLS && block.restore(voxel.restore()?);
            ensure(is_new, || format!("{:?} of block {key:?} is there twice or outside", voxel.cell))?;
        }
        block.dense = block.awake().iter().filter(|voxel| voxel.count >= params.min_points()).count() as u32;
        block.news = self.news;
        ensure(self.states.len() == block.dense as usize, || {
            format!("block {key:?} has {} dense voxels and states of {}", block.dense, self.states.len())
        })?;
        Ok(block)
    }
}

impl SavedVoxel {
    fn restore(&self) -> Result<Voxel, RestoreError> {
        let possible = (1..=MAX_POINTS).contains(&self.count)
            && self.moments.is_possible()
            && self.baseline.is_possible();
        ensure(possible, || format!("an impossible voxel: {self:?}"))?;
        Ok(Voxel {
            cell: self.cell,
            count: self.count,
            moments: self.moments,
            baseline: self.baseline,
            hit: self.hit,
            clearance: self.clearance,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_without_voxels_is_refused() {
        let empty = SavedBlock::of(&Block::new([1, 2, 3]), Vec::new());
        let refused = empty.restore(&Params::default(), 1).unwrap_err().to_string();
        assert!(refused.ends_with("block [1, 2, 3] has no voxel"), "{refused}");
    }
}
