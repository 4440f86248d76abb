//! A map as it was saved while voxels kept sums: read, and never written.

use serde::Deserialize;

use super::{SavedBlock, SavedConsistent, SavedGrid, SavedVoxel};
use crate::engine::consistent::block::Cell;
use crate::engine::consistent::published::Published;
use crate::engine::consistent::sums::Moments;
use crate::engine::consistent::view::Clearance;

/// A voxel with the sums of its points.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Voxel {
    cell: Cell,
    count: u32,
    sums: Sums,
    published: Noted,
    hit: u64,
    clearance: Clearance,
}

/// Sums over points, weighed but for the directions.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::engine::consistent) struct Sums {
    pub(in crate::engine::consistent) points: u64,
    pub(in crate::engine::consistent) weight: u64,
    /// Of offsets from the corner, in 1/4096 of the voxel's edge.
    pub(in crate::engine::consistent) sum: [u64; 3],
    /// Of their products: xx, xy, xz, yy, yz, zz.
    pub(in crate::engine::consistent) squares: [u64; 6],
    /// Of unit directions towards the sensor times 1024.
    pub(in crate::engine::consistent) towards: [i64; 3],
}

/// What was noted of a voxel when it was published.
#[derive(Clone, Debug, Deserialize)]
pub(in crate::engine::consistent) struct Noted {
    pub(in crate::engine::consistent) mean: [u16; 3],
    pub(in crate::engine::consistent) points: u64,
    pub(in crate::engine::consistent) weight: u64,
    pub(in crate::engine::consistent) looked_at: u64,
    pub(in crate::engine::consistent) drifted: bool,
}

impl From<Voxel> for SavedVoxel {
    fn from(voxel: Voxel) -> Self {
        let Voxel { cell, count, sums, published, hit, clearance } = voxel;
        let (moments, published) = (Moments::from(&sums), Published::from(&published));
        Self { cell, count, moments, published, hit, clearance }
    }
}

impl From<SavedConsistent<Voxel>> for SavedConsistent {
    fn from(map: SavedConsistent<Voxel>) -> Self {
        let SavedConsistent { grid: SavedGrid { blocks, free }, surfaces, standpoint, next } = map;
        let blocks = blocks.into_iter().map(|(slot, block)| (slot, block.into())).collect();
        Self { grid: SavedGrid { blocks, free }, surfaces, standpoint, next }
    }
}

impl From<SavedBlock<Voxel>> for SavedBlock {
    fn from(block: SavedBlock<Voxel>) -> Self {
        Self {
            key: block.key,
            voxels: block.voxels.into_iter().map(SavedVoxel::from).collect(),
            changed: block.changed,
            drifted: block.drifted,
            points: block.points,
            unknown: block.unknown,
            published: block.published,
            begun: block.begun,
            seen: block.seen,
            states: block.states,
        }
    }
}
