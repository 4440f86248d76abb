//! The parameters of the method, checked once.

use std::f64::consts::FRAC_PI_2;
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::consistent::NoiseModel;

/// How points become clusters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// CFODI to the letter.
    Paper,
    /// The partition that a definition gives from scratch, kept scan by scan.
    #[default]
    Consistent,
}

impl Mode {
    /// As in the parameter.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Consistent => "consistent",
        }
    }
}

/// Parameters of the engine; every value of this type is a possible one.
///
/// Where both modes have a parameter, its default is the paper's (section V), but for `min_vicinity` and
/// `expansion_interval`, of which it gives no value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    mode: Mode,
    voxel_size: f64,
    min_points: u32,
    depth: u8,
    max_normal_angle: f64,
    min_vicinity: u32,
    expansion_interval: u32,
    noise_model: NoiseModel,
    pose_sigma: f64,
    clearing: bool,
    max_voxels: u64,
    keep_radius: f64,
}

/// A parameter that cannot be: its name, the value and what it must be.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ParamsError {
    /// The edge of a voxel.
    #[error("voxel_size is {0} m; it must be finite and above 0")]
    VoxelSize(f64),
    /// A voxel without points is no obstacle.
    #[error("min_points is {0}; it must be from 1 to {most}", most = MIN_POINTS.end())]
    MinPoints(i64),
    /// Depth of a neighbourhood.
    #[error("depth is {0}; it must be from 1 to {most}", most = DEPTH.end())]
    Depth(i64),
    /// Angle between normals.
    #[error("max_normal_angle is {0} rad; it must be from 0 to pi/2")]
    MaxNormalAngle(f64),
    /// Pairs of directly connected voxels.
    #[error("min_vicinity is {0}; it must be from 1 to {most}", most = MIN_VICINITY.end())]
    MinVicinity(i64),
    /// Scans without expansion.
    #[error(
        "expansion_interval is {0}; it must be from 0 (never complete) to {most} scans",
        most = EXPANSION_INTERVAL.end()
    )]
    ExpansionInterval(i64),
    /// Error of the poses.
    #[error("pose_sigma is {0} m; it must be from {least} to {most}", least = POSE_SIGMA.start(), most = POSE_SIGMA.end())]
    PoseSigma(f64),
    /// Voxels that are kept.
    #[error("max_voxels is {0}; it must be 0 (no bound) or more")]
    MaxVoxels(i64),
    /// Radius around the sensor.
    #[error("keep_radius is {0} m; it must be finite and 0 (no bound) or more")]
    KeepRadius(f64),
}

/// Largest `depth`.
pub(crate) const MAX_DEPTH: u8 = 8;

/// Most points that a voxel counts; in `paper` further ones change neither its count nor its centre.
///
/// A centre made of 2^31 points has long come to rest, and up to here the sums fit in 64 bits.
pub(crate) const MAX_POINTS: u32 = 1 << 31;

/// What the parameters can be; here and nowhere else.
pub(crate) const VOXEL_SIZE: RangeInclusive<f64> = f64::from_bits(1)..=f64::MAX;
pub(crate) const MIN_POINTS: RangeInclusive<i64> = 1..=MAX_POINTS as i64;
pub(crate) const DEPTH: RangeInclusive<i64> = 1..=MAX_DEPTH as i64;
pub(crate) const MAX_NORMAL_ANGLE: RangeInclusive<f64> = 0.0..=FRAC_PI_2;
pub(crate) const MIN_VICINITY: RangeInclusive<i64> = 1..=u32::MAX as i64;
pub(crate) const EXPANSION_INTERVAL: RangeInclusive<i64> = 0..=u32::MAX as i64;
pub(crate) const POSE_SIGMA: RangeInclusive<f64> = 0.0..=1.0;
pub(crate) const MAX_VOXELS: RangeInclusive<i64> = 0..=i64::MAX;
pub(crate) const KEEP_RADIUS: RangeInclusive<f64> = 0.0..=f64::MAX;

impl Default for Params {
    fn default() -> Self {
        Self::DEFAULT
    }
}

fn within<T: TryFrom<i64>>(value: i64, bounds: &RangeInclusive<i64>) -> Option<T> {
    T::try_from(value).ok().filter(|_| bounds.contains(&value))
}

impl Params {
    /// What is not told otherwise.
    pub const DEFAULT: Self = Self {
        mode: Mode::Consistent,
        voxel_size: 0.08,
        min_points: 15,
        depth: 4,
        max_normal_angle: 0.53,
        min_vicinity: 1,
        expansion_interval: 10,
        noise_model: NoiseModel::KinectV1,
        pose_sigma: 0.0,
        clearing: true,
        max_voxels: 0,
        keep_radius: 0.0,
    };

    /// The defaults for the method to the letter, which forgets nothing.
    pub fn paper() -> Self {
        Self::default().with_mode(Mode::Paper)
    }

    /// How points become clusters.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The paper's xi: edge of a voxel (m), above 0.
    pub const fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// The paper's tau: points from which on a voxel is dense, 1 or more.
    pub const fn min_points(&self) -> u32 {
        self.min_points
    }

    /// The paper's d: steps that a neighbourhood reaches (Definition 2), 1 to 8.
    pub const fn depth(&self) -> u8 {
        self.depth
    }

    /// The paper's theta: the largest angle between similar normals (rad), 0 to pi/2.
    pub const fn max_normal_angle(&self) -> f64 {
        self.max_normal_angle
    }

    /// The paper's minUnits: least vicinity (Definition 7) of an absorption, 1 or more.
    pub const fn min_vicinity(&self) -> u32 {
        self.min_vicinity
    }

    /// The paper's delta: scans after which a cluster that did not grow is complete; 0 = never.
    pub const fn expansion_interval(&self) -> u32 {
        self.expansion_interval
    }

    /// What the sensor's depths scatter by. Not used in [`Mode::Paper`].
    pub const fn noise_model(&self) -> NoiseModel {
        self.noise_model
    }

    /// By how much the poses of the sensor put a surface off its place, as a standard deviation (m); 0 where that is less
    /// than a centimetre. Not used in [`Mode::Paper`].
    pub const fn pose_sigma(&self) -> f64 {
        self.pose_sigma
    }

    /// Whether voxels that the sensor looks through lose their points; never in [`Mode::Paper`].
    pub const fn clearing(&self) -> bool {
        self.clearing && matches!(self.mode, Mode::Consistent)
    }

    /// Most voxels that hold points; 0 = no bound. Not used in [`Mode::Paper`].
    pub const fn max_voxels(&self) -> u64 {
        self.max_voxels
    }

    /// How far from the sensor voxels are kept (m); 0 = no bound. Not used in [`Mode::Paper`].
    pub const fn keep_radius(&self) -> f64 {
        self.keep_radius
    }

    /// These with those of `other` that a map can go on with, as they do not shape what it holds: `clearing`, `max_voxels`,
    /// `keep_radius` and `expansion_interval`.
    #[must_use]
    pub const fn tuned(self, other: &Self) -> Self {
        let Self { expansion_interval, clearing, max_voxels, keep_radius, .. } = *other;
        Self { expansion_interval, clearing, max_voxels, keep_radius, ..self }
    }

    /// Sets whether voxels that the sensor looks through lose their points, in [`Mode::Consistent`].
    #[must_use]
    pub const fn with_clearing(self, clearing: bool) -> Self {
        Self { clearing, ..self }
    }

    /// Sets the most voxels that hold points; 0 = no bound.
    ///
    /// # Errors
    /// Below 0.
    pub fn with_max_voxels(self, value: i64) -> Result<Self, ParamsError> {
        let max_voxels = within(value, &MAX_VOXELS).ok_or(ParamsError::MaxVoxels(value))?;
        Ok(Self { max_voxels, ..self })
    }

    /// Sets how far from the sensor voxels are kept (m); 0 = no bound.
    ///
    /// # Errors
    /// When it is not a length.
    pub fn with_keep_radius(self, keep_radius: f64) -> Result<Self, ParamsError> {
        let possible = KEEP_RADIUS.contains(&keep_radius);
        possible.then_some(Self { keep_radius, ..self }).ok_or(ParamsError::KeepRadius(keep_radius))
    }

    /// Sets what the sensor's depths scatter by.
    #[must_use]
    pub const fn with_noise_model(self, noise_model: NoiseModel) -> Self {
        Self { noise_model, ..self }
    }

    /// Sets by how much the poses of the sensor put a surface off its place, as a standard deviation (m).
    ///
    /// # Errors
    /// When it is not from 0 to 1 m. More than a voxel leaves nothing of what a voxel is to tell apart, and is possible.
    pub fn with_pose_sigma(self, pose_sigma: f64) -> Result<Self, ParamsError> {
        let possible = POSE_SIGMA.contains(&pose_sigma);
        possible.then_some(Self { pose_sigma, ..self }).ok_or(ParamsError::PoseSigma(pose_sigma))
    }

    /// Sets how points become clusters.
    #[must_use]
    pub const fn with_mode(self, mode: Mode) -> Self {
        Self { mode, ..self }
    }

    /// Sets the edge of a voxel (m).
    ///
    /// # Errors
    /// One that is not finite, or not above 0.
    pub fn with_voxel_size(self, voxel_size: f64) -> Result<Self, ParamsError> {
        let possible = VOXEL_SIZE.contains(&voxel_size);
        possible.then_some(Self { voxel_size, ..self }).ok_or(ParamsError::VoxelSize(voxel_size))
    }

    /// Sets the points from which on a voxel is dense.
    ///
    /// # Errors
    /// Below 1 or above 2^31.
    pub fn with_min_points(self, value: i64) -> Result<Self, ParamsError> {
        let min_points = within(value, &MIN_POINTS).ok_or(ParamsError::MinPoints(value))?;
        Ok(Self { min_points, ..self })
    }

    /// Sets the depth of a neighbourhood.
    ///
    /// # Errors
    /// Outside 1 to 8.
    pub fn with_depth(self, value: i64) -> Result<Self, ParamsError> {
        let depth = within(value, &DEPTH).ok_or(ParamsError::Depth(value))?;
        Ok(Self { depth, ..self })
    }

    /// Sets the largest angle between similar normals (rad).
    ///
    /// # Errors
    /// Outside 0 to pi/2.
    pub fn with_max_normal_angle(self, max_normal_angle: f64) -> Result<Self, ParamsError> {
        let possible = MAX_NORMAL_ANGLE.contains(&max_normal_angle);
        possible
            .then_some(Self { max_normal_angle, ..self })
            .ok_or(ParamsError::MaxNormalAngle(max_normal_angle))
    }

    /// Sets the least vicinity of an absorption.
    ///
    /// # Errors
    /// Below 1.
    pub fn with_min_vicinity(self, value: i64) -> Result<Self, ParamsError> {
        let min_vicinity = within(value, &MIN_VICINITY).ok_or(ParamsError::MinVicinity(value))?;
        Ok(Self { min_vicinity, ..self })
    }

    /// Sets the number of scans after which a cluster that did not grow is complete; 0 = never.
    ///
    /// # Errors
    /// Below 0.
    pub fn with_expansion_interval(self, value: i64) -> Result<Self, ParamsError> {
        let expansion_interval =
            within(value, &EXPANSION_INTERVAL).ok_or(ParamsError::ExpansionInterval(value))?;
        Ok(Self { expansion_interval, ..self })
    }

    /// Definition 4 and reading R1: whether two directions, of any length above 0, lie within `max_normal_angle` of
    /// each other or of each other's opposite.
    pub(crate) fn similar(&self, a: &nalgebra::Vector3<f64>, b: &nalgebra::Vector3<f64>) -> bool {
        a.dot(b).abs() >= self.max_normal_angle.cos() * (a.norm() * b.norm())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn impossible_parameters_are_refused_with_their_value() {
        let params = Params::default();
        assert_eq!(params.with_voxel_size(0.0), Err(ParamsError::VoxelSize(0.0)));
        for size in [-0.08, -0.0, f64::INFINITY, f64::NAN] {
            assert!(matches!(params.with_voxel_size(size), Err(ParamsError::VoxelSize(_))), "{size}");
        }
        let line = ParamsError::VoxelSize(-8.0).to_string();
        assert_eq!(line, "voxel_size is -8 m; it must be finite and above 0");
        assert_eq!(params.with_min_points(0), Err(ParamsError::MinPoints(0)));
        assert_eq!(params.with_depth(9), Err(ParamsError::Depth(9)));
        assert_eq!(params.with_depth(256 + 4), Err(ParamsError::Depth(260)));
        assert_eq!(params.with_max_normal_angle(1.6), Err(ParamsError::MaxNormalAngle(1.6)));
        assert_eq!(params.with_min_vicinity(-1), Err(ParamsError::MinVicinity(-1)));
        assert_eq!(params.with_expansion_interval(-1), Err(ParamsError::ExpansionInterval(-1)));
        assert_eq!(params.with_expansion_interval(0).unwrap().expansion_interval(), 0);
        assert_eq!(params.with_pose_sigma(-0.1), Err(ParamsError::PoseSigma(-0.1)));
        assert!(matches!(params.with_pose_sigma(f64::NAN), Err(ParamsError::PoseSigma(_))));
        assert_eq!(params.with_max_voxels(-1), Err(ParamsError::MaxVoxels(-1)));
        assert_eq!(params.with_keep_radius(-0.5), Err(ParamsError::KeepRadius(-0.5)));
        assert!(matches!(params.with_keep_radius(f64::INFINITY), Err(ParamsError::KeepRadius(_))));
        let line = ParamsError::Depth(9).to_string();
        assert_eq!(line, "depth is 9; it must be from 1 to 8");
    }

    #[test]
    fn the_letter_forgets_nothing_whatever_is_said() {
        assert!(Params::default().clearing());
        assert!(!Params::default().with_clearing(false).clearing());
        assert!(!Params::paper().with_clearing(true).clearing());
        assert_eq!(Params::default().mode(), Mode::Consistent);
    }

    #[test]
    fn definition_4_similar_means_within_the_angle_whatever_sign_and_length() {
        let params = Params::default().with_max_normal_angle(0.5).unwrap();
        let x = Vector3::x();
        let at = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.0) * 3.0;
        assert!(params.similar(&x, &at(0.499)));
        assert!(!params.similar(&x, &at(0.501)));
        assert!(params.similar(&x, &-at(0.499)));
        assert!(!params.similar(&x, &-at(0.501)));
    }
}
