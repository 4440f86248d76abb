//! Random streams: after every scan the engine equals the naive oracle, and its updates add up to its snapshots.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::collections::BTreeMap;

use cfodi::engine::paper::Cfodi;
use cfodi::engine::paper::oracle::Oracle;
use cfodi::engine::{Cluster, ClusterId, Engine, Isometry3, Params, Points, Scan, Stamp, Update};
use nalgebra::{Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

/// A rectangle of points, jittered in all directions so that no two computations meet a tie.
#[derive(Clone, Debug)]
struct Patch {
    corner: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    sides: [f64; 2],
    points: usize,
}

fn patch() -> impl Strategy<Value = Patch> {
    let coordinate = || -1.0..1.0;
    let angles = (0..4i32, -0.6..0.6, -0.6..0.6);
    let sides = [0.05..1.2, 0.05..1.2];
    ([coordinate(), coordinate(), coordinate()], angles, sides, 20usize..1500).prop_map(
        |(corner, (quarter, a, b), sides, points)| Patch {
            corner: Vector3::from(corner),
            turn: UnitQuaternion::from_euler_angles(
                f64::from(quarter) * std::f64::consts::FRAC_PI_2 + a,
                b,
                0.0,
            ),
            sides,
            points,
        },
    )
}

fn scan(number: usize, patches: &[Patch], origin: [f64; 3], seed: u64) -> Scan {
    let mut state = seed | 1;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let pose = Isometry3::from_parts(
        Translation3::from(Vector3::from(origin)),
        UnitQuaternion::from_euler_angles(0.1, 0.2, f64::from(number as u32)),
    );
    let mut points = Vec::new();
    for patch in patches {
        for _ in 0..patch.points {
            let flat = Vector3::new(random() * patch.sides[0], random() * patch.sides[1], random() * 0.02);
            let point = pose.inverse() * nalgebra::Point3::from(patch.corner + patch.turn * flat);
            points.push([point.x, point.y, point.z]);
        }
    }
    let points = if number.is_multiple_of(2) {
        Points::F64(points)
    } else {
        Points::F32(points.into_iter().map(|p| p.map(|c| c as f32)).collect())
    };
    Scan { stamp: Stamp::from_nanos(number as i64 * 33_333_333), fixed_from_sensor: pose, points }
}

fn params() -> impl Strategy<Value = Params> {
    (0.05..0.25, 1i64..12, 1i64..6, 0.1..1.2, 1i64..5, 0i64..6).prop_map(
        |(size, points, depth, angle, vicinity, interval)| {
            Params::paper()
                .with_voxel_size(size)
                .and_then(|p| p.with_min_points(points))
                .and_then(|p| p.with_depth(depth))
                .and_then(|p| p.with_max_normal_angle(angle))
                .and_then(|p| p.with_min_vicinity(vicinity))
                .and_then(|p| p.with_expansion_interval(interval))
                .unwrap()
        },
    )
}

type Map = BTreeMap<ClusterId, Cluster>;

/// Applies an update as a reader does that has only the changes.
fn apply(map: &mut Map, update: &Update) -> Result<(), TestCaseError> {
    for id in &update.removed {
        prop_assert!(map.remove(id).is_some(), "{id} removed twice");
    }
    let mut gone = Vec::new();
    for changed in &update.changed {
        let before = map.insert(changed.cluster.id, changed.cluster.clone());
        let revision = before.map_or(0, |cluster| cluster.revision);
        prop_assert_eq!(changed.cluster.revision, revision + 1);
        gone.extend(changed.merged_from.iter().copied());
    }
    gone.sort_unstable();
    prop_assert_eq!(&gone, &update.removed);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn engine_equals_oracle_and_its_updates_add_up_to_the_snapshot(
        params in params(),
        stream in proptest::collection::vec(
            (proptest::collection::vec(patch(), 0..4), proptest::array::uniform3(-2.0..2.0), any::<u64>()), 1..14),
    ) {
        let (mut engine, mut oracle) = (Cfodi::new(params), Oracle::new(params));
        let mut map = Map::new();
        for (number, (patches, origin, seed)) in stream.iter().enumerate() {
            let scan = scan(number, patches, *origin, *seed);
            let update = engine.insert(&scan);
            oracle.insert(&scan);
            let snapshot = engine.snapshot();
            prop_assert_eq!(oracle.difference(&snapshot), None);
            apply(&mut map, &update)?;
            let whole: Vec<_> = map.values().cloned().collect();
            prop_assert_eq!(&whole, &snapshot.clusters);
            prop_assert_eq!(update.unclustered_voxels, snapshot.unclustered_voxels);
            prop_assert_eq!(update.sequence, snapshot.sequence);
        }
    }

    #[test]
    fn the_order_of_points_within_a_scan_does_not_matter(
        params in params(), patches in proptest::collection::vec(patch(), 1..4), seed in any::<u64>(),
    ) {
        let forwards = scan(0, &patches, [0.0; 3], seed);
        let mut backwards = forwards.clone();
        if let Points::F64(points) = &mut backwards.points {
            points.reverse();
        }
        let (mut a, mut b) = (Cfodi::new(params), Cfodi::new(params));
        prop_assert_eq!(a.insert(&forwards), b.insert(&backwards));
        // A voxel without a normal has no curvature (NaN), which equals nothing: compared as text.
        prop_assert_eq!(format!("{:?}", a.snapshot()), format!("{:?}", b.snapshot()));
    }
}

#[test]
fn a_scan_that_lies_nowhere_makes_no_voxel_dense() {
    let patch =
        Patch { corner: Vector3::zeros(), turn: UnitQuaternion::identity(), sides: [1.0, 1.0], points: 900 };
    let fixed_from_sensor = Isometry3::translation(f64::NAN, 0.0, 0.0);
    let nowhere = Scan { fixed_from_sensor, ..scan(0, &[patch], [0.0; 3], 7) };
    let (mut engine, mut oracle) = (Cfodi::new(Params::paper()), Oracle::new(Params::paper()));
    assert_eq!(engine.insert(&nowhere).points_beyond_grid as usize, nowhere.points.len());
    oracle.insert(&nowhere);
    assert_eq!(oracle.difference(&engine.snapshot()), None);
    assert_eq!(engine.snapshot().unclustered_voxels, 0);
}

#[test]
fn where_a_ray_ends_too_far_away_is_no_point() {
    let patch =
        Patch { corner: Vector3::zeros(), turn: UnitQuaternion::identity(), sides: [1.0, 1.0], points: 9000 };
    let scan = scan(1, &[patch], [0.0; 3], 7);
    let Points::F32(points) = scan.points.clone() else { panic!("odd scans are in single precision") };
    let ends = points.iter().map(|point| point.map(|c| 9.0 * c)).collect();
    let ended = Scan { points: Points::Ended { points, ends }, ..scan.clone() };
    assert_eq!(ended.points.len(), scan.points.len());
    for params in [Params::paper(), Params::default()] {
        let (mut plain, mut other) = (Engine::new(params), Engine::new(params));
        assert_eq!(plain.insert(&scan), other.insert(&ended));
        assert_eq!(format!("{:?}", plain.snapshot()), format!("{:?}", other.snapshot()));
        assert!(!plain.snapshot().clusters.is_empty());
    }
}
