//! Stamps that jump back, and messages out of order.

use std::fs;

use crate::bags::{self, BagWriter, Layout, OPTICAL, POINTS, drive, drive_along, stamp, wall};
use crate::{Folder, cfodi, replay};

#[test]
fn an_experiment_ends_where_stamps_jump_back_counts_what_it_leaves_out_and_has_status_1() {
    let folder = Folder::new();
    let lap = || (0..60).step_by(6);
    let laps = drive_along(BagWriter::new(Layout::Plain), lap().chain(lap()));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.join("figures"));
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
    let report = folder.join("report");
    let looped = replay(&folder.put("loop.mcap", &laps), &["--report", report.to_str().unwrap()]);
    let once = replay(&folder.put("once.mcap", &drive(BagWriter::new(Layout::Plain), 3)), &[]);
    assert_eq!((looped.number("scans"), looped.number("sessions")), (63, 2), "{}", looped.errors);
    assert_eq!(looped.voxels, once.voxels);
    // All figures of the report are of what it shows.
    let page = fs::read_to_string(report.join("index.html")).unwrap();
    for figure in ["scans taken in</dt><dd>3<", "points used</dt><dd>4\u{202f}800<", "recorded</dt><dd>0.07<"]
    {
        assert!(page.contains(figure), "{figure}");
    }
}

#[test]
fn where_messages_lie_out_of_order_and_transforms_are_missing_for_it_that_is_said() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    let scans = 0..450;
    scans.clone().for_each(|i| writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64));
    scans.step_by(30).for_each(|i| writer.scan(i));
    let found = replay(&folder.put("unsorted.mcap", &writer.finish()), &[]);
    let skipped = found.summary.as_ref().unwrap()["scans_skipped"]["tf_too_early"].as_u64().unwrap();
    assert_eq!((found.status, found.number("scans") + skipped), (0, 15), "{}", found.errors);
    assert!(skipped > 0 && found.errors.contains("up to 14.8 s out of the order"), "{}", found.errors);
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
        writer.scan(i);
    }
    let found = replay(&folder.put("shuffled.mcap", &writer.finish()), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (3, 3), "{}", found.errors);
    assert!(found.errors.contains("up to 3.3 s out of the order"), "{}", found.errors);
    assert!(found.summary.as_ref().unwrap()["remarks"][0].as_str().unwrap().contains("mcap sort"));
}

/// Of a bag in which a part of the scans was put behind the others, and the transforms were not.
#[test]
fn scans_that_lie_behind_later_ones_are_a_disorder_though_their_transforms_are_there() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..120 {
        writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64);
        if i >= 60 {
            writer.scan(i);
        }
    }
    (0..60).for_each(|i| writer.scan(i));
    let found = replay(&folder.put("behind.mcap", &writer.finish()), &[]);
    let skipped = &found.summary.as_ref().unwrap()["scans_skipped"];
    assert_eq!(found.number("sessions"), 1, "{}", found.errors);
    assert!(skipped["tf_not_jumped_back"].as_u64().unwrap() > 30, "{skipped}");
    assert!(found.errors.contains("`mcap sort` helps"), "{}", found.errors);
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
        writer.scan(i);
    }
    let found = replay(&folder.put("laps.mcap", &writer.finish()), &[]);
    assert_eq!((found.number("scans"), found.number("sessions")), (198, 2), "{}", found.errors);
    assert!(!found.errors.contains("mcap sort"), "{}", found.errors);
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
