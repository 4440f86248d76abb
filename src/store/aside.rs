//! Maps that are set aside: kept beside the one that is saved, as `NAME.KIND-1`, `NAME.KIND-2` and so on.
//!
//! **Kept true.** No file is written over. Of two of a kind the one with the greater number was set aside later: no clock is
//! asked, for a robot's may begin in 1970. What has not exactly such a name is never named as one too many.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};

use super::{beside, folder, synced, target, write_beside};

/// Most files of a kind that are to be kept: a node that starts again and again must not fill its disk.
pub const MOST_ASIDE: usize = 8;

/// Why a map is set aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// Another was to take its place.
    Before,
    /// It could not be resumed.
    Refused,
}

impl Kept {
    /// All there are.
    pub const ALL: [Self; 2] = [Self::Before, Self::Refused];

    /// As it stands in names of files.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::Refused => "refused",
        }
    }
}

/// Gives a file another name beside its own, `NAME.KIND-1` or one with a number above all that there are, and returns it.
///
/// # Errors
/// When the system refuses it, or there is no greater number.
pub fn set_aside(path: &Path, kind: Kept) -> io::Result<PathBuf> {
    let path = &target(path)?;
    let name = next_name(path, kind)?;
    fs::rename(path, &name)?;
    Ok(name)
}

/// Gives a file a second name, chosen as by [`set_aside`], under which it stays when another takes its own; `None` where
/// there is no file, or it has such a name already: a disk on which nothing takes its place must not fill with names of one file.
///
/// # Errors
/// When the system refuses it, or there is no greater number; no second name is then left.
pub fn keep_aside(path: &Path, kind: Kept) -> io::Result<Option<PathBuf>> {
    keep_aside_by(|path, name| fs::hard_link(path, name), path, kind)
}

/// By this way to give a second name, or where there is none, as on FAT, by a copy.
pub(super) fn keep_aside_by(
    link: impl FnOnce(&Path, &Path) -> io::Result<()>,
    path: &Path,
    kind: Kept,
) -> io::Result<Option<PathBuf>> {
    let path = &target(path)?;
    if !path.try_exists()? {
        return Ok(None);
    }
    if is_kept(path, kind)? {
        return Ok(None);
    }
    let name = next_name(path, kind)?;
    let folder = File::open(folder(path))?;
    link(path, &name).or_else(|_| copy(path, &name))?;
    // A disk may take changes of a folder in another order: the map must not lose its name before it has this one.
    if let Err(error) = synced(folder.sync_all()) {
        drop(fs::remove_file(&name));
        return Err(error);
    }
    Ok(Some(name))
}

/// Whether a file has a name of this kind beside its own.
fn is_kept(path: &Path, kind: Kept) -> io::Result<bool> {
    let file = path.metadata()?;
    let is_it = |about: fs::Metadata| (about.dev(), about.ino()) == (file.dev(), file.ino());
    let asides = asides(path, kind)?;
    Ok(asides.iter().any(|aside| name(path, kind, aside.number).symlink_metadata().is_ok_and(is_it)))
}

/// Copies a file, and who may read it, to a name under which it is whole or not there.
fn copy(path: &Path, name: &Path) -> io::Result<()> {
    let mut from = File::open(path)?;
    write_beside(path, name, |file| {
        file.set_permissions(from.metadata()?.permissions())?;
        io::copy(&mut from, file).map(drop)
    })
}

fn next_name(path: &Path, kind: Kept) -> io::Result<PathBuf> {
    let last = asides(path, kind)?.last().map_or(0, |aside| aside.number);
    let number = last.checked_add(1).ok_or(io::ErrorKind::AlreadyExists)?;
    Ok(name(path, kind, number))
}

/// The files of a kind beyond the newest [`MOST_ASIDE`], the oldest first; the largest of all is none of them: after a row
/// of short starts it is what a robot has learned. A folder is none, whatever its name.
///
/// # Errors
/// When the system does not list them.
pub fn too_many_aside(path: &Path, kind: Kept) -> io::Result<Vec<PathBuf>> {
    let path = &target(path)?;
    let mut files = asides(path, kind)?;
    files.retain(|aside| aside.is_file);
    let largest = files.iter().max_by_key(|aside| aside.size).map(|aside| aside.number);
    files.truncate(files.len().saturating_sub(MOST_ASIDE));
    files.retain(|aside| Some(aside.number) != largest);
    Ok(files.into_iter().map(|aside| name(path, kind, aside.number)).collect())
}

/// The file of a kind, of more than so many bytes, that was set aside last; `None` where there is none.
///
/// # Errors
/// When the system does not list them.
pub fn newest_aside(path: &Path, kind: Kept, size: u64) -> io::Result<Option<PathBuf>> {
    let path = &target(path)?;
    let newest = asides(path, kind)?.into_iter().rfind(|aside| aside.is_file && aside.size > size);
    Ok(newest.map(|aside| name(path, kind, aside.number)))
}

/// What has a name that [`set_aside`] gives.
struct Aside {
    number: u32,
    /// No folder.
    is_file: bool,
    /// Bytes.
    size: u64,
}

/// By ascending number.
fn asides(path: &Path, kind: Kept) -> io::Result<Vec<Aside>> {
    let start = beside(path, &format!("{}-", kind.as_str()));
    let start = start.file_name().unwrap_or_default();
    let mut asides = Vec::new();
    for entry in fs::read_dir(folder(path))? {
        let entry = entry?;
        if let Some(number) = number(&entry.file_name(), start) {
            // Where the system does not tell what it is, it is not to be removed.
            let is_file = entry.file_type().is_ok_and(|kind| !kind.is_dir());
            let size = entry.metadata().map_or(0, |about| about.len());
            asides.push(Aside { number, is_file, size });
        }
    }
    asides.sort_unstable_by_key(|aside| aside.number);
    Ok(asides)
}

/// The number at the end of a name; `None` for `NAME.KIND-0`, `NAME.KIND-01` or `NAME.KIND-1.bak`, which are somebody else's.
fn number(name: &OsStr, start: &OsStr) -> Option<u32> {
    let digits = name.as_encoded_bytes().strip_prefix(start.as_encoded_bytes())?;
    let digits = str::from_utf8(digits).ok()?;
    let number = digits.parse::<u32>().ok().filter(|&number| number > 0)?;
    (number.to_string() == digits).then_some(number)
}

fn name(path: &Path, kind: Kept, number: u32) -> PathBuf {
    beside(path, &format!("{}-{number}", kind.as_str()))
}
