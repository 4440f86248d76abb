//! Which topics are taken, and several sensors in one map.

use cfodi::msg::ros::{CameraInfo, Image};

use crate::bags::{self, BagWriter, Layout, OPTICAL, stamp, wall};
use crate::{Folder, replay};

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
            writer.scan(i);
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
    let one = replay(&bag, &["--topic", "/left", "--ros-args", "-p", "sensors:=[left, right]"]);
    assert_eq!(one.number("scans"), 4, "{}", one.errors);
    assert!(one.errors.contains("reading /left (not /right: choose with --topic)"), "{}", one.errors);
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
fn a_camera_info_that_comes_late_is_looked_for_ahead() {
    let folder = Folder::new();
    let record = |topic: &str, info_at: usize, frame: &str, is_readable: bool| {
        let mut writer = BagWriter::new(Layout::Chunks);
        writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
        for i in 0..30 {
            if i == info_at {
                let k = [50.0, 0.0, 20.0, 0.0, 50.0, 20.0, 0.0, 0.0, 1.0];
                let header = bags::header(stamp(i), frame);
                let info =
                    CameraInfo { header, width: 40, height: 40, k, d: vec![0.1], ..CameraInfo::default() };
                let (beside, type_name) = ("/depth/camera_info", "sensor_msgs/msg/CameraInfo");
                if is_readable {
                    writer.put(beside, type_name, stamp(i), &info);
                } else {
                    writer.put_bytes(beside, type_name, stamp(i), &[0, 1, 0, 0, 9]);
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
            writer.put(topic, "sensor_msgs/msg/Image", stamp(i), &image);
        }
        replay(&folder.put("depth.mcap", &writer.finish()), &[])
    };
    let plain = "/depth/image";
    let (early, late, none) =
        (record(plain, 0, OPTICAL, true), record(plain, 25, "", true), record(plain, 25, OPTICAL, false));
    assert_eq!((early.number("scans"), late.number("scans")), (30, 30), "{}", late.errors);
    assert_eq!(early.voxels, late.voxels);
    assert_eq!(late.errors.matches("tells of lens distortion").count(), 1, "{}", late.errors);
    let rectified = record("/depth/image_rect", 0, OPTICAL, true);
    assert_eq!((rectified.number("scans"), rectified.errors.contains("distortion")), (30, false));
    let skipped = &none.summary.as_ref().unwrap()["scans_skipped"];
    assert_eq!(skipped, &serde_json::json!({ "no_camera_info": 30 }), "{}", none.errors);
    let words = format!(
        "images of {plain} are in frame `{OPTICAL}`, their intrinsics on /depth/camera_info in `colour`"
    );
    let said = [early, late, record(plain, 0, "colour", true)].map(|run| run.errors.matches(&words).count());
    assert_eq!(said, [0, 0, 1], "intrinsics of the same frame, of one that is not told, and of another");
}
