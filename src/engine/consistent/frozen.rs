//! The map as it was after a scan, which no later scan changes: whatever leaves the engine of all of the map is made of it, by
//! another thread if need be, while the engine goes on.
//!
//! **Cost.** O(map). Blocks at rest, nearly all of a large map, share their voxels with the engine, and all blocks what was
//! published of theirs; the voxels of those that the sensor has seen in the last 64 scans are copied. So is, of every block, what
//! stands beside its voxels: its place in the grid and in the index by place, its patches, each with the component and plane that
//! it has, and its loose voxels; and all clusters that are told of. All the same it takes a twentieth of what it takes to make a
//! snapshot of it.

mod voxels;

use nalgebra::Isometry3;
use serde::{Serialize, Serializer};

use super::grid::Grid;
use super::noise::Noise;
use super::saved::{SavedBlock, SavedConsistent};
use super::surfaces::FrozenSurfaces;
use crate::engine::key::Partition;
use crate::engine::now::Taken;
use crate::engine::snapshot::Snapshot;

#[derive(Clone, Debug)]
pub(crate) struct FrozenConsistent {
    pub(super) grid: Grid,
    pub(super) surfaces: FrozenSurfaces,
    pub(super) noise: Noise,
    pub(super) taken: Taken,
    /// Where the sensor stands, and since which scan.
    pub(super) standpoint: (Isometry3<f64>, u64),
    /// The number of the block at which forgetting goes on.
    pub(super) next: u64,
}

impl FrozenConsistent {
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            sequence: self.taken.sequence,
            stamp: self.taken.stamp,
            voxel_size: self.grid.voxel_size(),
            clusters: self.surfaces.told.clone(),
            voxels: self.voxels(),
            unclustered_voxels: self.grid.dense() - self.surfaces.clustered,
        }
    }

    pub(crate) fn save(&self) -> SavedConsistent {
        self.saved(self.blocks().collect())
    }

    /// The same to be written: each block is made when its turn comes.
    pub(crate) fn pieces(&self) -> SavedConsistent<Pieces<'_>> {
        self.saved(Pieces(self))
    }

    fn saved<B>(&self, blocks: B) -> SavedConsistent<B> {
        let (standpoint, next) = (self.standpoint, self.next);
        SavedConsistent { blocks, surfaces: self.surfaces.save(), standpoint, next }
    }

    fn blocks(&self) -> impl Iterator<Item = SavedBlock> {
        let blocks = self.grid.blocks();
        blocks.map(|(slot, block)| SavedBlock::of(block, self.surfaces.save_states(&self.grid, slot)))
    }

    pub(crate) const fn taken(&self) -> &Taken {
        &self.taken
    }

    pub(super) fn partition(&self) -> Partition {
        let mut partition = Partition::new();
        for (index, block) in self.grid.blocks() {
            for (state, face) in self.surfaces.voxels(index) {
                let number = face.map(|face| face.component.0);
                partition.extend(block.voxel_key(state.cell()).map(|key| (key, number)));
            }
        }
        partition.sort_unstable();
        partition
    }
}

/// The blocks of a frozen map, which are a list of [`SavedBlock`] when they are written.
pub(crate) struct Pieces<'a>(&'a FrozenConsistent);

impl Serialize for Pieces<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.blocks())
    }
}
