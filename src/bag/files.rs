//! A recording: the files that it is made of, in their order.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::ops::Deref;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use super::bag_file::{BagFile, reading, sqlite};
use super::error::BagError;
use super::metadata::{self, Metadata};
use super::order::side_by_side;
use super::read::{Message, Messages};
use super::survey::survey;
use super::topic::{Survey, Topic};
use crate::yaml;

/// What a recorder says of a folder.
pub(super) const METADATA: &str = "metadata.yaml";

/// Files that a line names at most.
const NAMED: usize = 20;

/// A recording that can be read: which files, in which order.
#[derive(Clone, Debug)]
pub struct Bag {
    files: Vec<BagFile>,
    /// As `metadata.yaml` lists them; empty where there is none.
    listed: Vec<Topic>,
    /// Files of its folder that hold what another one holds.
    copies: Vec<PathBuf>,
    /// Which others of its folder are not read, and which are read together.
    remarks: Vec<String>,
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
            return Ok(Self::of(vec![BagFile::open(path)?]));
        }
        let description = description(path)?;
        let is_described = description.is_some();
        let Chosen { paths, copies, listed, mut remarks } = match description {
            Some(text) => Chosen::of_metadata(path, metadata::parse(path, &text)?)?,
            None => Chosen::of_folder(path)?,
        };
        let opened: Vec<_> = paths.iter().map(|path| BagFile::open(path)).collect();
        let mut files = Vec::new();
        if opened.iter().any(Result::is_ok) {
            // One that cannot be opened costs only its own messages: it fails when its turn comes.
            files = paths
                .iter()
                .zip(opened)
                .map(|(path, bag_file)| bag_file.unwrap_or_else(|_| BagFile::unopened(path)))
                .collect();
        } else {
            for bag_file in opened {
                files.push(bag_file?);
            }
        }
        remarks.extend((!is_described).then(|| in_order_of_reading(&mut files)).flatten());
        Ok(Self { listed, copies, remarks, ..Self::of(files) })
    }

    const fn of(files: Vec<BagFile>) -> Self {
        Self { files, listed: Vec::new(), copies: Vec::new(), remarks: Vec::new(), surveyed: OnceLock::new() }
    }

    /// Files that are not read, for another one has the same name without `.zstd`: what was decompressed beside them; and links to one
    /// that is.
    pub fn copies(&self) -> &[PathBuf] {
        &self.copies
    }

    /// What is to be said of a folder's files: which of them are not read but for copies, and which are read together though nothing
    /// says that they belong together.
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Bytes on disk.
    pub fn size(&self) -> u64 {
        self.files.iter().map(|bag_file| bag_file.size).sum()
    }

    /// The files that it is made of, its description and copies of them among them.
    pub fn paths(&self) -> Vec<PathBuf> {
        let described = self.files.iter().filter_map(|bag_file| Some(bag_file.path.parent()?.join(METADATA)));
        let files = self.files.iter().map(|bag_file| bag_file.path.clone());
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

    /// All messages in the order of the file; of files that were recorded side by side, by the times of recording.
    pub fn messages(&self) -> Messages {
        Messages::new(self.files.clone())
    }

    /// As [`Self::messages`], up to the first that cannot be read, and up to `stop`.
    pub(crate) fn readable_until<S>(&self, stop: S) -> impl Iterator<Item = Message> + use<S>
    where
        S: Deref<Target = AtomicBool>,
    {
        self.messages().map_while(Result::ok).take_while(move |_| !stop.load(Ordering::Relaxed))
    }
}

/// Which files of a folder are its recording.
struct Chosen {
    paths: Vec<PathBuf>,
    /// See [`Bag`].
    copies: Vec<PathBuf>,
    listed: Vec<Topic>,
    remarks: Vec<String>,
}

impl Chosen {
    fn of_metadata(folder: &Path, metadata: Metadata) -> Result<Self, BagError> {
        let Metadata { files: paths, storage, topics: listed } = metadata;
        if storage == "sqlite3" {
            return Err(sqlite(folder, vec![folder.to_owned()]));
        }
        let mut others = mcap_files(folder).unwrap_or_default();
        others.retain(|path| !paths.contains(path));
        let remarks = remark("not read, as metadata.yaml does not list them", &others, 1);
        Ok(Self { paths, copies: Vec::new(), listed, remarks: remarks.into_iter().collect() })
    }

    fn of_folder(folder: &Path) -> Result<Self, BagError> {
        let (paths, copies) = without_copies(mcap_files(folder)?);
        let (results, recorded): (Vec<_>, Vec<_>) =
            paths.into_iter().partition(|path| BagFile::is_result(path));
        // Where there is nothing else, these are what is meant.
        let (paths, results) = if recorded.is_empty() { (results, recorded) } else { (recorded, results) };
        let left_out = remark("not read, as a replay has written them", &results, 1);
        Ok(Self { paths, copies, listed: Vec::new(), remarks: left_out.into_iter().collect() })
    }
}

/// Puts the files of a folder that nothing describes into the order in which they are read, and says which that is.
fn in_order_of_reading(files: &mut [BagFile]) -> Option<String> {
    let how = if side_by_side(files) { "by the times of their messages" } else { "in this order" };
    let paths: Vec<_> = files.iter().map(|bag_file| bag_file.path.clone()).collect();
    remark(&format!("without a metadata.yaml these are read as one recording, {how}"), &paths, 2)
}

/// Names the files that something is to be said of, where there are so many.
fn remark(what: &str, paths: &[PathBuf], least: usize) -> Option<String> {
    let mut names: Vec<_> = paths.iter().take(NAMED).map(|path| name(path)).collect();
    let more = paths.len() - names.len();
    names.extend((more > 0).then(|| format!("and {more} more")));
    (paths.len() >= least).then(|| format!("{what}: {}", names.join(", ")))
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// What a recorder says of a folder; `None` where it says nothing.
fn description(folder: &Path) -> Result<Option<String>, BagError> {
    let path = folder.join(METADATA);
    let read = || yaml::read(&path).map_err(|source| reading(&path, source));
    match BagFile::check_regular(&path).and_then(|_| read()) {
        Ok(text) => Ok(Some(text)),
        Err(BagError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// The files to read, and their copies: links to one of them, and of names that differ only by how the file is compressed all but the
/// first. A plain file comes before compressed ones.
fn without_copies(paths: Vec<PathBuf>) -> (Vec<PathBuf>, Vec<PathBuf>) {
    let (links, mut seen) = (links(&paths), BTreeSet::new());
    paths.into_iter().partition(|path| {
        if links.contains(path) {
            return false;
        }
        let is_compressed = path.extension().is_some_and(|end| end == "zstd" || end == "zst");
        seen.insert(if is_compressed { path.with_extension("") } else { path.clone() })
    })
}

/// The names that are another one's for a file, hard links too: all but the first of each file, symbolic links being the last.
fn links(paths: &[PathBuf]) -> BTreeSet<PathBuf> {
    let mut paths: Vec<_> = paths.iter().collect();
    paths.sort_by_key(|path| path.is_symlink());
    let mut seen = BTreeSet::new();
    // One that cannot be looked at is said when its turn comes.
    let mut is_seen =
        |path: &Path| fs::metadata(path).is_ok_and(|file| !seen.insert((file.dev(), file.ino())));
    paths.into_iter().filter(|path| is_seen(path)).cloned().collect()
}

fn mcap_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let entries = fs::read_dir(folder).map_err(|source| reading(folder, source))?;
    let paths = entries.map(|entry| entry.map(|entry| entry.path()));
    let all: Vec<PathBuf> = paths.collect::<Result<_, _>>().map_err(|source| reading(folder, source))?;
    let (mut paths, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|path| {
        let name = name(path);
        [".mcap", ".mcap.zstd", ".mcap.zst"].iter().any(|end| name.ends_with(end)) && !name.starts_with('.')
    });
    paths.sort_by_cached_key(|path| in_order(&name(path)));
    if !paths.is_empty() {
        return Ok(paths);
    }
    if let Some(bag) = others.iter().find(|path| path.extension().is_some_and(|end| end == "bag")) {
        return Err(BagError::Ros1 { path: bag.clone(), folder: bag.with_extension("") });
    }
    // What a recorder leaves that was killed.
    let mut in_sqlite = others;
    in_sqlite.retain(|path| [".db3", ".db3.zstd", ".db3.zst"].iter().any(|end| name(path).ends_with(end)));
    in_sqlite.sort_by_cached_key(|path| in_order(&name(path)));
    Err(match in_sqlite.first().cloned() {
        Some(first) => sqlite(&first, in_sqlite),
        None => BagError::NoBag { path: folder.to_owned() },
    })
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
    use std::convert::Infallible;
    use std::fs::File;
    use std::os::unix::fs::symlink;

    use super::super::{OutputTopics, ResultBag, SensorBag};
    use super::*;
    use crate::msg::twins::Twins;

    fn recording(path: &Path) {
        SensorBag::new(File::create(path).unwrap(), "/points").unwrap().finish().unwrap();
    }

    fn result(path: &Path) {
        let topics =
            OutputTopics::new(Twins::default(), |name| Ok::<_, Infallible>(name.to_owned())).unwrap();
        ResultBag::new(File::create(path).unwrap(), &topics, true).unwrap().finish().unwrap();
    }

    /// The names of the files that are read of a folder, and what is said of the others.
    fn read_of(folder: &Path) -> (Vec<String>, Vec<String>) {
        let bag = Bag::open(folder).unwrap();
        (bag.files.iter().map(|bag_file| name(&bag_file.path)).collect(), bag.remarks)
    }

    #[test]
    fn results_beside_a_recording_are_left_out_and_files_that_nothing_joins_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        result(&at("b.mcap"));
        let none: [&str; 0] = [];
        let (read, said) = read_of(folder.path());
        assert_eq!((read, said.len()), (vec!["b.mcap".to_owned()], 0), "it may be looked at again");
        recording(&at("c.mcap"));
        let left_out = "not read, as a replay has written them: b.mcap";
        assert_eq!(read_of(folder.path()), (vec!["c.mcap".to_owned()], vec![left_out.to_owned()]));
        recording(&at("a.mcap"));
        let (read, said) = read_of(folder.path());
        let together =
            "without a metadata.yaml these are read as one recording, in this order: a.mcap, c.mcap";
        assert_eq!(
            (&read[..], &said[..]),
            (&["a.mcap", "c.mcap"].map(str::to_owned)[..], &[left_out, together].map(str::to_owned)[..])
        );
        let listed = |names: &str| {
            let text = format!(
                "rosbag2_bagfile_information: {{relative_file_paths: [{names}], storage_identifier: mcap}}"
            );
            fs::write(at(METADATA), text).unwrap();
            read_of(folder.path())
        };
        let (read, said) = listed("./c.mcap");
        assert_eq!(
            (&read[..], &said[..]),
            (
                &["c.mcap".to_owned()][..],
                &["not read, as metadata.yaml does not list them: a.mcap, b.mcap".to_owned()][..]
            )
        );
        assert_eq!(listed("c.mcap, a.mcap, b.mcap").1, none);
    }

    #[test]
    fn a_line_names_no_more_files_than_can_be_read() {
        let paths: Vec<_> = (0..NAMED + 3).map(|i| PathBuf::from(format!("/bags/{i}.mcap"))).collect();
        let line = remark("read", &paths, 2).unwrap();
        assert!(
            line.starts_with("read: 0.mcap, 1.mcap, ") && line.ends_with(", 19.mcap, and 3 more"),
            "{line}"
        );
        assert_eq!(remark("read", &paths[..1], 2), None);
        assert_eq!(remark("read", &[], 1), None);
    }

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

    #[test]
    fn a_file_that_has_several_names_is_read_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        recording(&at("lab.mcap"));
        symlink("lab.mcap", at("latest.mcap")).unwrap();
        symlink(at("lab.mcap"), at("a.mcap")).unwrap();
        symlink("nothing", at("gone.mcap")).unwrap();
        fs::hard_link(at("lab.mcap"), at("kept.mcap")).unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        recording(&elsewhere.path().join("m.mcap"));
        symlink(elsewhere.path().join("m.mcap"), at("other.mcap")).unwrap();
        let bag = Bag::open(folder.path()).unwrap();
        let names = |paths: &[PathBuf]| paths.iter().map(|path| name(path)).collect::<Vec<_>>();
        assert_eq!(names(bag.copies()), ["a.mcap", "lab.mcap", "latest.mcap"]);
        let read: Vec<_> = bag.files.iter().map(|bag_file| bag_file.path.clone()).collect();
        assert_eq!(names(&read), ["gone.mcap", "kept.mcap", "other.mcap"]);
        assert!(bag.paths().contains(&at("latest.mcap")), "no output may replace it");
    }
}
