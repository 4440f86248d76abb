//! When and what a result bag has of its input.

use std::fs;

use crate::bags::{self, BagWriter, Layout, OPTICAL, POINTS, drive_along, stamp, wall};
use crate::{Folder, replay};

/// When the messages on a topic of a bag are logged, in the order of the file.
fn times(bag: &[u8], topic: &str) -> Vec<u64> {
    let messages = mcap::MessageStream::new(bag).unwrap().map(Result::unwrap);
    messages.filter(|message| message.channel.topic == topic).map(|message| message.log_time).collect()
}

const DELTAS: &str = "/cfodi/clusters_delta";

#[test]
fn each_lap_is_a_session_of_its_own_in_the_result_bag_and_plays_after_the_one_before() {
    let folder = Folder::new();
    let laps = drive_along(BagWriter::new(Layout::Plain), (0..60).chain(0..60));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap()]);
    assert_eq!((found.status, found.number("sessions")), (0, 2), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let mut deltas = Vec::new();
    for message in mcap::MessageStream::new(&result).unwrap().map(Result::unwrap) {
        if message.channel.topic == DELTAS {
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
fn the_transforms_of_each_lap_are_played_with_its_clusters() {
    let folder = Folder::new();
    let laps = drive_along(BagWriter::new(Layout::Plain), (0..60).chain(0..60));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.join("out.mcap"));
    assert_eq!(replay(&bag, &["--out", out.to_str().unwrap()]).status, 0);
    let result = fs::read(&out).unwrap();
    let (tf, deltas) = (times(&result, "/tf"), times(&result, DELTAS));
    assert_eq!(tf.len(), 120);
    assert!(tf.is_sorted() && tf.iter().zip(&deltas).all(|(tf, delta)| tf.abs_diff(*delta) < 50_000_000));
}

/// In a second lap too, whose messages are logged after those of the first.
#[test]
fn copied_messages_keep_their_numbers_and_how_long_they_took() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.lag = 7_000_000;
    let laps = drive_along(writer, (0..60).chain(0..60));
    let (bag, out) = (folder.put("laps.mcap", &laps), folder.join("out.mcap"));
    assert_eq!(replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]).number("sessions"), 2);
    let result = fs::read(&out).unwrap();
    for topic in [POINTS, "/tf"] {
        let numbers = |bag: &[u8]| -> Vec<u32> {
            let messages = mcap::MessageStream::new(bag).unwrap().map(Result::unwrap);
            let of_topic = messages.filter(|message| message.channel.topic == topic);
            of_topic
                .inspect(|it| assert_eq!(it.log_time - it.publish_time, 7_000_000))
                .map(|it| it.sequence)
                .collect()
        };
        assert_eq!(numbers(&result), numbers(&laps), "{topic}");
    }
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
    let (bag, out) = (folder.put("sim.mcap", &writer.finish()), folder.join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]);
    assert_eq!((found.status, found.number("scans")), (0, 199), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let of = |topic: &str| times(&result, topic);
    let (clouds, deltas) = (of(POINTS), of(DELTAS));
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
    let (bag, out) = (folder.put("late.mcap", &writer.finish()), folder.join("out.mcap"));
    assert_eq!(replay(&bag, &["--out", out.to_str().unwrap()]).number("scans"), 55);
    let result = fs::read(&out).unwrap();
    assert_eq!(times(&result, "/tf"), (0..100).map(|i| stamp(i) as u64).collect::<Vec<_>>());
}

/// Two publishers on `/tf`, one of them recorded 1.5 s late; and a message that nobody reads, which comes 1.5 s late.
#[test]
fn messages_out_of_order_move_no_other_where_no_session_begins() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    let link = "tf2_msgs/msg/TFMessage";
    let late = |i: usize| stamp(i) - 1_500_000_000;
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    let mut tf = Vec::new();
    for i in 0..120 {
        writer.tf("/tf", stamp(i), "odom", "camera_link", 0.01 * i as f64);
        writer.put("/tf", link, late(i), &bags::transform(stamp(i), "odom", "other", 0.0));
        tf.extend([stamp(i), late(i)].map(i64::cast_unsigned));
        if i == 60 {
            writer.put("/chatter", "std_msgs/msg/String", late(i), &"hello");
        }
        writer.scan(i);
    }
    let (bag, out) = (folder.put("late.mcap", &writer.finish()), folder.join("out.mcap"));
    for more in [&["--with-input"][..], &[]] {
        let found = replay(&bag, &[&["--out", out.to_str().unwrap()], more].concat());
        assert_eq!((found.number("scans"), found.number("sessions")), (120, 1), "{}", found.errors);
        let result = fs::read(&out).unwrap();
        assert_eq!(times(&result, "/tf"), tf);
        if !more.is_empty() {
            assert_eq!(times(&result, "/chatter"), [late(60) as u64]);
            assert_eq!(times(&result, POINTS), times(&result, DELTAS));
        }
    }
}

/// As a player in a loop is recorded, with a pause before each lap; and where the times of recording jump back as well.
#[test]
fn results_and_input_of_each_lap_lie_to_each_other_as_in_the_first() {
    let folder = Folder::new();
    for pause in [Some(165), None] {
        let mut writer = BagWriter::new(Layout::Chunks);
        writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
        for (lap, i) in (0..3).flat_map(|lap| (0..60).map(move |i| (lap, i))) {
            // Some milliseconds pass until a message is recorded, and transforms go on behind the last scan.
            let recorded = stamp(i + lap * pause.unwrap_or(0)) + 7_000_000;
            let link = bags::transform(stamp(i), "odom", "camera_link", 0.01 * i as f64);
            writer.put("/tf", "tf2_msgs/msg/TFMessage", recorded, &link);
            if i < 50 {
                let cloud = bags::cloud(stamp(i), OPTICAL, &wall(i));
                writer.put(POINTS, "sensor_msgs/msg/PointCloud2", recorded, &cloud);
            }
        }
        let (bag, out) = (folder.put("loop.mcap", &writer.finish()), folder.join("out.mcap"));
        let found = replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]);
        assert_eq!((found.number("scans"), found.number("sessions")), (150, 3), "{}", found.errors);
        let result = fs::read(&out).unwrap();
        let (tf, clouds, deltas) = (times(&result, "/tf"), times(&result, POINTS), times(&result, DELTAS));
        assert!(tf.is_sorted() && clouds.is_sorted() && deltas.is_sorted());
        assert_eq!(clouds, deltas.iter().map(|time| time + 7_000_000).collect::<Vec<_>>());
        let with_a_cloud = tf.chunks(60).flat_map(|lap| lap[..50].to_vec());
        assert_eq!(clouds, with_a_cloud.collect::<Vec<_>>());
        if pause.is_some() {
            assert_eq!([50, 100].map(|i| clouds[i] - clouds[0]), [1, 2].map(|lap| lap * 165 * 33_000_000));
        }
    }
}

/// In it each scan is placed as it comes.
const IN_MAP: [&str; 3] = ["--ros-args", "-p", "fixed_frame:=map"];

/// A camera's topic whose clock is an hour ahead of that of the clouds on [`POINTS`].
const AHEAD: &str = "/ahead/points";

/// How far (ns).
const HOUR: i64 = 3_600_000_000_000;

fn put_ahead(writer: &mut BagWriter, i: usize, recorded: i64) {
    let cloud = bags::cloud(stamp(i) + HOUR, OPTICAL, &wall(i));
    writer.put(AHEAD, "sensor_msgs/msg/PointCloud2", recorded, &cloud);
}

/// Whichever of the two comes first in each lap, and whether or not the times of recording jump back as well.
#[test]
fn results_of_a_lap_come_after_those_of_the_one_before_though_the_clocks_of_two_sensors_differ() {
    let folder = Folder::new();
    let firsts = [[false; 3], [true; 3], [false, true, false]];
    for (pause, begins_ahead) in firsts.into_iter().flat_map(|laps| [(165, laps), (0, laps)]) {
        let mut writer = BagWriter::new(Layout::Chunks);
        writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
        for (lap, i) in (0..3).flat_map(|lap| (0..60).map(move |i| (lap, i))) {
            let recorded = stamp(i + lap * pause);
            for is_ahead in [begins_ahead[lap], !begins_ahead[lap]] {
                if !is_ahead {
                    let cloud = bags::cloud(stamp(i), OPTICAL, &wall(i));
                    writer.put(POINTS, "sensor_msgs/msg/PointCloud2", recorded, &cloud);
                } else if i % 3 == 0 {
                    put_ahead(&mut writer, i, recorded);
                }
            }
        }
        let (bag, out) = (folder.put("loop.mcap", &writer.finish()), folder.join("out.mcap"));
        let more = ["--topic", POINTS, "--topic", AHEAD, "--with-input", "--out", out.to_str().unwrap()];
        let found = replay(&bag, &[&more[..], &IN_MAP].concat());
        let case = format!("pause {pause}, begins with the one ahead: {begins_ahead:?}: {}", found.errors);
        assert_eq!((found.number("scans"), found.number("sessions")), (240, 3), "{case}");
        let result = fs::read(&out).unwrap();
        for topic in [DELTAS, "/cfodi/clusters", "/diagnostics"] {
            assert!(times(&result, topic).is_sorted(), "{topic}, {case}");
        }
        // Its first cloud is the first or second of a lap, and from then on results are logged by its clock.
        let (clouds, deltas) = (times(&result, AHEAD), times(&result, DELTAS));
        let apart = [0, 1, 2].map(|lap| deltas[80 * lap + 1].abs_diff(clouds[20 * lap]));
        assert_eq!(apart, [HOUR as u64; 3], "{case}");
    }
}

/// The other sensor sends one cloud, an hour ahead.
#[test]
fn snapshots_and_reports_go_on_while_the_newest_stamp_stands_still() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    put_ahead(&mut writer, 0, stamp(0));
    (0..150).for_each(|i| writer.scan(i));
    let (bag, out) = (folder.put("a.mcap", &writer.finish()), folder.join("out.mcap"));
    let more = ["--topic", POINTS, "--topic", AHEAD, "--out", out.to_str().unwrap()];
    let found = replay(&bag, &[&more[..], &IN_MAP].concat());
    assert_eq!((found.number("scans"), found.number("sessions")), (151, 1), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    // With the first scan, and of the 3.9 s from a second later on two snapshots and one report a second; the snapshot of the end.
    assert_eq!([times(&result, "/cfodi/clusters").len(), times(&result, "/diagnostics").len()], [9, 4]);
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
        block.for_each(|i| writer.scan(i));
    }
    let (bag, out) = (folder.put("blocks.mcap", &writer.finish()), folder.join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap(), "--with-input"]);
    assert_eq!((found.number("scans"), found.number("sessions")), (480, 2), "{}", found.errors);
    let result = fs::read(&out).unwrap();
    let (tf, clouds, deltas) = (times(&result, "/tf"), times(&result, POINTS), times(&result, DELTAS));
    assert_eq!(clouds[..240], (0..240).map(|i| stamp(i) as u64).collect::<Vec<_>>());
    assert_eq!((tf.len(), &tf), (480, &clouds));
    assert!(clouds.iter().zip(&deltas).all(|(cloud, delta)| cloud.abs_diff(*delta) < 1_000_000));
}

#[test]
fn transforms_in_whose_place_results_go_are_said_not_to_be_copied() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..3 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.scan(i);
    }
    let (bag, out) = (folder.put("a.mcap", &writer.finish()), folder.join("out.mcap"));
    let found = replay(&bag, &["--out", out.to_str().unwrap(), "--ros-args", "-r", "~/clusters:=/tf"]);
    assert_eq!(found.number("scans"), 3, "{}", found.errors);
    assert_eq!(found.errors.matches("/tf of the input is not copied").count(), 1, "{}", found.errors);
}

#[test]
fn each_topic_of_the_input_that_the_result_has_itself_is_said_not_to_be_copied() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    (0..2).for_each(|i| writer.scan(i));
    for topic in ["/cfodi/points_labelled", "/cfodi/markers", "/cfodi/points_labelled"] {
        writer.cloud(topic, stamp(1), &wall(1));
    }
    let (bag, out) = (folder.put("own.mcap", &writer.finish()), folder.join("out.mcap"));
    let arguments = ["--topic", POINTS, "--with-input", "--out", out.to_str().unwrap()];
    let found = replay(&bag, &arguments);
    assert_eq!((found.status, found.number("scans")), (0, 2), "{}", found.errors);
    for topic in ["/cfodi/points_labelled", "/cfodi/markers"] {
        let said = format!("{topic} of the input is not copied");
        assert_eq!(found.errors.matches(&said).count(), 1, "{topic}: {}", found.errors);
    }
}
