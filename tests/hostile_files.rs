//! Files, arguments and an environment made to harm: each is refused or read in part, with its reason, within bounds of
//! memory, and never with a panic.
#![cfg(feature = "node")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/bags.rs"]
mod bags;
#[path = "support/mcap_bytes.rs"]
mod mcap_bytes;
#[path = "support/program.rs"]
mod program;

use std::ffi::OsStr;
use std::fs;
use std::io::{Read as _, Write as _, repeat};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use bags::{BagWriter, Layout, OPTICAL, POINTS, drive, stamp, wall};
use cfodi::bag::{Bag, BagError, Message};
use mcap_bytes::{MAGIC, channel, chunk, footer, header, message, record, whole};
use program::{Folder, command, errors, replay_within};

/// All that can be read of a bag of these bytes, and what is said at its end.
fn read(bytes: &[u8]) -> (Vec<Message>, Option<BagError>) {
    let folder = Folder::new();
    let bag = Bag::open(&folder.put("a.mcap", bytes)).unwrap();
    let survey = bag.survey(&AtomicBool::new(false));
    assert!(survey.topics.len() <= 100);
    let (mut messages, mut failure) = (Vec::new(), None);
    for item in bag.messages() {
        assert!(failure.is_none(), "the failure comes last");
        match item {
            Ok(message) => messages.push(message),
            Err(error) => failure = Some(error),
        }
    }
    (messages, failure)
}

/// It ends by itself, with that status and words, within bounds of memory.
fn ends(bag: &Path, more: &[&str], status: i32, said: &str) {
    let output = replay_within(bag, more);
    let errors = errors(&output);
    assert_eq!(output.status.code(), Some(status), "{}: {errors}", bag.display());
    assert!(errors.contains(said) && !errors.contains("panicked"), "{}: {errors}", bag.display());
}

fn good_message(i: usize) -> Vec<u8> {
    let mut data = vec![0, 1, 0, 0];
    data.extend(
        cdr_encoding::to_vec::<_, byteorder::LittleEndian>(&bags::cloud(stamp(i), OPTICAL, &wall(i)))
            .unwrap(),
    );
    data
}

#[test]
fn a_record_that_claims_two_to_the_63_bytes_ends_the_bag_and_takes_no_memory() {
    for length in [1_u64 << 63, u64::MAX, u64::MAX - 8, 1 << 40, 1 << 30] {
        for opcode in [0x03, 0x04, 0x05, 0x06, 0x09, 0x0c, 0x7f] {
            let claims = [&[opcode][..], &length.to_le_bytes(), &[0; 100]].concat();
            let bytes = [MAGIC, &header(), &channel(1, POINTS), &message(1, 7, b"abcd"), &claims].concat();
            let (messages, failure) = read(&bytes);
            assert_eq!(messages.len(), 1, "{opcode} of {length}");
            assert!(matches!(failure, Some(BagError::Cut { .. })), "{opcode} of {length}: {failure:?}");
        }
    }
}

#[test]
fn a_chunk_that_claims_to_unpack_to_any_size_is_read_by_what_it_holds() {
    let inside = [channel(1, POINTS), message(1, 7, b"abcd")].concat();
    for compression in ["", "zstd", "lz4", "brotli", "\u{1b}[2J"] {
        for size in [0, 1, 1 << 20, 1 << 63, u64::MAX] {
            let packed = if compression == "zstd" {
                zstd::encode_all(&inside[..], 1).unwrap()
            } else {
                inside.clone()
            };
            let bytes = [MAGIC, &header(), &chunk(compression, size, &packed), &footer(0), MAGIC].concat();
            let (messages, failure) = read(&bytes);
            // What is there may be read, where the way to unpack it is known.
            let is_known = ["", "zstd", "lz4"].contains(&compression);
            assert!(messages.len() <= usize::from(is_known), "{compression} {size}");
            // A chunk that says that nothing is in it is passed over.
            assert!(failure.is_some() || messages.len() == 1 || size == 0, "{compression} {size}");
        }
    }
}

/// A find of the fuzzer: the library subtracts without a check.
#[test]
fn a_record_that_is_longer_than_its_chunk_costs_what_is_left_of_that_chunk() {
    let inside = [channel(1, POINTS), message(1, 7, &[0; 100])].concat();
    for less in [1, 4, 100, 130] {
        let packed = &inside[..inside.len() - less];
        let (messages, failure) = read(&whole(&[chunk("", 1000, packed), message(1, 8, b"abcd")].concat()));
        assert_eq!(messages.len(), 1, "{less}: that behind it");
        assert!(matches!(failure, Some(BagError::Damaged { .. })), "{less}: {failure:?}");
    }
}

#[test]
fn a_message_that_unpacks_to_a_gigabyte_is_cut_off_within_bounds() {
    let folder = Folder::new();
    let zeros = zstd::encode_all(repeat(0).take(1 << 30), 1).unwrap();
    assert!(zeros.len() < 100_000);
    let bag = whole(&[channel(1, POINTS), message(1, 7, &zeros)].concat());
    ends(&folder.put("a.mcap", &bag), &[], 1, "more than 536870912 bytes");
}

/// Of a recorder that compresses each message by itself: 48 files, each with one of 40 MiB that waits for its turn.
#[test]
fn no_message_of_files_side_by_side_is_unpacked_before_its_turn() {
    let folder = Folder::new();
    let zeros = zstd::encode_all(repeat(0).take(40 << 20), 1).unwrap();
    for i in 0..48 {
        let mut writer = BagWriter::new(Layout::Plain);
        writer.put_bytes("/other", "std_msgs/msg/String", stamp(i), b"abcd");
        writer.put_bytes(POINTS, "sensor_msgs/msg/PointCloud2", stamp(100 + i), &zeros);
        folder.put(&format!("{i}.mcap"), &writer.finish());
    }
    ends(folder.path(), &["--ros-args", "-p", "fixed_frame:=map"], 0, "empty_frame_id 48");
}

/// A map or a video that somebody has put beside the messages.
#[test]
fn an_attachment_larger_than_any_message_is_passed_over() {
    let folder = Folder::new();
    let messages = [0, 1].map(|i| message(1, stamp(i) as u64, &good_message(i)));
    let attachment = [&[0x09][..], &(600_u64 << 20).to_le_bytes()].concat();
    let before = [MAGIC, &header(), &channel(1, POINTS), &messages[0], &attachment].concat();
    let after = [&messages[1][..], &record(0x0f, &[1; 4]), &footer(0), MAGIC].concat();
    for (left, status, said) in [(600 << 20, 0, "2 scans in"), (500 << 20, 1, "not all of the bag was read")]
    {
        let zeros = repeat(0).take(left);
        let file = before.as_slice().chain(zeros).chain(if status == 0 { &after[..] } else { &[] });
        let path = folder.put("a.mcap.zstd", &zstd::encode_all(file, 1).unwrap());
        ends(&path, &[], status, said);
    }
}

#[test]
fn a_chunk_that_unpacks_to_a_gigabyte_is_read_as_a_stream() {
    let folder = Folder::new();
    // A thousand messages of a megabyte of zeros each.
    let mut inside = channel(1, POINTS);
    let one = message(1, 7, &vec![0; 1 << 20]);
    (0..1000).for_each(|_| inside.extend(&one));
    let packed = zstd::encode_all(&inside[..], 1).unwrap();
    assert!(packed.len() < 1 << 20);
    let bytes = whole(&chunk("zstd", inside.len() as u64, &packed));
    ends(&folder.put("a.mcap", &bytes), &["--ros-args", "-p", "fixed_frame:=map"], 0, "empty_frame_id 1000");
}

#[test]
fn a_file_that_unpacks_to_any_number_of_empty_records_is_read_as_a_stream() {
    let folder = Folder::new();
    let endless = MAGIC.chain(repeat(0).take(200 << 20));
    let path = folder.put("a.mcap.zstd", &zstd::encode_all(endless, 1).unwrap());
    assert!(path.metadata().unwrap().len() < 1 << 20);
    ends(&path, &[], 1, "not all of the bag was read");
}

#[test]
fn a_footer_that_points_anywhere_costs_the_summary_only() {
    let inside = [channel(1, POINTS), message(1, 7, &good_message(0))].concat();
    for start in [1, 8, 9, 100, inside.len() as u64, u64::MAX / 2, u64::MAX] {
        let bytes = [MAGIC, &header(), &inside, &record(0x0f, &[0; 4]), &footer(start), MAGIC].concat();
        let (messages, _) = read(&bytes);
        assert_eq!(messages.len(), 1, "{start}");
    }
}

#[test]
fn messages_of_unknown_channels_and_channels_of_unknown_schemas_end_the_bag_with_a_reason() {
    let stranger = whole(&[channel(1, POINTS), message(1, 7, b"abcd"), message(9, 8, b"abcd")].concat());
    let (messages, failure) = read(&stranger);
    assert!(messages.len() == 1 && failure.is_some());
    let no_schema = record(0x04, &mcap_bytes::channel_body(1, 77, POINTS, "cdr"));
    assert!(read(&whole(&no_schema)).1.is_some());
}

#[test]
fn a_channel_that_changes_its_meaning_ends_the_bag_with_a_reason() {
    let (messages, failure) = read(&whole(
        &[channel(1, POINTS), message(1, 7, b"abcd"), channel(1, "/other"), message(1, 8, b"abcd")].concat(),
    ));
    assert!(messages.len() == 1 && failure.is_some(), "{failure:?}");
}

#[test]
fn what_a_chunk_says_wrongly_costs_that_chunk_alone() {
    let in_chunk = |records: &[Vec<u8>]| chunk("", records.concat().len() as u64, &records.concat());
    let of = |channel, time| message(channel, time, b"abcd");
    let first = in_chunk(&[channel(1, POINTS), of(1, 7)]);
    // Its schema was in what is damaged.
    let lost = record(0x04, &mcap_bytes::channel_body(3, 3, "/other", "cdr"));
    for wrong in [of(9, 8), channel(1, "/other"), record(0x03, &[1, 0, 0xff, 0xff, 0xff, 0xff])] {
        let rest = in_chunk(&[lost.clone(), of(3, 9), channel(2, "/others"), of(2, 10)]);
        let (messages, failure) = read(&whole(&[first.clone(), in_chunk(&[wrong, of(1, 8)]), rest].concat()));
        let times: Vec<_> = messages.iter().map(|message| message.log_time).collect();
        assert_eq!(times, [7, 10], "{failure:?}");
        let said = failure.map(|failure| failure.to_string()).unwrap_or_default();
        assert!(said.contains("1 of its chunks"), "{said}");
    }
}

/// Bodies of a header, a schema and channels in which a string, or what is to be a map of strings, claims 4 GB.
fn claims_of_four_gigabytes() -> Vec<(u8, Vec<u8>)> {
    let (much, none, id) = ([0xff; 4], [0; 4], [1, 0]);
    let bodies = [
        (0x01, [&much[..], b"abc"].concat()),
        (0x01, [&none[..], &much, b"abc"].concat()),
        (0x03, [&id[..], &much, b"abc"].concat()),
        (0x03, [&id[..], &none, &much, b"abc"].concat()),
        (0x03, [&id[..], &none, &none, &much, b"abc"].concat()),
        (0x04, [&id[..], &[0; 2], &much, b"abc"].concat()),
        (0x04, [&id[..], &[0; 2], &none, &much, b"abc"].concat()),
        (0x04, [&id[..], &[0; 2], &none, &none, &much, b"abc"].concat()),
        (0x04, [&id[..], &[0; 2], &none, &none, &[7, 0, 0, 0], &much, b"abc"].concat()),
    ];
    bodies.to_vec()
}

#[test]
fn lengths_inside_of_records_that_exceed_them_end_the_bag_with_a_reason() {
    let any = [0x01, 0x03, 0x04, 0x06].into_iter().flat_map(|opcode| {
        [0xff, 0x7f, 0x10].map(|length| (opcode, [&[1, 0][..], &[length; 12], b"abc"].concat()))
    });
    let folder = Folder::new();
    for (opcode, body) in any.chain(claims_of_four_gigabytes()) {
        let bytes = whole(&record(opcode, &body));
        let (messages, failure) = read(&bytes);
        assert!(messages.is_empty() && failure.is_some(), "{opcode} {body:?}");
        ends(&folder.put("a.mcap", &bytes), &[], 1, "not all of the bag was read");
    }
}

#[test]
fn lengths_in_the_summary_that_exceed_its_records_cost_the_summary_only() {
    let folder = Folder::new();
    let inside = [channel(1, POINTS), message(1, 7, &good_message(0))].concat();
    let data = [MAGIC, &header(), &inside, &record(0x0f, &[0; 4])].concat();
    for (opcode, body) in claims_of_four_gigabytes() {
        let bytes = [&data[..], &record(opcode, &body), &footer(data.len() as u64), MAGIC].concat();
        let (messages, failure) = read(&bytes);
        assert!(messages.len() == 1 && failure.is_some(), "{opcode} {body:?}");
        ends(&folder.put("a.mcap", &bytes), &[], 1, "42949672");
    }
    // Where a footer is to be stands another record, whose string claims as much.
    let bytes = [&data[..], &record(0x03, &[0xff; 20]), MAGIC].concat();
    assert_eq!(read(&bytes).0.len(), 1);
    ends(&folder.put("a.mcap", &bytes), &[], 1, "42949672");
}

/// A bag of one chunk with so many records, made one by one.
fn bag_of_many(count: u16, opcode: u8, body: impl Fn(u16) -> Vec<u8>) -> Vec<u8> {
    let mut size = 0;
    let mut packed = zstd::Encoder::new(Vec::new(), 1).unwrap();
    for id in 1..=count {
        let one = record(opcode, &body(id));
        size += one.len() as u64;
        packed.write_all(&one).unwrap();
    }
    whole(&chunk("zstd", size, &packed.finish().unwrap()))
}

/// Each is small when packed, and all of them would be kept until the end of the file.
#[test]
fn schemas_and_channels_of_gigabytes_end_the_bag_within_bounds() {
    let text = |length: usize| [&(length as u32).to_le_bytes()[..], &vec![b'x'; length]].concat();
    let schema = |id: u16, length| [&id.to_le_bytes()[..], &text(1), &text(1), &text(length)].concat();
    let pair = |i: u32| [&5_u32.to_le_bytes()[..], format!("{i:05}").as_bytes(), &[0; 4]].concat();
    let pairs: Vec<_> = (0..80_000).flat_map(pair).collect();
    let pairs = [&(pairs.len() as u32).to_le_bytes()[..], &pairs].concat();
    let channel = |id: u16| [&id.to_le_bytes()[..], &[0; 2], &text(1), &text(1), &pairs].concat();
    let folder = Folder::new();
    for (bytes, said) in [
        (bag_of_many(2500, 0x03, |id| schema(id, 1_000_000)), "33554432 are kept"),
        (bag_of_many(500, 0x04, channel), "33554432 are kept"),
        (bag_of_many(1, 0x03, |id| schema(id, 40 << 20)), "1048576 are read"),
    ] {
        ends(&folder.put("a.mcap", &bytes), &[], 1, said);
    }
}

#[test]
fn a_summary_that_contradicts_the_data_costs_no_message() {
    let inside = [channel(1, POINTS), message(1, 7, b"abcd")].concat();
    let data = [MAGIC, &header(), &inside, &record(0x0f, &[0; 4])].concat();
    let contradicts = channel(1, "/other");
    let end = [&footer(data.len() as u64)[..], MAGIC].concat();
    let (messages, failure) = read(&[&data[..], &contradicts, &end].concat());
    assert!(messages.len() == 1 && failure.is_none(), "{failure:?}");
    // But where the data was not over after all, nobody knows what that message is.
    let (messages, failure) = read(&[&data[..], &contradicts, &message(1, 8, b"abcd"), &end].concat());
    assert!(messages.len() == 1 && failure.is_some(), "{failure:?}");
}

#[test]
fn times_at_the_ends_of_the_clock_break_nothing() {
    let folder = Folder::new();
    let out = folder.join("out.mcap");
    let mut inside = channel(1, POINTS);
    for (i, time) in [0, u64::MAX, 1, 1 << 63, u64::MAX - 1].into_iter().enumerate() {
        inside.extend(message(1, time, &good_message(i)));
    }
    let bag = folder.put("a.mcap", &whole(&inside));
    ends(&bag, &["--with-input", "--out", out.to_str().unwrap()], 0, "5 scans");
    let messages = Bag::open(&out).unwrap().messages().map(Result::unwrap);
    let times: Vec<_> =
        messages.filter(|message| message.topic() == POINTS).map(|message| message.log_time).collect();
    // Those near 1970 are of a clock that counts from its start, and are brought to that of the stamps; those beyond any clock
    // are copied as they are.
    assert_eq!([times[1], times[3], times[4]], [u64::MAX, 1 << 63, u64::MAX - 1]);
    assert!([times[0], times[2]].iter().all(|time| time.abs_diff(stamp(2) as u64) < 2), "{times:?}");
}

#[test]
fn stamps_from_1901_to_2038_are_replayed_into_every_output() {
    let folder = Folder::new();
    let path = |name: &str| folder.argument(name);
    let mut writer = BagWriter::new(Layout::Plain);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    for (i, sec) in [i64::from(i32::MIN), -1, 0, i64::from(i32::MAX)].into_iter().enumerate() {
        writer.put(
            POINTS,
            "sensor_msgs/msg/PointCloud2",
            7,
            &bags::cloud(sec * 1_000_000_000, OPTICAL, &wall(i)),
        );
    }
    let bag = folder.put("a.mcap", &writer.finish());
    let (out, report, clusters) = (path("out.mcap"), path("report"), path("c.json"));
    ends(&bag, &["--out", &out, "--report", &report, "--clusters", &clusters], 0, "4 scans");
}

#[test]
fn names_in_a_bag_do_not_speak_to_the_terminal() {
    let folder = Folder::new();
    let evil = "/depth\u{1b}]0;owned\u{7}\ncfodi: all is well\r";
    let mut writer = BagWriter::new(Layout::Plain);
    writer.put_bytes(evil, "sensor_msgs/msg/PointCloud2", 7, &good_message(0));
    writer.put_bytes("/tf", "tf2_msgs/msg/TFMessage", 7, &[0, 1, 0, 0, 9, 9, 9, 9]);
    writer.tf("/tf_static", stamp(0), "evil\u{1b}[31m\nroot", OPTICAL, 0.0);
    let bag = folder.put("a.mcap", &writer.finish());
    for more in [&[][..], &["--topic", "/nope"], &["--topic", "/tf"]] {
        says_nothing_raw(&replay_within(&bag, more));
    }
}

/// No name steers the terminal or begins a line; gives what is said.
fn says_nothing_raw(output: &Output) -> String {
    let said = errors(output);
    assert!(!said.contains(['\u{1b}', '\u{7}', '\r']), "{said:?}");
    let is_of_a_name = |line: &str| line.starts_with("cfodi: all") || line.starts_with("root");
    assert!(!said.lines().any(is_of_a_name), "{said:?}");
    said
}

#[test]
fn names_of_files_channels_and_parameters_do_not_speak_to_the_terminal() {
    let folder = Folder::new();
    let written_out = r"\u{1b}[2J\ncfodi: all is well\r";
    folder.put("good.mcap", &drive(BagWriter::new(Layout::Plain), 3));
    // Alone it is no bag; beside a good file it is what was not read.
    let evil = r#""\e[2J\ncfodi: all is well\r""#;
    for files in [evil.to_owned(), format!("{evil}, good.mcap")] {
        let listed = format!("rosbag2_bagfile_information: {{relative_file_paths: [{files}]}}");
        folder.put("metadata.yaml", listed.as_bytes());
        let said = says_nothing_raw(&replay_within(folder.path(), &[]));
        assert!(said.contains(written_out), "{said:?}");
    }
    let records =
        [channel(1, POINTS), message(1, 7, &good_message(0)), channel(1, "\u{1b}[2J\ncfodi: all is well\r")];
    let said = says_nothing_raw(&replay_within(&folder.put("a.mcap", &whole(&records.concat())), &[]));
    assert!(said.contains(&format!("Channel `{written_out}`")), "{said:?}");
    let params = folder.put("params.yaml", format!("/**: {{ros__parameters: {{{evil}: 3}}}}").as_bytes());
    let ros_args = ["--ros-args", "--params-file", params.to_str().unwrap()];
    let said = says_nothing_raw(&replay_within(folder.path(), &ros_args));
    assert!(said.contains(&format!("unknown parameter `{written_out}`")), "{said:?}");
}

#[test]
fn a_pipe_a_device_and_a_folder_are_no_bags_and_nobody_waits_for_them() {
    let folder = Folder::new();
    let pipe = folder.join("pipe.mcap");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    ends(&pipe, &[], 1, "it is no regular file");
    ends(Path::new("/dev/zero"), &[], 1, "it is no regular file");
    fs::create_dir(folder.join("dir.mcap")).unwrap();
    ends(&folder.join("dir.mcap"), &[], 2, "holds neither");
    // Listed beside a good file they cost only themselves.
    folder.put("good.mcap", &drive(BagWriter::new(Layout::Plain), 3));
    let listed = "rosbag2_bagfile_information: {relative_file_paths: [pipe.mcap, dir.mcap, good.mcap]}";
    folder.put("metadata.yaml", listed.as_bytes());
    ends(folder.path(), &[], 1, "3 scans");
}

#[test]
fn a_metadata_without_bounds_is_refused() {
    let laughs = (1..12).fold("a0: &a0 [1, 1, 1]\n".to_owned(), |text, i| {
        text + &format!("a{i}: &a{i} [{}]\n", vec![format!("*a{}", i - 1); 9].join(", "))
    });
    let heavy = format!("a: &x \"{}\"\nb: [{}]\n", "y".repeat(4 << 20), vec!["*x"; 300_000].join(", "));
    let deep = "- ".repeat(300_000);
    for text in
        [laughs.into_bytes(), heavy.into_bytes(), deep.into_bytes(), vec![b' '; 9 << 20], vec![0xff; 100]]
    {
        let folder = Folder::new();
        folder.put("metadata.yaml", &text);
        ends(folder.path(), &[], 1, "metadata.yaml");
    }
    let folder = Folder::new();
    let metadata = folder.join("metadata.yaml");
    std::os::unix::fs::symlink("/dev/zero", &metadata).unwrap();
    ends(folder.path(), &[], 1, "metadata.yaml: it is no regular file");
    fs::remove_file(&metadata).unwrap();
    assert!(Command::new("mkfifo").arg(&metadata).status().unwrap().success());
    ends(folder.path(), &[], 1, "metadata.yaml: it is no regular file");
}

#[test]
fn a_metadata_with_an_entry_that_is_no_name_is_refused() {
    let folder = Folder::new();
    folder.put("good.mcap", &drive(BagWriter::new(Layout::Plain), 3));
    let text = "rosbag2_bagfile_information: {relative_file_paths: [good.mcap, 7]}";
    folder.put("metadata.yaml", text.as_bytes());
    ends(folder.path(), &[], 1, "metadata.yaml: relative_file_paths[1] is 7, not the name of a file");
}

#[test]
fn a_metadata_that_leads_out_of_its_folder_is_refused() {
    let folder = Folder::new();
    let text = "rosbag2_bagfile_information: {relative_file_paths: [../../../../etc/hostname]}";
    folder.put("metadata.yaml", text.as_bytes());
    ends(folder.path(), &[], 1, "which is not in the folder");
}

#[test]
fn arguments_that_are_no_text_are_refused_with_status_2() {
    let not_text = OsStr::from_bytes(b"\xff\xfe.mcap");
    let output = command(&["replay"]).arg(not_text).output().unwrap();
    let errors = errors(&output);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert!(errors.contains("is no text") && !errors.contains("panicked"), "{errors}");
}

#[test]
fn an_environment_of_nonsense_is_refused_or_without_effect() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let run = |name: &str, value: &[u8]| {
        command(&["replay"]).arg(&bag).env(name, OsStr::from_bytes(value)).output().unwrap()
    };
    for domain in [&b"\xff\xff"[..], b"233", b"-1", b"many"] {
        let output = run("ROS_DOMAIN_ID", domain);
        assert_eq!(output.status.code(), Some(2), "{}", errors(&output));
        assert!(errors(&output).contains("it must be from 0 to 232"), "{}", errors(&output));
    }
    for log in [&b"[[["[..], b"\xff", b"trace=trace=trace", b",", b"", "\u{2003}ab=info".as_bytes()] {
        let output = run("RUST_LOG", log);
        assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
    }
}

#[test]
fn what_a_library_says_of_each_bad_message_does_not_fill_the_log() {
    let folder = Folder::new();
    let mut inside = channel(1, POINTS);
    // A name without the zero that ends it, of which the library for CDR says so each time.
    (0..1000).for_each(|_| inside.extend(message(1, 7, &[&[0, 1, 0, 0][..], &[0; 60]].concat())));
    let said = errors(&replay_within(&folder.put("a.mcap", &whole(&inside)), &[]));
    assert!(said.lines().count() < 20 && said.contains("empty_frame_id 1000"), "{said}");
}

#[test]
fn a_bag_of_a_thousand_topics_is_listed_and_refused() {
    let folder = Folder::new();
    let mut inside = Vec::new();
    (0..1000).for_each(|i| inside.extend(channel(i, &format!("/depth{i}/points"))));
    (0..1000).for_each(|i| inside.extend(message(i, 7, b"abcd")));
    ends(&folder.put("a.mcap", &whole(&inside)), &[], 2, "several topics could be meant");
}
