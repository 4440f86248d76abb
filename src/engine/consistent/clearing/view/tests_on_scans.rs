//! On the simulated Kinect's drive through a room in which nothing changes.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3, Vector3};
use rand::SeedableRng;
use rand::rngs::Xoshiro256PlusPlus;

use super::tests::padded;
use super::*;
use crate::engine::consistent::clearing::Clearance;
use crate::engine::consistent::clearing::tests::on_surfaces;
use crate::sim::{Kinect, Robot, Scene};

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
    let measured = camera.points(&image).map(|(point, _)| point);
    measured.filter(|[_, _, z]| (0.4..=6.0).contains(z)).collect()
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
    let surfaces = on_surfaces(&scene, edge);
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
                votes.note_points();
            }
        }
        grid.fill(&Points::F32(scanned));
        let inverse = pose.inverse();
        let half = super::blocks::cube_reach(&inverse.rotation.to_rotation_matrix(), edge);
        for (key, votes) in &mut votes {
            let centre = inverse * Point3::from(Vector3::from(*key).map(|i| (f64::from(i) + 0.5) * edge));
            if centre.z > 0.4 && centre.z < 6.0 {
                outcome.looks += 1;
                if grid.sees_through(&padded(centre, half), margin(centre.z, edge, share)) {
                    outcome.seen_through += 1;
                    votes.note_seen_through();
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
