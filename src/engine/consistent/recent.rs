//! Where the sums of the voxels are that a scan came to lately: a table by the voxel's place that forgets.
//!
//! One place for each voxel of a cube with an edge of 32, so that voxels near each other never share one.

use super::local::LocalKey;

const BITS: u32 = 5;
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
    /// Stands for a voxel beyond the grid.
    pub(super) const BEYOND: u32 = u32::MAX;

    pub(super) fn clear(&mut self) {
        self.entries.fill((LocalKey::NONE, 0));
    }

    /// What was put here for this voxel, unless another has come since.
    #[inline(always)]
    pub(super) fn get(&self, key: LocalKey) -> Option<u32> {
        let (known, sums) = self.entries[place(key)];
        (known == key).then_some(sums)
    }

    pub(super) fn put(&mut self, key: LocalKey, sums: u32) {
        self.entries[place(key)] = (key, sums);
    }
}

/// The lowest bits along each axis.
#[inline(always)]
const fn place(key: LocalKey) -> usize {
    let ([x, y, z], low) = (key.indices(), (1 << BITS) - 1);
    (x & low | (y & low) << BITS | (z & low) << (2 * BITS)) as usize
}
