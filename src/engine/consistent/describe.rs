//! From what is kept of a cluster to the value that leaves the engine. Costs O(rim) a cluster.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, SymmetricEigen, Vector3};

use super::class::{Evidence, FLOOR_AREA, Neighbour, classify, faces_up};
use super::cluster::{Cluster, PlaneFit};
use super::outline::{self, Detail, Drawing, Outline};
use super::rules::{PLANAR, Rules};
use crate::engine::class::SurfaceClass;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::rectangle::rectangle_around;
use crate::engine::scan::Stamp;
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
/// [`Rules::planar`] in standard deviations of the noise. Where the points of a wall scatter over several layers of voxels, as from 4 m on
/// in voxels of 5 cm, the layers' means scatter by 0.85 of it.
const NOISY_PLANAR: f64 = 1.25;
/// Voxels, and seconds since it was first seen, from which on a cluster can be relied on.
const RELIABLE_VOXELS: u32 = 20;
const RELIABLE_SECONDS: f64 = 0.3;

/// Everything but class and state.
pub(super) fn describe(
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
    let on = outline::Plane { normal, d: offset };
    let outline = Outline::new(&cluster.footprint, &on, size, &Detail::default(), drawing)?;
    let covariance = without_negative((plane.covariance + cluster.sums.spread()) * (size * size));
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
        plane_covariance: plane_covariance(plane, &pose, sides, outline.area, size),
        centroid: point,
        covariance,
        rms_error,
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
    0.5 * (raised + raised.transpose())
}

/// How far it can be relied on.
pub(super) fn state(cluster: &Cluster, params: &Params, now: Now) -> ClusterState {
    let identity = &cluster.identity;
    if cluster.voxels < RELIABLE_VOXELS || is_new(identity.first_seen, now) {
        ClusterState::Tentative
    } else if is_grown(identity.grown, params, now) {
        ClusterState::Complete
    } else {
        ClusterState::Active
    }
}

/// Whether what was first seen then is too new to be relied on.
pub(super) fn is_new(first_seen: Stamp, now: Now) -> bool {
    // Seen first by a later clock: before a restart, and so for long.
    (0.0..RELIABLE_SECONDS).contains(&now.stamp.seconds_since(first_seen))
}

/// Whether what has grown last in this scan is complete.
pub(super) fn is_grown(grown: u64, params: &Params, now: Now) -> bool {
    let interval = u64::from(params.expansion_interval());
    interval > 0 && now.sequence - grown > interval
}

/// What the state of a cluster waits for that becomes another by time alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Waits {
    /// It is large enough, and too new: first seen then.
    New(Stamp),
    /// It is active, and may be complete: it grew last in this scan.
    Grown(u64),
}

/// What the state that a cluster is told to have waits for.
pub(super) fn waits(cluster: &Cluster) -> Option<Waits> {
    let identity = &cluster.identity;
    match cluster.told.as_ref()?.state {
        ClusterState::Tentative if cluster.voxels >= RELIABLE_VOXELS => Some(Waits::New(identity.first_seen)),
        ClusterState::Active => Some(Waits::Grown(identity.grown)),
        ClusterState::Tentative | ClusterState::Complete => None,
    }
}

/// Covariance of (turn about pose x, turn about pose y, place along pose z at its origin): the inverse of the information in
/// the voxels' means, and what does not average away. `None` where rounding leaves nothing of it: voxels in one row
/// say nothing of the turn about it, and variances came out negative.
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
    let noise = information.cholesky()?.inverse();
    let part = SMALL / area.max(SMALL);
    let waves = WAVES * WAVES * plane.mean_square() * size * size * part;
    let layers = LAYERS * LAYERS * (plane.noise - PLANAR * PLANAR).max(0.0) * size * size;
    let variance = waves + layers + (RIM_BIAS * size * size * part).powi(2);
    let tilt = |side: f64| variance / (0.5 * side).max(size).powi(2);
    Some(noise + Matrix3::from_diagonal(&Vector3::new(tilt(sides[1]), tilt(sides[0]), variance)))
}

/// What a class depends on beside the cluster itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surroundings {
    /// z of the floor of its storey (m).
    pub(super) floor: Option<f64>,
    /// z of the lowest floor (m), where it lies below all.
    pub(super) floor_above: Option<f64>,
    /// z of the sensor (m).
    pub(super) sensor: f64,
    /// Whether it has been taken for a ceiling.
    pub(super) was_ceiling: bool,
}

/// How a cluster's voxels lie on its plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planarity {
    /// Root mean square distance of their means from it, and up to which one it is a plane, in voxels.
    rms: f64,
    tolerance: f64,
    /// Angle between its normal, that of the voxels' means, and the mean of its patches' normals, which where there is but one
    /// row of voxels are those of the points within them: any plane may hold the row.
    across: f64,
}

impl Planarity {
    pub(super) fn of(cluster: &Cluster, plane: &PlaneFit, rules: &Rules) -> Self {
        Self {
            rms: plane.mean_square().sqrt(),
            tolerance: rules.planar.max(NOISY_PLANAR * plane.noise.sqrt()),
            across: plane.normal.angle(&cluster.sums.normal()),
        }
    }
}

/// Class and confidence of a cluster among its neighbours.
pub(super) fn class(
    cluster: &snapshot::Cluster,
    planarity: Planarity,
    uprights: &Uprights,
    surroundings: Surroundings,
    voxel_size: f64,
) -> (SurfaceClass, f32) {
    let n = cluster.normal;
    let level = level(cluster);
    let (width, height) = (extent(cluster, &level), extent(cluster, &n.cross(&level)));
    let (lowest, highest) = extent(cluster, &Vector3::z());
    let is_level = cluster.area.is_some_and(|area| area >= FLOOR_AREA) && faces_up(&n);
    debug_assert!(
        !is_level || surroundings.floor.or(surroundings.floor_above).is_some(),
        "itself a floor: {cluster:?}"
    );
    classify(&Evidence {
        normal: n,
        tilt_covariance: tilt_covariance(cluster),
        lowest,
        highest,
        width: width.1 - width.0,
        height: height.1 - height.0,
        area: cluster.area.unwrap_or_default(),
        voxels: cluster.voxel_count,
        voxel_size,
        rms: planarity.rms,
        tolerance: planarity.tolerance,
        across: planarity.across,
        floor: surroundings.floor,
        floor_above: surroundings.floor_above,
        sensor: surroundings.sensor,
        was_ceiling: surroundings.was_ceiling,
        neighbours: &uprights.neighbours,
        corners: uprights.corners,
    })
}

/// Half way from the lowest z of a cluster to the highest (m).
pub(super) fn middle(cluster: &snapshot::Cluster) -> f64 {
    let (lowest, highest) = extent(cluster, &Vector3::z());
    f64::midpoint(lowest, highest)
}

/// Covariance of the turns about the pose's x and y; what is not known is certain of nothing.
fn tilt_covariance(cluster: &snapshot::Cluster) -> Matrix2<f64> {
    let known = cluster.plane_covariance.map(|covariance| covariance.fixed_view::<2, 2>(0, 0).into_owned());
    known.unwrap_or_else(|| Matrix2::from_element(f64::NAN))
}

/// How far beyond an upright surface's edge another may begin and still be beside it (m).
const BESIDE: f64 = 0.3;
/// How far its edge may be off the other's plane (m). A hinge is within 0.3 m of it, and so is the middle of a shut leaf,
/// whose edges then are within 0.5 m: what is farther off makes no door of a cluster.
const ACROSS: f64 = 1.0;

/// Half extents, along the axes of its pose, of the box in which the edges of others are beside an upright cluster (m).
pub(super) fn reach(upright: &snapshot::Cluster) -> Vector3<f64> {
    Vector3::new(0.5 * upright.size.x + BESIDE, 0.5 * upright.size.y + BESIDE, ACROSS)
}

/// Whether others can stand beside it.
pub(super) fn is_upright(cluster: &snapshot::Cluster) -> bool {
    cluster.normal.z.abs() <= 0.34
}

/// The upright edges of a cluster, at the height of its middle; `None` where it leans too much for a door.
pub(super) fn edges(cluster: &snapshot::Cluster) -> Option<[Point3<f64>; 2]> {
    if cluster.normal.z.abs() >= 0.5 {
        return None;
    }
    let (level, middle) = (level(cluster), cluster.pose.translation.vector);
    let (left, right) = extent(cluster, &level);
    let along = level.dot(&middle);
    Some([left, right].map(|edge| Point3::from(middle + level * (edge - along))))
}

/// The horizontal direction in a cluster's plane; x where all are.
fn level(cluster: &snapshot::Cluster) -> Vector3<f64> {
    cluster.normal.cross(&Vector3::z()).try_normalize(1e-6).unwrap_or_else(Vector3::x)
}

/// From where to where a cluster reaches along an axis (m).
fn extent(cluster: &snapshot::Cluster, axis: &Vector3<f64>) -> (f64, f64) {
    let along = cluster.boundary.iter().map(|point| axis.dot(&point.coords));
    along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
}

/// The upright clusters beside one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Uprights {
    /// The larger ones.
    pub(super) neighbours: Vec<Neighbour>,
    /// See [`Evidence::corners`].
    pub(super) corners: [f64; 2],
}

impl Uprights {
    /// The clusters, of `others`, that one with these edges stands beside; none of one that has no edges.
    pub(super) fn of<'a>(
        cluster: &snapshot::Cluster,
        edges: Option<&[Point3<f64>; 2]>,
        others: impl Iterator<Item = &'a snapshot::Cluster>,
    ) -> Self {
        let mut beside = Self { neighbours: Vec::new(), corners: [f64::INFINITY; 2] };
        let Some(edges) = edges else { return beside };
        for other in others.filter(|other| other.id != cluster.id && is_upright(other)) {
            let is_beside = edges.each_ref().map(|edge| reaches(other, edge));
            beside.neighbours.extend(neighbour(cluster, edges, is_beside, other));
            if makes_corner(cluster, other) {
                let gaps = gaps(edges, is_beside, other);
                beside.corners = [0, 1].map(|edge| beside.corners[edge].min(gaps[edge]));
            }
        }
        beside
    }
}

/// Whether a point is beside an upright cluster.
fn reaches(upright: &snapshot::Cluster, point: &Point3<f64>) -> bool {
    let (local, half) = (upright.pose.inverse_transform_point(point), reach(upright));
    (0..3).all(|axis| local[axis].abs() <= half[axis])
}

/// Another, larger cluster as a neighbour of the one with these edges; `None` where none of them is beside it.
fn neighbour(
    cluster: &snapshot::Cluster,
    edges: &[Point3<f64>; 2],
    is_beside: [bool; 2],
    other: &snapshot::Cluster,
) -> Option<Neighbour> {
    if other.area < cluster.area {
        return None;
    }
    let height_above = |point: &Point3<f64>| other.normal.dot(&point.coords) + other.offset;
    let offsets =
        edges.each_ref().map(height_above).into_iter().enumerate().filter(|(edge, _)| is_beside[*edge]);
    let (hinge, hinge_offset) = offsets.min_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))?;
    let plane_offset = height_above(&Point3::from(cluster.pose.translation.vector));
    let highest = other.boundary.iter().map(|point| point.z).fold(f64::NEG_INFINITY, f64::max);
    Some(Neighbour { normal: other.normal, hinge_offset, hinge, plane_offset, highest })
}

/// Least angle between two surfaces with a corner between them (60 degrees), as its cosine.
const TURNED: f64 = 0.5;
/// Least width of what makes a corner (m): the edge of a leaf and the reveal of a doorway are narrower.
const CORNER_WIDTH: f64 = 0.25;

/// Whether another upright cluster turns away from this one, beside half of its height at least.
fn makes_corner(cluster: &snapshot::Cluster, other: &snapshot::Cluster) -> bool {
    let [own, others] = [cluster, other].map(|cluster| extent(cluster, &Vector3::z()));
    let common = own.1.min(others.1) - own.0.max(others.0);
    cluster.normal.dot(&other.normal).abs() <= TURNED && common >= 0.5 * (own.1 - own.0)
}

/// How far from those of these edges that are beside another cluster its nearest own edge is (m).
fn gaps(edges: &[Point3<f64>; 2], is_beside: [bool; 2], other: &snapshot::Cluster) -> [f64; 2] {
    let apart = |a: &Point3<f64>, b: &Point3<f64>| (a - b).xy().norm();
    let ends = self::edges(other).filter(|[a, b]| apart(a, b) >= CORNER_WIDTH);
    let gap =
        |edge: &Point3<f64>| ends.iter().flatten().map(|end| apart(edge, end)).fold(f64::INFINITY, f64::min);
    [0, 1].map(|edge| if is_beside[edge] { gap(&edges[edge]) } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, UnitVector3};
    use proptest::prelude::*;

    use super::*;

    /// The covariance of a level plane whose voxels vary so along x and y (voxels^2).
    fn covariance(x: f64, y: f64) -> Option<Matrix3<f64>> {
        let plane = PlaneFit {
            point: Vector3::zeros(),
            normal: Vector3::z_axis(),
            weight: 1e5,
            covariance: Matrix3::from_diagonal(&Vector3::new(x, y, 0.0)),
            noise: 0.0,
        };
        plane_covariance(&plane, &Isometry3::identity(), [1.0, 0.1], 0.1, 0.05)
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

    #[test]
    fn a_turn_that_rounding_made_certain_to_less_than_nothing_is_not_known() {
        let known = covariance(30.0, 0.1).unwrap();
        assert!(known.cholesky().is_some() && known[(0, 0)] > known[(1, 1)], "{known}");
        // The voxels of one row: what they vary by across it is rounding.
        for across in [0.0, -1e-17] {
            assert_eq!(covariance(30.0, across), None);
        }
    }

    #[test]
    fn a_turn_about_the_long_side_is_known_less_well_than_one_about_the_short_side() {
        let known = covariance(30.0, 30.0).unwrap();
        assert!(known[(0, 0)] > 50.0 * known[(1, 1)], "{known}");
    }

    /// An upright rectangle that stands on the ground between two places, seen from the left of the way from the first to the second.
    fn upright(id: u64, [from, to]: [[f64; 2]; 2], height: f64) -> snapshot::Cluster {
        let [from, to] = [from, to].map(|[x, y]| Point3::new(x, y, 0.0));
        let up = Vector3::z() * height;
        let normal = UnitVector3::new_normalize(Vector3::z().cross(&(to - from)));
        let boundary = vec![to, from, from + up, to + up];
        let (pose, sides) = rectangle_around(&boundary, &from, &normal);
        snapshot::Cluster { normal, boundary, ..snapshot::Cluster::rectangle(id, pose, sides) }
    }

    fn beside(cluster: &snapshot::Cluster, other: &snapshot::Cluster) -> Uprights {
        Uprights::of(cluster, edges(cluster).as_ref(), std::iter::once(other))
    }

    #[test]
    fn a_wall_is_the_neighbour_of_the_leaf_at_its_end_and_the_leaf_is_none_of_the_wall() {
        let wall = upright(1, [[0.0, 0.0], [4.0, 0.0]], 2.5);
        let leaf = upright(2, [[4.05, 0.05], [4.05, 0.95]], 2.0);
        let of_leaf = beside(&leaf, &wall).neighbours;
        let [Neighbour { normal, hinge_offset, hinge, plane_offset, highest }] = of_leaf[..] else {
            panic!("{of_leaf:?}")
        };
        assert_eq!((normal, highest), (wall.normal, 2.5));
        assert!((hinge_offset - 0.05).abs() < 1e-9 && (plane_offset - 0.5).abs() < 1e-9, "{of_leaf:?}");
        assert!((edges(&leaf).unwrap()[hinge].y - 0.05).abs() < 1e-9, "{of_leaf:?}");
        assert_eq!(beside(&wall, &leaf).neighbours, []);
    }

    #[test]
    fn a_corner_is_at_the_edge_where_another_surface_turns_away_and_not_at_the_other_edge() {
        let side = upright(1, [[0.0, 0.0], [0.0, 1.5]], 2.0);
        for (y, at) in [(1.55, 1), (-0.05, 0)] {
            let corners = beside(&side, &upright(2, [[0.05, y], [1.0, y]], 2.0)).corners;
            assert!((corners[at] - 0.05_f64.hypot(0.05)).abs() < 1e-9, "{y}: {corners:?}");
            assert_eq!(corners[1 - at], f64::INFINITY, "{y}");
        }
    }
}
