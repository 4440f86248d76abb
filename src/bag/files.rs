//! A recording: the files that it is made of, in their order.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::BagError;
use super::metadata;
use super::part::{Part, reading, sqlite};
use super::read::Messages;
use super::survey::survey;
use super::topic::{Survey, Topic};
use crate::yaml;

/// What a recorder says of a folder.
const METADATA: &str = "metadata.yaml";

/// A recording that can be read: which files, in which order.
#[derive(Clone, Debug)]
pub struct Bag {
    files: Vec<Part>,
    /// As `metadata.yaml` lists them; empty where there is none.
    listed: Vec<Topic>,
    /// Files of its folder that hold what another one holds.
    copies: Vec<PathBuf>,
    /// What [`Self::survey`] has found.
    surveyed: OnceLock<Survey>,
}

impl Bag {
    /// Opens a folder that `rosbags-convert` or `ros2 bag record` made, an MCAP file, or one compressed with zstd.
    ///
    /// # Errors
    /// A [`BagError`]: where there is no such input, and where it is of another kind, with the command that converts it.
    pub fn open(path: &Path) -> Result<Self, BagError> {
        let about = fs::metadata(path).map_err(|source| reading(path, source))?;
        if !about.is_dir() {
            return Ok(Self::of(vec![Part::open(path)?]));
        }
        let ((paths, copies), listed) = match description(path)? {
            Some(text) => {
                let metadata = metadata::parse(path, &text)?;
                if metadata.storage == "sqlite3" {
                    return Err(sqlite(path, path));
                }
                ((metadata.files, Vec::new()), metadata.topics)
            }
            None => (without_copies(mcap_files(path)?), Vec::new()),
        };
        let opened: Vec<_> = paths.iter().map(|path| Part::open(path)).collect();
        let mut files = Vec::new();
        if opened.iter().any(Result::is_ok) {
            // One that cannot be opened costs only its own messages: it fails when its turn comes.
            files = paths
                .iter()
                .zip(opened)
                .map(|(path, part)| part.unwrap_or_else(|_| Part::unopened(path)))
                .collect();
        } else {
            for part in opened {
                files.push(part?);
            }
        }
        Ok(Self { listed, copies, ..Self::of(files) })
    }

    const fn of(files: Vec<Part>) -> Self {
        Self { files, listed: Vec::new(), copies: Vec::new(), surveyed: OnceLock::new() }
    }

    /// Files that are not read, for another one has the same name without `.zstd`: what was decompressed beside them.
    pub fn copies(&self) -> &[PathBuf] {
        &self.copies
    }

    /// Bytes on disk.
    pub fn size(&self) -> u64 {
        self.files.iter().map(|part| part.size).sum()
    }

    /// The files that it is made of, its description and copies of them among them.
    pub fn paths(&self) -> Vec<PathBuf> {
        let described = self.files.iter().filter_map(|part| Some(part.path.parent()?.join(METADATA)));
        let files = self.files.iter().map(|part| part.path.clone());
        files.chain(described).chain(self.copies.iter().cloned()).collect()
    }

    /// The topics: from the summary or `metadata.yaml` where there is one, otherwise by reading all of the bag, once, up to `stop`.
    pub fn survey(&self, stop: &AtomicBool) -> Survey {
        if let Some(known) = self.surveyed.get() {
            return known.clone();
        }
        let found = survey(&self.files, &self.listed, stop);
        // What a signal has ended is not all that can be found.
        if stop.load(Ordering::Relaxed) { found } else { self.surveyed.get_or_init(|| found).clone() }
    }

    /// All messages in the order of the file.
    pub fn messages(&self) -> Messages {
        Messages::new(self.files.clone())
    }
}

/// What a recorder says of a folder; `None` where it says nothing.
fn description(folder: &Path) -> Result<Option<String>, BagError> {
    let path = folder.join(METADATA);
    let read = || yaml::read(&path).map_err(|source| reading(&path, source));
    match Part::check_regular(&path).and_then(|_| read()) {
        Ok(text) => Ok(Some(text)),
        Err(BagError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// The files without those whose name differs from that of one before only by how they are compressed, and these. By its name a
/// plain file is before those.
fn without_copies(paths: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let mut seen = BTreeSet::new();
    paths.into_iter().partition(|path| {
        let is_compressed = path.extension().is_some_and(|end| end == "zstd" || end == "zst");
        seen.insert(if is_compressed { path.with_extension("") } else { path.clone() })
    })
}

fn mcap_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let entries = fs::read_dir(folder).map_err(|source| reading(folder, source))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let mut paths: Vec<PathBuf> =
        paths.collect::<Result<_, _>>().map_err(|source| reading(folder, source))?;
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    paths.retain(|path| {
        let name = name(path);
        [".mcap", ".mcap.zstd", ".mcap.zst"].iter().any(|end| name.ends_with(end)) && !name.starts_with('.')
    });
    paths.sort_by_cached_key(|path| in_order(&name(path)));
    if paths.is_empty() { Err(BagError::NoBag { path: folder.to_owned() }) } else { Ok(paths) }
}

/// A key by which `_10` comes after `_9`: the texts and the numbers of a name in turn, a number by its length without
/// leading zeros and then by its digits; at last the name itself.
fn in_order(name: &str) -> (Vec<(String, usize, String)>, String) {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let (text, after) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
        let (digits, after) =
            after.split_at(after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len()));
        let number = digits.trim_start_matches('0');
        parts.push((text.to_owned(), number.len(), number.to_owned()));
        rest = after;
    }
    (parts, name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_a_split_bag_are_read_by_their_numbers() {
        let mut names = ["run_10.mcap", "run_9.mcap", "run_0.mcap", "run.mcap", "run_100.mcap"];
        names.sort_by_cached_key(|name| in_order(name));
        assert_eq!(names, ["run.mcap", "run_0.mcap", "run_9.mcap", "run_10.mcap", "run_100.mcap"]);
        let mut dates =
            ["20250101120000000010.mcap", "20250101120000000009.mcap", "run_01.mcap", "run_1.mcap"];
        let sorted = dates;
        dates.sort_by_cached_key(|name| in_order(name));
        assert_eq!(dates, [sorted[1], sorted[0], sorted[2], sorted[3]]);
    }

    #[test]
    fn of_a_file_and_its_compressed_copy_the_plain_one_is_read() {
        let names = ["b.mcap.zst", "a.mcap.zstd", "a.mcap_2.mcap", "c.mcap.zstd", "a.mcap", "c.mcap.zst"];
        let folder = tempfile::tempdir().unwrap();
        names.iter().for_each(|name| fs::write(folder.path().join(name), "").unwrap());
        let (files, copies) = without_copies(mcap_files(folder.path()).unwrap());
        let in_folder =
            |names: &[&str]| names.iter().map(|name| folder.path().join(name)).collect::<Vec<_>>();
        assert_eq!(files, in_folder(&["a.mcap", "a.mcap_2.mcap", "b.mcap.zst", "c.mcap.zst"]));
        assert_eq!(copies, in_folder(&["a.mcap.zstd", "c.mcap.zstd"]));
    }
}
