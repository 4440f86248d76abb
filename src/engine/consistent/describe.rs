//! From what is kept of a cluster to the value that leaves the engine, but for its class (`class`) and its state
//! (`surfaces/waiting`). Costs O(rim) a cluster.

use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Vector3};

use super::cluster::{Cluster, ClusterPlane};
use super::noise::NoiseModel;
use super::outline::{self, Drawing, Outline};
use super::rules::{PLANAR, SENSOR_BIAS};
use crate::engine::class::SurfaceClass;
use crate::engine::key::ClusterId;
use crate::engine::params::Params;
use crate::engine::rectangle::rectangle_around;
use crate::engine::snapshot::{self, ClusterState};
use crate::engine::symmetric::quadratic;

/// What is systematically wrong about a plane, about its place and at its half extent about its tilt, where it has [`SMALL`]
/// m^2 or less. Noise averages away, this does not. Both parts were calibrated on the simulated laboratory at 5 and 8 cm.
///
/// By the root mean square distance of its voxels' means: what bends a surface in the map bends its plane. Falls with the
/// root of the area beyond, for the more there is of a surface, the more of it is bent otherwise.
const WAVES: f64 = 0.12;
/// By the square of a voxel's edge (1/m), falling with the area beyond: what rim voxels hold of the surfaces beside lies off
/// by a part of a voxel, and the larger the voxels, the more of them are at the rim.
const RIM_BIAS: f64 = 1.1;
const SMALL: f64 = 0.5;
/// By the standard deviation of the noise beyond [`PLANAR`] voxels: of a wall whose points scatter over several layers of voxels
/// the farther ones may be out of range, and the sparser layers are not dense. All of it is wrong by this, however large it is.
const LAYERS: f64 = 0.3;

/// How many times its noise a plane's points are off it before the rest is taken for what poses put off, whatever it is: walls
/// of the laboratory, whose poses are exact, have 1.07 at most.
const EXPLAINED: f64 = 1.15;
/// What poses put off is this many times the variance that is seen of it: what lies farther off is in no patch, and no plane is seen
/// under all poses.
const UNSEEN: f64 = 3.0;
/// Part of what poses put off that tilts a plane at its half extent: most of it moves all of a surface.
const TILTED: f64 = 0.5;

/// Everything but class and state; `None` where it has no plane, or nothing to draw an outline around.
pub(super) fn shape_of(
    cluster: &Cluster,
    id: ClusterId,
    params: &Params,
    drawing: &mut Drawing,
) -> Option<snapshot::Cluster> {
    let size = params.voxel_size();
    let plane = cluster.plane.as_ref()?;
    let point = Point3::from(plane.point * size);
    let normal = plane.normal;
    let offset = -normal.dot(&point.coords);
    let on = outline::PlaneEquation { normal, d: offset };
    let outline = Outline::new(&cluster.footprint, &on, size, drawing)?;
    let covariance = without_negative((plane.covariance + cluster.sums.covariance_within()) * (size * size));
    let rms_error = quadratic(&covariance, &normal).max(0.0).sqrt();
    let (pose, sides) = rectangle_around(&outline.boundary, &point, &normal);
    Some(snapshot::Cluster {
        id,
        revision: cluster.identity.revision,
        state: ClusterState::Tentative,
        first_seen: cluster.identity.first_seen,
        last_seen: cluster.identity.last_seen,
        class: SurfaceClass::Unknown,
        class_confidence: 0.0,
        normal,
        offset,
        plane_covariance: plane_covariance(plane, &pose, sides, outline.area, size)
            .map(|exact| exact + off_by_poses(poses_variance(plane, rms_error, params), sides, size)),
        centroid: point,
        covariance,
        rms_error,
        noise: (params.noise_model() != NoiseModel::None).then(|| plane.noise.sqrt() * size),
        area: Some(outline.area),
        boundary: outline.boundary,
        holes: outline.holes,
        pose,
        // What is spread evenly over a thickness has a standard deviation of its 12th part's root.
        size: Vector3::new(sides[0], sides[1], rms_error * 12.0_f64.sqrt()),
        voxel_count: cluster.voxels,
        point_count: cluster.points,
    })
}

/// Part of the sum of a covariance's eigenvalues that arithmetic cannot tell from none.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// A covariance as it is, or, where rounding has left it an eigenvalue of none or below, the nearest that has none such: the
/// spread of points within a voxel is known to a 65536th of its square, entry by entry, and of a thin surface that is at a slant
/// no more is left along its normal. A Cholesky decomposition of what it gives exists.
fn without_negative(covariance: Matrix3<f64>) -> Matrix3<f64> {
    let eigen = SymmetricEigen::new(covariance);
    let least = ROUNDING * covariance.trace();
    if eigen.eigenvalues.min() >= least {
        return covariance;
    }
    let eigenvalues = eigen.eigenvalues.map(|eigenvalue| eigenvalue.max(least));
    let raised = SymmetricEigen { eigenvalues, ..eigen }.recompose();
    symmetric(&raised)
}

/// A matrix that is symmetric but for rounding, without that.
fn symmetric(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    0.5 * (matrix + matrix.transpose())
}

/// Covariance of (turn about pose x, turn about pose y, place along pose z at its origin): the inverse of the information in
/// the voxels' means, and what does not average away with exact poses. `None` where their places leave nothing of it but what
/// rounding may: voxels in one row say nothing of the turn about it.
fn plane_covariance(
    plane: &ClusterPlane,
    pose: &Isometry3<f64>,
    sides: [f64; 2],
    area: f64,
    size: f64,
) -> Option<Matrix3<f64>> {
    let from_origin = plane.point * size - pose.translation.vector;
    let turn = pose.rotation.to_rotation_matrix().into_inner();
    let [x, y] = [0, 1].map(|axis| turn.column(axis).into_owned());
    let second = plane.covariance * (size * size) + from_origin * from_origin.transpose();
    if least_in_plane(&plane.covariance, &x, &y) * (size * size) < ROUNDING * second.trace() {
        return None;
    }
    let moment = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(&(second * b));
    let (mx, my) = (from_origin.dot(&x), from_origin.dot(&y));
    // A turn about x lifts what lies at y, one about y lowers what lies at x.
    #[rustfmt::skip]
    let information = Matrix3::new(
        moment(&y, &y), -moment(&x, &y), my,
        -moment(&x, &y), moment(&x, &x), -mx,
        my, -mx, 1.0,
    ) * (plane.information / (size * size));
    let noise = information.cholesky()?.inverse();
    let part = SMALL / area.max(SMALL);
    let waves = WAVES * WAVES * plane.mean_square() * size * size * part;
    let layers = LAYERS * LAYERS * (plane.noise - PLANAR * PLANAR).max(0.0) * size * size;
    let variance = waves + layers + (RIM_BIAS * size * size * part).powi(2);
    let tilt = |side: f64| variance / (0.5 * side).max(size).powi(2);
    Some(symmetric(&noise) + Matrix3::from_diagonal(&Vector3::new(tilt(sides[1]), tilt(sides[0]), variance)))
}

/// By how much the poses put a plane off its place (m^2): what they are said to, or, where this is more, by how much its points are
/// off it for no other reason that is known. One that was seen for moments only, from poses that were off alike, shows nothing.
fn poses_variance(plane: &ClusterPlane, rms_error: f64, params: &Params) -> f64 {
    let told = params.pose_sigma() * params.pose_sigma();
    if params.noise_model() == NoiseModel::None {
        return told;
    }
    let noise = plane.noise * params.voxel_size() * params.voxel_size();
    let unexplained = rms_error * rms_error - EXPLAINED * EXPLAINED * noise - SENSOR_BIAS * SENSOR_BIAS;
    told.max(UNSEEN * unexplained)
}

/// What a plane's covariance has of poses that put it off its place by this (m^2).
fn off_by_poses(variance: f64, sides: [f64; 2], size: f64) -> Matrix3<f64> {
    let tilt = |side: f64| TILTED * variance / (0.5 * side).max(size).powi(2);
    Matrix3::from_diagonal(&Vector3::new(tilt(sides[1]), tilt(sides[0]), variance))
}

/// The least variance of this covariance along a direction in the plane of two orthogonal ones.
fn least_in_plane(covariance: &Matrix3<f64>, x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    let [xx, xy, yy] = [(x, x), (x, y), (y, y)].map(|(a, b)| a.dot(&(covariance * b)));
    0.5 * (xx + yy) - (0.5 * (xx - yy)).hypot(xy)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;
    use crate::engine::consistent::cluster::{Identity, Member, Share};
    use crate::engine::consistent::patch::Weight;
    use crate::engine::consistent::patch::examples::states;
    use crate::engine::key::VoxelKey;
    use crate::engine::scan::Stamp;

    /// A level plane whose voxels vary by `x` and `y` along these axes (voxels^2).
    fn level(x: f64, y: f64) -> ClusterPlane {
        ClusterPlane {
            point: Vector3::zeros(),
            normal: Vector3::z_axis(),
            information: 1e5,
            covariance: Matrix3::from_diagonal(&Vector3::new(x, y, 0.0)),
            noise: 0.0,
        }
    }

    /// Its covariance, of 10 cm by 1 m.
    fn covariance(x: f64, y: f64) -> Option<Matrix3<f64>> {
        plane_covariance(&level(x, y), &Isometry3::identity(), [1.0, 0.1], 0.1, 0.05)
    }

    #[test]
    fn a_plane_is_no_more_certain_than_the_poses_that_it_was_seen_from() {
        let params = Params::default().with_voxel_size(0.05).unwrap();
        // 2 cm of noise.
        let plane = ClusterPlane { noise: 0.16, ..level(40.0, 40.0) };
        let variance = |rms_error, params: &Params| poses_variance(&plane, rms_error, params);
        let told = params.with_pose_sigma(0.04).unwrap();
        assert_eq!((variance(0.024, &params), variance(0.024, &told)), (0.0, 0.0016));
        // What noise does not explain is three times as much, and counts where it is more than what is told.
        let seen = 3.0 * (0.06 * 0.06 - 1.15 * 1.15 * 0.0004 - 0.008 * 0.008);
        assert!(
            (variance(0.06, &params) - seen).abs() < 1e-12
                && variance(0.06, &told) == variance(0.06, &params)
        );
        let unknown = told.with_noise_model(NoiseModel::None);
        assert_eq!(variance(0.06, &unknown), 0.0016, "all of it may be noise");
        // In place, and half of it in tilt at the half extent: 0.5 m from x, 1 m from y.
        let expected = Matrix3::from_diagonal(&(0.0016 * Vector3::new(2.0, 0.5, 1.0)));
        assert!((off_by_poses(0.0016, [2.0, 1.0], 0.05) - expected).abs().max() < 1e-15);
    }

    proptest! {
        #[test]
        fn a_covariance_that_rounding_left_indefinite_becomes_the_nearest_that_is_not(
            variances in (prop_oneof![-1e-5..0.0, Just(0.0), 1e-4..1.0], prop_oneof![Just(0.0), 1e-4..1.0], 1e-2..1.0_f64),
            turn in prop::array::uniform3(-3.0..3.0),
        ) {
            let variances = Vector3::<f64>::from(<[f64; 3]>::from(variances));
            let turn: Matrix3<f64> = Rotation3::from_scaled_axis(Vector3::from(turn)).into_inner();
            let before = turn * Matrix3::from_diagonal(&variances) * turn.transpose();
            let before: Matrix3<f64> = (before + before.transpose()) * 0.5;
            let after = without_negative(before);
            prop_assert!(after.cholesky().is_some() && after == after.transpose(), "{after}");
            let off = (after - before).norm();
            prop_assert!(off <= (-variances.min()).max(0.0) + 1e-13, "{off} of {variances}");
            prop_assert!(variances.min() < 1e-4 || after == before, "{after} of {before}");
        }
    }

    /// The covariance of a plane through voxels that lie so many steps each from the first, which is `far` from the origin; its pose is
    /// turned by this in the plane.
    fn covariance_through(
        steps: &[[i32; 3]],
        weights: &[f64],
        far: [i32; 3],
        turned: f64,
    ) -> Option<Matrix3<f64>> {
        let state = &states(1.0, &Vector3::z(), 0..1, |_| 0.3)[0];
        let mut cluster = Cluster::new(Identity::new(Stamp::from_nanos(0)));
        for (step, weight) in steps.iter().zip(weights) {
            let corner = [0, 1, 2].map(|axis| far[axis] + step[axis]);
            let weight = Weight { most: *weight, part: 1.0 };
            let share = Some(Share { corner, weight, normal: Vector3::z_axis(), noise: 0.0 });
            cluster.add(&Member { key: VoxelKey::new(0, 0, 0).unwrap(), state, is_thin: true, share });
        }
        cluster.refit();
        let (plane, size) = (cluster.plane.unwrap(), 0.05);
        let upright = UnitQuaternion::rotation_between(&Vector3::z(), &plane.normal).unwrap();
        let rotation = upright * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned);
        let middle = Vector3::from(far).map(f64::from) * size;
        let beside = middle - plane.normal.into_inner() * plane.normal.dot(&(middle - plane.point * size));
        let pose = Isometry3::from_parts(beside.into(), rotation);
        plane_covariance(&plane, &pose, [1.0, 0.1], 0.1, size)
    }

    proptest! {
        #[test]
        fn voxels_in_one_row_leave_the_turn_about_it_unknown(
            step in prop::array::uniform3(-9..9_i32).prop_filter("a step", |step| *step != [0; 3]),
            weights in prop::collection::vec(1.0..1000.0, 2..200),
            far in prop::array::uniform3(-100_000..100_000_i32),
            turned in -3.0..3.0,
        ) {
            let steps: Vec<_> = (0..weights.len() as i32).map(|i| step.map(|along| along * i)).collect();
            let known = covariance_through(&steps, &weights, far, turned);
            prop_assert_eq!(known, None);
        }

        #[test]
        fn a_covariance_of_a_plane_is_symmetric(
            steps in prop::collection::vec((0..40_i32, 0..40_i32), 12..60), slope in prop::array::uniform2(-3..3_i32),
            far in prop::array::uniform3(-100_000..100_000_i32), turned in -3.0..3.0,
        ) {
            let steps: Vec<_> = steps.into_iter().map(|(x, y)| [x, y, slope[0] * x + slope[1] * y]).collect();
            let known = covariance_through(&steps, &vec![10.0; steps.len()], far, turned).unwrap();
            prop_assert!(known == known.transpose() && known.cholesky().is_some(), "{known}");
        }
    }

    #[test]
    fn a_turn_that_rounding_made_certain_to_less_than_nothing_is_not_known() {
        let known = covariance(30.0, 0.1).unwrap();
        assert!(known.cholesky().is_some() && known[(0, 0)] > known[(1, 1)], "{known}");
        // The voxels of one row: what they vary by across it is rounding.
        for across in [0.0, -1e-17, 1e-17, 1e-13] {
            assert_eq!(covariance(30.0, across), None);
        }
    }

    #[test]
    fn a_turn_about_the_long_side_is_known_less_well_than_one_about_the_short_side() {
        let known = covariance(30.0, 30.0).unwrap();
        assert!(known[(0, 0)] > 50.0 * known[(1, 1)], "{known}");
    }
}
