//! The frame of the map: given, found, or guessed.

use std::fs;

use cfodi::msg::ros::{Quaternion, TfMessage};
use serde_json::Value;

use crate::bags::{self, BagWriter, Layout, OPTICAL, POINTS, drive, late_odom, stamp, wall};
use crate::{Folder, Replayed, cfodi, put_cloud, replay};

#[test]
fn a_static_transform_may_come_last_and_a_cloud_before_its_transform() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    for i in 0..30 {
        writer.scan(i);
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
    }
    writer.tf("/tf_static", stamp(29), "camera_link", OPTICAL, 0.0);
    let late = replay(&folder.put("late.mcap", &writer.finish()), &["--ros-args", "-p", "fixed_frame:=map"]);
    let early = replay(&folder.put("early.mcap", &drive(BagWriter::new(Layout::Plain), 30)), &[]);
    assert_eq!((late.status, late.number("scans")), (0, 30), "{}", late.errors);
    assert_eq!(late.voxels, early.voxels);
}

#[test]
fn clouds_whose_frame_is_no_sensors_are_warned_of() {
    let folder = Folder::new();
    let bag = |frame: &str| {
        let mut writer = BagWriter::new(Layout::Plain);
        for i in 0..12 {
            writer.tf("/tf", stamp(i), "odom", "base_link", 0.1 * i as f64);
            writer.tf("/tf", stamp(i), "base_link", OPTICAL, 0.0);
            put_cloud(&mut writer, POINTS, frame, i);
        }
        writer.finish()
    };
    let said = "clouds come in `odom`, so that nobody knows where the sensor stood";
    let found = replay(&folder.put("registered.mcap", &bag("odom")), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
    assert!(found.errors.contains(said), "{}", found.errors);
    assert!(found.summary.as_ref().unwrap()["remarks"][0].as_str().unwrap().contains(said));
    let found = replay(&folder.put("driver.mcap", &bag(OPTICAL)), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
    assert!(!found.errors.contains(said), "{}", found.errors);
    // The robot's, which moves itself.
    for frame in ["base_link", "robot1/base_footprint"] {
        let mut writer = BagWriter::new(Layout::Plain);
        for i in 0..12 {
            writer.tf("/tf", stamp(i), "odom", frame, 0.1 * i as f64);
            put_cloud(&mut writer, POINTS, frame, i);
        }
        let found = replay(&folder.put("robot.mcap", &writer.finish()), &[]);
        assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
        assert!(found.errors.contains(&said.replace("odom", frame)), "{}", found.errors);
    }
    // Above the fixed frame, and a map between that one and what moves.
    for (frame, fixed_frame) in [("odom", "base_link"), ("odom", "map")] {
        let mut writer = BagWriter::new(Layout::Plain);
        for i in 0..12 {
            writer.tf("/tf", stamp(i), "map", "odom", 0.0);
            writer.tf("/tf", stamp(i), "odom", "base_link", 0.1 * i as f64);
            put_cloud(&mut writer, POINTS, frame, i);
        }
        let given = ["--ros-args", "-p", &format!("fixed_frame:={fixed_frame}")];
        let found = replay(&folder.put("others.mcap", &writer.finish()), &given);
        assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
        assert!(found.errors.contains(said), "{frame} in {fixed_frame}: {}", found.errors);
    }
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
            writer.scan(i);
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
    let found = replay(&bag, &["--ros-args", "-r", "/tf:=/robot2/tf"]);
    assert!(found.status == 2 && found.summary.is_none(), "{}", found.errors);
    assert!(found.errors.contains("the bag has no transforms on /robot2/tf, from which"), "{}", found.errors);
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
        writer.scan(i);
    }
    let bag = folder.put("two.mcap", &writer.finish());
    let found = replay(&bag, &[]);
    assert!(found.status == 2 && found.summary.is_none(), "{}", found.errors);
    for robot in ["/robot1", "/robot2"] {
        let choice = format!("-r /tf:={robot}/tf -r /tf_static:={robot}/tf_static");
        assert!(found.errors.contains(&choice), "{}", found.errors);
    }
    // A frame that is none of a sensor's own needs them too, given or not.
    let given = replay(&bag, &["--ros-args", "-p", "fixed_frame:=map"]);
    assert_eq!((given.status, given.errors.lines().last()), (2, found.errors.lines().last()));
    assert!(given.summary.is_none(), "{}", given.errors);
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

/// A bag that was thinned out, or whose times of recording stand still; the frame is guessed, or the camera is placed at the end.
#[test]
fn transforms_are_not_forgotten_while_seldom_clouds_wait_for_what_can_be_found_out() {
    const EVERY: usize = 60;
    let folder = Folder::new();
    let record = |static_at: usize, moves: bool| {
        let mut writer = BagWriter::new(Layout::Chunks);
        let link = "tf2_msgs/msg/TFMessage";
        for i in 0..=600 {
            let recorded = stamp(if moves { i } else { 0 });
            if i == static_at {
                writer.put(
                    "/tf_static",
                    link,
                    recorded,
                    &bags::transform(stamp(i), "camera_link", OPTICAL, 0.0),
                );
            }
            let odometry = bags::transform(stamp(i), "map", "camera_link", 0.01 * i as f64);
            writer.put("/tf", link, recorded, &odometry);
            if i % EVERY == 0 {
                let cloud = bags::cloud(stamp(i), OPTICAL, &wall(i));
                writer.put(POINTS, "sensor_msgs/msg/PointCloud2", recorded, &cloud);
            }
        }
        folder.put("seldom.mcap", &writer.finish())
    };
    let given = ["--ros-args", "-p", "fixed_frame:=map"];
    let patient = ["--ros-args", "-p", "tf_timeout:=60.0"];
    let expected = replay(&record(0, true), &given);
    for (static_at, moves, more) in [
        (0, true, &[][..]),
        (0, true, &patient),
        (0, false, &[]),
        (600, true, &[]),
        (600, true, &given),
        (600, false, &given),
    ] {
        let found = replay(&record(static_at, moves), more);
        assert_eq!(
            (found.status, found.number("scans")),
            (0, 11),
            "{static_at} {moves} {more:?}: {}",
            found.errors
        );
        assert_eq!(found.voxels, expected.voxels, "{static_at} {moves} {more:?}");
    }
}

#[test]
fn the_default_frame_is_taken_where_the_bag_has_it_and_the_root_is_named_where_not() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..12 {
        writer.scan(i);
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
fn without_any_transform_the_sensor_stands_still_and_that_is_said() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    (0..3).for_each(|i| writer.scan(i));
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
        (0..30).for_each(|i| writer.scan(i));
        writer.finish()
    };
    let expected = replay(&folder.put("told.mcap", &record(&[body_to_optical()])), &[]);
    let [out, clusters] = ["r.mcap", "c.json"].map(|name| folder.join(name));
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
        found
            .errors
            .contains("frames seen: map, and 2 that move with the sensor (choose with -p fixed_frame:=...)"),
        "{}",
        found.errors
    );
}

#[test]
fn a_static_transform_that_comes_late_shows_the_frame_too() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 0..60 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.scan(i);
        if i == 45 {
            writer.tf("/tf_static", stamp(i), "camera_link", OPTICAL, 0.0);
        }
    }
    let late =
        replay(&folder.put("late.mcap", &writer.finish()), &["--report", folder.path().to_str().unwrap()]);
    let early = replay(&folder.put("early.mcap", &drive(BagWriter::new(Layout::Plain), 60)), &[]);
    assert_eq!((late.status, late.number("scans")), (0, 60), "{}", late.errors);
    assert!(late.errors.contains("made in `map`"), "{}", late.errors);
    assert!(!late.errors.contains("reading begins again"), "the frame is looked for ahead: {}", late.errors);
    assert_eq!(late.voxels, early.voxels);
}

#[test]
fn poses_that_all_lie_behind_the_clouds_are_looked_for_before_a_frame_is_guessed() {
    let folder = Folder::new();
    for is_mounted in [true, false] {
        let mut writer = BagWriter::new(Layout::Chunks);
        let mount = |writer: &mut BagWriter| writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
        if is_mounted {
            mount(&mut writer);
        }
        (0..60).for_each(|i| writer.scan(i));
        (0..60).for_each(|i| writer.tf("/tf", stamp(i), "odom", "camera_link", 0.1 * i as f64));
        if !is_mounted {
            mount(&mut writer);
        }
        let found = replay(&folder.put("behind.mcap", &writer.finish()), &[]);
        assert_eq!((found.status, found.number("scans")), (0, 60), "{}", found.errors);
        assert!(!found.errors.contains("reading begins again"), "{}", found.errors);
        assert!(found.errors.contains(" in frame odom:"), "{}", found.errors);
    }
}

#[test]
fn a_sensor_stands_still_where_a_topic_of_transforms_has_none() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    for i in 0..12 {
        writer.put("/tf", "tf2_msgs/msg/TFMessage", stamp(i), &TfMessage::default());
        writer.scan(i);
    }
    let found = replay(&folder.put("nothing.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 12), "{}", found.errors);
    assert!(found.errors.contains("so it is taken to look straight ahead"), "{}", found.errors);
}

#[test]
fn a_default_frame_that_begins_late_is_still_the_default() {
    let folder = Folder::new();
    let bag = folder.put("odom.mcap", &late_odom());
    let (open, given) = (replay(&bag, &[]), replay(&bag, &["--ros-args", "-p", "fixed_frame:=odom"]));
    assert_eq!((open.number("scans"), given.number("scans")), (20, 20), "{}", open.errors);
    assert_eq!(open.voxels, given.voxels);
    assert!(!open.errors.contains("has no frame `odom`"), "{}", open.errors);
    assert!(open.errors.contains("reading begins again"), "{}", open.errors);
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
