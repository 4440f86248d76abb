//! The outermost voxels of a cluster in 98 directions: a small core set from which the box around it is measured.
//!
//! Neighbouring directions are at most 27 degrees apart, so that a right angle's corner and a hexagon's are among the
//! voxels found: a rectangle's box is exact however it lies, a disc's too small by 3 % (a core set for extents, Agarwal,
//! Har-Peled and Varadarajan, J. ACM 51, 2004). Adding a voxel and merging two clusters cost O(1).

use crate::engine::key::VoxelKey;

const DIRECTIONS: usize = 98;

/// The steps from a voxel to the faces of the cube of 5 x 5 x 5 voxels around it.
const OUTWARD: [[i32; 3]; DIRECTIONS] = {
    let mut directions = [[0; 3]; DIRECTIONS];
    let (mut cell, mut next) = (0, 0);
    while cell < 125 {
        let [x, y, z] = [cell / 25 - 2, cell / 5 % 5 - 2, cell % 5 - 2];
        if x == -2 || x == 2 || y == -2 || y == 2 || z == -2 || z == 2 {
            directions[next] = [x, y, z];
            next += 1;
        }
        cell += 1;
    }
    directions
};

/// For each direction the member furthest along it, of equals the one with the largest key.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Extremes([VoxelKey; DIRECTIONS]);

/// How far `key` lies along `direction`; of equals the larger key is further.
fn rank(key: VoxelKey, direction: [i32; 3]) -> (i32, VoxelKey) {
    let [x, y, z] = key.indices();
    (x * direction[0] + y * direction[1] + z * direction[2], key)
}

impl Extremes {
    pub(crate) const fn of(member: VoxelKey) -> Self {
        Self([member; DIRECTIONS])
    }

    pub(crate) fn add(&mut self, member: VoxelKey) {
        self.merge(&Self::of(member));
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for ((mine, &theirs), direction) in self.0.iter_mut().zip(&other.0).zip(OUTWARD) {
            if rank(theirs, direction) > rank(*mine, direction) {
                *mine = theirs;
            }
        }
    }

    /// The voxels, each once, by ascending key.
    pub(crate) fn members(&self) -> Vec<VoxelKey> {
        let mut members = self.0.to_vec();
        members.sort_unstable();
        members.dedup();
        members
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
