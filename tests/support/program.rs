//! `cfodi` as a program, and folders for what it reads and writes.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

use std::fs::{self, DirEntry};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// The program with these arguments, not yet started.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cfodi"));
    command.args(arguments);
    command
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
