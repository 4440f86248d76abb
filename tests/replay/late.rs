//! Transforms that lie far behind the clouds they place: poses that were found after the drive and merged into its bag.

use crate::bags::{self, BagWriter, Layout, OPTICAL, ends_of_clouds, stamp, wall};
use crate::{Folder, Replayed, replay};

/// Clouds of a drive: more than may wait.
const CLOUDS: usize = 150;

/// The edges that lead from the map to the camera, and how far they move from cloud to cloud (m).
const EDGES: [(&str, &str, f64); 2] = [("map", "odom", 0.02), ("odom", "base", 0.1)];

/// A drive whose edges of these children lie behind all else; of `map` to `odom` each scan in `lacks` has no transform.
fn bag(late: &[&str], lacks: std::ops::Range<usize>) -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "base", OPTICAL, 0.0);
    let is_there = |child: &str, i: usize| child != "odom" || !lacks.contains(&i);
    for i in 0..CLOUDS {
        for (parent, child, step) in EDGES {
            if !late.contains(&child) && is_there(child, i) {
                writer.tf("/tf", stamp(i), parent, child, step * i as f64);
            }
        }
        writer.scan(i);
    }
    for i in 0..CLOUDS {
        for (parent, child, step) in EDGES {
            if late.contains(&child) && is_there(child, i) {
                writer.tf("/tf", stamp(i), parent, child, step * i as f64);
            }
        }
    }
    writer.finish()
}

fn replayed(bag: &[u8]) -> Replayed {
    replay(&Folder::new().put("a.mcap", bag), &["--ros-args", "-p", "fixed_frame:=map"])
}

#[test]
fn poses_that_lie_behind_all_clouds_place_each() {
    let expected = replayed(&bag(&[], 0..0));
    assert_eq!((expected.status, expected.number("scans")), (0, CLOUDS as u64), "{}", expected.errors);
    assert!(!expected.errors.contains("before their turn"), "{}", expected.errors);
    for late in [&["odom"][..], &["base"], &["odom", "base"]] {
        let found = replayed(&bag(late, 0..0));
        assert_eq!((found.status, found.number("scans")), (0, CLOUDS as u64), "{late:?}: {}", found.errors);
        assert!(found.voxels == expected.voxels, "{late:?}: another map");
        for frame in late {
            let said = format!("transforms of `{frame}` lie far behind the clouds in the bag");
            assert!(found.errors.contains(&said), "{late:?}: {}", found.errors);
        }
    }
}

#[test]
fn the_frame_is_found_where_all_poses_lie_behind_all_clouds() {
    let folder = Folder::new();
    let found = replay(&folder.put("a.mcap", &bag(&["odom", "base"], 0..0)), &[]);
    assert_eq!((found.status, found.number("scans")), (0, CLOUDS as u64), "{}", found.errors);
}

#[test]
fn over_a_gap_of_seconds_no_cloud_is_placed_that_would_not_have_waited_for_its_end() {
    let lacks = 20..100;
    let beside = replayed(&bag(&[], lacks.clone()));
    let behind = replayed(&bag(&["odom"], lacks));
    for found in [&beside, &behind] {
        assert!(found.errors.contains("0.033000 s after the range covered by odom"), "{}", found.errors);
        assert!(found.errors.contains("see tf_timeout"), "{}", found.errors);
        let (least, waited) = (CLOUDS as u64 - 80, 1000 / 33 + 2);
        assert!((least..=least + waited).contains(&found.number("scans")), "{}", found.errors);
    }
}

#[test]
fn of_what_waits_at_the_end_no_longer_wait_is_advised() {
    let found = replayed(&bag(&[], CLOUDS - 10..CLOUDS));
    assert_eq!((found.status, found.number("scans")), (0, CLOUDS as u64 - 10), "{}", found.errors);
    assert!(found.errors.contains("s after the range covered by odom"), "{}", found.errors);
    assert!(!found.errors.contains("tf_timeout"), "{}", found.errors);
}

#[test]
fn what_begins_late_places_no_cloud_from_before_its_first_stamp() {
    let found = replayed(&bag(&["odom"], 0..100));
    assert_eq!((found.status, found.number("scans")), (0, CLOUDS as u64 - 100), "{}", found.errors);
}

/// More than the time (33 ms each) over which transforms are remembered.
const LONG: usize = 400;

#[test]
fn a_cloud_from_before_the_first_transform_is_that_much_too_early_however_long_it_has_waited() {
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "base", OPTICAL, 0.0);
    writer.scan(0);
    for i in 1..LONG {
        writer.tf("/tf", stamp(i), "map", "base", 0.01 * i as f64);
        writer.scan(i);
    }
    let found = replayed(&writer.finish());
    assert_eq!((found.status, found.number("scans")), (0, LONG as u64 - 1), "{}", found.errors);
    assert!(found.errors.contains("0.033000 s before the range covered by base"), "{}", found.errors);
}

#[test]
fn a_sensor_whose_clock_is_an_hour_ahead_takes_no_transform_from_another() {
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "base", OPTICAL, 0.0);
    for i in 0..LONG {
        writer.tf("/tf", stamp(i), "map", "base", 0.01 * i as f64);
        writer.cloud("/left", stamp(i), &wall(i));
        let ahead = bags::cloud(stamp(i) + 3_600_000_000_000, OPTICAL, &wall(i));
        writer.put("/right", "sensor_msgs/msg/PointCloud2", stamp(i), &ahead);
    }
    let bag = Folder::new();
    let found = replay(&bag.put("a.mcap", &writer.finish()), &["--topic", "/left", "--topic", "/right"]);
    let skipped = &found.summary.as_ref().unwrap()["scans_skipped"];
    assert_eq!(skipped, &serde_json::json!({ "tf_too_late": LONG }), "{}", found.errors);
    assert_eq!((found.status, found.number("scans")), (0, LONG as u64), "{}", found.errors);
    assert!(!found.errors.contains("before their turn"), "{}", found.errors);
}

#[test]
fn what_is_read_ahead_is_the_same_from_run_to_run_and_for_a_cut_bag() {
    let folder = Folder::new();
    let whole = bag(&["odom"], 0..0);
    let cut = ends_of_clouds(&whole).last().unwrap() + 8000;
    let cut = folder.put("cut.mcap", &whole[..cut]);
    let [first, second] = [(); 2].map(|()| replay(&cut, &["--ros-args", "-p", "fixed_frame:=map"]));
    assert!((20..CLOUDS as u64).contains(&first.number("scans")), "{}", first.errors);
    assert!(first.voxels == second.voxels, "another map");
}
