//! Files of every shape, cut, damaged or of something else.

use std::io::Read as _;
use std::path::Path;

use crate::bags::{BagWriter, Layout, OPTICAL, POINTS, chunks, drive, ends_of_clouds, stamp};
use crate::mcap_bytes::{MAGIC, channel_of, footer, message, record, whole};
use crate::{Folder, replay};

/// Where the length of the first record in a chunk stands, behind what the chunk begins with.
const FIRST_LENGTH: usize = 9 + 40 + 1;

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
fn a_bag_in_compressed_chunks_cut_at_any_byte_gives_at_least_the_whole_chunks() {
    let folder = Folder::new();
    let bag = drive(BagWriter::new(Layout::Zstd), 20);
    let ends = ends_of_chunks(&bag);
    // The same messages are in the chunks of one that is not compressed.
    let plain = drive(BagWriter::new(Layout::Chunks), 20);
    let (plain_ends, clouds) = (ends_of_chunks(&plain), ends_of_clouds(&plain));
    assert!(ends.len() > 5 && ends.len() == plain_ends.len(), "{} and {}", ends.len(), plain_ends.len());
    for cut in cuts(bag.len(), 60) {
        let found = replay(&folder.put("chunks.mcap", &bag[..cut]), &[]);
        let chunks = ends.iter().filter(|end| **end <= cut).count();
        let end = chunks.checked_sub(1).map_or(0, |last| plain_ends[last]);
        let least = clouds.iter().filter(|cloud| **cloud <= end).count() as u64;
        assert_eq!(found.status, 1, "cut at {cut}: {}", found.errors);
        let scans = found.number("scans");
        assert!((least..=20).contains(&scans), "cut at {cut}: {scans} of {least}: {}", found.errors);
    }
}

#[test]
fn a_bag_compressed_as_a_whole_and_cut_at_any_byte_gives_every_scan_that_can_be_unpacked() {
    let folder = Folder::new();
    let plain = drive(BagWriter::new(Layout::Plain), 20);
    let (bag, ends) = (zstd::encode_all(&plain[..], 3).unwrap(), ends_of_clouds(&plain));
    let mut most = 0;
    for cut in cuts(bag.len(), 60) {
        let mut unpacked = Vec::new();
        let rest = zstd::Decoder::new(&bag[..cut]).unwrap().read_to_end(&mut unpacked);
        assert!(rest.is_err());
        let before = ends.iter().filter(|end| **end <= unpacked.len()).count() as u64;
        let found = replay(&folder.put("whole.mcap.zstd", &bag[..cut]), &[]);
        let scans = found.number("scans");
        assert_eq!((found.status, scans), (1, before), "cut at {cut}: {}", found.errors);
        most = most.max(scans);
    }
    assert!(most > 10, "{most}");
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
fn other_recordings_are_refused_with_the_command_that_converts_them() {
    let folder = Folder::new();
    for (name, begin) in [("a.bag", &b"#ROSBAG V2.0\nxyz"[..]), ("a.db3", b"SQLite format 3\0abc")] {
        let found = replay(&folder.put(name, begin), &[]);
        assert_eq!((found.status, found.summary), (2, None));
        assert!(found.errors.contains("rosbags-convert --src "), "{}", found.errors);
    }
    // Compressed, and beside no metadata, as a recorder leaves it that was killed.
    let packed = zstd::encode_all(&b"SQLite format 3\0abc"[..], 3).unwrap();
    let found = replay(&folder.put("b.db3.zstd", &packed), &[]);
    assert!(found.status == 2 && found.errors.contains("rosbags-convert --src "), "{}", found.errors);
    let alone = Folder::new();
    alone.put("x_0.db3", b"SQLite format 3\0abc");
    let found = replay(alone.path(), &[]);
    assert!(found.status == 2 && found.errors.contains("rosbags-convert --src "), "{}", found.errors);
    // In MCAP, but with what ROS 1 sent, whichever name the type has.
    for type_name in ["sensor_msgs/PointCloud2", "sensor_msgs/msg/PointCloud2"] {
        let records = [channel_of(1, POINTS, type_name, "ros1"), message(1, 0, &[0; 8])].concat();
        let found = replay(&folder.put("ros1.mcap", &whole(&records)), &[]);
        let says = |what: &str| assert!(found.errors.contains(what), "{}", found.errors);
        says("serialised as in ROS 1; convert the .bag that it was made of: rosbags-convert --src ");
        says(&format!("\n  {POINTS} 1 x {type_name} (ros1)"));
        assert_eq!((found.status, &found.summary), (2, &None));
    }
    let found = replay(&folder.put("a.txt", b"hello, hello"), &[]);
    assert!(
        found.status == 2 && found.errors.contains("it begins with \"hello, hello\""),
        "{}",
        found.errors
    );
    let found = replay(&folder.put("metadata.yaml", b"rosbag2_bagfile_information:\n"), &[]);
    assert!(
        found.status == 2 && found.errors.contains("; give the folder that it lies in"),
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

/// The first chunk names the channel, which is then taken from the summary.
#[test]
fn a_damaged_chunk_costs_its_own_scans_alone() {
    let folder = Folder::new();
    for layout in [Layout::Chunks, Layout::Zstd, Layout::Lz4] {
        let mut writer = BagWriter::new(layout);
        (0..20).for_each(|i| writer.scan(i));
        let whole = writer.finish();
        let chunks = chunks(&whole);
        assert!(chunks.len() > 5, "{}", chunks.len());
        for chunk in chunks {
            let mut bag = whole.clone();
            bag[chunk.start.midpoint(chunk.end)] ^= 1;
            let found = replay(&folder.put("a.mcap", &bag), &[]);
            assert_eq!(found.status, 1, "{layout:?} {chunk:?}: {}", found.errors);
            assert!((17..=20).contains(&found.number("scans")), "{layout:?} {chunk:?}: {}", found.errors);
            let bytes = chunk.len() - 9;
            let said =
                format!("a.mcap is damaged; 1 of its chunks, of {bytes} bytes, could not be read in full");
            assert!(found.errors.contains(&said), "{}", found.errors);
            let cut = folder.put("a.mcap", &bag[..chunk.end]);
            assert_eq!(replay(&cut, &[]).status, 1, "{layout:?} {chunk:?}");
            bag.truncate(bag.len() - 4);
            let found = replay(&folder.put("a.mcap", &bag), &[]);
            let said = ["is cut or damaged", "before that, 1 of its chunks"];
            assert!(said.iter().all(|said| found.errors.contains(said)), "{}", found.errors);
        }
    }
}

#[test]
fn a_length_in_a_chunk_that_is_wrong_costs_the_scans_of_that_chunk_alone() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    (0..20).for_each(|i| writer.scan(i));
    let whole = writer.finish();
    let chunks = chunks(&whole);
    for chunk in &chunks[1..chunks.len() - 1] {
        for more in [1 << 10, 64 << 10, 10 << 20, u64::MAX >> 1] {
            let mut bag = whole.clone();
            let length = &mut bag[chunk.start + FIRST_LENGTH..][..8];
            let before = u64::from_le_bytes((&*length).try_into().unwrap());
            length.copy_from_slice(&(before + more).to_le_bytes());
            let found = replay(&folder.put("a.mcap", &bag), &[]);
            let said = format!("1 of its chunks, of {} bytes, could not be read in full", chunk.len() - 9);
            assert!(
                found.status == 1 && found.errors.contains(&said),
                "{chunk:?} + {more}: {}",
                found.errors
            );
            assert!(found.number("scans") >= 17, "{chunk:?} + {more}: {}", found.number("scans"));
        }
    }
}

/// Of a file without the summary, which names each channel once more; cut before it, or made without one.
#[test]
fn messages_whose_channel_a_damaged_chunk_alone_names_are_counted() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Chunks);
    let other = |writer: &mut BagWriter, i| {
        writer.put_bytes("/other", "std_msgs/msg/String", stamp(i), &vec![0; 60_000]);
    };
    // A channel is named where the chunk before its first message ends: that of the clouds in the second one.
    (0..2).for_each(|i| other(&mut writer, i));
    for i in 2..9 {
        writer.scan(i);
        other(&mut writer, i);
    }
    let mut cut = writer.finish();
    let chunks = chunks(&cut);
    cut.truncate(chunks.last().unwrap().end);
    cut[chunks[0].start + FIRST_LENGTH..][..8].fill(0xff);
    let ended = [&cut[..], &record(0x0f, &[0; 4]), &footer(0), MAGIC].concat();
    for (bag, how) in [(cut, "is cut or damaged"), (ended, "is damaged; 1 of its chunks")] {
        let found = replay(&folder.put("a.mcap", &bag), &[]);
        assert_eq!((found.status, found.number("scans")), (1, 7), "{}", found.errors);
        let unread = found.summary.as_ref().unwrap()["unread"].as_str().unwrap();
        for said in [how, ", nor could 8 of its messages, whose channel or schema nothing else names"] {
            assert!(unread.contains(said) && found.errors.contains(said), "{unread}: {}", found.errors);
        }
    }
}

#[test]
fn a_damaged_file_of_several_costs_only_its_own_scans() {
    let folder = Folder::new();
    let whole = drive(BagWriter::new(Layout::Plain), 10);
    folder.put("run_2.mcap", &whole);
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 10..20 {
        writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        writer.scan(i);
    }
    folder.put("run_10.mcap", &writer.finish());
    let found = replay(folder.path(), &[]);
    assert_eq!(
        (found.status, found.number("scans"), found.number("sessions")),
        (0, 20, 1),
        "{}",
        found.errors
    );
    folder.put("run_2.mcap", &whole[..ends_of_clouds(&whole)[3]]);
    let found = replay(folder.path(), &[]);
    assert_eq!((found.status, found.number("scans")), (1, 14), "{}", found.errors);
    assert!(found.errors.contains("run_2.mcap is cut"), "{}", found.errors);
}

/// As of two recorders that ran at one time, where a third file went on behind.
#[test]
fn files_that_were_recorded_side_by_side_are_read_by_their_times() {
    let folder = Folder::new();
    let [mut clouds, mut transforms, mut rest] = [(); 3].map(|()| BagWriter::new(Layout::Chunks));
    transforms.tf("/tf_static", stamp(0), "camera_link", OPTICAL, 0.0);
    for i in 0..200 {
        let (clouds, transforms) =
            if i < 150 { (&mut clouds, Some(&mut transforms)) } else { (&mut rest, None) };
        clouds.scan(i);
        let step = |writer: &mut BagWriter| writer.tf("/tf", stamp(i), "map", "camera_link", 0.1 * i as f64);
        transforms.map_or_else(|| step(clouds), step);
    }
    folder.put("a_clouds.mcap", &rest.finish());
    folder.put("b_clouds.mcap", &clouds.finish());
    let transforms = folder.put("c_transforms.mcap", &transforms.finish());
    let found = replay(folder.path(), &[]);
    let ended = (found.status, found.number("scans"), found.number("sessions"));
    assert_eq!(ended, (0, 200, 1), "{}", found.errors);
    let said = "read as one recording, by the times of their messages: ";
    assert!(found.errors.contains(said), "{}", found.errors);
    let one = Folder::new();
    let expected = replay(&one.put("one.mcap", &drive(BagWriter::new(Layout::Chunks), 200)), &[]);
    assert!(found.voxels == expected.voxels, "another map");
    // What is cut tells no times: one file is read after the other, and what it holds is used as far as it can be.
    let whole = std::fs::read(&transforms).unwrap();
    std::fs::write(&transforms, &whole[..whole.len() * 9 / 10]).unwrap();
    let found = replay(folder.path(), &[]);
    assert_eq!(found.status, 1, "{}", found.errors);
    assert!(
        found.errors.contains("read as one recording, in this order: a_clouds.mcap, b_"),
        "{}",
        found.errors
    );
    assert!(found.number("scans") >= 50, "{}", found.errors);
}

#[test]
fn a_file_that_lies_in_a_folder_plain_and_compressed_is_read_once_and_that_is_said() {
    let folder = Folder::new();
    let bag = drive(BagWriter::new(Layout::Plain), 10);
    folder.put("a.mcap", &bag);
    let compressed = folder.put("a.mcap.zstd", &zstd::encode_all(&bag[..], 3).unwrap());
    let found = replay(folder.path(), &[]);
    assert_eq!(
        (found.status, found.number("scans"), found.number("sessions")),
        (0, 10, 1),
        "{}",
        found.errors
    );
    assert!(found.errors.contains("or not at all: a.mcap.zstd\n"), "{}", found.errors);
    let found = replay(folder.path(), &["--ply", compressed.to_str().unwrap()]);
    assert!(found.status == 2 && found.errors.contains("would replace the input"), "{}", found.errors);
}

#[test]
fn what_cannot_be_decoded_is_said_once_and_counted() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in 0..5 {
        writer.put_bytes("/tf", "tf2_msgs/msg/TFMessage", stamp(i), &[0, 1, 0, 0, 9, 9, 9, 9]);
        writer.scan(i);
    }
    let found = replay(&folder.put("garbled.mcap", &writer.finish()), &[]);
    assert_eq!(found.errors.matches("a message on /tf was skipped").count(), 1, "{}", found.errors);
    assert_eq!(found.summary.as_ref().unwrap()["messages_undecodable"]["/tf"], 5);
    assert_eq!(found.number("scans"), 5);
}

/// Of a bag whose messages are compressed one by one, transforms as well.
#[test]
fn a_damaged_compressed_message_costs_itself_alone() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for i in 0..9 {
        writer.compress_messages = true;
        writer.scan(i);
        writer.compress_messages = false;
        let topic = [("/tf", "tf2_msgs/msg/TFMessage"), (POINTS, "sensor_msgs/msg/PointCloud2")][i % 2];
        writer.put_bytes(
            topic.0,
            topic.1,
            stamp(i),
            b"\x28\xb5\x2f\xfd, and then nothing that zstd has made",
        );
    }
    let bag = folder.put("a.mcap", &writer.finish());
    let out = folder.argument("out.mcap");
    let found = replay(&bag, &["--out", &out, "--with-input"]);
    assert_eq!((found.status, found.number("scans")), (1, 9), "{}", found.errors);
    assert!(
        found.errors.contains("9 of its compressed messages, of 369 bytes, could not be read"),
        "{}",
        found.errors
    );
    let summary = found.summary.as_ref().unwrap();
    assert_eq!(summary["messages_undecodable"]["/tf"], 5, "{}", found.errors);
    assert_eq!(summary["scans_skipped"]["undecodable"], 4, "{}", found.errors);
    assert!(found.errors.contains("a compressed message: "), "{}", found.errors);
}

#[test]
fn files_that_are_no_bag_cost_only_their_own_scans_and_all_are_counted() {
    let folder = Folder::new();
    folder.put("run_0.mcap", &[0; 5000]);
    folder.put("run_1.mcap", &drive(BagWriter::new(Layout::Plain), 5));
    folder.put("run_2.mcap", b"");
    let found = replay(folder.path(), &[]);
    assert_eq!((found.status, found.number("scans")), (1, 5), "{}", found.errors);
    assert!(
        found.errors.contains("run_0.mcap") && found.errors.contains("1 more of its files"),
        "{}",
        found.errors
    );
}

#[test]
fn a_saved_map_is_told_from_other_files_with_the_command_that_takes_it() {
    let folder = Folder::new();
    let map = cfodi::engine::Engine::new(cfodi::engine::Params::default()).freeze();
    let map = folder.put("some.map", &cfodi::store::pack("odom", &map).unwrap());
    let found = replay(&map, &[]);
    assert_eq!((found.status, &found.summary), (2, &None), "{}", found.errors);
    let words = format!("cfodi run --resume --ros-args -p snapshot_path:={}", map.display());
    assert!(
        found.errors.contains("is a saved map and no bag") && found.errors.contains(&words),
        "{}",
        found.errors
    );
}
