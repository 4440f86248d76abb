//! The evidence for a class: how a cluster lies, how planar and how large it is, and which upright clusters it stands beside.
//!
//! An upright cluster has two upright edges. It stands **beside** another where one of them is near the other's outline and plane:
//! the other may be the wall that it is a door of, or make a **corner** with it. Lengths in m; O(neighbours and their outlines).

use nalgebra::{Matrix2, Point3, Vector3};

use super::{Evidence, FLOOR_AREA, Neighbour, calibration as c, faces_up};
use crate::engine::consistent::cluster::{Cluster, ClusterPlane};
use crate::engine::consistent::rules::{Rules, apart_by_poses};
use crate::engine::params::Params;
use crate::engine::snapshot;

/// What a class depends on beside the cluster itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surroundings {
    /// z of the floor of its storey, the lowest known large surface there that faces up, which may be the cluster itself (m).
    pub(in super::super) floor: Option<f64>,
    /// z of the lowest floor of all (m), where the cluster lies below that.
    pub(in super::super) floor_above: Option<f64>,
    /// z of the sensor (m).
    pub(in super::super) sensor: f64,
    /// Whether it was a ceiling before: then it was above the sensor that saw it, which may have taken a lift since.
    pub(in super::super) was_ceiling: bool,
}

/// How a cluster's voxels lie on its plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planarity {
    /// Root mean square distance of their means from it, and up to which one it is a plane, in voxels.
    pub(super) rms: f64,
    pub(super) tolerance: f64,
    /// Angle between its normal, that of the voxels' means, and the mean of its patches' normals, which where there is but one
    /// row of voxels are those of the points within them: any plane may hold the row.
    pub(super) across: f64,
}

impl Planarity {
    pub(in super::super) fn of(cluster: &Cluster, plane: &ClusterPlane, rules: &Rules) -> Self {
        Self {
            rms: plane.mean_square().sqrt(),
            tolerance: rules.planar.max(c::NOISY_PLANAR * plane.noise.sqrt()),
            across: plane.normal.angle(&cluster.sums.normal()),
        }
    }
}

impl<'a> Evidence<'a> {
    /// That of a cluster among its neighbours.
    pub(in super::super) fn of(
        cluster: &snapshot::Cluster,
        planarity: Planarity,
        uprights: &'a Uprights,
        surroundings: Surroundings,
        params: &Params,
    ) -> Self {
        let n = cluster.normal;
        let level = level(cluster);
        let (width, height) = (extent(cluster, &level), extent(cluster, &n.cross(&level)));
        let (lowest, highest) = extent(cluster, &Vector3::z());
        let is_level = cluster.area.is_some_and(|area| area >= FLOOR_AREA) && faces_up(&n);
        debug_assert!(
            !is_level || surroundings.floor.or(surroundings.floor_above).is_some(),
            "itself a floor: {cluster:?}"
        );
        Self {
            normal: n,
            tilt_covariance: tilt_covariance(cluster),
            lowest,
            highest,
            width: width.1 - width.0,
            height: height.1 - height.0,
            area: cluster.area.unwrap_or_default(),
            voxels: cluster.voxel_count,
            voxel_size: params.voxel_size(),
            apart: apart_by_poses(params),
            planarity,
            surroundings,
            neighbours: &uprights.neighbours,
            corners: uprights.corners,
        }
    }
}

/// Half way from the lowest z of a cluster to the highest (m).
pub(in super::super) fn middle(cluster: &snapshot::Cluster) -> f64 {
    let (lowest, highest) = extent(cluster, &Vector3::z());
    f64::midpoint(lowest, highest)
}

/// Covariance of the turns about the pose's x and y; what is not known is certain of nothing.
fn tilt_covariance(cluster: &snapshot::Cluster) -> Matrix2<f64> {
    let known = cluster.plane_covariance.map(|covariance| covariance.fixed_view::<2, 2>(0, 0).into_owned());
    known.unwrap_or_else(|| Matrix2::from_element(f64::NAN))
}

/// Half extents, along the axes of its pose, of the box in which the edges of others are beside an upright cluster (m).
pub(in super::super) fn reach(upright: &snapshot::Cluster) -> Vector3<f64> {
    Vector3::new(0.5 * upright.size.x + c::BESIDE, 0.5 * upright.size.y + c::BESIDE, c::OFF_PLANE)
}

/// Whether others can stand beside it.
pub(in super::super) fn is_upright(cluster: &snapshot::Cluster) -> bool {
    cluster.normal.z.abs() <= c::UPRIGHT_COSINE
}

/// The upright edges of a cluster, at the height of its middle; `None` where it leans too much for a door.
pub(in super::super) fn edges(cluster: &snapshot::Cluster) -> Option<[Point3<f64>; 2]> {
    if cluster.normal.z.abs() >= c::LEANING_COSINE {
        return None;
    }
    let (level, middle) = (level(cluster), cluster.pose.translation.vector);
    let (left, right) = extent(cluster, &level);
    let along = level.dot(&middle);
    Some([left, right].map(|edge| Point3::from(middle + level * (edge - along))))
}

/// The horizontal direction in a cluster's plane; x where all are.
fn level(cluster: &snapshot::Cluster) -> Vector3<f64> {
    cluster.normal.cross(&Vector3::z()).try_normalize(c::LEVEL_SINE).unwrap_or_else(Vector3::x)
}

/// From where to where a cluster reaches along an axis (m).
fn extent(cluster: &snapshot::Cluster, axis: &Vector3<f64>) -> (f64, f64) {
    let along = cluster.boundary.iter().map(|point| axis.dot(&point.coords));
    along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
}

/// The upright clusters beside one.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Uprights {
    /// The larger ones.
    pub(in super::super) neighbours: Vec<Neighbour>,
    /// See [`Evidence::corners`].
    pub(in super::super) corners: [f64; 2],
}

impl Uprights {
    /// The clusters, of `others`, that one with these edges stands beside; none of one that has no edges.
    pub(in super::super) fn of<'a>(
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

/// Whether another upright cluster turns away from this one, beside half of its height at least.
fn makes_corner(cluster: &snapshot::Cluster, other: &snapshot::Cluster) -> bool {
    let [own, others] = [cluster, other].map(|cluster| extent(cluster, &Vector3::z()));
    let common = own.1.min(others.1) - own.0.max(others.0);
    cluster.normal.dot(&other.normal).abs() <= c::TURNED && common >= c::CORNER_PART * (own.1 - own.0)
}

/// How far from those of these edges that are beside another cluster its nearest own edge is (m).
fn gaps(edges: &[Point3<f64>; 2], is_beside: [bool; 2], other: &snapshot::Cluster) -> [f64; 2] {
    let apart = |a: &Point3<f64>, b: &Point3<f64>| (a - b).xy().norm();
    let ends = self::edges(other).filter(|[a, b]| apart(a, b) >= c::CORNER_WIDTH);
    let gap =
        |edge: &Point3<f64>| ends.iter().flatten().map(|end| apart(edge, end)).fold(f64::INFINITY, f64::min);
    [0, 1].map(|edge| if is_beside[edge] { gap(&edges[edge]) } else { f64::INFINITY })
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitVector3;

    use super::*;
    use crate::engine::rectangle::rectangle_around;

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
