//! Milliseconds a scan of the engine, and what a map costs those who read all of it.
//!
//! On the cabinet recording where there is one (`CFODI_DATA`), on the simulated room otherwise. A group holds: `insert`, a whole
//! drive from an empty map on, divided by its scans, in mode `paper` and in mode `consistent`, and the ratio of the two;
//! `STATIC`, one re-clustering of the whole map; `freeze`; `snapshot`; `save`, the map to the bytes of a file and back. The group
//! `sim` is the simulator on one of its scenes after the other: `labelled_scan` and, what scores are measured by, `true_hits`.
//! `benches/limit.rs` tells where the time of a scan goes, from the bytes of its message on.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark"
)]

mod drive;
#[path = "../tests/support/mod.rs"]
mod support;

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfodi::cloud::{Cloud, CloudFilter, decode};
use cfodi::engine::paper::Cfodi;
use cfodi::engine::{Engine, Isometry3, Mode, Params, Scan, Stamp};
use cfodi::msg::ros::PointCloud2;
use cfodi::sim::{Drive, Scene};
use cfodi::store::{pack, unpack};
use criterion::measurement::WallTime;
use criterion::{BatchSize, BenchmarkGroup, Criterion, criterion_group, criterion_main};

type Group<'a> = BenchmarkGroup<'a, WallTime>;

const FILTER: CloudFilter = CloudFilter::DEFAULT;

fn scans(drive: &[(PointCloud2, Isometry3<f64>)]) -> Vec<Scan> {
    let scan = |(message, pose): &(PointCloud2, Isometry3<f64>)| {
        let Cloud { stamp, points, .. } = decode(message, &FILTER).unwrap();
        Scan { stamp, fixed_from_sensor: *pose, points }
    };
    drive.iter().map(scan).collect()
}

fn bench(criterion: &mut Criterion) {
    let (name, drive) = drive::drive();
    let scans = scans(&drive);
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10);
    for (label, voxel_size) in [("8 cm", 0.08), ("5 cm", 0.05)] {
        let params = Params::paper().with_voxel_size(voxel_size).unwrap();
        insert(&mut group, label, &scans, params);
        let mut engine = Cfodi::new(params);
        scans.iter().for_each(|scan| drop(engine.insert(scan)));
        group.bench_function(format!("STATIC {label}, a map"), |b| b.iter(|| engine.static_partition()));
        group.bench_function(format!("snapshot {label}, paper"), |b| b.iter(|| engine.snapshot()));
        save(&mut group, label, &scans, params.with_mode(Mode::Consistent));
    }
    group.finish();
    simulator(criterion);
}

/// What a map costs on its way to those who read all of it, and into a file and back, without the disk.
fn save(group: &mut Group, label: &str, scans: &[Scan], params: Params) {
    let mut engine = Engine::new(params);
    scans.iter().for_each(|scan| drop(engine.insert(scan)));
    let bytes = pack("map", &engine.freeze()).unwrap();
    println!("save {label}: {} voxels, {} bytes", engine.voxel_count(), bytes.len());
    group.bench_function(format!("freeze {label}, consistent"), |b| b.iter(|| engine.freeze()));
    group.bench_function(format!("snapshot {label}, consistent"), |b| b.iter(|| engine.snapshot()));
    let frozen = engine.freeze();
    group.bench_function(format!("save {label}"), |b| b.iter(|| pack("map", &frozen)));
    group.bench_function(format!("save {label}, unpack"), |b| b.iter(|| unpack(&bytes)));
    group.bench_function(format!("save {label}, restore"), |b| {
        b.iter_batched(
            || engine.freeze().save(),
            |map| Engine::restore(params, map),
            BatchSize::PerIteration,
        );
    });
}

/// A scan of each mode, and how many times as long the second takes; nothing of it where a filter leaves one out.
fn insert(group: &mut Group, label: &str, scans: &[Scan], paper: Params) {
    let consistent = Params::default().with_voxel_size(paper.voxel_size()).unwrap();
    let shortest = [("paper", paper), ("consistent", consistent)].map(|(mode, params)| {
        let mut shortest: Option<Duration> = None;
        group.bench_function(format!("insert {label}, a scan, {mode}"), |b| {
            b.iter_custom(|iterations| {
                let drives: Vec<_> = (0..iterations).map(|_| time_of_a_scan(scans, params)).collect();
                shortest = shortest.into_iter().chain(drives.iter().copied()).min();
                drives.iter().sum()
            });
        });
        shortest
    });
    if let [Some(paper), Some(consistent)] = shortest {
        let ratio = consistent.div_duration_f64(paper);
        println!("insert {label}: consistent takes {ratio:.2} times as long as paper (shortest drives)\n");
    }
}

/// Mean over a drive from an empty map on.
fn time_of_a_scan(scans: &[Scan], params: Params) -> Duration {
    let mut engine = Engine::new(params);
    let begin = Instant::now();
    scans.iter().for_each(|scan| drop(black_box(engine.insert(scan))));
    begin.elapsed() / scans.len() as u32
}

fn simulator(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sim");
    group.sample_size(10);
    for name in Scene::NAMES {
        let drive = Drive::new(Scene::named(name).unwrap(), 3, Stamp::from_nanos(0));
        let mut next = (0..2000).step_by(40).cycle();
        group.bench_function(format!("labelled_scan {name}"), |b| {
            b.iter(|| drive.labelled_scan(next.next().unwrap()));
        });
        group.bench_function(format!("true_hits {name}, each second pixel"), |b| {
            b.iter(|| drive.true_hits(next.next().unwrap(), 2).count());
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
