//! On the simulated Kinect's drive through a room in which nothing changes.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Point3, Vector3};
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;

use super::tests::padded;
use super::*;
use crate::sim::{Kinect, Robot, Scene};

/// Every voxel that holds a surface, from points on it 1 cm apart.
fn voxels_on_surfaces(scene: &Scene, edge: f64) -> BTreeSet<[i32; 3]> {
    let mut keys = BTreeSet::new();
    for surface in scene.surfaces() {
        let [width, height] = [0, 1].map(|i| 2.0 * surface.shape().half_extents()[i]);
        let [columns, rows] = [width, height].map(|size| (size / 0.01).ceil() as i32);
        for (column, row) in (0..=columns).flat_map(|column| (0..=rows).map(move |row| (column, row))) {
            let along = |i: i32, count: i32, size: f64| (f64::from(i) / f64::from(count) - 0.5) * size;
            let place = Point3::new(along(column, columns, width), along(row, rows, height), 0.0);
            keys.insert(key_of(&(surface.pose() * place), edge));
        }
    }
    keys
}

fn key_of(point: &Point3<f64>, edge: f64) -> [i32; 3] {
    [point.x, point.y, point.z].map(|x| (x / edge).floor() as i32)
}

/// The points of one image, optical frame.
fn points(
    camera: &Kinect,
    scene: &Scene,
    pose: &Isometry3<f64>,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<[f32; 3]> {
    let image = camera.sample(scene, pose, 0.0, rng);
    let measured = image.depths.iter().enumerate().filter(|(_, depth)| (0.4..=6.0).contains(*depth));
    measured
        .map(|(i, &z)| {
            let (x, y) = (camera.direction_x(i % image.width), camera.direction_y(i / image.width));
            [x as f32 * z, y as f32 * z, z]
        })
        .collect()
}

fn margin(depth: f64, edge: f64, share: f64) -> f64 {
    let sigma = (0.0012 + 0.0019 * (depth - 0.4).powi(2)).hypot(0.003_071 * depth * depth / 12_f64.sqrt());
    3.0 * sigma + share * edge
}

/// How the votes of the voxels on surfaces went.
#[derive(Debug, Default)]
struct Outcome {
    seen_through: u32,
    looks: u32,
    worst: u8,
}

/// 300 scans along the drive, or those up to the first that would clear a voxel; every voxel on a surface that is within 6 m is
/// looked at in each of them, which is two to four times as often as a map would.
fn drive(edge: f64, share: f64) -> Outcome {
    let (scene, camera) = (Scene::room(), Kinect::v1());
    let robot = Robot::new(&scene);
    let surfaces = voxels_on_surfaces(&scene, edge);
    let mut votes: BTreeMap<[i32; 3], Clearance> =
        surfaces.iter().map(|&key| (key, Clearance::default())).collect();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let (mut grid, mut outcome) = (RangeGrid::new(), Outcome::default());
    for scan in 0..300 {
        if outcome.worst >= Clearance::LIMIT {
            break;
        }
        // Ten stretches of the drive, at 30 scans a second.
        let pose = robot.optical_pose(5.3 * f64::from(scan / 30) + f64::from(scan % 30) / 30.0);
        let scanned = points(&camera, &scene, &pose, &mut rng);
        for point in &scanned {
            if let Some(votes) = votes.get_mut(&key_of(&(pose * Point3::from(point.map(f64::from))), edge)) {
                votes.received_points();
            }
        }
        grid.fill(&Points::F32(scanned));
        let inverse = pose.inverse();
        let half = half_extents(&inverse.rotation.to_rotation_matrix(), edge);
        for (key, votes) in &mut votes {
            let centre = inverse * Point3::from(Vector3::from(*key).map(|i| (f64::from(i) + 0.5) * edge));
            if centre.z > 0.4 && centre.z < 6.0 {
                outcome.looks += 1;
                if grid.sees_through(&centre, &padded(&centre, half), margin(centre.z, edge, share)) {
                    outcome.seen_through += 1;
                    votes.seen_through();
                    outcome.worst = outcome.worst.max(votes.votes());
                }
            }
        }
    }
    outcome
}

#[test]
fn no_voxel_on_a_surface_is_cleared_in_a_room_where_nothing_changes() {
    for edge in [0.08, 0.05] {
        let outcome = drive(edge, 0.5);
        println!("edge {edge}: {outcome:?}");
        assert!(outcome.worst < Clearance::LIMIT, "{outcome:?}");
        assert!(outcome.looks > 100_000);
    }
}

#[test]
fn with_a_margin_that_reaches_before_the_voxel_surfaces_would_be_cleared() {
    let outcome = drive(0.05, -2.0);
    println!("margin less two edges: {outcome:?}");
    assert!(outcome.worst >= Clearance::LIMIT, "the drive proves nothing: {outcome:?}");
}
