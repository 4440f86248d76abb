//! The paper's definitions of clusters, on maps small enough to be counted by hand. (Definitions 1 to 4 and 6 are
//! tested beside their code.)
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use cfodi::engine::{ClusterState, Engine, Isometry3, Params, Points, Scan, Snapshot, Stamp, Update};

const VOXEL: f64 = 0.1;
const PER_VOXEL: usize = 16;

/// Fills voxels with points: on the floor (z in the middle of its voxel) or, with `upright`, on a wall of constant x.
fn fill(cells: impl IntoIterator<Item = [i32; 3]>, upright: bool) -> Vec<[f64; 3]> {
    let inside = |i: usize| 0.1 + 0.8 * (i % 4) as f64 / 3.0;
    let mut points = Vec::new();
    for [x, y, z] in cells {
        for i in 0..PER_VOXEL {
            let (a, b) = (inside(i), inside(i / 4));
            let [dx, dy, dz] = if upright { [0.5, a, b] } else { [a, b, 0.5] };
            points.push([f64::from(x) + dx, f64::from(y) + dy, f64::from(z) + dz].map(|c| c * VOXEL));
        }
    }
    points
}

fn floor(x: std::ops::Range<i32>, y: std::ops::Range<i32>) -> Vec<[f64; 3]> {
    fill(x.flat_map(|x| y.clone().map(move |y| [x, y, 0])), false)
}

/// Seen from 2 m above the origin; the sensor's axes are those of the map.
fn scan(number: i64, points: &[[f64; 3]]) -> Scan {
    let pose = Isometry3::translation(0.0, 0.0, 2.0);
    let points = points.iter().map(|p| [p[0], p[1], p[2] - 2.0]).collect();
    Scan {
        stamp: Stamp::from_nanos(number * 1_000_000_000),
        fixed_from_sensor: pose,
        points: Points::F64(points),
    }
}

fn params() -> Params {
    Params::paper().with_voxel_size(VOXEL).unwrap()
}

fn after(params: Params, scans: &[Vec<[f64; 3]>]) -> Snapshot {
    let mut engine = Engine::new(params);
    for (number, points) in (1..).zip(scans) {
        engine.insert(&scan(number, points));
    }
    engine.snapshot()
}

fn sizes(snapshot: &Snapshot) -> Vec<u32> {
    snapshot.clusters.iter().map(|cluster| cluster.voxel_count).collect()
}

#[test]
fn definition_5_a_cluster_is_a_maximal_connected_set_of_similar_voxels() {
    let mut two_floors = floor(0..10, 0..10);
    two_floors.extend(floor(12..20, 0..10));
    assert_eq!(sizes(&after(params(), &[two_floors])), [100, 80]);
    // A wall that stands on a floor is another surface, though every voxel of the corner is connected.
    let mut corner = floor(0..20, 0..20);
    corner.extend(fill((0..20).flat_map(|y| (1..20).map(move |z| [20, y, z])), true));
    let snapshot = after(params(), &[corner]);
    let large: Vec<_> = snapshot.clusters.iter().filter(|cluster| cluster.voxel_count > 100).collect();
    assert_eq!(large.len(), 2);
    assert!(large[0].normal.dot(&large[1].normal).abs() < 0.3);
}

#[test]
fn definition_5_the_normal_is_the_fit_over_the_members_towards_the_sensor() {
    let snapshot = after(params(), &[floor(0..10, 0..10), floor(10..20, 0..10)]);
    assert_eq!(sizes(&snapshot), [200]);
    let cluster = &snapshot.clusters[0];
    assert!(cluster.normal.z > 1.0 - 1e-9);
    assert!((cluster.centroid - nalgebra::Point3::new(1.0, 0.5, 0.05)).norm() < 1e-6);
    assert!((cluster.size - nalgebra::Vector3::new(1.9, 0.9, 0.0)).norm() < 1e-6);
}

#[test]
fn definition_7_vicinity_is_the_number_of_directly_connected_pairs() {
    let scans = [floor(0..10, 0..10), floor(10..15, 0..10)];
    let with = |min_vicinity| sizes(&after(params().with_min_vicinity(min_vicinity).unwrap(), &scans));
    assert_eq!(with(10), [150]);
    assert_eq!(with(11), [100, 50]);
}

#[test]
fn a_partial_cluster_between_two_global_ones_joins_them_under_the_smaller_id() {
    let (left, right) = (floor(0..10, 0..10), floor(14..24, 0..10));
    let mut engine = Engine::new(params());
    engine.insert(&scan(1, &left));
    engine.insert(&scan(2, &right));
    let update = engine.insert(&scan(3, &floor(10..14, 0..10)));
    let ids = |clusters: &[cfodi::engine::ClusterId]| clusters.iter().map(|id| id.get()).collect::<Vec<_>>();
    assert_eq!(ids(&update.removed), [2]);
    assert_eq!(update.changed.len(), 1);
    assert_eq!(ids(&update.changed[0].merged_from), [2]);
    let cluster = &update.changed[0].cluster;
    assert_eq!((cluster.id.get(), cluster.voxel_count), (1, 240));
    assert_eq!(cluster.first_seen, Stamp::from_nanos(1_000_000_000));
    // The id that has gone is not used again.
    let next = engine.insert(&scan(4, &floor(40..50, 0..10)));
    assert_eq!(next.changed[0].cluster.id.get(), 3);
}

#[test]
fn forgetting_a_cluster_is_complete_after_the_interval_and_then_not_expanded() {
    let interval = 3;
    let params = params().with_expansion_interval(interval).unwrap();
    let run = |empty_scans: i64| {
        let mut engine = Engine::new(params);
        engine.insert(&scan(1, &floor(0..10, 0..10)));
        let updates: Vec<_> = (0..empty_scans).map(|i| engine.insert(&scan(2 + i, &[]))).collect();
        let last = engine.insert(&scan(9, &floor(10..15, 0..10)));
        (updates, last, engine.snapshot())
    };
    let (_, _, in_time) = run(interval - 1);
    assert_eq!(sizes(&in_time), [150]);
    let (updates, last, too_late) = run(interval);
    // When the interval is over the cluster turns COMPLETE, and in the next scan a new one begins beside it.
    let states = |update: &Update| -> Vec<_> {
        update.changed.iter().map(|changed| (changed.cluster.voxel_count, changed.cluster.state)).collect()
    };
    let told: Vec<_> = updates.iter().map(states).collect();
    assert_eq!(told, [vec![], vec![], vec![(100, ClusterState::Complete)]]);
    assert_eq!(sizes(&too_late), [100, 50]);
    assert_eq!(states(&last), [(50, ClusterState::Active)]);
}

#[test]
fn a_map_that_goes_on_with_another_interval_says_in_a_delta_when_a_cluster_is_complete_by_that() {
    let with = |interval: i64| params().with_expansion_interval(interval).unwrap();
    for (before, after) in [(3, 8), (0, 4), (8, 3)] {
        let mut engine = Engine::new(with(before));
        engine.insert(&scan(1, &floor(0..10, 0..10)));
        (2..=6).for_each(|number| drop(engine.insert(&scan(number, &[]))));
        let mut engine = Engine::restore(with(after), engine.freeze().save()).unwrap();
        let mut told = engine.snapshot().clusters;
        for number in 7..=12 {
            let update = engine.insert(&scan(number, &[]));
            for changed in update.changed {
                told.retain(|cluster| cluster.id != changed.cluster.id);
                told.push(changed.cluster);
            }
            assert_eq!(engine.snapshot().clusters, told, "{before} to {after}, scan {number}");
        }
        assert_eq!(told[0].state, ClusterState::Complete, "{before} to {after}");
    }
}

#[test]
fn a_cluster_of_fewer_than_ten_voxels_is_tentative() {
    let snapshot = after(params(), &[floor(0..3, 0..3)]);
    assert_eq!((sizes(&snapshot), snapshot.clusters[0].state), (vec![9], ClusterState::Tentative));
}

#[test]
fn an_empty_scan_counts_and_changes_nothing() {
    let mut engine = Engine::new(params());
    let update = engine.insert(&scan(1, &[]));
    assert_eq!((update.sequence, update.changed.len(), update.newly_dense), (1, 0, 0));
    assert!(engine.snapshot().voxels.is_empty());
}

#[test]
fn the_box_of_a_hexagon_and_of_a_disc_is_as_large_as_they_are() {
    // Flat tops up and down, corners of 120 degrees at (-20, 0) and (20, 0): 41 x 35 voxels from centre to centre.
    let hexagon = |x: f64, y: f64| y.abs() <= 17.0 && x.abs() + y.abs() / 1.732 <= 20.0;
    let disc = |x: f64, y: f64| x.hypot(y) <= 20.0;
    let cells = |inside: &dyn Fn(f64, f64) -> bool| {
        let all = (-20..=20).flat_map(|x| (-20..=20).map(move |y| [x, y, 0]));
        all.filter(|c| inside(f64::from(c[0]), f64::from(c[1]))).collect::<Vec<_>>()
    };
    let size =
        |inside: &dyn Fn(f64, f64) -> bool| after(params(), &[fill(cells(inside), false)]).clusters[0].size;
    let hexagon = size(&hexagon);
    assert!(hexagon.x >= 3.9 && hexagon.y >= 3.3, "{hexagon}");
    let disc = size(&disc);
    assert!(disc.x >= 0.97 * 4.0 && disc.y >= 0.97 * 4.0, "{disc}");
}
