//! From what is kept of a cluster to the value that leaves the engine. Costs O(rim) a cluster.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Vector3};

use super::class::{Evidence, Neighbour, classify};
use super::cluster::{Cluster, PlaneFit};
use super::outline::{self, Detail, Outline};
use crate::engine::class::SurfaceClass;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::rectangle::rectangle_around;
use crate::engine::snapshot::{self, ClusterState};

/// What is systematically wrong about a plane (m), about its place and at its half extent about its tilt: the sensor's
/// distortion and rounding, the cut at the borders of voxels. Noise averages away, this does not.
const BIAS: f64 = 0.0012;
/// The same where the surface has [`SMALL`] m^2 or less, falling with the area beyond: what rim voxels hold of the
/// surfaces beside weighs more in a small one. Both calibrated on the simulated laboratory.
const RIM_BIAS: f64 = 0.005;
const SMALL: f64 = 0.5;
/// Root mean square distance of a planar cluster's means from its plane, at most, in voxels.
const PLANAR: f64 = 0.6;
/// Voxels, and seconds since it was first seen, from which on a cluster can be relied on.
const RELIABLE_VOXELS: u32 = 20;
const RELIABLE_SECONDS: f64 = 0.3;

/// Everything but class and state.
pub(super) fn describe(cluster: &Cluster, id: ClusterId, params: &Params) -> Option<snapshot::Cluster> {
    let size = params.voxel_size();
    let plane = cluster.plane()?;
    let point = Point3::from(plane.point * size);
    let normal = plane.normal;
    let offset = -normal.dot(&point.coords);
    let detail = Detail { min_points: params.min_points(), ..Detail::default() };
    let outline = Outline::new(&cluster.footprint, &outline::Plane { normal, d: offset }, size, &detail)?;
    let covariance = (plane.covariance + cluster.sums.spread()) * (size * size);
    let rms_error = normal.dot(&(covariance * normal.into_inner())).max(0.0).sqrt();
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
        plane_covariance: plane_covariance(&plane, &pose, sides, outline.area, size),
        centroid: point,
        covariance,
        rms_error,
        area: Some(outline.area + outline.area_left_out),
        boundary: outline.boundary,
        holes: outline.holes,
        pose,
        // What is spread evenly over a thickness has a standard deviation of its 12th part's root.
        size: Vector3::new(sides[0], sides[1], rms_error * 12.0_f64.sqrt()),
        voxel_count: cluster.voxels,
        point_count: cluster.points,
    })
}

/// How far it can be relied on.
pub(super) fn state(cluster: &Cluster, params: &Params, now: Now) -> ClusterState {
    let identity = &cluster.identity;
    let interval = u64::from(params.expansion_interval());
    if cluster.voxels < RELIABLE_VOXELS || now.stamp.seconds_since(identity.first_seen) < RELIABLE_SECONDS {
        ClusterState::Tentative
    } else if interval == 0 || now.sequence - identity.grown <= interval {
        ClusterState::Active
    } else {
        ClusterState::Complete
    }
}

/// Covariance of (turn about pose x, turn about pose y, place along pose z at its origin): the inverse of the information in
/// the voxels' means, and what does not average away.
fn plane_covariance(
    plane: &PlaneFit,
    pose: &Isometry3<f64>,
    sides: [f64; 2],
    area: f64,
    size: f64,
) -> Option<Matrix3<f64>> {
    let from_origin = plane.point * size - pose.translation.vector;
    let turn = pose.rotation.to_rotation_matrix().into_inner();
    let [x, y] = [0, 1].map(|axis| turn.column(axis).into_owned());
    let second = plane.covariance * (size * size) + from_origin * from_origin.transpose();
    let moment = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(&(second * b));
    let (mx, my) = (from_origin.dot(&x), from_origin.dot(&y));
    // A turn about x lifts what lies at y, one about y lowers what lies at x.
    #[rustfmt::skip]
    let information = Matrix3::new(
        moment(&y, &y), -moment(&x, &y), my,
        -moment(&x, &y), moment(&x, &x), -mx,
        my, -mx, 1.0,
    ) * (plane.weight / (size * size));
    let noise = information.try_inverse()?;
    let bias = BIAS + RIM_BIAS * (SMALL / area.max(SMALL));
    let tilt = |side: f64| (bias / (0.5 * side).max(size)).powi(2);
    Some(noise + Matrix3::from_diagonal(&Vector3::new(tilt(sides[1]), tilt(sides[0]), bias * bias)))
}

/// What a class depends on beside the cluster itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// z of the lowest large surface that faces up (m).
    pub(super) floor: Option<f64>,
    /// z of the sensor (m).
    pub(super) sensor: f64,
}

/// Class and confidence of a cluster among the others.
pub(super) fn class<'a>(
    cluster: &snapshot::Cluster,
    planarity: f64,
    others: impl Iterator<Item = &'a snapshot::Cluster>,
    surroundings: Surroundings,
    voxel_size: f64,
) -> (SurfaceClass, f32) {
    let n = cluster.normal;
    let level = n.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x);
    let extent = |axis: &Vector3<f64>| {
        let along = cluster.boundary.iter().map(|point| axis.dot(&point.coords));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
    };
    let (width, height, upright) = (extent(&level), extent(&n.cross(&level)), extent(&Vector3::z()));
    let neighbours: Vec<_> = if n.z.abs() < 0.5 {
        others.filter_map(|other| neighbour(cluster, &level, width, other)).collect()
    } else {
        Vec::new()
    };
    classify(&Evidence {
        normal: n,
        tilt_covariance: tilt_covariance(cluster),
        lowest: upright.0,
        highest: upright.1,
        width: width.1 - width.0,
        height: height.1 - height.0,
        area: cluster.area.unwrap_or_default(),
        voxels: cluster.voxel_count,
        voxel_size,
        rms: planarity,
        tolerance: PLANAR,
        floor: surroundings.floor,
        sensor: surroundings.sensor,
        neighbours: &neighbours,
    })
}

/// Covariance of the turns about the pose's x and y; what is not known is certain of nothing.
fn tilt_covariance(cluster: &snapshot::Cluster) -> Matrix2<f64> {
    let known = cluster.plane_covariance.map(|covariance| covariance.fixed_view::<2, 2>(0, 0).into_owned());
    known.unwrap_or_else(|| Matrix2::from_element(f64::NAN))
}

/// How far beyond an upright surface's edge another may begin and still be beside it (m).
const BESIDE: f64 = 0.3;

/// Another upright, larger cluster as a neighbour of this one; `None` where it is not beside it.
fn neighbour(
    cluster: &snapshot::Cluster,
    level: &Vector3<f64>,
    width: (f64, f64),
    other: &snapshot::Cluster,
) -> Option<Neighbour> {
    if other.id == cluster.id || other.normal.z.abs() > 0.34 || other.area < cluster.area {
        return None;
    }
    let middle = cluster.pose.translation.vector;
    let along = level.dot(&middle);
    let edges = [width.0, width.1].map(|edge| middle + level * (edge - along));
    let half = other.size * 0.5 + Vector3::repeat(BESIDE);
    let is_beside = |point: &Vector3<f64>| {
        let local = other.pose.inverse_transform_point(&Point3::from(*point));
        local.x.abs() <= half.x && local.y.abs() <= half.y
    };
    let height_above = |point: &Vector3<f64>| other.normal.dot(point) + other.offset;
    let nearest = edges.iter().filter(|edge| is_beside(edge)).map(height_above);
    let hinge_offset = nearest.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
    let highest = other.boundary.iter().map(|point| point.z).fold(f64::NEG_INFINITY, f64::max);
    Some(Neighbour { normal: other.normal, hinge_offset, plane_offset: height_above(&middle), highest })
}
