//! Where a voxel's points are: the box that rays must pass and end beyond.
//!
//! Not the cube of the voxel. Rays through the lowest voxels of what stood on a floor end on the floor just behind their
//! cubes, but well beyond their points, which lay on an upright side. The box is around the mean of the points, and each
//! part of it answers to one thing that would tell against what the rays say:
//!
//! - the points may be scatter of a surface that lies before or behind them, on the ray on which they were measured: so
//!   the box reaches [`SCATTER`] sigma to both sides along it. The layers of noise before a wall that was seen from afar
//!   are no ghosts: the wall is in their box, from wherever it is looked at;
//! - they may be several surfaces with a gap at the mean: [`SPREAD`] of their deviation;
//! - a surface seen edge-on (a table from afar) is thin in the image, is often not measured, and a pose that is off by its
//!   thickness sees past it. So a body that is thin across the ray is padded, by up to half a voxel and a cell, as much
//!   as if the whole cube were looked at. More would keep points that strayed beside edges;
//! - in any case there are [`LEAST`] of the depth, three quarters of a cell: the pose, and points beside a border.

use nalgebra::{Matrix3, Point3, Vector3};

use crate::engine::consistent::noise::NoiseModel;
use crate::engine::consistent::sums::Moments;

/// Standard deviations by which points may have been measured off what they lie on.
const SCATTER: f64 = 2.5;
/// Standard deviations of the points about their mean that the rays must pass.
const SPREAD: f64 = 0.5;
/// Least half of the box in shares of its depth.
pub(super) const LEAST: f64 = 0.006;
/// Padding of what has no thickness, in voxels.
const PADDING: f64 = 0.5;
/// Padding of what has no thickness, in shares of the depth: a cell of a [`RangeGrid`](super::view::RangeGrid).
const PADDING_OF_DEPTH: f64 = 1.0 / 128.0;

/// Parts of a voxel's edge that points spread over: what spreads over less is thin.
const THIN: f64 = 0.5;

/// A box along the sensor's axes, in its frame (m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub(crate) centre: Point3<f64>,
    /// Half extents.
    pub(crate) half: Vector3<f64>,
    /// Along which axes what is in it is thin.
    pub(crate) is_thin: [bool; 3],
}

impl Body {
    /// The box around the points of a voxel, whose `mean` is in the sensor's frame (m).
    ///
    /// `steps` are one voxel along each axis of the grid, in the sensor's frame (m).
    pub(super) fn new(
        steps: &Matrix3<f64>,
        voxel_size: f64,
        noise: NoiseModel,
        moments: &Moments,
        mean: &Point3<f64>,
    ) -> Self {
        let spread = (steps * moments.covariance() * steps.transpose())
            .diagonal()
            .map(|square| square.max(0.0).sqrt());
        let axis = mean.coords.iamax();
        let depth = mean[axis].abs();
        // The deviation across a voxel that is filled from side to side.
        let full = voxel_size / 12.0_f64.sqrt();
        let mut thinness = spread.map(|spread| (1.0 - spread / full).max(0.0));
        thinness[axis] = 0.0;
        let padding = thinness * (PADDING * voxel_size + PADDING_OF_DEPTH * depth);
        let half = scatter(&(steps / voxel_size), noise, moments) + spread * SPREAD + padding;
        Self {
            centre: *mean,
            half: half.sup(&Vector3::repeat(LEAST * depth)),
            is_thin: [0, 1, 2].map(|axis| spread[axis] < THIN * full),
        }
    }
}

/// How far from where they were measured the points may belong, along the sensor's axes (m).
fn scatter(sensor_from_fixed: &Matrix3<f64>, noise: NoiseModel, moments: &Moments) -> Vector3<f64> {
    let reach = SCATTER * noise.depth_variance(moments.points.into(), moments.weight.into()).sqrt();
    let towards = moments.towards();
    // Seen from several sides, they may belong to either side of any.
    let other_ways = (1.0 - towards.norm_squared()).max(0.0).sqrt();
    ((sensor_from_fixed * towards).abs().add_scalar(other_ways)) * reach
}
