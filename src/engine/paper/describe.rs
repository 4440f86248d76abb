//! From a cluster's sums to the value that leaves the engine. Costs O(1) a cluster.

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::globals::{Global, is_complete};
use super::grid::Grid;
use crate::engine::class::SurfaceClass;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::rectangle::rectangle_around;
use crate::engine::snapshot::{Cluster, ClusterState};

pub(crate) fn describe(global: &Global, grid: &Grid, params: &Params, now: Now) -> Cluster {
    let voxel_size = grid.voxel_size();
    let centroid = global.moments.mean(voxel_size);
    let covariance = global.moments.covariance() * (voxel_size * voxel_size);
    let outermost = outermost_centres(global, grid);
    let (pose, size) = bounding_box(&global.normal, &centroid, &outermost);
    Cluster {
        id: global.id,
        revision: global.revision,
        state: state(global, params, now),
        first_seen: global.first_seen,
        last_seen: global.last_seen,
        class: SurfaceClass::Unknown,
        class_confidence: 0.0,
        normal: global.normal,
        offset: -global.normal.dot(&centroid.coords),
        plane_covariance: None,
        centroid,
        covariance,
        rms_error: global.normal.dot(&(covariance * global.normal.into_inner())).max(0.0).sqrt(),
        noise: None,
        area: None,
        boundary: Vec::new(),
        holes: Vec::new(),
        pose,
        size,
        voxel_count: global.moments.count(),
        point_count: global.point_count,
    }
}

fn state(global: &Global, params: &Params, now: Now) -> ClusterState {
    if !global.is_reliable() {
        ClusterState::Tentative
    } else if is_complete(global.grown, params, now) {
        ClusterState::Complete
    } else {
        ClusterState::Active
    }
}

fn outermost_centres(global: &Global, grid: &Grid) -> Vec<Point3<f64>> {
    let voxels = global.extremes.members().into_iter().filter_map(|key| grid.get(key));
    voxels.map(|voxel| grid[voxel].centre().metres(grid.voxel_size())).collect()
}

/// The box of least area along the surface around `points`: its middle with z = normal and x = the longer side, and its
/// full extents.
fn bounding_box(
    normal: &UnitVector3<f64>,
    centroid: &Point3<f64>,
    points: &[Point3<f64>],
) -> (Isometry3<f64>, Vector3<f64>) {
    let (pose, [length, width]) = rectangle_around(points, centroid, normal);
    let heights = points.iter().map(|point| normal.dot(&(point - centroid)));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), a| (l.min(a), h.max(a)));
    let middle = pose.translation.vector + normal.into_inner() * f64::midpoint(low, high);
    (Isometry3::from_parts(middle.into(), pose.rotation), Vector3::new(length, width, high - low))
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    #[test]
    fn the_box_of_a_tilted_rectangle_has_its_sides_whatever_their_ratio() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
        let offset = Vector3::new(4.0, -3.0, 1.0);
        for (length, width) in [(1.4, 0.4), (1.0, 1.0), (2.0, 1.99)] {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let corner = |c: [f64; 2]| Vector3::new(c[0] * length / 2.0, c[1] * width / 2.0, 0.0);
            let points: Vec<_> = corners.iter().map(|&c| Point3::from(turn * corner(c) + offset)).collect();
            let normal = UnitVector3::new_normalize(turn * Vector3::z());
            let (pose, size) = bounding_box(&normal, &Point3::from(offset), &points);
            assert!((size - Vector3::new(length, width, 0.0)).norm() < 1e-9, "{size}");
            assert!((pose.translation.vector - offset).norm() < 1e-9);
            assert!((pose.rotation * Vector3::z() - normal.into_inner()).norm() < 1e-9);
        }
    }
}
