//! What becomes of the files that `cfodi replay` is to write, wherever they are to go.
#![cfg(all(feature = "node", target_os = "linux"))]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/bags.rs"]
mod bags;

use std::fs::{self, File};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output};

use bags::{BagWriter, Layout, drive};
use tempfile::TempDir;

/// A folder of the test's own with a bag in it, removed at its end.
struct Folder(TempDir);

impl Folder {
    fn with_bag(bag: &[u8]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        fs::write(folder.path("a.mcap"), bag).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A replay of the bag within the folder.
    fn replay(&self, more: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cfodi"));
        command.current_dir(self.0.path()).args(["replay", "a.mcap"]).args(more);
        command
    }
}

/// What was said, and whether all went well.
fn said(ended: &Output) -> (Option<i32>, String) {
    (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
}

#[test]
fn standard_output_that_is_appended_to_a_file_leaves_what_is_in_it() {
    let folder = Folder::with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    fs::write(folder.path("all.json"), "earlier\n").unwrap();
    let all = File::options().append(true).open(folder.path("all.json")).unwrap();
    let ended = folder.replay(&["--clusters", "/dev/stdout"]).stdout(all).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(0), "{errors}");
    let text = fs::read_to_string(folder.path("all.json")).unwrap();
    let clusters = text.strip_prefix("earlier\n").unwrap_or_else(|| panic!("{text}"));
    serde_json::from_str::<serde_json::Value>(clusters).unwrap();
}

/// As `{ echo header; cfodi replay ...; echo footer; } > f` does it.
#[test]
fn standard_output_is_written_where_it_stands_and_gone_on_with_behind() {
    let folder = Folder::with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    let mut file = File::create(folder.path("f")).unwrap();
    file.write_all(b"header\n").unwrap();
    let out = file.try_clone().unwrap();
    let ended = folder.replay(&["--summary", "/dev/stdout"]).stdout(out).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(0), "{errors}");
    file.write_all(b"footer\n").unwrap();
    let text = fs::read_to_string(folder.path("f")).unwrap();
    let summary = text.strip_prefix("header\n").and_then(|text| text.strip_suffix("footer\n"));
    let summary = summary.unwrap_or_else(|| panic!("{text}"));
    assert_eq!(serde_json::from_str::<serde_json::Value>(summary).unwrap()["scans"], 2);
}
