//! One file of a bag, told apart by how it begins.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use mcap::MAGIC;
use mcap::records::op;

use super::error::BagError;
use super::files::METADATA;
use super::write::is_result;

/// Bytes of a file by which it is known who wrote it.
const HEADER: u64 = 256;

/// One file of a bag.
#[derive(Clone, Debug)]
pub(super) struct BagFile {
    pub(super) path: PathBuf,
    /// Bytes on disk.
    pub(super) size: u64,
    /// Whether the whole file is a stream of zstd.
    pub(super) is_compressed: bool,
    /// When its first message was recorded (ns), where it is read from then on, beside others.
    pub(super) begins: Option<u64>,
}

/// How what zstd has compressed begins.
pub(super) const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";
const ROS1: &[u8] = b"#ROSBAG";
const SQLITE: &[u8] = b"SQLite format 3";
/// How a map begins that the node has saved; the feature `store`, which says so too, may be missing.
const SAVED_MAP: &[u8] = b"cfodimap";

impl BagFile {
    /// A file that cannot be opened, or is none of a bag: reading it says so.
    pub(super) fn unopened(path: &Path) -> Self {
        let size = path.metadata().map_or(0, |about| about.len());
        Self { path: path.to_owned(), size, is_compressed: false, begins: None }
    }

    /// Refuses what is no regular file: opening a pipe would wait for its writer, and a device has no end.
    pub(super) fn check_regular(path: &Path) -> Result<Metadata, BagError> {
        let about = path.metadata().map_err(|source| reading(path, source))?;
        let refused = || reading(path, io::Error::new(io::ErrorKind::InvalidInput, "it is no regular file"));
        if about.is_file() { Ok(about) } else { Err(refused()) }
    }

    /// Whether it is what a replay has written.
    pub(super) fn is_result(path: &Path) -> bool {
        let mut start = Vec::new();
        let file = Self::check_regular(path).ok().and_then(|_| File::open(path).ok());
        let read = file.and_then(|file| file.take(HEADER).read_to_end(&mut start).ok());
        read.is_some() && library(&start).is_some_and(is_result)
    }

    pub(super) fn open(path: &Path) -> Result<Self, BagError> {
        let failed = |source| reading(path, source);
        let about = Self::check_regular(path)?;
        let file = File::open(path).map_err(failed)?;
        let size = about.len();
        let mut start = Vec::new();
        file.take(16).read_to_end(&mut start).map_err(failed)?;
        // What is too short to tell is a cut file, which reading it will say.
        let is =
            |magic: &[u8]| !start.is_empty() && start.starts_with(&magic[..magic.len().min(start.len())]);
        let folder = path.with_extension("");
        if is(ROS1) {
            Err(BagError::Ros1 { path: path.to_owned(), folder })
        } else if is(SQLITE)
            || is(ZSTD) && unpacked_start(path).is_some_and(|start| start.starts_with(SQLITE))
        {
            let folder = path.parent().filter(|folder| folder.join(METADATA).is_file());
            let folder =
                folder.map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
            Err(sqlite(path, vec![folder.unwrap_or(path).to_owned()]))
        } else if is(MAGIC) || is(ZSTD) || start.is_empty() {
            Ok(Self { path: path.to_owned(), size, is_compressed: is(ZSTD), begins: None })
        } else if start.starts_with(SAVED_MAP) {
            Err(BagError::SavedMap { path: path.to_owned() })
        } else {
            Err(BagError::NotMcap { path: path.to_owned(), start: format!("\"{}\"", start.escape_ascii()) })
        }
    }
}

/// What a compressed file begins with, as far as it can be unpacked.
fn unpacked_start(path: &Path) -> Option<Vec<u8>> {
    let mut start = Vec::new();
    let unpacked = zstd::Decoder::new(File::open(path).ok()?).ok()?;
    unpacked.take(SQLITE.len() as u64).read_to_end(&mut start).ok().map(|_| start)
}

/// A text behind its length, and what follows it.
fn text(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u32::from_le_bytes(*length)).ok()?)
}

/// What the header of an MCAP file, its first record, names as its writer.
fn library(start: &[u8]) -> Option<&[u8]> {
    let (_, fields) = start.strip_prefix(MAGIC)?.strip_prefix(&[op::HEADER])?.split_at_checked(8)?;
    let (_profile, rest) = text(fields)?;
    Some(text(rest)?.0)
}

pub(super) fn reading(path: &Path, source: io::Error) -> BagError {
    BagError::Io { path: path.to_owned(), source }
}

/// What is in a data base is converted by its folder, where that says what it holds, else by its files.
pub(super) fn sqlite(path: &Path, sources: Vec<PathBuf>) -> BagError {
    let first = sources.first().map_or(path, PathBuf::as_path);
    let plain = first.canonicalize().unwrap_or_else(|_| first.to_owned());
    let name = if plain.is_dir() { plain.file_name() } else { plain.file_stem() };
    let mut folder = name.unwrap_or("bag".as_ref()).to_owned();
    folder.push("_mcap");
    let folder = first.parent().unwrap_or(first).join(folder);
    BagError::Sqlite { path: path.to_owned(), sources, folder }
}

#[cfg(test)]
#[cfg(feature = "store")]
mod tests {
    use super::*;

    #[test]
    fn a_saved_map_is_known_by_what_it_is_written_with() {
        assert_eq!(SAVED_MAP, crate::store::MAGIC);
    }
}
