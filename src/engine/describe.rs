//! From a cluster's sums to the value that leaves the engine. Costs O(1) a cluster.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector3};

use super::globals::{Global, Now, is_active};
use super::grid::Grid;
use super::params::Params;
use super::snapshot::{Cluster, ClusterState};

pub(crate) fn describe(global: &Global, grid: &Grid, params: &Params, now: Now) -> Cluster {
    let voxel_size = grid.voxel_size();
    let centroid = global.moments.mean(voxel_size);
    let covariance = global.moments.covariance() * (voxel_size * voxel_size);
    let outermost = outermost_centres(global, grid);
    let axes = axes(&global.normal, &covariance);
    let (pose, size) = bounding_box(axes, &centroid, &outermost);
    Cluster {
        id: global.id,
        revision: global.revision,
        state: state(global, params, now),
        first_seen: global.first_seen,
        last_seen: global.last_seen,
        normal: global.normal,
        centroid,
        centre_covariance: covariance,
        pose,
        size,
        voxel_count: global.moments.count(),
        point_count: global.point_count,
    }
}

fn state(global: &Global, params: &Params, now: Now) -> ClusterState {
    if !global.is_reliable() {
        ClusterState::Tentative
    } else if is_active(global.grown, params, now) {
        ClusterState::Active
    } else {
        ClusterState::Complete
    }
}

fn outermost_centres(global: &Global, grid: &Grid) -> Vec<Point3<f64>> {
    let voxels = global.extremes.members().iter().filter_map(|&key| grid.get(key));
    voxels.map(|voxel| grid[voxel].centre().metres(grid.voxel_size())).collect()
}

/// Axes of a surface: z = normal, x = the direction in which the members spread most.
fn axes(normal: &UnitVector3<f64>, covariance: &Matrix3<f64>) -> [Vector3<f64>; 3] {
    let z = normal.into_inner();
    let across = if z.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = (across - z * z.dot(&across)).normalize();
    let v = z.cross(&u);
    let spread = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(&(covariance * b));
    let angle = 0.5 * (2.0 * spread(&u, &v)).atan2(spread(&u, &u) - spread(&v, &v));
    let x = u * angle.cos() + v * angle.sin();
    [x, z.cross(&x), z]
}

/// The box along `axes` around `points`: its middle with the axes' turn, and its full extents.
fn bounding_box(
    axes: [Vector3<f64>; 3],
    centroid: &Point3<f64>,
    points: &[Point3<f64>],
) -> (Isometry3<f64>, Vector3<f64>) {
    let extent = |axis: &Vector3<f64>| {
        let along = points.iter().map(|point| axis.dot(&(point - centroid)));
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), a| (least.min(a), most.max(a)))
    };
    let extents = axes.map(|axis| extent(&axis));
    let length = |(least, most): (f64, f64)| most - least;
    let middle = axes.iter().zip(extents).map(|(axis, (least, most))| axis * f64::midpoint(least, most));
    let middle = centroid + middle.sum::<Vector3<f64>>();
    let [x, y, z] = axes;
    let [length_x, length_y, thickness] = extents.map(length);
    // The members' spread and the box may disagree about the longer side of a nearly square surface.
    let (x, y, size) = if length_x >= length_y {
        (x, y, Vector3::new(length_x, length_y, thickness))
    } else {
        (y, -x, Vector3::new(length_y, length_x, thickness))
    };
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    let turn = UnitQuaternion::from_rotation_matrix(&turn);
    (Isometry3::from_parts(Translation3::from(middle), turn), size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_a_tilted_rectangle_has_its_sides() {
        let turn = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
        let corners = [[-0.7, -0.2], [0.7, -0.2], [0.7, 0.2], [-0.7, 0.2]];
        let offset = Vector3::new(4.0, -3.0, 1.0);
        let points: Vec<_> =
            corners.iter().map(|c| Point3::from(turn * Vector3::new(c[0], c[1], 0.0) + offset)).collect();
        let covariance =
            points.iter().map(|p| p.coords - offset).map(|d| d * d.transpose()).sum::<Matrix3<f64>>() / 4.0;
        let normal = UnitVector3::new_normalize(turn * Vector3::z());
        let (pose, size) = bounding_box(axes(&normal, &covariance), &Point3::from(offset), &points);
        assert!((size - Vector3::new(1.4, 0.4, 0.0)).norm() < 1e-9, "{size}");
        assert!((pose.translation.vector - offset).norm() < 1e-9);
        assert!((pose.rotation * Vector3::z() - normal.into_inner()).norm() < 1e-9);
        assert!((pose.rotation * Vector3::x()).dot(&(turn * Vector3::x())).abs() > 1.0 - 1e-9);
    }
}
