//! Which voxels a scan has touched lately: a table by the voxel's place that forgets.
//!
//! One place for each voxel of a cube with an edge of 16, so that voxels near each other never share one.

use super::local::LocalKey;

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
    /// Stands for a voxel beyond the grid.
    pub(super) const BEYOND: u32 = u32::MAX;

    pub(super) fn clear(&mut self) {
        self.entries.fill((LocalKey::NONE, 0));
    }

    /// What was put here for this voxel, unless another has come since.
    #[inline(always)]
    pub(super) fn get(&self, key: LocalKey) -> Option<u32> {
        let (known, touched) = self.entries[place(key)];
        (known == key).then_some(touched)
    }

    pub(super) fn put(&mut self, key: LocalKey, touched: u32) {
        self.entries[place(key)] = (key, touched);
    }
}

/// The lowest bits along each axis.
#[inline(always)]
const fn place(LocalKey(key): LocalKey) -> usize {
    let low = (1 << BITS) - 1;
    (key & low | (key >> 10 & low) << BITS | (key >> 20 & low) << (2 * BITS)) as usize
}
