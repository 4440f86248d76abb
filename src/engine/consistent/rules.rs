//! The tolerances of the definition, in voxels, for one voxel size.

use super::noise::Noise;
use crate::engine::params::Params;

/// What is systematically wrong about a depth or a pose, however many points there are (m).
const SENSOR_BIAS: f64 = 0.008;

/// See each rule's use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// What points scatter by.
    pub(super) noise: Noise,
    /// Standard deviations of noise that the points of a patch's voxel may be off its plane.
    pub(super) noise_factor: f64,
    /// What they may be off besides.
    pub(super) flatness: f64,
    /// The same where no flat patch has a place.
    pub(super) rough_flatness: f64,
    /// The same for a voxel beside a patch.
    pub(super) rim_noise_factor: f64,
    pub(super) rim_flatness: f64,
    /// Angle up to which touching patches are one surface, whatever is known of their planes (rad).
    pub(super) join_angle: f64,
    /// Angle from which on two planes that meet within a patch are no single one (rad).
    pub(super) fold_angle: f64,
    /// Distance between two planes where their patches meet, up to which they are one surface.
    pub(super) join_offset: f64,
    /// What each of them adds to that, in standard deviations of its noise.
    pub(super) cut: f64,
    /// The same two of rough patches.
    pub(super) rough_angle: f64,
    pub(super) rough_offset: f64,
    /// Standard deviation of noise from which on a patch may be a slice of another's scatter.
    pub(super) noisy: f64,
    /// Part of its noise, at most, that the other one has.
    pub(super) sharper: f64,
    /// Angle between their normals, at most (rad).
    pub(super) slice_angle: f64,
    /// The same of what joins a slice and the one that this is a slice of.
    pub(super) beside_angle: f64,
    /// How far the voxels of two patches that meet may lie apart, along each axis.
    pub(super) contact_reach: i32,
    /// How far a voxel beside a patch may lie from it.
    pub(super) rim_reach: i32,
}

impl Rules {
    pub(super) fn new(params: &Params) -> Self {
        let bias = SENSOR_BIAS / params.voxel_size();
        Self {
            noise: Noise::new(params.noise_model(), params.voxel_size()),
            noise_factor: 2.0,
            flatness: 0.1 + bias,
            rough_flatness: 0.5,
            rim_noise_factor: 3.0,
            rim_flatness: 0.4,
            join_angle: 0.17_f64.min(params.max_normal_angle()),
            fold_angle: 0.12,
            join_offset: 0.4,
            cut: 0.8,
            rough_angle: 0.4_f64.min(params.max_normal_angle()),
            rough_offset: 0.8,
            noisy: 0.25,
            sharper: 0.75,
            slice_angle: 0.6,
            beside_angle: 0.4,
            contact_reach: 1,
            rim_reach: 3,
        }
    }

    /// Those that rough patches grow by.
    pub(super) const fn rough(&self) -> Self {
        Self { flatness: self.rough_flatness, ..*self }
    }
}
