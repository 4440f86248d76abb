//! The map as it was after a scan, which no later scan changes: whatever leaves the engine of all of the map is made of it, by
//! another thread if need be, while the engine goes on.
//!
//! **Cost.** To freeze it, a pointer for each page of blocks, patches and components
//! ([`Shared`](super::lists::shared::Shared)), and who each cluster is. Nothing else is copied then but the numbers of free
//! slots: the map shares all that it holds with the engine, which has a page for itself from the first change on that it
//! makes there, so that the scans after it pay for what they change. What is made of it costs O(map).

mod voxels;

use serde::{Serialize, Serializer};

use super::grid::Blocks;
use super::noise::Noise;
use super::publish::standpoint::Standpoint;
use super::saved::{SavedBlock, SavedConsistent};
use super::surfaces::FrozenSurfaces;
use crate::engine::key::Partition;
use crate::engine::now::Taken;
use crate::engine::snapshot::Snapshot;

#[derive(Clone, Debug)]
pub(crate) struct FrozenConsistent {
    pub(super) blocks: Blocks,
    pub(super) surfaces: FrozenSurfaces,
    pub(super) noise: Noise,
    pub(super) taken: Taken,
    pub(super) standpoint: Standpoint,
    /// The number of the block at which forgetting goes on.
    pub(super) next: u64,
}

impl FrozenConsistent {
    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot {
            sequence: self.taken.sequence,
            stamp: self.taken.stamp,
            voxel_size: self.blocks.voxel_size(),
            clusters: self.surfaces.descriptions(),
            voxels: self.voxels(),
            unclustered_voxels: self.blocks.dense() - self.surfaces.clustered,
        }
    }

    pub(crate) fn save(&self) -> SavedConsistent {
        self.saved(self.saved_blocks().collect())
    }

    /// The same to be written: each block is made when its turn comes.
    pub(crate) fn pieces(&self) -> SavedConsistent<Pieces<'_>> {
        self.saved(Pieces(self))
    }

    fn saved<B>(&self, blocks: B) -> SavedConsistent<B> {
        let (standpoint, next) = (self.standpoint, self.next);
        SavedConsistent { blocks, surfaces: self.surfaces.save(), standpoint, next }
    }

    fn saved_blocks(&self) -> impl Iterator<Item = SavedBlock> {
        let blocks = self.blocks.blocks();
        blocks.map(|(slot, block)| SavedBlock::of(block, self.surfaces.save_states(&self.blocks, slot)))
    }

    pub(crate) const fn taken(&self) -> &Taken {
        &self.taken
    }

    pub(super) fn partition(&self) -> Partition {
        let mut partition = Partition::new();
        let faces = self.surfaces.faces();
        for (index, block) in self.blocks.blocks() {
            for (state, face) in self.surfaces.voxels(index, &faces) {
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
        serializer.collect_seq(self.0.saved_blocks())
    }
}
