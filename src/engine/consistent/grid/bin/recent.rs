//! The blocks that a scan came to lately: a table by the block's place that forgets.
//!
//! One place for each block of a cube with an edge of 16, so that blocks near each other never share one.

use super::region::LocalKey;
use crate::engine::consistent::block::EDGE;

const BITS: u32 = 4;
const PLACES: usize = 1 << (3 * BITS);

#[derive(Clone, Debug)]
pub(super) struct Recent {
    entries: Vec<(LocalKey, u32)>,
}

impl Default for Recent {
    fn default() -> Self {
        Self { entries: vec![(LocalKey::NONE, 0); PLACES] }
    }
}

impl Recent {
    /// Stands for a block beyond the grid.
    pub(super) const BEYOND: u32 = u32::MAX;

    pub(super) fn clear(&mut self) {
        self.entries.fill((LocalKey::NONE, 0));
    }

    /// What was put here for the block with this first voxel, unless another has come since.
    #[inline(always)]
    pub(super) fn get(&self, first: LocalKey) -> Option<u32> {
        let (known, block) = self.entries[place(first)];
        (known == first).then_some(block)
    }

    pub(super) fn put(&mut self, first: LocalKey, block: u32) {
        self.entries[place(first)] = (first, block);
    }
}

/// The lowest bits of the block's index along each axis.
#[inline(always)]
fn place(first: LocalKey) -> usize {
    let [x, y, z] = first.indices().map(|index| (index / EDGE) & ((1 << BITS) - 1));
    (x | (y << BITS) | (z << (2 * BITS))) as usize
}
