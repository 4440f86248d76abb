//! Trees of frames that no robot has, and links that are missing or refused.

use crate::bags::{self, BagWriter, Layout, OPTICAL, POINTS, drive, stamp, wall};
use crate::{Folder, put_cloud, replay};

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
        writer.scan(i);
    }
    let found = replay(&folder.put("circle.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 20), "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["transforms_refused"]["cycle"], 1, "{}", found.errors);
    assert_eq!(found.voxels, expected.voxels, "{}", found.errors);
    assert!(found.errors.contains("made in `map`, the root of the sensor's frames"), "{}", found.errors);
    assert!(!found.errors.contains("reading begins again"), "{}", found.errors);
}

#[test]
fn a_refused_transform_costs_no_other_of_its_message() {
    let folder = Folder::new();
    let expected = replay(&folder.put("plain.mcap", &drive(BagWriter::new(Layout::Plain), 20)), &[]);
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..20 {
        let mut message = bags::transform(stamp(i), "map", "arm", f64::NAN);
        message.transforms.extend(bags::transform(stamp(i), "map", "camera_link", 0.1 * i as f64).transforms);
        writer.put("/tf", "tf2_msgs/msg/TFMessage", stamp(i), &message);
        writer.scan(i);
    }
    let found = replay(&folder.put("refused.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 20), "{}", found.errors);
    let refused = &found.summary.as_ref().unwrap()["transforms_refused"]["non_finite"];
    assert_eq!(refused, 20, "{}", found.errors);
    assert_eq!(found.voxels, expected.voxels, "{}", found.errors);
}

#[test]
fn a_chain_of_frames_that_grows_is_read_twice_at_most() {
    let folder = Folder::new();
    // Where something has moved the sensor the frame is guessed, and else looked for behind the clouds.
    for (is_moved, readings) in [(true, 2), (false, 1)] {
        let mut writer = BagWriter::new(Layout::Plain);
        for i in 0..40 {
            if is_moved {
                writer.tf("/tf", stamp(i), "f0", OPTICAL, 0.1 * i as f64);
            }
            writer.scan(i);
        }
        for i in 0..100 {
            let (parent, child) =
                (format!("f{}", i + 1), if i > 0 || is_moved { format!("f{i}") } else { OPTICAL.to_owned() });
            writer.tf("/tf_static", stamp(40), &parent, &child, 0.0);
        }
        let found = replay(&folder.put("chain.mcap", &writer.finish()), &[]);
        assert_eq!((found.status, found.number("scans")), (0, 40), "{}", found.errors);
        assert_eq!(found.errors.matches("reading begins again").count() + 1, readings, "{}", found.errors);
        assert!(found.errors.contains("made in `f100`"), "{}", found.errors);
        let forgotten = found.errors.contains("its past is forgotten");
        assert!(!forgotten, "the guess was no publisher: {}", found.errors);
    }
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

#[test]
fn a_static_transform_that_another_one_contradicts_is_said_in_a_replay_and_one_that_is_sent_again_is_not() {
    let folder = Folder::new();
    let replayed = |x: f64| {
        let mut writer = BagWriter::new(Layout::Plain);
        writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
        writer.tf("/tf_static", stamp(1), "camera_link", OPTICAL, x);
        replay(&folder.put("statics.mcap", &drive(writer, 12)), &[])
    };
    let said = format!(
        "the static transform of {OPTICAL} below camera_link is another than before, by 1.000 m and 0.000 rad"
    );
    let (same, other) = (replayed(0.0), replayed(1.0));
    assert!(!same.errors.contains("another than before"), "{}", same.errors);
    assert_eq!(other.errors.matches(&said).count(), 2, "there and back: {}", other.errors);
}
