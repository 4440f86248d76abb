//! Where points lie in the grid: whole 1/4096 of a voxel's edge from the corner of a region around the sensor.
//!
//! The region is some [`REACH`] voxels to each side, 25 m at 5 cm, and moves with the sensor by whole blocks, so that a place in
//! it takes 22 bits. What lies beyond is placed by `binning`.
//!
//! A place is rounded down, to within 2^-24 of a unit: what lies nearer than that below a voxel's border counts as above it.
//! Arithmetic is multiplication and addition, each rounded on its own, and gives the same on every processor however many points
//! are done at once.

use nalgebra::Isometry3;

use crate::engine::binning::{UNITS, nearest};
use crate::engine::consistent::block::{Cell, EDGE};
use crate::engine::key::{GRID_REACH, VoxelKey};

/// Voxels of the region to each side of the sensor.
const REACH: i32 = 512;
/// Bits of a voxel's place along an axis, and of an offset in it.
pub(super) const AXIS_BITS: u32 = 10;
pub(super) const UNIT_BITS: u32 = UNITS.ilog2();
/// Units from which on a place is beyond the region.
const END: u32 = 1 << (AXIS_BITS + UNIT_BITS);
/// What makes the nearest whole number the one below.
const DOWN: f64 = 0.5 - 1.0 / (1 << 24) as f64;

/// Place of a voxel in the region: ten bits for each axis, x lowest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LocalKey(pub(super) i32);

impl LocalKey {
    /// What lies in no voxel of the region; above all others.
    pub(super) const NONE: Self = Self(i32::MAX);

    /// Voxels along each axis from the region's corner.
    #[inline(always)]
    pub(super) const fn indices(self) -> [i32; 3] {
        let last = 2 * REACH - 1;
        [self.0 & last, self.0 >> AXIS_BITS & last, self.0 >> (2 * AXIS_BITS) & last]
    }

    /// The first voxel of its block.
    #[inline(always)]
    pub(super) const fn block(self) -> Self {
        const IN_BLOCK: i32 = EDGE - 1;
        Self(self.0 & !(IN_BLOCK | IN_BLOCK << AXIS_BITS | IN_BLOCK << (2 * AXIS_BITS)))
    }

    /// Its place in its block.
    #[inline(always)]
    pub(super) fn cell(self) -> Cell {
        Cell::at(self.indices().map(|index| index & (EDGE - 1)))
    }
}

/// The region and the pose of one scan.
#[derive(Clone, Copy, Debug)]
pub(super) struct SensorRegion {
    /// The region's first voxel, which is the first of a block.
    corner: [i32; 3],
    /// For each axis the units that one metre along x, y and z of the sensor's frame makes.
    pub(super) units: [[f64; 3]; 3],
    /// For each axis the sensor's place in units, less [`DOWN`].
    pub(super) origin: [f64; 3],
}

impl SensorRegion {
    /// `None` where the sensor is itself beyond the grid.
    pub(super) fn new(fixed_from_sensor: &Isometry3<f64>, voxel_size: f64) -> Option<Self> {
        let sensor = fixed_from_sensor.translation.vector / voxel_size;
        if !sensor.iter().all(|index| index.abs() < f64::from(GRID_REACH)) {
            return None;
        }
        let corner: [i32; 3] = sensor.map(|index| (index.floor() as i32 - REACH) & !(EDGE - 1)).into();
        let rotation = fixed_from_sensor.rotation.to_rotation_matrix();
        let scale = UNITS as f64 / voxel_size;
        let place = |axis: usize| (sensor[axis] - f64::from(corner[axis])) * UNITS as f64;
        Some(Self {
            corner,
            units: [0, 1, 2].map(|axis| [0, 1, 2].map(|of| rotation[(axis, of)] * scale)),
            origin: [0, 1, 2].map(|axis| place(axis) - DOWN),
        })
    }

    /// A place along one axis from what lies between it and the sensor and from the sensor's ([`Self::origin`]), in units; below 0
    /// or [`END`] or more where it is beyond the region or not a number.
    #[inline(always)]
    pub(super) fn place(from_sensor: f64, origin: f64) -> i32 {
        const LEAST: f64 = -1.0;
        const MOST: f64 = END as f64;
        let place = from_sensor + origin;
        // The comparisons are those that a processor has one instruction for.
        let place = if place > LEAST { place } else { LEAST };
        let place = if place < MOST { place } else { MOST };
        nearest(place) as i32
    }

    /// The voxel that places along the three axes are in.
    #[inline(always)]
    pub(super) fn key([x, y, z]: [i32; 3]) -> LocalKey {
        let key = x >> UNIT_BITS | (y >> UNIT_BITS) << AXIS_BITS | (z >> UNIT_BITS) << (2 * AXIS_BITS);
        if ((x | y | z) as u32) < END { LocalKey(key) } else { LocalKey::NONE }
    }

    /// Offset of a place in its voxel.
    #[inline(always)]
    pub(super) const fn offset(place: i32) -> i32 {
        place & (UNITS as i32 - 1)
    }

    /// The voxel in the grid; `None` beyond it.
    pub(super) fn voxel(&self, key: LocalKey) -> Option<VoxelKey> {
        let [x, y, z] = key.indices();
        VoxelKey::new(self.corner[0] + x, self.corner[1] + y, self.corner[2] + z)
    }
}
