//! The files that a bag is made of, told apart by how they begin.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use super::error::BagError;
use super::metadata;
use super::read::Messages;
use super::survey::{self, Survey, Topic};

/// A recording that can be read: which files, in which order.
#[derive(Clone, Debug)]
pub struct Bag {
    pub(super) files: Vec<Part>,
    /// As `metadata.yaml` lists them; empty where there is none.
    pub(super) listed: Vec<Topic>,
}

/// One file of a bag.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) path: PathBuf,
    /// Bytes on disk.
    pub(super) size: u64,
    /// Whether the whole file is a stream of zstd.
    pub(super) is_compressed: bool,
}

const MCAP: &[u8] = b"\x89MCAP0\r\n";
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";
const ROS1: &[u8] = b"#ROSBAG";
const SQLITE: &[u8] = b"SQLite format 3";

impl Bag {
    /// Opens a folder that `rosbags-convert` or `ros2 bag record` made, an MCAP file, or one compressed with zstd.
    ///
    /// # Errors
    /// A [`BagError`]: where there is no such input, and where it is of another kind, with the command that converts it.
    pub fn open(path: &Path) -> Result<Self, BagError> {
        let about = fs::metadata(path).map_err(|source| reading(path, source))?;
        if !about.is_dir() {
            return Ok(Self { files: vec![Part::open(path)?], listed: Vec::new() });
        }
        let (paths, listed) = match fs::read_to_string(path.join("metadata.yaml")) {
            Ok(text) => {
                let metadata = metadata::parse(path, &text)?;
                if metadata.storage == "sqlite3" {
                    return Err(sqlite(path, path));
                }
                (metadata.files, metadata.topics)
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => (mcap_files(path)?, Vec::new()),
            Err(source) => return Err(reading(&path.join("metadata.yaml"), source)),
        };
        let files = paths.iter().map(|path| Part::open(path)).collect::<Result<_, _>>()?;
        Ok(Self { files, listed })
    }

    /// Bytes on disk.
    pub fn size(&self) -> u64 {
        self.files.iter().map(|part| part.size).sum()
    }

    /// The files that it is made of.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.files.iter().map(|part| part.path.clone()).collect()
    }

    /// The topics: from the summary or `metadata.yaml` where there is one, by reading all of the bag otherwise.
    pub fn survey(&self) -> Survey {
        survey::survey(self)
    }

    /// All messages in the order of the file.
    pub fn messages(&self) -> Messages {
        Messages::new(self.clone())
    }
}

impl Part {
    fn open(path: &Path) -> Result<Self, BagError> {
        let failed = |source| reading(path, source);
        let file = File::open(path).map_err(failed)?;
        let size = file.metadata().map_err(failed)?.len();
        let mut begin = Vec::new();
        file.take(16).read_to_end(&mut begin).map_err(failed)?;
        // What is too short to tell is a cut file, which reading it will say.
        let is =
            |magic: &[u8]| !begin.is_empty() && begin.starts_with(&magic[..magic.len().min(begin.len())]);
        let folder = path.with_extension("");
        if is(ROS1) {
            Err(BagError::Ros1 { path: path.to_owned(), folder })
        } else if is(SQLITE) {
            Err(sqlite(path, path.parent().unwrap_or(path)))
        } else if is(MCAP) || is(ZSTD) || begin.is_empty() {
            Ok(Self { path: path.to_owned(), size, is_compressed: is(ZSTD) })
        } else {
            Err(BagError::NotMcap { path: path.to_owned(), begin: format!("\"{}\"", begin.escape_ascii()) })
        }
    }
}

pub(super) fn reading(path: &Path, source: io::Error) -> BagError {
    BagError::Io { path: path.to_owned(), source }
}

fn sqlite(path: &Path, source_folder: &Path) -> BagError {
    let mut folder = source_folder.as_os_str().to_owned();
    folder.push("_mcap");
    BagError::Sqlite { path: path.to_owned(), source_folder: source_folder.to_owned(), folder: folder.into() }
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
    paths.sort();
    if paths.is_empty() { Err(BagError::NoBag { path: folder.to_owned() }) } else { Ok(paths) }
}
