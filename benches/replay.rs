//! `cfodi replay` as a program, on a bag of clouds of 640 x 480 points, from its start to the account of its map.
//!
//! The cabinet recording where there is one (`CFODI_DATA`), the simulated room otherwise, once as it is and once compressed. A
//! group holds `read`, the yardstick: the bytes of the file, summed; and `replay` with each size of voxels. Criterion says of both
//! how many scans a second that is.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "../tests/support/bags.rs"]
mod bags;
mod drive;
#[path = "../tests/support/program.rs"]
mod program;
#[path = "../tests/support/mod.rs"]
mod support;

use std::fs;
use std::hint::black_box;

use bags::{BagWriter, Layout, POINTS, header};
use cfodi::engine::Isometry3;
use cfodi::msg::ros::{PointCloud2, Quaternion, TfMessage, Transform, TransformStamped, Vector3};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use program::{Folder, cfodi, errors};

/// Clouds of a bag: 150 MB.
const SCANS: usize = 30;

fn bench(criterion: &mut Criterion) {
    let (name, mut drive) = drive::drive();
    drive.truncate(SCANS);
    for (layout, form) in [(Layout::Chunks, "chunks"), (Layout::Zstd, "chunks, zstd")] {
        let folder = Folder::new();
        let bytes = bag(layout, &drive);
        println!("{name}, {form}: {} clouds, {} bytes", drive.len(), bytes.len());
        let path = folder.put("drive.mcap", &bytes);
        let bag = path.to_str().unwrap();
        let mut group = criterion.benchmark_group(format!("{name}, {form}"));
        group.sample_size(10).throughput(Throughput::Elements(drive.len() as u64));
        group.bench_function("read", |b| {
            b.iter(|| black_box(fs::read(bag).unwrap().into_iter().map(u64::from).sum::<u64>()));
        });
        let account = errors(&cfodi(&["replay", bag]));
        assert!(account.contains(&format!("{} scans in ", drive.len())), "{account}");
        for size in ["0.08", "0.05"] {
            let voxel_size = format!("voxel_size:={size}");
            group.bench_function(format!("replay, voxels of {size} m"), |b| {
                b.iter(|| {
                    let ended = cfodi(&["replay", bag, "--ros-args", "-p", &voxel_size]);
                    assert!(ended.status.success(), "{}", errors(&ended));
                });
            });
        }
        group.finish();
    }
}

/// Each cloud behind the transform of its sensor.
fn bag(layout: Layout, drive: &[(PointCloud2, Isometry3<f64>)]) -> Vec<u8> {
    let mut writer = BagWriter::new(layout);
    for (cloud, pose) in drive {
        let stamp = i64::from(cloud.header.stamp.sec) * 1_000_000_000 + i64::from(cloud.header.stamp.nanosec);
        let [x, y, z] = pose.translation.vector.into();
        let translation = Vector3 { x, y, z };
        let [x, y, z, w] = pose.rotation.coords.into();
        let transform = TransformStamped {
            header: header(stamp, "map"),
            child_frame_id: cloud.header.frame_id.clone(),
            transform: Transform { translation, rotation: Quaternion { x, y, z, w } },
        };
        writer.put("/tf", "tf2_msgs/msg/TFMessage", stamp, &TfMessage { transforms: vec![transform] });
        writer.put(POINTS, "sensor_msgs/msg/PointCloud2", stamp, cloud);
    }
    writer.finish()
}

criterion_group!(benches, bench);
criterion_main!(benches);
