//! `cfodi replay` as a program: bags of every shape in, files and exit status out.
#![cfg(feature = "node")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "../support/bags.rs"]
mod bags;
mod frames;
mod late;
#[path = "../support/mcap_bytes.rs"]
mod mcap_bytes;
mod outputs;
#[path = "../support/program.rs"]
mod program;
mod reading;
mod result;
mod sensors;
mod sessions;
mod signals;
mod trees;

use std::fs;
use std::path::Path;

use bags::{BagWriter, stamp, wall};
use program::{Folder, cfodi};
use serde_json::Value;

struct Replayed {
    status: i32,
    errors: String,
    summary: Option<Value>,
    voxels: Option<String>,
}

/// Replays into a folder that is new each time.
fn replay(bag: &Path, more: &[&str]) -> Replayed {
    let out = Folder::new();
    let (summary, voxels) = (out.join("s.json"), out.join("v.csv"));
    let mut arguments = vec!["replay", bag.to_str().unwrap(), "--summary", summary.to_str().unwrap()];
    arguments.extend(["--voxels", voxels.to_str().unwrap()]);
    arguments.extend(more);
    let ended = cfodi(&arguments);
    Replayed {
        status: ended.status.code().expect("ended by a signal"),
        errors: String::from_utf8(ended.stderr).unwrap(),
        summary: fs::read_to_string(summary).ok().map(|text| serde_json::from_str(&text).unwrap()),
        voxels: fs::read_to_string(voxels).ok(),
    }
}

impl Replayed {
    fn number(&self, name: &str) -> u64 {
        self.summary.as_ref().unwrap_or_else(|| panic!("{}", self.errors))[name].as_u64().unwrap()
    }
}

/// A cloud of a sensor in a frame of its own.
fn put_cloud(writer: &mut BagWriter, topic: &str, frame: &str, i: usize) {
    writer.put(topic, "sensor_msgs/msg/PointCloud2", stamp(i), &bags::cloud(stamp(i), frame, &wall(i)));
}
