//! Ten kilometres away, at the voxel size of the robot and not by whole voxels: as true to the surface as at the origin.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use cfodi::engine::{Engine, Isometry3, Mode, Params, Points, Scan, Snapshot, Stamp};
use nalgebra::{Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// A plate of 2 x 2 m, 2 m before the sensor and oblique to it, with a point every 4 mm: in the sensor's frame, in single
/// precision, as a driver sends it.
fn plate() -> (Vec<[f32; 3]>, Vector3<f64>) {
    let turn = Rotation3::from_euler_angles(0.3, -0.4, 0.1);
    let points = (0..500 * 500).map(|i| {
        let [u, v] = [i % 500, i / 500].map(|step| 0.004 * f64::from(step) - 1.0);
        let point = turn * Vector3::new(u, v, 0.0) + Vector3::z() * 2.0;
        [point.x as f32, point.y as f32, point.z as f32]
    });
    (points.collect(), turn * -Vector3::z())
}

fn map(mode: Mode, fixed_from_sensor: Isometry3<f64>, points: &[[f32; 3]]) -> Snapshot {
    let params = Params::default().with_voxel_size(0.08).unwrap().with_mode(mode);
    let mut engine = Engine::new(params);
    for second in 1..4 {
        let points = Points::F32(points.to_vec());
        engine.insert(&Scan { stamp: Stamp::from_nanos(second * 1_000_000_000), fixed_from_sensor, points });
    }
    engine.snapshot()
}

/// The largest distance of a centre from the plate (m), and the largest angle of a normal to its own (rad).
fn errors(map: &Snapshot, on: &Point3<f64>, normal: &Vector3<f64>) -> (f64, f64) {
    assert!(map.voxels.len() > 500, "{} voxels", map.voxels.len());
    let off = map.voxels.iter().map(|voxel| (voxel.centre - on).dot(normal).abs());
    let normals = map.voxels.iter().filter_map(|voxel| voxel.normal);
    let angles = normals.map(|found| found.cross(normal).norm().asin());
    (off.fold(0.0, f64::max), angles.fold(0.0, f64::max))
}

#[test]
fn at_8_cm_centres_and_normals_lie_on_the_surface_ten_kilometres_away_too() {
    let (points, normal) = plate();
    let turn = UnitQuaternion::from_euler_angles(-1.2, 0.2, 0.7);
    let fixed_normal = turn * normal;
    for mode in [Mode::Paper, Mode::Consistent] {
        for far in [[0.0; 3], [10_000.013, -9_999.971, 10_000.049], [-10_000.027, 3.3, 9_999.99]] {
            let pose = Isometry3::from_parts(Translation3::from(Vector3::from(far)), turn);
            let map = map(mode, pose, &points);
            let (off, angle) = errors(&map, &(pose * Point3::new(0.0, 0.0, 2.0)), &fixed_normal);
            // A voxel keeps a point's place in it to some 10 micrometres; single precision 10 km away is a millimetre.
            assert!(off < 2e-5 && angle < 1e-4, "{mode:?} at {far:?}: {off} m, {angle} rad");
            assert_eq!(map.clusters.len(), 1, "{mode:?} at {far:?}");
        }
    }
}
