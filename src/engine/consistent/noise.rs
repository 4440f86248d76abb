//! What a sensor's depths scatter by, and the weight that points get from it.
//!
//! A point weighs 1 / sigma^2, as a whole number. All points that one scan puts into a voxel weigh the same, by the depth of
//! their mean: what a voxel knows does not depend on their order.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::engine::binning::nearest;

/// How the depth measurements of a sensor scatter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum NoiseModel {
    /// The first Kinect, after Nguyen, Izadi and Lovell, "Modeling Kinect Sensor Noise for Improved 3D Reconstruction
    /// and Tracking", 2012: sigma = 1.2 mm + 1.9 mm (z - 0.4)^2 along z, about 0.8 pixels across it.
    #[default]
    KinectV1,
    /// Every point weighs the same and scatters by nothing that is known.
    None,
}

impl NoiseModel {
    /// As in the parameter.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::KinectV1 => "kinect_v1",
            Self::None => "none",
        }
    }
}

/// The sigma (m) at which a point weighs 1: a Kinect's at 9 m. The least sigma of a Kinect, 1.2 mm, gives 2^14.
const UNIT_SIGMA: f64 = 0.1536;

/// Greatest weight of a point.
pub(super) const MAX_WEIGHT: u64 = 1 << 14;

/// The noise of points in voxels of one size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    model: NoiseModel,
    /// Square of a voxel's edge (m^2).
    area: f64,
}

impl Noise {
    pub(super) fn new(model: NoiseModel, voxel_size: f64) -> Self {
        Self { model, area: voxel_size * voxel_size }
    }

    /// Mean variance of depth (voxels^2) of `points` points whose weights sum to `weight`.
    pub(super) fn depth_variance(&self, points: u32, weight: u32) -> f64 {
        self.model.depth_variance(points.into(), weight.into()) / self.area
    }

    /// Variance across the depth axis (voxels^2) where the depth varies by `depth_variance` (voxels^2).
    pub(super) fn lateral_variance(&self, depth_variance: f64) -> f64 {
        self.model.lateral_variance(depth_variance * self.area) / self.area
    }
}

impl fmt::Display for NoiseModel {
    /// The value of the parameter `noise_model`.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.as_str())
    }
}

impl NoiseModel {
    /// Standard deviation of a depth (m) at that depth (m).
    pub(crate) fn depth_sigma(self, depth: f64) -> f64 {
        match self {
            Self::KinectV1 => 0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4),
            Self::None => 0.0,
        }
    }

    /// Weight of a point at this depth (m), 1 to 2^14.
    pub(super) fn weight(self, depth: f64) -> u64 {
        match self {
            Self::KinectV1 => {
                let ratio = UNIT_SIGMA / self.depth_sigma(depth);
                (nearest((ratio * ratio).min(MAX_WEIGHT as f64)) as u64).max(1)
            }
            Self::None => 1,
        }
    }

    /// Mean variance of depth (m^2) of `points` points whose weights sum to `weight`.
    pub(super) fn depth_variance(self, points: f64, weight: f64) -> f64 {
        match self {
            Self::KinectV1 => UNIT_SIGMA * UNIT_SIGMA * points / weight,
            Self::None => 0.0,
        }
    }

    /// Variance across the depth axis (m^2) where the depth varies by `depth_variance`: 0.8 pixels of 1/525 rad.
    pub(super) fn lateral_variance(self, depth_variance: f64) -> f64 {
        match self {
            Self::KinectV1 => {
                let depth = 0.4 + ((depth_variance.sqrt() - 0.0012).max(0.0) / 0.0019).sqrt();
                (0.8 / 525.0 * depth).powi(2)
            }
            Self::None => 0.0,
        }
    }
}
