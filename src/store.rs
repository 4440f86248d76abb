//! A map in a file: what a session has learned, for the next one.
//!
//! **Kept true.** While maps are written, there is at all times a whole one under the name, the one before or the new one,
//! whenever the process or the machine ends: a map is written beside it, brought to the disk, and then given the name; one
//! that is to outlast this is first given a second name ([`keep_aside`]). A symbolic link stays, and what it leads to is
//! replaced. What is read is whole and undamaged, or refused with its reason; nothing is allocated by a length that the file
//! does not bear out.
//!
//! # Format
//!
//! All numbers are little-endian.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `cfodimap` |
//! | 4 | version of the format, [`VERSION`] |
//! | 8 | length of the map, unpacked |
//! | 8 | length of the map, packed |
//! | 4 | CRC-32 of all before and of the packed map |
//! | ... | a [`Stored`] in postcard's encoding, packed by zstd |

mod aside;

use std::borrow::Borrow;
use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::aside::{Kept, MOST_ASIDE, keep_aside, newest_aside, set_aside, too_many_aside};
use crate::count::count_of;
use crate::engine::{Frozen, RestoreError, SavedMap};
use crate::link::folder;
pub use crate::link::target;
use crate::replace::Partial;

/// What a file holds.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Stored {
    /// The fixed frame of the map.
    pub frame_id: String,
    /// The map.
    pub map: SavedMap,
}

/// What a [`Stored`] is written from.
#[derive(Serialize)]
struct Storing<'a> {
    frame_id: &'a str,
    map: &'a Frozen,
}

/// The version of the format; no other is read.
pub const VERSION: u32 = 6;

/// How a saved map begins.
pub(crate) const MAGIC: &[u8; 8] = b"cfodimap";
const HEADER: usize = 32;
/// Where the checksum begins.
const CHECKED: usize = 28;
/// How many times as long as the packed map the unpacked one is at most; a real one is some 2 to 5 times as long. What it
/// takes in memory follows its unpacked length. As it is read, and before it is checked, an element of a list takes at most 11 times
/// the fewest bytes that it can be (a cluster does; blocks, and voxels of mode `paper`, 10, ids 8, states 6, all others 4), and
/// the list twice that while it grows: of the file some 350 and 700 times. Nothing in it is worth more than some tens of its bytes
/// once it is restored.
const MOST_UNPACKED: u64 = 32;
/// zstd's level: 1 packs a map in a tenth of the time of its default and makes it a few per cent larger.
const LEVEL: i32 = 1;

/// A map that cannot be written or read.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The system refused it.
    #[error("{path}: {error}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's words.
        error: io::Error,
    },
    /// The new map has the name, and a failure of power may yet take it back.
    #[error("{path} is written, but it is not sure that this outlasts a failure of power: {error}")]
    Unsure {
        /// The file.
        path: PathBuf,
        /// The system's words.
        error: io::Error,
    },
    /// The map before could not be kept beside the name, and stays under it.
    #[error("{path} stays, for it cannot be kept beside the map that would take its place: {error}")]
    NotKept {
        /// The file.
        path: PathBuf,
        /// The system's words.
        error: io::Error,
    },
    /// Nobody waits any longer for the map to be written.
    #[error("{path} stays as it was saved last, for a signal came while the new map was written")]
    GivenUp {
        /// The file.
        path: PathBuf,
    },
    /// Another process saves its map there.
    #[error("{path} is in use by another process")]
    InUse {
        /// The file.
        path: PathBuf,
    },
    /// The file is none of ours, or damaged.
    #[error("{path} holds no whole map: {what}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its numbers.
        what: String,
    },
    /// An earlier or a later program has written it.
    #[error("{path} is of version {version}; this program reads version {VERSION}")]
    OtherVersion {
        /// The file.
        path: PathBuf,
        /// Its version.
        version: u32,
    },
    /// The map in it cannot be resumed.
    #[error("{path}: {error}")]
    Map {
        /// The file.
        path: PathBuf,
        /// Why not.
        error: RestoreError,
    },
}

impl StoreError {
    /// Whether there is no such file.
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Io { error, .. } if error.kind() == io::ErrorKind::NotFound)
    }
}

/// The right to save under a name, until it is dropped.
#[derive(Debug)]
pub struct Lock(#[expect(dead_code, reason = "closing it gives the right back")] File);

/// Takes the right to save under this name, by a lock on the file `NAME.lock`, which stays.
///
/// # Errors
/// When another process has it, or the system refuses it.
pub fn lock(path: &Path) -> Result<Lock, StoreError> {
    let target = target(path).map_err(|error| StoreError::Io { path: path.to_owned(), error })?;
    let name = beside(&target, "lock");
    let refused = |error| StoreError::Io { path: name.clone(), error };
    // Nothing is cut short: it may be a link that somebody has put there.
    let file = File::options().write(true).create(true).truncate(false).open(&name).map_err(refused)?;
    match file.try_lock() {
        Ok(()) => Ok(Lock(file)),
        Err(TryLockError::WouldBlock) => Err(StoreError::InUse { path: path.to_owned() }),
        Err(TryLockError::Error(error)) => Err(refused(error)),
    }
}

/// Writes a map under this name, in place of the one before; returns the bytes of the file. While the disk takes its time, only these
/// are held.
///
/// # Errors
/// When the system refuses it; the one before is then as it was, unless it is [`StoreError::Unsure`].
pub fn write(path: &Path, frame_id: &str, map: impl Borrow<Frozen>) -> Result<u64, StoreError> {
    let refused = |error| StoreError::Io { path: path.to_owned(), error };
    let bytes = pack(frame_id, map.borrow()).map_err(refused)?;
    drop(map);
    let target = target(path).map_err(refused)?;
    let folder = File::open(folder(&target)).map_err(refused)?;
    write_beside(&target, &target, |file| file.write_all(&bytes)).map_err(refused)?;
    // The name is on the disk when its folder is.
    synced(folder.sync_all()).map_err(|error| StoreError::Unsure { path: path.to_owned(), error })?;
    Ok(bytes.len() as u64)
}

/// Reads the map of this name.
///
/// # Errors
/// When there is none, or it is damaged or of another version.
pub fn read(path: &Path) -> Result<Stored, StoreError> {
    let refused = |error| StoreError::Io { path: path.to_owned(), error };
    // Opening what is no file, a pipe, might never end.
    if !path.metadata().map_err(refused)?.is_file() {
        return Err(StoreError::Damaged { path: path.to_owned(), what: "it is no file".to_owned() });
    }
    let mut file = File::open(path).map_err(refused)?;
    let mut bytes = Vec::new();
    io::Read::by_ref(&mut file).take(HEADER as u64).read_to_end(&mut bytes).map_err(refused)?;
    // No more than the header says is read, and one byte that shows that there is more; `plain` looks at it again.
    if let Ok(header) = Header::read(&bytes) {
        let rest = header.packed_length.saturating_add(1);
        file.take(rest).read_to_end(&mut bytes).map_err(refused)?;
    }
    let plain = plain(&bytes);
    drop(bytes);
    match plain.and_then(|plain| decode(&plain)) {
        Ok(stored) => Ok(stored),
        Err(Flaw::OtherVersion(version)) => Err(StoreError::OtherVersion { path: path.to_owned(), version }),
        Err(Flaw::Damaged(what)) => Err(StoreError::Damaged { path: path.to_owned(), what }),
    }
}

fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name: OsString = path.as_os_str().to_owned();
    name.push(".");
    name.push(end);
    name.into()
}

/// Writes a file as `NAME.part` and gives it the name `to`, in place of what has it.
fn write_beside(path: &Path, to: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
    let name = beside(path, "part");
    // What a killed process has left: who has the lock is the only one who writes it.
    match fs::remove_file(&name) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let (mut partial, mut file) = Partial::create(name, to)?;
    write(&mut file)?;
    partial.settle(&file, to)
}

/// What bringing a folder to the disk has come to.
fn synced(folder: io::Result<()>) -> io::Result<()> {
    use io::ErrorKind::{InvalidInput, Unsupported};

    match folder {
        // Some file systems, such as VirtualBox's shared folders and some of 9p, refuse it for any folder: nothing safer can be had
        // there, and PostgreSQL takes it so too.
        Err(error) if matches!(error.kind(), InvalidInput | Unsupported) => Ok(()),
        other => other,
    }
}

/// Why bytes are no map.
#[derive(Debug, PartialEq, Eq)]
pub enum Flaw {
    /// They are of this version.
    OtherVersion(u32),
    /// What is wrong, with its numbers.
    Damaged(String),
}

/// The bytes of a file. As plain data or unpacked bytes a large map has more than all else that is held of it: no more of the one is
/// there at once than a block, and of the other than the packer takes in one piece.
///
/// # Errors
/// When the encoder finds no memory.
pub fn pack(frame_id: &str, map: &Frozen) -> io::Result<Vec<u8>> {
    let packer = zstd::Encoder::new(vec![0; HEADER], LEVEL)?;
    let pieces = BufWriter::with_capacity(PIECE, Counted { to: packer, length: 0 });
    let pieces = postcard::to_io(&Storing { frame_id, map }, pieces).map_err(io::Error::other)?;
    let Counted { to: packer, length } = pieces.into_inner().map_err(io::IntoInnerError::into_error)?;
    let mut bytes = packer.finish()?;
    let (start, packed) = bytes.split_at_mut(HEADER);
    let mut header = Vec::with_capacity(HEADER);
    header.extend(MAGIC);
    header.extend(VERSION.to_le_bytes());
    header.extend(length.to_le_bytes());
    header.extend((packed.len() as u64).to_le_bytes());
    header.extend(checksum(&header, packed).to_le_bytes());
    start.copy_from_slice(&header);
    Ok(bytes)
}

/// What the packer takes in one piece: of each number on its own it would be slow.
const PIECE: usize = 1 << 17;

/// Counts the bytes on their way.
struct Counted<W> {
    to: W,
    length: u64,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.to.write(bytes)?;
        self.length += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        // What is packed comes out when the frame ends.
        Ok(())
    }
}

fn checksum(header: &[u8], packed: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(header);
    hasher.update(packed);
    hasher.finalize()
}

/// What the header says.
struct Header {
    plain_length: u64,
    packed_length: u64,
    checksum: u32,
}

impl Header {
    /// The first bytes of a file.
    fn read(bytes: &[u8]) -> Result<Self, Flaw> {
        let damaged = |what: String| Err(Flaw::Damaged(what));
        let Some(header) = bytes.get(..HEADER) else {
            return damaged(format!(
                "{}, fewer than the {HEADER} of its header",
                count_of(bytes.len(), "byte")
            ));
        };
        if &header[..8] != MAGIC {
            return damaged("it does not begin with `cfodimap`".to_owned());
        }
        let version = number(&header[8..12]) as u32;
        if version != VERSION {
            return Err(Flaw::OtherVersion(version));
        }
        let [plain_length, packed_length] = [12, 20].map(|at| number(&header[at..at + 8]));
        if plain_length > packed_length.saturating_mul(MOST_UNPACKED) {
            return damaged(format!("{packed_length} bytes that claim to be {plain_length}"));
        }
        Ok(Self { plain_length, packed_length, checksum: number(&header[CHECKED..]) as u32 })
    }
}

/// The map in the bytes of a file.
///
/// # Errors
/// When they hold none, or one of another version.
pub fn unpack(bytes: &[u8]) -> Result<Stored, Flaw> {
    decode(&plain(bytes)?)
}

/// The unpacked bytes of a map.
fn plain(bytes: &[u8]) -> Result<Vec<u8>, Flaw> {
    let damaged = |what: String| Err(Flaw::Damaged(what));
    let header = Header::read(bytes)?;
    let (start, packed) = bytes.split_at(HEADER);
    if header.packed_length != packed.len() as u64 {
        return damaged(format!(
            "{} after the header, and there are {}",
            count_of(header.packed_length, "byte"),
            packed.len()
        ));
    }
    let found = checksum(&start[..CHECKED], packed);
    if header.checksum != found {
        return damaged(format!("its checksum is {:08x}, that of its bytes {found:08x}", header.checksum));
    }
    let plain = inflate(packed, header.plain_length).map_err(|error| Flaw::Damaged(error.to_string()))?;
    if plain.len() as u64 != header.plain_length {
        return damaged(format!("{} bytes of map or more, and it says {}", plain.len(), header.plain_length));
    }
    Ok(plain)
}

fn decode(plain: &[u8]) -> Result<Stored, Flaw> {
    match postcard::take_from_bytes(plain) {
        Ok((stored, [])) => Ok(stored),
        Ok((_, rest)) => Err(Flaw::Damaged(format!("{} after the map", count_of(rest.len(), "byte")))),
        Err(error) => Err(Flaw::Damaged(error.to_string())),
    }
}

/// The unpacked bytes, and one more where there are more than `length`.
fn inflate(packed: &[u8], length: u64) -> io::Result<Vec<u8>> {
    let mut plain = Vec::new();
    zstd::Decoder::new(packed)?.take(length + 1).read_to_end(&mut plain)?;
    Ok(plain)
}

/// A number of up to 8 bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

#[cfg(test)]
mod tests;
