//! `cfodi` as a program, and folders for what it reads and writes.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

use std::fs::{self, DirEntry};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};

use tempfile::TempDir;

/// The program with these arguments, not yet started.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cfodi"));
    command.args(arguments);
    command
}

/// Kibibytes of address space that a replay of anything small has enough of.
const ENOUGH: u64 = 2 << 20;

/// What came of a replay with no more than [`ENOUGH`] of memory.
pub fn replay_within(bag: &Path, more: &[&str]) -> Output {
    let limited = format!("ulimit -v {ENOUGH}; exec \"$0\" replay \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &limited, env!("CARGO_BIN_EXE_cfodi")]);
    command.arg(bag).args(more).stdin(Stdio::null()).output().unwrap()
}

/// What came of the program with these arguments.
pub fn cfodi(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// The lines to stderr.
pub fn errors(ended: &Output) -> String {
    String::from_utf8_lossy(&ended.stderr).into_owned()
}

/// The status, `None` after a signal, and the lines to stderr.
pub fn said(ended: &Output) -> (Option<i32>, String) {
    (ended.status.code(), errors(ended))
}

/// The program under way; a test that fails meanwhile leaves none behind.
pub struct Running(pub Child);

impl Running {
    pub fn start(arguments: &[&str]) -> Self {
        Self(command(arguments).stderr(Stdio::piped()).spawn().unwrap())
    }

    /// Sends it what Ctrl-C does.
    pub fn interrupt(&self) {
        let sent = Command::new("kill").args(["-s", "INT", &self.0.id().to_string()]).status().unwrap();
        assert!(sent.success());
    }

    /// The status it ends with, and what it said.
    pub fn end(mut self) -> (Option<i32>, String) {
        let mut errors = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut errors).unwrap();
        (self.0.wait().unwrap().code(), errors)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Where it has ended there is nothing to do.
        let _ended = self.0.kill();
        let _status = self.0.wait();
    }
}

/// Whether a process catches SIGINT, which would otherwise end it.
#[cfg(target_os = "linux")]
pub fn listens(id: u32) -> bool {
    const SIGINT: u64 = 1 << 1;
    let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    caught.is_some_and(|mask| u64::from_str_radix(mask.trim(), 16).unwrap() & SIGINT != 0)
}

/// A folder of the test's own, removed at its end.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// With one file in it.
    pub fn with(name: &str, bytes: &[u8]) -> Self {
        let folder = Self::new();
        folder.put(name, bytes);
        folder
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// A file in it.
    pub fn join(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    /// A file in it, for a command line.
    pub fn argument(&self, name: &str) -> String {
        self.join(name).to_str().unwrap().to_owned()
    }

    pub fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    pub fn entries(&self) -> impl Iterator<Item = DirEntry> {
        fs::read_dir(self.path()).unwrap().map(Result::unwrap)
    }

    /// Names of the files in it, ascending.
    pub fn names(&self) -> Vec<String> {
        let mut names: Vec<_> =
            self.entries().map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The bytes of the largest file; 0 where there is none, or one just got its final name.
    pub fn largest(&self) -> u64 {
        self.entries().map(|entry| entry.metadata().map_or(0, |file| file.len())).max().unwrap_or(0)
    }
}
