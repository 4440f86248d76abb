//! The tolerances of the definition that follow from the parameters, for one voxel size.
//!
//! Those of length are parts of a voxel, but for two that are lengths: what a flat patch is allowed beside that, which is the sensor's
//! bias and what poses put off, and how far apart poses put two pieces of one surface. In small voxels, from 2.7 cm down with exact
//! poses, these are more than some of the others, which then are as much.

use super::noise::Noise;
use crate::engine::params::Params;

/// What is systematically wrong about a depth, or a pose that is taken as exact, however many points there are (m).
pub(super) const SENSOR_BIAS: f64 = 0.008;

/// [`Rules::planar`] where the bias is less: walls of the laboratory have up to 0.37, its pillar has 0.52 in voxels of 8 cm.
pub(super) const PLANAR: f64 = 0.5;

/// The same in standard deviations of what poses put a surface off by: each layer of voxels that they have spread it over counts as
/// much, those farthest off too.
const PLANAR_POSES: f64 = 1.5;

/// Standard deviations of noise that the points of a voxel may be off the plane of its patch.
pub(super) const NOISE_FACTOR: f64 = 2.0;
/// Standard deviations of noise that the points of a voxel beside a patch may be off its plane.
pub(super) const RIM_NOISE_FACTOR: f64 = 3.0;

/// How far apart poses may put two pieces of one surface, in standard deviations of what they put each off by: two of the
/// difference.
const POSES_APART: f64 = 2.0 * std::f64::consts::SQRT_2;

/// How far apart poses may put two pieces of one surface (m).
pub(super) fn apart_by_poses(params: &Params) -> f64 {
    POSES_APART * params.pose_sigma()
}

/// What is allowed in one map: distances in voxels, angles in rad.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// What points scatter by.
    pub(super) noise: Noise,
    /// How far the points of a voxel may be off the plane of its patch, as a root mean square, besides their noise.
    pub(super) flatness: f64,
    /// How far the points of a rough patch's voxel may be off its plane.
    pub(super) rough_flatness: f64,
    /// How far the points of a voxel beside a patch, or of a slice, may be off its plane.
    pub(super) rim_flatness: f64,
    /// Angle up to which touching patches are one surface, whatever is known of their planes.
    pub(super) join_angle: f64,
    /// Distance between two planes where their patches meet, up to which they are one surface.
    pub(super) join_offset: f64,
    /// Angle up to which touching rough patches are one surface.
    pub(super) rough_angle: f64,
    /// Distance between the planes of two rough patches where these meet, up to which they are one surface.
    pub(super) rough_offset: f64,
    /// Root mean square distance of a planar cluster's means from its plane, at most.
    pub(super) planar: f64,
}

impl Rules {
    pub(super) fn new(params: &Params) -> Self {
        let flatness = 0.1 + SENSOR_BIAS.hypot(params.pose_sigma()) / params.voxel_size();
        // In small voxels the bias alone is more, and nothing may be held to less than a flat patch is.
        let at_least = |tolerance: f64| tolerance.max(flatness);
        let join_offset = at_least(0.4_f64.max(apart_by_poses(params) / params.voxel_size()));
        Self {
            noise: Noise::new(params.noise_model(), params.voxel_size()),
            flatness,
            rough_flatness: at_least(0.5),
            rim_flatness: at_least(0.4),
            join_angle: 0.17_f64.min(params.max_normal_angle()),
            join_offset,
            rough_angle: 0.4_f64.min(params.max_normal_angle()),
            rough_offset: join_offset.max(0.8),
            planar: at_least(PLANAR.hypot(PLANAR_POSES * params.pose_sigma() / params.voxel_size())),
        }
    }

    /// The rules by which rough patches grow.
    pub(super) const fn rough(&self) -> Self {
        Self { flatness: self.rough_flatness, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules(voxel_size: f64) -> Rules {
        Rules::new(&Params::default().with_voxel_size(voxel_size).unwrap())
    }

    #[test]
    fn nothing_is_held_to_less_than_a_flat_patch_is_however_small_the_voxels() {
        for voxel_size in (1..=100).map(|centimetres| 0.01 * f64::from(centimetres)) {
            let rules = rules(voxel_size);
            let others = [rules.rim_flatness, rules.rough_flatness, rules.join_offset, rules.planar];
            assert!(others.iter().all(|other| *other >= rules.flatness), "{voxel_size}: {rules:?}");
            assert!(rules.rough_offset >= rules.join_offset, "{voxel_size}: {rules:?}");
        }
    }

    #[test]
    fn what_poses_put_off_is_allowed_of_patches_of_what_they_join_and_of_what_is_planar() {
        let params = Params::default().with_voxel_size(0.08).unwrap();
        let rules = Rules::new(&params.with_pose_sigma(0.06).unwrap());
        assert!((rules.flatness - 0.1 - 0.008_f64.hypot(0.06) / 0.08).abs() < 1e-12, "{rules:?}");
        assert!((rules.join_offset - 8.0_f64.sqrt() * 0.75).abs() < 1e-12, "{rules:?}");
        assert!((rules.planar - 0.5_f64.hypot(1.5 * 0.75)).abs() < 1e-12, "{rules:?}");
        assert_eq!((rules.rough_offset, rules.rim_flatness), (rules.join_offset, rules.flatness));
    }

    #[test]
    fn in_voxels_from_27_millimetres_on_the_tolerances_are_parts_of_a_voxel() {
        for voxel_size in [0.027, 0.05, 0.08, 0.3] {
            let rules = rules(voxel_size);
            let parts = [rules.rim_flatness, rules.rough_flatness, rules.join_offset, rules.rough_offset];
            assert_eq!((parts, rules.planar), ([0.4, 0.5, 0.4, 0.8], PLANAR), "{voxel_size}");
        }
    }
}
