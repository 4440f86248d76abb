//! Small bags for tests, with the shapes that recorders give them.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::ops::Range;

use byteorder::LittleEndian;
use cfodi::engine::Stamp;
use cfodi::msg::ros::{
    Header, PointCloud2, PointField, Quaternion, TfMessage, Transform, TransformStamped, Vector3,
};
use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use serde::Serialize;

/// The topic of the clouds.
pub const POINTS: &str = "/camera/depth/points";
/// Their frame.
pub const OPTICAL: &str = "camera_depth_optical_frame";
/// Stamp of the first cloud (ns); one follows each 33 ms.
pub const START: i64 = 1_700_000_000_000_000_000;

/// The opcode of a chunk.
const CHUNK: u8 = 6;

/// How messages lie in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// One after the other.
    Plain,
    /// In chunks of two or three clouds.
    Chunks,
    /// In such chunks, each compressed.
    Zstd,
    /// Likewise.
    Lz4,
}

/// Writes messages into MCAP in memory.
pub struct BagWriter {
    writer: Writer<Cursor<Vec<u8>>>,
    /// Whether each message is compressed by itself, as rosbag2's mode `message` does.
    pub compress_messages: bool,
    /// How long a message takes from its sender until it is recorded (ns).
    pub lag: u64,
    /// How many messages there are.
    sequence: u32,
}

impl BagWriter {
    pub fn new(layout: Layout) -> Self {
        let options = WriteOptions::new().profile("ros2").compression_threads(0).chunk_size(Some(50_000));
        let options = match layout {
            Layout::Plain => options.use_chunks(false),
            Layout::Chunks => options.compression(None),
            Layout::Zstd => options.compression(Some(Compression::Zstd)),
            Layout::Lz4 => options.compression(Some(Compression::Lz4)),
        };
        Self {
            writer: options.create(Cursor::new(Vec::new())).unwrap(),
            compress_messages: false,
            lag: 0,
            sequence: 0,
        }
    }

    pub fn put(&mut self, topic: &str, type_name: &str, stamp: i64, message: &impl Serialize) {
        let mut data = vec![0, 1, 0, 0];
        data.extend(cdr_encoding::to_vec::<_, LittleEndian>(message).unwrap());
        self.put_bytes(topic, type_name, stamp, &data);
    }

    pub fn put_bytes(&mut self, topic: &str, type_name: &str, stamp: i64, data: &[u8]) {
        let schema = self.writer.add_schema(type_name, "ros2msg", b"").unwrap();
        let channel_id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap();
        let (log_time, sequence) = (stamp as u64, self.sequence);
        self.sequence += 1;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time - self.lag };
        if self.compress_messages {
            let data = zstd::encode_all(data, 3).unwrap();
            self.writer.write_to_known_channel(&header, &data).unwrap();
        } else {
            self.writer.write_to_known_channel(&header, data).unwrap();
        }
    }

    pub fn cloud(&mut self, topic: &str, stamp: i64, points: &[[f32; 3]]) {
        self.put(topic, "sensor_msgs/msg/PointCloud2", stamp, &cloud(stamp, OPTICAL, points));
    }

    /// The wall as it is in scan `i`.
    pub fn scan(&mut self, i: usize) {
        self.cloud(POINTS, stamp(i), &wall(i));
    }

    pub fn tf(&mut self, topic: &str, stamp: i64, parent: &str, child: &str, x: f64) {
        self.put(topic, "tf2_msgs/msg/TFMessage", stamp, &transform(stamp, parent, child, x));
    }

    pub fn finish(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }
}

/// The stamp of cloud `i` (ns).
pub fn stamp(i: usize) -> i64 {
    START + 33_000_000 * i as i64
}

pub fn header(stamp: i64, frame_id: &str) -> Header {
    Header { stamp: Stamp::from_nanos(stamp).into(), frame_id: frame_id.to_owned() }
}

pub fn cloud(stamp: i64, frame_id: &str, points: &[[f32; 3]]) -> PointCloud2 {
    let fields = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
    PointCloud2 {
        header: header(stamp, frame_id),
        height: 1,
        width: points.len() as u32,
        fields: fields.map(|(name, at)| PointField::single(name, at, PointField::FLOAT32)).collect(),
        is_bigendian: false,
        point_step: 12,
        row_step: 12 * points.len() as u32,
        data: points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect(),
        all_finite: true,
    }
}

pub fn transform(stamp: i64, parent: &str, child: &str, x: f64) -> TfMessage {
    let transform = Transform { translation: Vector3 { x, y: 0.0, z: 0.0 }, rotation: Quaternion::default() };
    let header = header(stamp, parent);
    TfMessage { transforms: vec![TransformStamped { header, child_frame_id: child.to_owned(), transform }] }
}

/// A wall of 1 m x 1 m, 2 m before the sensor, that differs a little from scan to scan.
pub fn wall(i: usize) -> Vec<[f32; 3]> {
    let side = 40;
    let at = |k: usize| (k as f32 + 0.1) / side as f32 - 0.5;
    (0..side * side).map(|k| [at(k % side), at(k / side), 2.04 + 0.0001 * i as f32]).collect()
}

/// `clouds` scans of a wall by a sensor that moves sideways, each after its transform.
pub fn drive(writer: BagWriter, clouds: usize) -> Vec<u8> {
    drive_along(writer, 0..clouds)
}

/// The same scans in any order: a bag in a loop goes back to the first.
pub fn drive_along(mut writer: BagWriter, scans: impl Iterator<Item = usize>) -> Vec<u8> {
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in scans {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.scan(i);
    }
    writer.finish()
}

/// 60 scans whose camera has its place in `odom` from the fortieth on.
pub fn late_odom() -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..60 {
        if i >= 40 {
            writer.tf("/tf", stamp(i), "odom", "base_link", 0.0);
        }
        writer.tf("/tf", stamp(i), "base_link", "camera_link", 0.1 * i as f64);
        writer.scan(i);
    }
    writer.finish()
}

/// Where each chunk lies.
pub fn chunks(bag: &[u8]) -> Vec<Range<usize>> {
    let (mut at, mut found) = (8, Vec::new());
    while at + 9 <= bag.len() - 8 {
        let length = u64::from_le_bytes(bag[at + 1..at + 9].try_into().unwrap()) as usize;
        if bag[at] == CHUNK {
            found.push(at..at + 9 + length);
        }
        at += 9 + length;
    }
    found
}

/// Where the record of each cloud ends, in a bag without compression: found by walking over the records.
pub fn ends_of_clouds(bag: &[u8]) -> Vec<usize> {
    let mut ends = Vec::new();
    walk(bag, 8, bag.len() - 8, &mut ends);
    ends
}

/// A cloud is known by its size: all other messages are small.
fn walk(bag: &[u8], mut at: usize, end: usize, ends: &mut Vec<usize>) {
    const MESSAGE: u8 = 5;
    while at + 9 <= end {
        let length = u64::from_le_bytes(bag[at + 1..at + 9].try_into().unwrap()) as usize;
        match bag[at] {
            MESSAGE if length > 10_000 => ends.push(at + 9 + length),
            // Times, sizes and CRC, the name of the compression (none), and the length of the records.
            CHUNK => walk(bag, at + 9 + 40, at + 9 + length, ends),
            _ => {}
        }
        at += 9 + length;
    }
}
