//! What a signal leaves that comes before anything is known, or while the program waits.
#![cfg(target_os = "linux")]

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::Folder;
use crate::bags::{BagWriter, Layout, OPTICAL, stamp};
use crate::program::{Running, listens};

/// Half a gigabyte of messages that nobody reads, before the only scan; some kilobytes on the disk.
fn long_before_its_scan() -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Zstd);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    let zeros = vec![0; 1 << 20];
    (0..512).for_each(|_| writer.put_bytes("/blob", "std_msgs/msg/String", stamp(0), &zeros));
    writer.scan(1);
    writer.finish()
}

/// Replays, with a signal as soon as it listens to one; gives its status and what it says.
fn interrupted(bag: &str, summary: &str) -> (Option<i32>, String) {
    let mut replay = Running::start(&["replay", bag, "--summary", summary]);
    while replay.0.try_wait().unwrap().is_none() {
        if listens(replay.0.id()) {
            replay.interrupt();
            break;
        }
        std::thread::yield_now();
    }
    replay.end()
}

#[test]
fn before_the_first_scan_earlier_results_stay_and_before_the_topics_are_known_none_is_missed() {
    let folder = Folder::new();
    let bag = long_before_its_scan();
    let [path, summary] = ["a.mcap", "s.json"].map(|name| folder.argument(name));
    // Without its summary a bag tells its topics only when all of it is read.
    for (length, said) in [(bag.len(), "before a scan was taken in"), (bag.len() - 100, "before the topics")]
    {
        folder.put("a.mcap", &bag[..length]);
        // On a busy machine the signal may come when that is over.
        let mut attempts = (0..5).map(|_| {
            folder.put("s.json", b"earlier");
            let (status, errors) = interrupted(&path, &summary);
            assert!(!errors.contains("no point cloud"), "{errors}");
            (status, errors)
        });
        let (status, errors) = attempts.find(|(_, errors)| errors.contains(said)).expect(said);
        assert_eq!(status, Some(1), "{errors}");
        assert_eq!(fs::read_to_string(&summary).unwrap(), "earlier");
    }
}

#[test]
fn a_second_signal_ends_a_replay_that_waits_for_the_reader_of_a_pipe_and_drops_what_is_not_complete() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Zstd);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    writer.scan(1);
    folder.put("a.mcap", &writer.finish());
    let [bag, pipe, voxels] = ["a.mcap", "pipe", "v.csv"].map(|name| folder.argument(name));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut replay = Running::start(&["replay", &bag, "--voxels", &voxels, "--clusters", &pipe]);
    let patience = Instant::now() + Duration::from_secs(60);
    // Two that come within a second are one request.
    while replay.0.try_wait().unwrap().is_none() {
        assert!(Instant::now() < patience, "it still waits");
        if listens(replay.0.id()) {
            replay.interrupt();
        }
        std::thread::sleep(Duration::from_millis(300));
    }
    assert_eq!(replay.end().0, Some(1));
    assert_eq!(folder.names(), ["a.mcap", "pipe"]);
}
