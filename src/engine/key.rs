//! Names of things in the grid: voxels by their index, clusters by their lasting id.

use std::collections::BTreeMap;
use std::fmt;
use std::num::NonZeroU64;

use serde::{Deserialize, Serialize};

/// Index of a voxel (the paper's "unit"): voxel `ix` covers `[ix, ix + 1) * voxel_size` along x, likewise y and z.
///
/// Ordered by (ix, iy, iz). Each index lies in `-2^20 .. 2^20`, so that a key packs into 63 bits and every sum over
/// voxels stays exact (see the module `moments`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct VoxelKey {
    ix: i32,
    iy: i32,
    iz: i32,
}

/// First index outside the grid, in voxels: at 8 cm the grid reaches 83 km from the origin.
pub const GRID_REACH: i32 = 1 << 20;

/// The six directions of Definition 1, in the order +x -x +y -y +z -z.
pub(crate) const DIRECTIONS: [[i32; 3]; 6] =
    [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

impl VoxelKey {
    /// The voxel with these indices, or `None` outside the grid's reach.
    pub fn new(ix: i32, iy: i32, iz: i32) -> Option<Self> {
        let inside = |i: i32| (-GRID_REACH..GRID_REACH).contains(&i);
        (inside(ix) && inside(iy) && inside(iz)).then_some(Self { ix, iy, iz })
    }

    /// The indices [ix, iy, iz].
    pub const fn indices(self) -> [i32; 3] {
        [self.ix, self.iy, self.iz]
    }

    /// The voxel one step further along `direction`, or `None` at the edge of the grid.
    pub fn step(self, direction: [i32; 3]) -> Option<Self> {
        let [x, y, z] = direction;
        Self::new(self.ix.checked_add(x)?, self.iy.checked_add(y)?, self.iz.checked_add(z)?)
    }

    /// The directly connected voxels (Definition 1) in the order +x -x +y -y +z -z.
    pub fn neighbours(self) -> impl Iterator<Item = Self> {
        DIRECTIONS.into_iter().filter_map(move |direction| self.step(direction))
    }
}

/// The dense voxels by ascending key, each with the number of its cluster; `None` = in no cluster. Numbers name clusters in it
/// alone.
pub type Partition = Vec<(VoxelKey, Option<u32>)>;

/// The same with the clusters numbered in the order of their first voxels: partitions that differ in names alone become equal.
pub fn canonical(partition: Partition) -> Partition {
    let mut names = BTreeMap::new();
    let named = partition.into_iter().map(|(key, number)| {
        let next = names.len() as u32;
        (key, number.map(|number| *names.entry(number).or_insert(next)))
    });
    named.collect()
}

/// Lasting name of a global cluster: counts up from 1 within a session and is never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct ClusterId(NonZeroU64);

impl ClusterId {
    /// The id with this number; `None` for 0, which on the wire means "no cluster".
    pub fn new(number: u64) -> Option<Self> {
        NonZeroU64::new(number).map(Self)
    }

    /// The number, 1 or more.
    pub const fn get(self) -> u64 {
        self.0.get()
    }
}

impl fmt::Display for ClusterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definition_1_directly_connected_voxels_differ_by_one_in_exactly_one_dimension() {
        let key = VoxelKey::new(-1, 0, 7).unwrap();
        let neighbours: Vec<_> = key.neighbours().map(VoxelKey::indices).collect();
        assert_eq!(neighbours, [[0, 0, 7], [-2, 0, 7], [-1, 1, 7], [-1, -1, 7], [-1, 0, 8], [-1, 0, 6]]);
    }

    #[test]
    fn the_grid_ends_at_its_reach() {
        let edge = VoxelKey::new(GRID_REACH - 1, -GRID_REACH, 0).unwrap();
        assert_eq!(edge.neighbours().count(), 4);
        assert_eq!(VoxelKey::new(GRID_REACH, 0, 0), None);
        assert_eq!(VoxelKey::new(0, 0, i32::MIN), None);
        assert_eq!(VoxelKey::new(1, 0, 0).unwrap().step([i32::MAX, 0, 0]), None);
    }
}
