//! A map of this engine as plain data, and back.
//!
//! Voxels with their moments and what was published of them, by blocks in the order of the grid's list, the slots of patches
//! and clusters, and who the clusters are. Joins, sums, footprints and outlines follow from these and are found again.

use serde::{Deserialize, Serialize};

use super::block::{Block, BlockKey, CELLS, Cell, EDGE, Voxel};
use super::grid::Grid;
use super::publish::news::News;
use super::publish::standpoint::Standpoint;
use super::state::State;
use super::surfaces::SavedSurfaces;
use crate::engine::key::GRID_REACH;
use crate::engine::params::Params;
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
    voxels: Vec<Voxel>,
    news: News,
    /// The states of its dense voxels, by ascending cell.
    pub(super) states: Vec<SavedState>,
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
        Self { key: block.key, voxels: block.voxels().into_owned(), news: block.news.saved(), states }
    }

    pub(super) fn restore(&self, params: &Params, sequence: u64) -> Result<Block, RestoreError> {
        let key = self.key;
        ensure(!self.voxels.is_empty(), || format!("block {key:?} has no voxel"))?;
        let reach = GRID_REACH / EDGE;
        ensure(key.iter().all(|i| (-reach..reach).contains(i)), || format!("block {key:?} is out of reach"))?;
        self.news.check(key, sequence)?;
        let mut block = Block::new(key);
        for voxel in &self.voxels {
            ensure(voxel.is_possible(), || format!("an impossible voxel: {voxel:?}"))?;
            let is_new = voxel.cell.index() < CELLS && block.restore(voxel.clone());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::graph::{ComponentId, NodeId};

    #[test]
    fn a_block_without_voxels_is_refused() {
        let empty = SavedBlock::of(&Block::new([1, 2, 3]), Vec::new());
        let refused = empty.restore(&Params::default(), 1).unwrap_err().to_string();
        assert!(refused.ends_with("block [1, 2, 3] has no voxel"), "{refused}");
    }

    #[test]
    fn a_voxel_is_written_field_by_field_and_a_slot_as_its_number() {
        // No two fields are written alike, so that none takes another's place.
        let mut voxel = Voxel { count: 1, hit: 2, ..Voxel::new(Cell(300)) };
        voxel.moments.weight = 4;
        voxel.baseline = postcard::from_bytes(&[5, 6, 7, 0, 0, 0, 128, 63, 8]).unwrap();
        voxel.clearance = postcard::from_bytes(&[3]).unwrap();
        let Voxel { cell, count, ref moments, ref baseline, hit, ref clearance } = voxel;
        assert_eq!(written(&voxel), written(&(cell.0, count, moments, baseline, hit, clearance)));
        assert_eq!(written(&NodeId(70_000)), written(&70_000_u32));
        assert_eq!(written(&ComponentId(70_000)), written(&70_000_u32));
    }

    fn written(what: &impl Serialize) -> Vec<u8> {
        postcard::to_stdvec(what).unwrap()
    }
}
