//! Milliseconds a scan of the engine, and what a cloud costs on the way to it.
//!
//! On the cabinet recording where there is one (`CFODI_DATA`), on the simulated room otherwise. A group holds: `read`,
//! the yardstick: summing the bytes of one cloud after the other; `decode`, `PointCloud2` bytes to points; `insert`, a
//! whole drive from an empty map on, divided by its scans; `STATIC`, one re-clustering of the whole map; `snapshot`.
#![allow(
    missing_docs,
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark"
)]

#[path = "../tests/support/mod.rs"]
mod support;

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfodi::cloud::{Cloud, CloudFilter, Optical, decode};
use cfodi::engine::paper::Cfodi;
use cfodi::engine::{Isometry3, Params, Scan};
use cfodi::msg::ros::PointCloud2;
use criterion::{Criterion, criterion_group, criterion_main};

const FILTER: CloudFilter =
    CloudFilter { min_range: 0.4, max_range: 6.0, optical: Optical::Auto, max_points: 4_000_000 };

/// Messages with the sensor's poses, and what they are called.
fn drive() -> (&'static str, Vec<(PointCloud2, Isometry3<f64>)>) {
    if let Some(recording) = support::recording("tum_fr3_cabinet58", "benches on the cabinet recording") {
        let rows = recording.rows().iter();
        return ("cabinet", rows.map(|row| (recording.message(row), row.map_from_optical)).collect());
    }
    let drive = cfodi::sim::Drive::new(cfodi::sim::Scene::room(), 1, cfodi::engine::Stamp::from_nanos(0));
    ("room", (0..60).map(|i| (drive.step(10 * i).cloud, drive.fixed_from_optical(10 * i))).collect())
}

fn scans(drive: &[(PointCloud2, Isometry3<f64>)]) -> Vec<Scan> {
    let scan = |(message, pose): &(PointCloud2, Isometry3<f64>)| {
        let Cloud { stamp, points, .. } = decode(message, &FILTER).unwrap();
        Scan { stamp, fixed_from_sensor: *pose, points }
    };
    drive.iter().map(scan).collect()
}

fn bench(criterion: &mut Criterion) {
    let (name, drive) = drive();
    let scans = scans(&drive);
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10);
    let mut next = (0..drive.len()).cycle();
    group.bench_function("read", |b| {
        b.iter(|| {
            let data = &drive[next.next().unwrap()].0.data;
            let words = data.chunks_exact(8).map(|word| u64::from_le_bytes(word.try_into().unwrap()));
            black_box(words.fold(0, u64::wrapping_add))
        });
    });
    group.bench_function("decode", |b| {
        b.iter(|| decode(&drive[next.next().unwrap()].0, &FILTER));
    });
    for (label, voxel_size) in [("8 cm", 0.08), ("5 cm", 0.05)] {
        let params = Params::paper().with_voxel_size(voxel_size).unwrap();
        group.bench_function(format!("insert {label}, a scan"), |b| {
            b.iter_custom(|iterations| {
                let mut total = Duration::ZERO;
                for _ in 0..iterations {
                    let mut engine = Cfodi::new(params);
                    let begin = Instant::now();
                    scans.iter().for_each(|scan| drop(black_box(engine.insert(scan))));
                    total += begin.elapsed() / scans.len() as u32;
                }
                total
            });
        });
        let mut engine = Cfodi::new(params);
        scans.iter().for_each(|scan| drop(engine.insert(scan)));
        group.bench_function(format!("STATIC {label}, a map"), |b| b.iter(|| engine.static_partition()));
        group.bench_function(format!("snapshot {label}"), |b| b.iter(|| engine.snapshot()));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
