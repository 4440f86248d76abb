//! What the markers of a map cost: of the simulated room after half a minute, and of a floor of 500 vertices and 20 holes
//! alone, whose triangulation is nearly all of it.
#![allow(missing_docs, clippy::unwrap_used, reason = "a benchmark")]

use std::f64::consts::TAU;
use std::hint::black_box;

use cfodi::engine::{Cluster, Engine, Params, Snapshot, Stamp};
use cfodi::msg::clusters::Session;
use cfodi::msg::markers::Markers;
use cfodi::sim::{Drive, Scene};
use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Point3;

/// Every how-manieth of the scans is taken, and how many.
const STEP: usize = 15;
const SCANS: u32 = 900;

fn room() -> Snapshot {
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(0));
    let mut engine = Engine::new(Params::default());
    for index in (0..SCANS).step_by(STEP) {
        engine.insert(&drive.labelled_scan(index).scan);
    }
    engine.snapshot()
}

/// The room's largest cluster alone, with another outline: a jagged ring around a grid of holes.
fn floor(room: &Snapshot) -> Snapshot {
    let largest = room.clusters.iter().max_by(|a, b| a.area.unwrap().total_cmp(&b.area.unwrap())).unwrap();
    let on_plane = |x: f64, y: f64| largest.pose.transform_point(&Point3::new(x, y, 0.0));
    let jagged = |i: u32| {
        let (turn, radius) = (TAU * f64::from(i) / 340.0, if i.is_multiple_of(2) { 5.0 } else { 4.6 });
        on_plane(radius * turn.cos(), radius * turn.sin())
    };
    let hole = |i: u32| {
        let (x, y) = (f64::from(i % 5) - 2.0, f64::from(i / 5) - 1.5);
        let clockwise = (0..8).map(|corner| TAU * f64::from(corner) / -8.0);
        clockwise.map(|turn| on_plane(x + 0.3 * turn.cos(), y + 0.3 * turn.sin())).collect()
    };
    let boundary = (0..340).map(jagged).collect();
    let cluster = Cluster { boundary, holes: (0..20).map(hole).collect(), ..largest.clone() };
    Snapshot { clusters: vec![cluster], voxels: Vec::new(), ..room.clone() }
}

fn bench(criterion: &mut Criterion) {
    let session = Session { id: 1, frame_id: "odom".to_owned() };
    let room = room();
    let floor = floor(&room);
    let mut group = criterion.benchmark_group("markers");
    for (name, snapshot) in [("room", &room), ("floor", &floor)] {
        let mut markers = Markers::default();
        group.bench_function(name, |b| b.iter(|| black_box(markers.update(&session, snapshot))));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
