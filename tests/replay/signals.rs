//! What a signal leaves that comes before anything is known.
#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::Folder;
use crate::bags::{BagWriter, Layout, OPTICAL, stamp};

/// Half a gigabyte of messages that nobody reads, before the only scan; some kilobytes on the disk.
fn long_before_its_scan() -> Vec<u8> {
    let mut writer = BagWriter::new(Layout::Zstd);
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    let zeros = vec![0; 1 << 20];
    (0..512).for_each(|_| writer.put_bytes("/blob", "std_msgs/msg/String", stamp(0), &zeros));
    writer.scan(1);
    writer.finish()
}

/// Whether a process catches SIGINT, which would otherwise end it.
fn listens(id: u32) -> bool {
    const SIGINT: u64 = 1 << 1;
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    caught.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & SIGINT != 0)
}

/// Replays, with a signal as soon as it listens to one; gives its status and what it says.
fn interrupted(bag: &Path, summary: &Path) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cfodi"));
    command.arg("replay").arg(bag).arg("--summary").arg(summary).stderr(Stdio::piped());
    let mut replay = command.spawn().unwrap();
    while !listens(replay.id()) && replay.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    let sent = Command::new("kill").args(["-s", "INT", &replay.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let ended = replay.wait_with_output().unwrap();
    (ended.status.code(), String::from_utf8(ended.stderr).unwrap())
}

#[test]
fn before_the_first_scan_earlier_results_stay_and_before_the_topics_are_known_none_is_missed() {
    let folder = Folder::new();
    let bag = long_before_its_scan();
    let summary = folder.put("s.json", b"earlier");
    // Without its summary a bag tells its topics only when all of it is read.
    for (length, said) in [(bag.len(), "before the first scan"), (bag.len() - 100, "before the topics")] {
        let (status, errors) = interrupted(&folder.put("a.mcap", &bag[..length]), &summary);
        assert_eq!(status, Some(1), "{errors}");
        assert!(errors.contains(said) && !errors.contains("no point cloud"), "{errors}");
        assert_eq!(fs::read_to_string(&summary).unwrap(), "earlier");
    }
}
