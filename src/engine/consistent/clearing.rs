//! Voxels that the sensor now looks through lose their points.
//!
//! **Kept true.** A voxel goes only when it was seen through several times with little that speaks for it in between
//! (see [`Clearance`]), never in a scan that puts a point into it. What is not dense goes as well:
//! strays would else pile up until they are dense.
//!
//! **What is looked at.** Not the cube of the voxel but where its points are ([`body`]): they are gone when every ray
//! towards them ends beyond them. So a thing that stood on a floor goes down to the floor's own layer of voxels, where the
//! floor's points keep coming, and noise before a wall stays as the wall's.
//!
//! **Delay.** A block is looked at once in three scans, so five looks take 11 to 17 scans, half a second of a Kinect's.
//!
//! **Cost.** A fifth of a nanosecond a pixel of a camera for the ranges, or 2 to 3 a point of a list, and one ray for each
//! voxel with points in a third of the blocks in view; the body is asked for only where that ray ends beyond the mean. It
//! follows the scan and the view, which ends at the farthest point, or at [`FARTHEST`].

mod body;
mod clearance;
mod view;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use self::body::Body;
pub(crate) use self::clearance::Clearance;
use self::view::RangeGrid;
use super::block::{Block, BlockIndex, BlockKey, Cell, EDGE, Voxel};
use super::grid::Grid;
use super::noise::NoiseModel;
use super::sums::Moments;
use crate::engine::scan::Scan;

/// Scans between two looks at a block.
const TURNS: i64 = 3;
/// Depth up to which every scan looks (m); one with points beyond looks as far as these. Where rays end on what is not mapped may be
/// ten times as far, and the blocks in such a view as many as those of a building.
const FARTHEST: f64 = 10.0;
/// Standard deviations of a depth by which a ray must end beyond the box around the points ([`body`]), with [`SHARE`] beside: it
/// is the nearest point of a cell that counts, and of a Kinect's 16 that one lies nearly two before the mean already.
const SIGMAS: f64 = 1.0;
/// How far beyond the box a ray must end besides, in voxels, for what the noise model leaves out: a pose that lags behind.
const SHARE: f64 = 0.1;
/// How far beyond the box a ray must end, in voxels, where depths scatter by nothing that is known.
const SHARE_OF_UNKNOWN: f64 = 0.5;

/// What clearing keeps from scan to scan: its memory.
#[derive(Clone, Debug)]
pub(super) struct Clearing {
    ranges: RangeGrid,
    blocks: Vec<BlockKey>,
    through: Vec<(BlockIndex, Cell)>,
    /// The blocks that were at rest before this scan looked at them.
    pub(super) woken: Vec<BlockIndex>,
}

impl Clearing {
    pub(super) fn new() -> Self {
        Self { ranges: RangeGrid::new(), blocks: Vec::new(), through: Vec::new(), woken: Vec::new() }
    }

    /// Takes out what the scan, which has been binned, saw through often enough; returns whose voxels these were.
    pub(super) fn clear(&mut self, grid: &mut Grid, scan: &Scan, sequence: u64) -> Vec<BlockIndex> {
        self.ranges.fill(&scan.points);
        let wanted = |key| is_its_turn(key, sequence) && grid.find(key).is_some();
        let known = (grid.slots(), grid.keys());
        let block_edge = grid.voxel_size() * f64::from(EDGE);
        self.ranges.blocks_in_view(
            &scan.fixed_from_sensor,
            block_edge,
            FARTHEST.max(self.ranges.farthest().into()),
            known,
            wanted,
            &mut self.blocks,
        );
        self.look(grid, &scan.fixed_from_sensor, sequence);
        let mut cleared = Vec::new();
        for (block, cell) in self.through.drain(..) {
            if grid.note_seen_through(block, cell) {
                cleared.extend(grid.remove(block, cell).map(|_| block));
            }
        }
        cleared
    }

    /// Lists the voxels of the blocks in view that were seen through.
    fn look(&mut self, grid: &mut Grid, fixed_from_sensor: &Isometry3<f64>, sequence: u64) {
        let view = View::new(fixed_from_sensor, grid);
        self.woken.clear();
        for &key in &self.blocks {
            let Some(block) = grid.find(key) else { continue };
            if grid.wake(block) {
                self.woken.push(block);
            }
            let here = grid.block(block);
            let corner = view.corner(here);
            for voxel in here.awake().iter().filter(|voxel| voxel.hit != sequence as u32) {
                let mean = corner + view.to_mean(voxel);
                let margin = view.margin(&mean);
                let sees_through = || self.ranges.sees_through(&view.body(&voxel.moments, &mean), margin);
                if self.ranges.ends_past(&mean, margin + View::least(&mean)) && sees_through() {
                    self.through.push((block, voxel.cell));
                }
            }
        }
    }
}

/// Whether a block is looked at in this scan. Neighbours have other turns: each scan has a part of every surface.
fn is_its_turn(key: BlockKey, sequence: u64) -> bool {
    let sum: i64 = key.iter().map(|&i| i64::from(i)).sum();
    (sum + turn(sequence)).rem_euclid(TURNS) == 0
}

/// Whose turn it is: each one's once in three scans, in an order that has no period. Sensors take turns as well, and where
/// one has every third scan, it would else look at the same third of the blocks for ever.
const fn turn(sequence: u64) -> i64 {
    let (round, place) = (sequence / TURNS as u64, (sequence % TURNS as u64) as i64);
    // The upper half of a product with an odd number near 2^64 over the golden ratio (Knuth, 6.4): Fibonacci hashing.
    let hash = (round.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 32) as i64;
    // Six orders: each of the three may be first, and the others follow forwards or backwards.
    let step = 1 + hash / TURNS % 2;
    (hash + place * step) % TURNS
}

/// Voxels as the sensor has them.
struct View {
    /// One voxel along each axis of the grid, in the sensor's frame (m).
    steps: Matrix3<f64>,
    origin: Vector3<f64>,
    voxel_size: f64,
    noise: NoiseModel,
    /// The part of the margin that does not depend on the depth (m).
    margin: f64,
}

impl View {
    fn new(fixed_from_sensor: &Isometry3<f64>, grid: &Grid) -> Self {
        let sensor_from_fixed = fixed_from_sensor.inverse();
        let rotation = sensor_from_fixed.rotation.to_rotation_matrix();
        let (voxel_size, noise) = (grid.voxel_size(), grid.noise());
        let share = if noise == NoiseModel::None { SHARE_OF_UNKNOWN } else { SHARE };
        Self {
            steps: rotation.matrix() * voxel_size,
            origin: sensor_from_fixed.translation.vector,
            voxel_size,
            noise,
            margin: share * voxel_size,
        }
    }

    /// The corner of a block.
    fn corner(&self, block: &Block) -> Point3<f64> {
        Point3::from(self.steps * block.low() + self.origin)
    }

    /// From there to the mean of a voxel's points.
    fn to_mean(&self, voxel: &Voxel) -> Vector3<f64> {
        self.steps * (voxel.cell.corner() + voxel.moments.mean())
    }

    fn body(&self, moments: &Moments, mean: &Point3<f64>) -> Body {
        Body::new(&self.steps, self.voxel_size, self.noise, moments, mean)
    }

    /// Least half extent of a body.
    fn least(mean: &Point3<f64>) -> f64 {
        body::LEAST * mean.coords.amax()
    }

    fn margin(&self, mean: &Point3<f64>) -> f64 {
        SIGMAS * self.noise.depth_sigma(mean.coords.amax()) + self.margin
    }
}

#[cfg(test)]
#[cfg(feature = "sim")]
pub(super) mod tests;
