//! The outermost voxels of a cluster in 26 directions: a small core set from which the box around it is measured.
//!
//! Of a flat rectangle, however it lies, the corners are among them, so the box around its voxels' centres is exact; of
//! a rounder shape the box is slightly too small (a core set for extents, Agarwal, Har-Peled and Varadarajan, J. ACM 51, 2004). Adding a voxel
//! and merging two clusters cost O(1).

use super::key::VoxelKey;

/// The steps to the 26 voxels around a voxel.
const OUTWARD: [[i32; 3]; 26] = {
    let mut directions = [[0; 3]; 26];
    let (mut cell, mut next) = (0, 0);
    while cell < 27 {
        if cell != 13 {
            directions[next] = [cell / 9 - 1, cell / 3 % 3 - 1, cell % 3 - 1];
            next += 1;
        }
        cell += 1;
    }
    directions
};

/// For each direction the member furthest along it, of equals the one with the largest key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Extremes([VoxelKey; 26]);

impl Extremes {
    pub(crate) const fn of(member: VoxelKey) -> Self {
        Self([member; 26])
    }

    pub(crate) fn add(&mut self, member: VoxelKey) {
        for (outermost, direction) in self.0.iter_mut().zip(OUTWARD) {
            let rank = |key: VoxelKey| {
                let [x, y, z] = key.indices();
                (x * direction[0] + y * direction[1] + z * direction[2], key)
            };
            if rank(member) > rank(*outermost) {
                *outermost = member;
            }
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for &member in &other.0 {
            self.add(member);
        }
    }

    pub(crate) const fn members(&self) -> &[VoxelKey; 26] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn of(keys: &[[i32; 3]]) -> Extremes {
        let keys: Vec<_> = keys.iter().map(|k| VoxelKey::new(k[0], k[1], k[2]).unwrap()).collect();
        let mut extremes = Extremes::of(keys[0]);
        keys.iter().for_each(|&key| extremes.add(key));
        extremes
    }

    proptest! {
        #[test]
        fn order_and_grouping_do_not_matter(
            mut keys in proptest::collection::vec(proptest::array::uniform3(-50..50), 2..60), at in 1usize..59,
        ) {
            let whole = of(&keys);
            keys.reverse();
            prop_assert_eq!(&of(&keys), &whole);
            let at = at.min(keys.len() - 1);
            let mut parts = of(&keys[..at]);
            parts.merge(&of(&keys[at..]));
            prop_assert_eq!(&parts, &whole);
        }
    }

    #[test]
    fn the_corners_of_a_rectangle_are_among_them() {
        let keys: Vec<_> = (0..200).map(|i| [i % 20, 7, i / 20]).collect();
        let found = of(&keys);
        for corner in [[0, 7, 0], [19, 7, 0], [0, 7, 9], [19, 7, 9]] {
            assert!(found.members().iter().any(|key| key.indices() == corner), "{corner:?}");
        }
    }
}
