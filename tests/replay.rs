//! `cfodi replay` as a program: bags of every shape in, files and exit status out.
#![cfg(feature = "node")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/bags.rs"]
mod bags;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use bags::{BagWriter, Layout, OPTICAL, POINTS, drive, drive_along, ends_of_clouds, stamp, wall};
use cfodi::msg::ros::{CameraInfo, Image, Quaternion, TfMessage};
use serde_json::Value;
use tempfile::TempDir;

/// A folder of the test's own, removed at its end.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

struct Replayed {
    status: i32,
    errors: String,
    summary: Option<Value>,
    voxels: Option<String>,
}

fn cfodi(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cfodi")).args(arguments).output().unwrap()
}

/// Replays into a folder that is new each time.
fn replay(bag: &Path, more: &[&str]) -> Replayed {
    let out = Folder::new();
    let (summary, voxels) = (out.0.path().join("s.json"), out.0.path().join("v.csv"));
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

#[test]
fn every_compression_gives_the_same_map() {
    let folder = Folder::new();
    let layouts = [Layout::Plain, Layout::Chunks, Layout::Zstd, Layout::Lz4].map(BagWriter::new);
    let mut messages = BagWriter::new(Layout::Chunks);
    messages.compress_messages = true;
    let mut bags: Vec<_> = layouts.into_iter().chain([messages]).map(|writer| drive(writer, 30)).collect();
    bags.push(zstd::encode_all(&bags[1][..], 3).unwrap());
    let expected = replay(&folder.put("0.mcap", &bags[0]), &[]);
    assert_eq!((expected.status, expected.number("scans")), (0, 30), "{}", expected.errors);
    assert!(expected.number("dense_voxels") > 100);
    for (i, bag) in bags.iter().enumerate().skip(1) {
        let name = if i == bags.len() - 1 { "a.mcap.zstd".to_owned() } else { format!("{i}.mcap") };
        let found = replay(&folder.put(&name, bag), &[]);
        assert_eq!((found.status, found.voxels), (0, expected.voxels.clone()), "bag {i}: {}", found.errors);
    }
}

/// A generator of the test's own, so that the cuts are the same on every run.
fn cuts(length: usize, number: usize) -> impl Iterator<Item = usize> {
    let mut state = 0x2545_F491_4F6C_DD1D_u64;
    (0..number).map(move |_| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % length as u64) as usize
    })
}

#[test]
fn a_bag_cut_at_any_byte_gives_every_scan_before_the_cut_and_status_1() {
    let folder = Folder::new();
    for (name, layout) in [("plain", Layout::Plain), ("chunks", Layout::Chunks)] {
        let bag = drive(BagWriter::new(layout), 20);
        let ends = ends_of_clouds(&bag);
        assert_eq!(ends.len(), 20);
        for cut in cuts(bag.len(), 70) {
            let found = replay(&folder.put(&format!("{name}.mcap"), &bag[..cut]), &[]);
            let before = ends.iter().filter(|end| **end <= cut).count() as u64;
            assert_eq!(
                (found.status, found.number("scans")),
                (1, before),
                "{name} cut at {cut}: {}",
                found.errors
            );
            assert!(found.errors.contains("not all of the bag was read"), "{}", found.errors);
        }
    }
}

#[test]
fn a_compressed_bag_cut_at_any_byte_gives_at_least_the_whole_chunks() {
    let folder = Folder::new();
    let (in_chunks, plain) =
        (drive(BagWriter::new(Layout::Zstd), 20), drive(BagWriter::new(Layout::Plain), 20));
    let as_a_whole = zstd::encode_all(&plain[..], 3).unwrap();
    for (name, bag) in [("chunks.mcap", in_chunks), ("whole.mcap.zstd", as_a_whole)] {
        let ends: Vec<usize> = if name.starts_with("chunks") { ends_of_chunks(&bag) } else { Vec::new() };
        for cut in cuts(bag.len(), 60) {
            let found = replay(&folder.put(name, &bag[..cut]), &[]);
            let chunks = ends.iter().filter(|end| **end <= cut).count() as u64;
            assert_eq!(found.status, 1, "{name} cut at {cut}: {}", found.errors);
            // A chunk holds the transforms and clouds of two scans and a half.
            assert!(
                found.number("scans") >= 2 * chunks.min(6),
                "{name} cut at {cut}: {chunks} chunks, {} scans: {}",
                found.number("scans"),
                found.errors
            );
            assert!(found.number("scans") <= 20);
        }
    }
}

fn ends_of_chunks(bag: &[u8]) -> Vec<usize> {
    let (mut at, mut ends) = (8, Vec::new());
    while at + 9 <= bag.len() - 8 {
        let length = u64::from_le_bytes(bag[at + 1..at + 9].try_into().unwrap()) as usize;
        at += 9 + length;
        if bag[at - 9 - length] == 6 {
            ends.push(at);
        }
    }
    ends
}

#[test]
fn a_static_transform_may_come_last_and_a_cloud_before_its_transform() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    for i in 0..30 {
        writer.cloud(POINTS, stamp(i), &wall(i));
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
    }
    writer.tf("/tf_static", stamp(29), "camera_link", OPTICAL, 0.0);
    let late = replay(&folder.put("late.mcap", &writer.finish()), &["--ros-args", "-p", "fixed_frame:=map"]);
    let early = replay(&folder.put("early.mcap", &drive(BagWriter::new(Layout::Plain), 30)), &[]);
    assert_eq!((late.status, late.number("scans")), (0, 30), "{}", late.errors);
    assert_eq!(late.voxels, early.voxels);
}

/// A camera that is mounted anew, and a frame that is told to stand still once it has moved.
#[test]
fn what_is_looked_for_ahead_is_what_is_missing_and_not_what_changes_later() {
    let folder = Folder::new();
    let record = |link_at: usize| {
        let mut writer = BagWriter::new(Layout::Chunks);
        for i in 0..60 {
            if i % 50 == 0 {
                writer.tf("/tf_static", stamp(i), "camera_link", OPTICAL, 0.4 * i as f64);
            }
            if i == link_at {
                writer.tf("/tf_static", stamp(i), "base", "camera_link", 0.0);
            }
            writer.tf("/tf", stamp(i), "map", "base", 0.1 * i as f64);
            writer.cloud(POINTS, stamp(i), &wall(i));
        }
        writer.tf("/tf_static", stamp(60), "base", "camera_link", 7.0);
        writer.tf("/tf_static", stamp(60), "map", "base", 7.0);
        replay(&folder.put("mounted.mcap", &writer.finish()), &["--ros-args", "-p", "fixed_frame:=map"])
    };
    let (early, late) = (record(0), record(59));
    assert_eq!((early.number("scans"), late.number("scans")), (60, 60), "{}", late.errors);
    assert_eq!(early.voxels, late.voxels);
}

#[test]
fn transforms_of_other_names_are_read_where_these_are_given_and_named_where_not() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/robot1/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..12 {
        writer.tf("/robot1/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.cloud("/robot1/points", stamp(i), &wall(i));
    }
    let bag = folder.put("fleet.mcap", &writer.finish());
    let expected = replay(&folder.put("one.mcap", &drive(BagWriter::new(Layout::Plain), 12)), &[]);
    let given = ["--ros-args", "-r", "__ns:=/robot1", "-r", "/tf:=tf", "-r", "/tf_static:=tf_static"];
    let found = replay(&bag, &given);
    assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
    assert_eq!(found.voxels, expected.voxels);
    assert!(!found.errors.contains("transforms are read from"), "{}", found.errors);
    let found = replay(&bag, &["--ros-args", "-r", "/tf:=/robot1/tf"]);
    let said = "transforms are read from /robot1/tf and /tf_static, not from /robot1/tf_static";
    assert!(found.errors.contains(said), "{}", found.errors);
    // The only ones are taken without being named.
    let found = replay(&bag, &["--ros-args", "-r", "__ns:=/robot1"]);
    assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
    assert_eq!(found.voxels, expected.voxels, "{}", found.errors);
    let said = "no transforms are on /tf and /tf_static: they are read from /robot1/tf and /robot1/tf_static";
    assert!(found.errors.contains(said), "{}", found.errors);
}

#[test]
fn a_sensor_is_not_taken_to_stand_still_while_transforms_of_several_names_could_tell_how_it_moved() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 0..3 {
        writer.tf("/robot1/tf", stamp(i), "map", OPTICAL, 0.1 * i as f64);
        writer.tf("/robot2/tf", stamp(i), "map", "other", 0.2 * i as f64);
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let bag = folder.put("two.mcap", &writer.finish());
    let found = replay(&bag, &[]);
    assert!(found.status == 2 && found.summary.is_none(), "{}", found.errors);
    for robot in ["/robot1", "/robot2"] {
        let choice = format!("-r /tf:={robot}/tf -r /tf_static:={robot}/tf_static");
        assert!(found.errors.contains(&choice), "{}", found.errors);
    }
    let fixed_frame = format!("fixed_frame:={OPTICAL}");
    for given in [&["-r", "/tf:=/robot1/tf"][..], &["-p", &fixed_frame]] {
        let found = replay(&bag, &[&["--ros-args"], given].concat());
        assert_eq!((found.status, found.number("scans")), (0, 3), "{}", found.errors);
    }
}

#[test]
fn clouds_of_many_sensors_wait_for_a_transform_that_is_seldom() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    let topics = ["/a", "/b", "/c", "/d"];
    for i in 0..31 {
        if i % 10 == 0 {
            writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        }
        topics.iter().for_each(|topic| writer.cloud(topic, stamp(i), &wall(i)));
    }
    let bag = folder.put("seldom.mcap", &writer.finish());
    let found = replay(&bag, &topics.map(|topic| ["--topic", topic]).concat());
    assert_eq!((found.status, found.number("scans")), (0, 4 * 31), "{}", found.errors);
}

#[test]
fn the_default_frame_is_taken_where_the_bag_has_it_and_the_root_is_named_where_not() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..12 {
        writer.cloud(POINTS, stamp(i), &wall(i));
        writer.tf("/tf", stamp(i), "map", "odom", 5.0);
        writer.tf("/tf", stamp(i), "odom", "camera_link", 0.1 * i as f64);
    }
    let found = replay(&folder.put("odom.mcap", &writer.finish()), &[]);
    let frame = |found: &Replayed| found.summary.as_ref().unwrap()["parameters"]["fixed_frame"].clone();
    assert_eq!((found.number("scans"), frame(&found)), (12, "odom".into()), "{}", found.errors);
    let found = replay(&folder.put("map.mcap", &drive(BagWriter::new(Layout::Plain), 12)), &[]);
    assert_eq!(frame(&found), "map");
    assert!(found.errors.contains("made in `map`, the root of the sensor's frames"), "{}", found.errors);
}

#[test]
fn a_transform_that_would_close_a_circle_is_left_out_and_no_more() {
    let folder = Folder::new();
    let expected = replay(&folder.put("plain.mcap", &drive(BagWriter::new(Layout::Plain), 20)), &[]);
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..20 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        if i == 10 {
            writer.tf("/tf", stamp(i), OPTICAL, "map", 0.0);
        }
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let found = replay(&folder.put("circle.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 20), "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["transforms_refused"]["cycle"], 1, "{}", found.errors);
    assert_eq!(found.voxels, expected.voxels, "{}", found.errors);
    assert!(found.errors.contains("made in `map`, the root of the sensor's frames"), "{}", found.errors);
    assert!(!found.errors.contains("reading begins again"), "{}", found.errors);
}

#[test]
fn without_any_transform_the_sensor_stands_still_and_that_is_said() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    (0..3).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    let found = replay(&folder.put("still.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 3));
    assert!(found.errors.contains("and to stand still"), "{}", found.errors);
}

/// From the body frame to the optical one, as REP 103 has the two.
fn body_to_optical() -> TfMessage {
    let mut body = bags::transform(stamp(0), "camera_depth_frame", OPTICAL, 0.0);
    body.transforms[0].transform.rotation = Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 };
    body
}

#[test]
fn without_any_transform_a_camera_is_level_and_what_is_upright_before_it_is_a_wall() {
    const WALL: u64 = 3;
    let folder = Folder::new();
    let record = |body: &[TfMessage]| {
        let mut writer = BagWriter::new(Layout::Plain);
        body.iter().for_each(|body| writer.put("/tf_static", "tf2_msgs/msg/TFMessage", stamp(0), body));
        (0..30).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
        writer.finish()
    };
    let expected = replay(&folder.put("told.mcap", &record(&[body_to_optical()])), &[]);
    let [out, clusters] = ["r.mcap", "c.json"].map(|name| folder.0.path().join(name));
    let more = ["--out", out.to_str().unwrap(), "--clusters", clusters.to_str().unwrap()];
    let found = replay(&folder.put("none.mcap", &record(&[])), &more);
    assert_eq!((found.status, found.number("scans")), (0, 30), "{}", found.errors);
    assert!(found.errors.contains("made in `camera_depth_frame`, the body frame"), "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["parameters"]["fixed_frame"], "camera_depth_frame");
    assert_eq!(found.voxels, expected.voxels);
    let clusters: Value = serde_json::from_str(&fs::read_to_string(clusters).unwrap()).unwrap();
    let classes: Vec<_> = clusters.as_array().unwrap().iter().map(|it| &it["surface_class"]).collect();
    assert_eq!(classes, [WALL], "{clusters}");
    // A viewer can show the input beside it.
    let result = fs::read(&out).unwrap();
    let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
    let transforms: Vec<TfMessage> = messages
        .filter(|message| message.channel.topic == "/tf_static")
        .map(|message| cdr_encoding::from_bytes::<_, byteorder::LittleEndian>(&message.data[4..]).unwrap().0)
        .collect();
    assert_eq!(transforms, [body_to_optical()]);
}

#[test]
fn a_fixed_frame_whose_z_looks_ahead_is_warned_of_in_a_replay_and_by_the_node() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 3));
    let fixed_frame = format!("fixed_frame:={OPTICAL}");
    let warning = format!("the fixed frame `{OPTICAL}` is an optical one by its name");
    let found = replay(&bag, &["--ros-args", "-p", &fixed_frame]);
    assert!(found.status == 0 && found.errors.contains(&warning), "{}", found.errors);
    // It ends before it opens a network, for want of a file to resume from.
    let ended = cfodi(&["run", "--resume", "--ros-args", "-p", &fixed_frame]);
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.code() == Some(2) && errors.contains(&warning), "{errors}");
    assert!(!replay(&bag, &[]).errors.contains("is an optical one"));
}

#[test]
fn a_frame_that_is_not_there_skips_every_scan_with_the_reason() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 20));
    let found = replay(&bag, &["--ros-args", "-p", "fixed_frame:=world"]);
    assert_eq!((found.status, found.number("scans")), (0, 0));
    assert_eq!(found.summary.as_ref().unwrap()["scans_skipped"]["tf_unknown_frame"], 20, "{}", found.errors);
    assert!(
        found.errors.contains("frames seen: camera_depth_optical_frame, camera_link, map"),
        "{}",
        found.errors
    );
}

#[test]
fn a_cloud_on_points_is_taken_before_others_where_it_is_one_and_these_are_named() {
    let folder = Folder::new();
    for (kind, read) in [
        ("sensor_msgs/msg/PointCloud2", "reading /points (not /camera/depth/points: choose with --topic)\n"),
        ("std_msgs/msg/String", "reading /camera/depth/points\n"),
    ] {
        let mut writer = BagWriter::new(Layout::Plain);
        writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
        for i in 0..4 {
            writer.put("/points", kind, stamp(i), &bags::cloud(stamp(i), OPTICAL, &wall(i)));
            writer.cloud(POINTS, stamp(i), &wall(i));
        }
        let found = replay(&folder.put("two.mcap", &writer.finish()), &[]);
        assert_eq!((found.status, found.number("scans")), (0, 4), "{}", found.errors);
        assert!(found.errors.contains(read), "{}", found.errors);
    }
}

#[test]
fn two_sensors_fill_one_map() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in 0..4 {
        writer.cloud("/left", stamp(2 * i), &wall(0));
        writer.cloud("/right", stamp(2 * i + 1), &wall(1));
    }
    let bag = folder.put("two.mcap", &writer.finish());
    let none = replay(&bag, &[]);
    assert_eq!((none.status, none.summary), (2, None));
    assert!(none.errors.contains("--topic /left or --topic /right"), "{}", none.errors);
    assert_eq!(replay(&bag, &["--topic", "/left"]).number("scans"), 4);
    assert_eq!(replay(&bag, &["--topic", "/left", "--topic", "/right"]).number("scans"), 8);
    assert_eq!(replay(&bag, &["--ros-args", "-r", "points:=/right"]).number("scans"), 4);
    let listed = |more: &[&str]| {
        let options = ["--ros-args", "-p", "sensors:=[left, rear]"].into_iter().chain(more.iter().copied());
        replay(&bag, &options.collect::<Vec<_>>())
    };
    assert_eq!(listed(&["-r", "rear:=/right"]).number("scans"), 8);
    let missing = listed(&[]);
    assert_eq!(missing.status, 2);
    assert!(missing.errors.contains("/rear"), "{}", missing.errors);
}

#[test]
fn two_sensors_in_one_frame_with_clocks_that_differ_make_one_map() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in 0..10 {
        for (topic, behind) in [("/a", 0), ("/b", 2_000_000_000)] {
            let cloud = bags::cloud(stamp(i) - behind, OPTICAL, &wall(i));
            writer.put(topic, "sensor_msgs/msg/PointCloud2", stamp(i), &cloud);
        }
    }
    let bag = folder.put("two.mcap", &writer.finish());
    let found = replay(&bag, &["--topic", "/a", "--topic", "/b"]);
    assert_eq!((found.number("scans"), found.number("sessions")), (20, 1), "{}", found.errors);
}

#[test]
fn an_experiment_ends_where_stamps_jump_back_counts_what_it_leaves_out_and_has_status_1() {
    let folder = Folder::new();
    let lap = || (0..60).step_by(6);
    let laps = drive_along(BagWriter::new(Layout::Plain), lap().chain(lap()));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.0.path().join("figures"));
    let [bag, out] = [&bag, &out].map(|path| path.to_str().unwrap());
    let fixed_frame = ["--ros-args", "-p", "fixed_frame:=map"];
    let ended = cfodi(&[&["experiment", bag, "--no-effects", "--out", out], &fixed_frame[..]].concat());
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{errors}");
    assert!(errors.contains("The stamps jump back by 1.782 s: what follows is left out."), "{errors}");
    assert!(errors.contains("10 scans skipped: after_jump 10"), "{errors}");
}

#[test]
fn stamps_that_jump_back_begin_a_session() {
    let folder = Folder::new();
    let laps = drive_along(BagWriter::new(Layout::Plain), (0..60).chain(0..3));
    let looped = replay(&folder.put("loop.mcap", &laps), &[]);
    let once = replay(&folder.put("once.mcap", &drive(BagWriter::new(Layout::Plain), 3)), &[]);
    assert_eq!((looped.number("scans"), looped.number("sessions")), (63, 2), "{}", looped.errors);
    assert_eq!(looped.voxels, once.voxels);
}

#[test]
fn other_recordings_are_refused_with_the_command_that_converts_them() {
    let folder = Folder::new();
    for (name, begin) in [("a.bag", &b"#ROSBAG V2.0\nxyz"[..]), ("a.db3", b"SQLite format 3\0abc")] {
        let found = replay(&folder.put(name, begin), &[]);
        assert_eq!((found.status, found.summary), (2, None));
        assert!(found.errors.contains("rosbags-convert --src "), "{}", found.errors);
    }
    let found = replay(&folder.put("a.txt", b"hello, hello"), &[]);
    assert!(
        found.status == 2 && found.errors.contains("it begins with \"hello, hello\""),
        "{}",
        found.errors
    );
    let found = replay(Path::new("/nowhere/a.mcap"), &[]);
    assert!(found.status == 1 && found.errors.contains("cannot read /nowhere/a.mcap"), "{}", found.errors);
    assert_eq!(replay(&folder.put("empty.mcap", b""), &[]).status, 1);
}

#[test]
fn bytes_after_the_end_and_damaged_chunks_are_said() {
    let folder = Folder::new();
    let mut bag = drive(BagWriter::new(Layout::Chunks), 5);
    let whole = bag.len();
    bag.extend(b"more");
    let found = replay(&folder.put("more.mcap", &bag), &[]);
    assert_eq!((found.status, found.number("scans")), (1, 5), "{}", found.errors);
    bag.truncate(whole);
    let middle = ends_of_clouds(&bag)[2] - 50;
    bag[middle] ^= 1;
    let found = replay(&folder.put("damaged.mcap", &bag), &[]);
    assert_eq!(found.status, 1);
    assert!(found.errors.contains("CRC"), "{}", found.errors);
}

#[test]
fn an_output_that_cannot_be_written_is_named_and_nothing_is_left() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let found = replay(&bag, &["--out", "/nowhere/out.mcap"]);
    assert!(found.status == 1 && found.errors.contains("/nowhere/out.mcap"), "{}", found.errors);
    assert!(found.summary.is_none());
    let cut = folder.put("b.mcap", &drive(BagWriter::new(Layout::Plain), 2)[..30_000]);
    let out = folder.0.path().join("out.mcap");
    assert_eq!(replay(&cut, &["--out", out.to_str().unwrap()]).status, 1);
    let result = mcap::Summary::read(&fs::read(&out).unwrap()).unwrap().unwrap();
    assert_eq!(result.channels.len(), 6);
    let names: Vec<_> =
        fs::read_dir(folder.0.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(!names.iter().any(|name| name.to_string_lossy().contains(".part")), "{names:?}");
}

#[test]
fn a_static_transform_that_comes_late_shows_the_frame_too() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 0..60 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.cloud(POINTS, stamp(i), &wall(i));
        if i == 45 {
            writer.tf("/tf_static", stamp(i), "camera_link", OPTICAL, 0.0);
        }
    }
    let late =
        replay(&folder.put("late.mcap", &writer.finish()), &["--report", folder.0.path().to_str().unwrap()]);
    let early = replay(&folder.put("early.mcap", &drive(BagWriter::new(Layout::Plain), 60)), &[]);
    assert_eq!((late.status, late.number("scans")), (0, 60), "{}", late.errors);
    assert!(late.errors.contains("made in `map`"), "{}", late.errors);
    assert!(!late.errors.contains("reading begins again"), "the frame is looked for ahead: {}", late.errors);
    assert_eq!(late.voxels, early.voxels);
}

#[test]
fn a_default_frame_that_begins_late_is_still_the_default() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..60 {
        if i >= 40 {
            writer.tf("/tf", stamp(i), "odom", "camera_link", 0.1 * i as f64);
        }
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let bag = folder.put("odom.mcap", &writer.finish());
    let (open, given) = (replay(&bag, &[]), replay(&bag, &["--ros-args", "-p", "fixed_frame:=odom"]));
    assert_eq!((open.number("scans"), given.number("scans")), (20, 20), "{}", open.errors);
    assert_eq!(open.voxels, given.voxels);
    assert!(!open.errors.contains("has no frame `odom`"), "{}", open.errors);
    assert!(open.errors.contains("reading begins again"), "{}", open.errors);
}

#[test]
fn a_sensor_that_lags_behind_another_begins_no_session() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    let other = "other_optical_frame";
    writer.tf("/tf_static", stamp(0), "map", other, 1.0);
    for i in 0..20 {
        writer.cloud("/left", stamp(i + 100), &wall(i));
        let late = bags::cloud(stamp(i), other, &wall(i));
        writer.put("/right", "sensor_msgs/msg/PointCloud2", stamp(i), &late);
    }
    let bag = folder.put("lag.mcap", &writer.finish());
    let found = replay(&bag, &["--topic", "/left", "--topic", "/right"]);
    assert_eq!((found.number("scans"), found.number("sessions")), (40, 1), "{}", found.errors);
}

#[test]
fn each_lap_is_a_session_of_its_own_in_the_result_bag_and_plays_after_the_one_before() {
    let folder = Folder::new();
    let laps = drive_along(BagWriter::new(Layout::Plain), (0..60).chain(0..60));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.0.path().join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap()]);
    assert_eq!((found.status, found.number("sessions")), (0, 2), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let mut deltas = Vec::new();
    for message in mcap::MessageStream::new(&result).unwrap().map(Result::unwrap) {
        if message.channel.topic == "/cfodi/clusters_delta" {
            let array: cfodi::msg::clusters::SurfaceClusterArray =
                cdr_encoding::from_bytes::<_, byteorder::LittleEndian>(&message.data[4..]).unwrap().0;
            deltas.push((message.log_time, array.session_id, array.sequence));
        }
    }
    assert_eq!(deltas.len(), 120);
    assert!(deltas.is_sorted(), "played in another order than made");
    let ids = [deltas[0].1, deltas[119].1];
    assert_eq!(ids, [stamp(0) as u64, stamp(0) as u64 + 1]);
}

#[test]
fn a_damaged_file_of_several_costs_only_its_own_scans() {
    let folder = Folder::new();
    let whole = drive(BagWriter::new(Layout::Plain), 10);
    folder.put("run_2.mcap", &whole);
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 10..20 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    folder.put("run_10.mcap", &writer.finish());
    let found = replay(folder.0.path(), &[]);
    assert_eq!(
        (found.status, found.number("scans"), found.number("sessions")),
        (0, 20, 1),
        "{}",
        found.errors
    );
    folder.put("run_2.mcap", &whole[..ends_of_clouds(&whole)[3]]);
    let found = replay(folder.0.path(), &[]);
    assert_eq!((found.status, found.number("scans")), (1, 14), "{}", found.errors);
    assert!(found.errors.contains("run_2.mcap is cut"), "{}", found.errors);
}

#[test]
fn a_file_that_lies_in_a_folder_plain_and_compressed_is_read_once_and_that_is_said() {
    let folder = Folder::new();
    let bag = drive(BagWriter::new(Layout::Plain), 10);
    folder.put("a.mcap", &bag);
    let compressed = folder.put("a.mcap.zstd", &zstd::encode_all(&bag[..], 3).unwrap());
    let found = replay(folder.0.path(), &[]);
    assert_eq!(
        (found.status, found.number("scans"), found.number("sessions")),
        (0, 10, 1),
        "{}",
        found.errors
    );
    assert!(found.errors.contains("or not at all: a.mcap.zstd\n"), "{}", found.errors);
    let found = replay(folder.0.path(), &["--ply", compressed.to_str().unwrap()]);
    assert!(found.status == 2 && found.errors.contains("would replace the input"), "{}", found.errors);
}

#[test]
fn a_result_in_the_folder_of_its_recording_is_no_part_of_it_and_may_be_replaced() {
    let folder = Folder::new();
    folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 10));
    let out = folder.0.path().join("result.mcap");
    for is_there in [false, true, true] {
        let found = replay(folder.0.path(), &["--out", out.to_str().unwrap(), "--with-input"]);
        assert_eq!(
            (found.status, found.number("scans"), found.number("sessions")),
            (0, 10, 1),
            "{}",
            found.errors
        );
        let said = "not read, as a replay has written them: result.mcap\n";
        assert_eq!(found.errors.contains(said), is_there, "{}", found.errors);
    }
    // Alone it is a recording like any other.
    assert_eq!(replay(&out, &[]).number("scans"), 10);
}

#[test]
fn no_output_replaces_a_part_of_the_input_and_none_is_begun_when_one_cannot_be_made() {
    let folder = Folder::new();
    folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let text = "rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [a.mcap]}";
    let metadata = folder.put("metadata.yaml", text.as_bytes());
    let found = replay(folder.0.path(), &["--ply", metadata.to_str().unwrap()]);
    assert_eq!(
        (found.status, fs::read_to_string(&metadata).unwrap().as_str()),
        (2, text),
        "{}",
        found.errors
    );
    let out = folder.0.path().join("out.mcap");
    let found = replay(folder.0.path(), &["--out", out.to_str().unwrap(), "--clusters", "/nowhere/c.json"]);
    assert!(found.status == 1 && found.errors.contains("/nowhere/c.json"), "{}", found.errors);
    assert!(found.summary.is_none() && !out.exists());
}

#[test]
fn what_cannot_be_decoded_is_said_once_and_counted() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in 0..5 {
        writer.put_bytes("/tf", "tf2_msgs/msg/TFMessage", stamp(i), &[0, 1, 0, 0, 9, 9, 9, 9]);
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let found = replay(&folder.put("garbled.mcap", &writer.finish()), &[]);
    assert_eq!(found.errors.matches("a message on /tf was skipped").count(), 1, "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["messages_undecodable"]["/tf"], 5);
    assert_eq!(found.number("scans"), 5);
}

#[test]
fn a_chain_of_frames_that_grows_is_read_twice_at_most() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    (0..40).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    for i in 0..100 {
        let (parent, child) =
            (format!("f{}", i + 1), if i == 0 { OPTICAL.to_owned() } else { format!("f{i}") });
        writer.tf("/tf_static", stamp(40), &parent, &child, 0.0);
    }
    let found = replay(&folder.put("chain.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 40), "{}", found.errors);
    assert_eq!(found.errors.matches("reading begins again").count(), 1, "{}", found.errors);
    assert!(found.errors.contains("made in `f100`"), "{}", found.errors);
    assert!(!found.errors.contains("its past is forgotten"), "the guess was no publisher: {}", found.errors);
}

#[test]
fn frames_that_change_places_for_ever_are_read_twice_at_most() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 0..40 {
        writer.tf("/tf", stamp(600 + i), "a", OPTICAL, 0.0);
        writer.cloud(POINTS, stamp(600 + i), &wall(i));
    }
    for _ in 0..3 {
        writer.tf("/tf", stamp(700), "q", "r", 0.0);
        writer.tf("/tf", stamp(700), "b", "a", 0.0);
        // A stamp that jumps back clears the tree.
        writer.tf("/tf", stamp(0), "q", "r", 0.0);
        writer.tf("/tf", stamp(0), "a", "b", 0.0);
    }
    let found = replay(&folder.put("flip.mcap", &writer.finish()), &[]);
    assert_eq!(found.status, 0, "{}", found.errors);
    assert!(found.errors.matches("reading begins again").count() <= 1, "{}", found.errors);
}

#[test]
fn files_that_are_no_bag_cost_only_their_own_scans_and_all_are_counted() {
    let folder = Folder::new();
    folder.put("run_0.mcap", &[0; 5000]);
    folder.put("run_1.mcap", &drive(BagWriter::new(Layout::Plain), 5));
    folder.put("run_2.mcap", b"");
    let found = replay(folder.0.path(), &[]);
    assert_eq!((found.status, found.number("scans")), (1, 5), "{}", found.errors);
    assert!(
        found.errors.contains("run_0.mcap") && found.errors.contains("1 more of its files"),
        "{}",
        found.errors
    );
}

#[test]
fn endless_new_names_of_frames_take_no_memory() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Zstd);
    for i in 0..50 {
        let name = format!("{i}{}", "x".repeat(100_000));
        let cloud = bags::cloud(stamp(i), &name, &[[0.0, 0.0, 1.0]]);
        writer.put(POINTS, "sensor_msgs/msg/PointCloud2", stamp(i), &cloud);
    }
    let found = replay(&folder.put("names.mcap", &writer.finish()), &[]);
    assert_eq!(found.summary.as_ref().unwrap()["scans_skipped"]["long_frame_id"], 50, "{}", found.errors);
}

#[test]
fn the_transforms_of_each_lap_are_played_with_its_clusters() {
    let folder = Folder::new();
    let laps = drive_along(BagWriter::new(Layout::Plain), (0..60).chain(0..60));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.0.path().join("out.mcap"));
    assert_eq!(replay(&bag, &["--out", out.to_str().unwrap()]).status, 0);
    let result = fs::read(&out).unwrap();
    let times = |topic: &str| -> Vec<u64> {
        let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
        messages.filter(|message| message.channel.topic == topic).map(|message| message.log_time).collect()
    };
    let (tf, deltas) = (times("/tf"), times("/cfodi/clusters_delta"));
    assert_eq!(tf.len(), 120);
    assert!(tf.is_sorted() && tf.iter().zip(&deltas).all(|(tf, delta)| tf.abs_diff(*delta) < 50_000_000));
}

/// A simulator stamps by its own time, which the recorder did not know, and which goes at half the speed.
#[test]
fn what_was_recorded_by_another_clock_is_played_with_its_clusters() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    let simulated = |i: usize| 10_000_000_000 + (stamp(i) - stamp(0)) / 2;
    let put_transform =
        |writer: &mut BagWriter, topic: &str, recorded: i64, stamp: i64, frames: [&str; 2], x: f64| {
            let message = bags::transform(stamp, frames[0], frames[1], x);
            writer.put(topic, "tf2_msgs/msg/TFMessage", recorded, &message);
        };
    put_transform(&mut writer, "/tf_static", stamp(0), 0, ["camera_link", OPTICAL], 0.0);
    for i in 0..200 {
        put_transform(&mut writer, "/tf", stamp(i), simulated(i), ["odom", "camera_link"], 0.01 * i as f64);
        // One stamp is a stray.
        let stamped = if i == 0 { 0 } else { simulated(i) };
        writer.put(POINTS, "sensor_msgs/msg/PointCloud2", stamp(i), &bags::cloud(stamped, OPTICAL, &wall(i)));
    }
    let (bag, out) = (folder.put("sim.mcap", &writer.finish()), folder.0.path().join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]);
    assert_eq!((found.status, found.number("scans")), (0, 199), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
    let times: Vec<_> = messages.map(|message| (message.channel.topic.clone(), message.log_time)).collect();
    let of = |topic: &str| -> Vec<u64> {
        times.iter().filter(|(of, _)| of == topic).map(|(_, time)| *time).collect()
    };
    let (clouds, deltas) = (of(POINTS), of("/cfodi/clusters_delta"));
    assert_eq!((clouds.len(), deltas.len(), of("/tf").len()), (200, 199, 200));
    for (input, delta) in [clouds, of("/tf")].iter().flat_map(|input| input[1..].iter().zip(&deltas)) {
        assert!(input.abs_diff(*delta) < 200_000_000, "{input} beside {delta}");
    }
}

/// A slow pipeline or a radio link.
#[test]
fn clouds_that_were_recorded_late_move_no_other_message() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..100 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.01 * i as f64);
        if let Some(late) = i.checked_sub(45) {
            writer.put(
                POINTS,
                "sensor_msgs/msg/PointCloud2",
                stamp(i),
                &bags::cloud(stamp(late), OPTICAL, &wall(late)),
            );
        }
    }
    let (bag, out) = (folder.put("late.mcap", &writer.finish()), folder.0.path().join("out.mcap"));
    assert_eq!(replay(&bag, &["--out", out.to_str().unwrap()]).number("scans"), 55);
    let result = fs::read(&out).unwrap();
    let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
    let times: Vec<_> =
        messages.filter(|message| message.channel.topic == "/tf").map(|message| message.log_time).collect();
    assert_eq!(times, (0..100).map(|i| stamp(i) as u64).collect::<Vec<_>>());
}

#[test]
fn where_messages_lie_out_of_order_and_transforms_are_missing_for_it_that_is_said() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    let scans = 0..450;
    scans.clone().for_each(|i| writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64));
    scans.step_by(30).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    let found = replay(&folder.put("unsorted.mcap", &writer.finish()), &[]);
    let skipped = found.summary.as_ref().unwrap()["scans_skipped"]["tf_too_early"].as_u64().unwrap();
    assert_eq!((found.status, found.number("scans") + skipped), (0, 15), "{}", found.errors);
    assert!(skipped > 0 && found.errors.contains("up to 14.8 s out of the order"), "{}", found.errors);
}

#[test]
fn where_all_transforms_lie_behind_the_scans_that_is_said_too() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    (0..200).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    (0..200).for_each(|i| writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64));
    let found = replay(&folder.put("behind.mcap", &writer.finish()), &[]);
    let skipped = found.summary.as_ref().unwrap()["scans_skipped"]["tf_unknown_frame"].as_u64().unwrap();
    assert_eq!((found.status, found.number("scans") + skipped), (0, 200), "{}", found.errors);
    assert!(skipped > 0 && found.errors.contains("`mcap sort` helps"), "{}", found.errors);
}

#[test]
fn where_disorder_makes_stamps_jump_back_what_came_before_the_first_jump_is_said() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in [100, 0] {
        writer.tf("/tf", stamp(i), "map", "robot", 0.0);
    }
    for i in [200, 100, 0] {
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let found = replay(&folder.put("shuffled.mcap", &writer.finish()), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (3, 3), "{}", found.errors);
    assert!(found.errors.contains("up to 3.3 s out of the order"), "{}", found.errors);
    assert!(found.summary.as_ref().unwrap()["remarks"][0].as_str().unwrap().contains("mcap sort"));
}

/// As where each chunk holds one topic.
#[test]
fn input_that_lies_out_of_order_keeps_its_times_within_each_lap() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for begin in (0..240).step_by(60).chain((0..240).step_by(60)) {
        let block = begin..begin + 60;
        block.clone().for_each(|i| writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64));
        block.for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    }
    let (bag, out) = (folder.put("blocks.mcap", &writer.finish()), folder.0.path().join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]);
    assert_eq!((found.number("scans"), found.number("sessions")), (480, 2), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let times = |topic: &str| -> Vec<u64> {
        let messages = mcap::MessageStream::new(&result).unwrap().map(Result::unwrap);
        messages.filter(|message| message.channel.topic == topic).map(|message| message.log_time).collect()
    };
    let (tf, clouds, deltas) = (times("/tf"), times(POINTS), times("/cfodi/clusters_delta"));
    assert_eq!(clouds[..240], (0..240).map(|i| stamp(i) as u64).collect::<Vec<_>>());
    assert_eq!((tf.len(), &tf), (480, &clouds));
    assert!(clouds.iter().zip(&deltas).all(|(cloud, delta)| cloud.abs_diff(*delta) < 1_000_000));
}

/// Sorting would make one map of both laps.
#[test]
fn a_lap_is_no_disorder_though_a_scan_of_it_lacks_its_transform() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in (0..100).chain(0..100) {
        if i > 0 {
            writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64);
        }
        writer.cloud(POINTS, stamp(i), &wall(i));
    }
    let found = replay(&folder.put("laps.mcap", &writer.finish()), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (198, 2), "{}", found.errors);
    assert!(!found.errors.contains("mcap sort"), "{}", found.errors);
}

#[test]
fn points_beyond_the_grid_are_said_and_counted() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    // The grid of 8 cm reaches 83 km.
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 100_000.0);
    (0..2).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    let report = folder.0.path().join("report");
    let found = replay(&folder.put("far.mcap", &writer.finish()), &["--report", report.to_str().unwrap()]);
    assert_eq!((found.status, found.number("points_beyond_grid"), found.number("voxels")), (0, 3200, 0));
    assert_eq!(found.errors.matches("1600 points of a scan lie beyond").count(), 1, "{}", found.errors);
    let account = "0 of 3200 points used (3200 beyond the grid)";
    assert!(found.errors.contains(account), "{}", found.errors);
    let page = std::fs::read_to_string(report.join("index.html")).unwrap();
    assert!(page.contains("3200 of 3200 points lay beyond the grid&#39;s reach"), "{page}");
}

#[test]
fn each_topic_of_the_input_that_the_result_has_itself_is_said_not_to_be_copied() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    (0..2).for_each(|i| writer.cloud(POINTS, stamp(i), &wall(i)));
    for topic in ["/cfodi/points_labelled", "/cfodi/markers", "/cfodi/points_labelled"] {
        writer.cloud(topic, stamp(1), &wall(1));
    }
    let (bag, out) = (folder.put("own.mcap", &writer.finish()), folder.0.path().join("out.mcap"));
    let arguments = ["--topic", POINTS, "--with-input", "--out", out.to_str().unwrap()];
    let found = replay(&bag, &arguments);
    assert_eq!((found.status, found.number("scans")), (0, 2), "{}", found.errors);
    for topic in ["/cfodi/points_labelled", "/cfodi/markers"] {
        let said = format!("{topic} of the input is not copied");
        assert_eq!(found.errors.matches(&said).count(), 1, "{topic}: {}", found.errors);
    }
}

#[cfg(unix)]
#[test]
fn an_output_goes_through_a_link_to_what_is_not_there_yet_and_two_do_not_go_to_one_file() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let [link, target] = ["link.json", "c.json"].map(|name| folder.0.path().join(name));
    std::os::unix::fs::symlink("c.json", &link).unwrap();
    let [link_text, target_text] = [&link, &target].map(|path| path.to_str().unwrap());
    let both = replay(&bag, &["--clusters", link_text, "--ply", target_text]);
    assert_eq!((both.status, target.exists()), (2, false), "{}", both.errors);
    assert!(both.errors.contains("two outputs would be written to"), "{}", both.errors);
    assert_eq!(replay(&bag, &["--clusters", link_text]).status, 0);
    assert!(link.is_symlink() && fs::symlink_metadata(&target).unwrap().is_file());
}

/// A cloud of a sensor in a frame of its own.
fn put_cloud(writer: &mut BagWriter, topic: &str, frame: &str, i: usize) {
    writer.put(topic, "sensor_msgs/msg/PointCloud2", stamp(i), &bags::cloud(stamp(i), frame, &wall(i)));
}

#[test]
fn a_sensor_without_transforms_is_refused_beside_one_that_has_them_whichever_comes_first() {
    let folder = Folder::new();
    for transforms_from in [0, 60] {
        let mut writer = BagWriter::new(Layout::Chunks);
        for i in 0..100 {
            put_cloud(&mut writer, "/a", "lonely", i);
            if i == transforms_from {
                writer.tf("/tf_static", stamp(i), "camera_link", OPTICAL, 0.0);
            }
            if i >= transforms_from {
                writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
                put_cloud(&mut writer, "/b", OPTICAL, i);
            }
        }
        let found = replay(&folder.put("two.mcap", &writer.finish()), &["--topic", "/a", "--topic", "/b"]);
        let skipped = &found.summary.as_ref().unwrap()["scans_skipped"];
        let expected = serde_json::json!({ "tf_unknown_frame": 100 });
        assert_eq!(
            (found.number("scans"), skipped),
            (100 - transforms_from as u64, &expected),
            "{}",
            found.errors
        );
        assert_eq!(found.errors.matches("no transform from lonely into map").count(), 1, "{}", found.errors);
        assert!(found.errors.contains("made in `map`, the root of the sensor's frames"), "{}", found.errors);
    }
}

/// 60 scans of a sensor below `camera_link`, and what two links are: its topic, its frames, and whether its numbers are good.
fn drive_with_links(links: [(&str, [&str; 2], bool); 2]) -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Chunks);
    for i in 0..60 {
        for (topic, [parent, child], is_good) in links {
            let mut message = bags::transform(stamp(i), parent, child, 0.1 * i as f64);
            if !is_good {
                message.transforms[0].transform.rotation.w = 0.0;
            }
            writer.put(topic, "tf2_msgs/msg/TFMessage", stamp(i), &message);
        }
        put_cloud(&mut writer, POINTS, OPTICAL, i);
    }
    writer.finish()
}

#[test]
fn a_sensor_whose_links_are_refused_or_missing_is_not_taken_to_stand_still() {
    let folder = Folder::new();
    for (links, why) in [
        ([("/tf", ["map", "base"], true), ("/tf_static", ["base", OPTICAL], false)], "no frame camera_depth"),
        ([("/tf", ["map", "base"], false), ("/tf_static", ["base", OPTICAL], true)], "no frame map has"),
        ([("/tf", ["odom", "base"], false), ("/tf_static", ["base", OPTICAL], true)], "no frame odom has"),
        ([("/tf", ["map", "base"], true), ("/tf_static", ["base", "laser"], true)], "no frame camera_depth"),
    ] {
        let found = replay(&folder.put("links.mcap", &drive_with_links(links)), &[]);
        let skipped = &found.summary.as_ref().unwrap()["scans_skipped"]["tf_unknown_frame"];
        assert_eq!((found.number("scans"), skipped), (0, &60.into()), "{links:?}: {}", found.errors);
        assert!(found.errors.contains(why), "{links:?}: {}", found.errors);
        let is_refused = links.iter().any(|link| !link.2);
        assert_eq!(found.errors.contains("a transform was refused"), is_refused, "{}", found.errors);
    }
}

#[test]
fn a_refused_link_above_the_frame_in_which_the_sensor_moves_costs_nothing() {
    let folder = Folder::new();
    let links = [("/tf", ["world", "map"], false), ("/tf", ["map", OPTICAL], true)];
    let found = replay(&folder.put("above.mcap", &drive_with_links(links)), &[]);
    assert_eq!(found.number("scans"), 60, "{}", found.errors);
    assert!(
        found.errors.contains("made in `map`, the root of the sensor's frames (choose"),
        "{}",
        found.errors
    );
    let links = [("/tf_static", ["map", "base"], true), ("/tf_static", ["base", OPTICAL], true)];
    let found = replay(&folder.put("still.mcap", &drive_with_links(links)), &[]);
    assert_eq!(found.number("scans"), 60, "{}", found.errors);
    assert!(found.errors.contains("in which no transform moves it"), "{}", found.errors);
}

#[test]
fn two_publishers_that_contradict_each_other_are_said_in_a_replay_too_and_not_without_end() {
    let folder = Folder::new();
    let links = [("/tf", ["odom", OPTICAL], true), ("/tf", ["map", OPTICAL], true)];
    let found = replay(&folder.put("two.mcap", &drive_with_links(links)), &[]);
    let said = format!("{OPTICAL} was below odom and is now below map, and its past is forgotten");
    assert_eq!(found.errors.matches(&said).count(), 2, "{}", found.errors);
}

/// Clouds of a sensor that stands still, at these stamps, one recorded each 33 ms.
fn at_stamps(stamps: impl Iterator<Item = i64>) -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for (i, stamped) in stamps.enumerate() {
        writer.put(POINTS, "sensor_msgs/msg/PointCloud2", stamp(i), &bags::cloud(stamped, OPTICAL, &wall(i)));
    }
    writer.finish()
}

#[test]
fn a_stamp_of_zero_is_refused_and_ends_no_session_but_where_time_begins_there() {
    let folder = Folder::new();
    let stray = (0..60).map(|i| if i == 40 { 0 } else { stamp(i) });
    let found = replay(&folder.put("stray.mcap", &at_stamps(stray)), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (59, 1), "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["scans_skipped"]["no_stamp"], 1, "{}", found.errors);
    assert!(found.errors.contains("a scan was skipped: its stamp is zero"), "{}", found.errors);
    let none = replay(&folder.put("none.mcap", &at_stamps((0..5).map(|_| 0))), &[]);
    assert_eq!(none.summary.as_ref().unwrap()["scans_skipped"]["no_stamp"], 5, "{}", none.errors);
    let simulated = (0..60).chain(0..3).map(|i| stamp(i) - stamp(0));
    let found = replay(&folder.put("simulated.mcap", &at_stamps(simulated)), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (63, 2), "{}", found.errors);
}

#[test]
fn a_camera_info_that_comes_late_is_looked_for_ahead() {
    let folder = Folder::new();
    let record = |info_at: usize, is_readable: bool| {
        let mut writer = BagWriter::new(Layout::Chunks);
        writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
        for i in 0..30 {
            if i == info_at {
                let k = [50.0, 0.0, 20.0, 0.0, 50.0, 20.0, 0.0, 0.0, 1.0];
                let info = CameraInfo { width: 40, height: 40, k, d: vec![0.1], ..CameraInfo::default() };
                let (topic, type_name) = ("/depth/camera_info", "sensor_msgs/msg/CameraInfo");
                if is_readable {
                    writer.put(topic, type_name, stamp(i), &info);
                } else {
                    writer.put_bytes(topic, type_name, stamp(i), &[0, 1, 0, 0, 9]);
                }
            }
            let image = Image {
                header: bags::header(stamp(i), OPTICAL),
                height: 40,
                width: 40,
                encoding: "16UC1".to_owned(),
                is_bigendian: 0,
                step: 80,
                data: [208, 7].repeat(1600),
            };
            writer.put("/depth/image", "sensor_msgs/msg/Image", stamp(i), &image);
        }
        replay(&folder.put("depth.mcap", &writer.finish()), &[])
    };
    let (early, late, none) = (record(0, true), record(25, true), record(25, false));
    assert_eq!((early.number("scans"), late.number("scans")), (30, 30), "{}", late.errors);
    assert_eq!(early.voxels, late.voxels);
    assert_eq!(late.errors.matches("tells of lens distortion").count(), 1, "{}", late.errors);
    let skipped = &none.summary.as_ref().unwrap()["scans_skipped"];
    assert_eq!(skipped, &serde_json::json!({ "no_camera_info": 30 }), "{}", none.errors);
}
