//! What a name of a file stands for, whether or not the file is there yet.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Links that are followed one after the other, as by Linux.
const MOST_LINKS: usize = 40;

/// What a name stands for: symbolic links stay, and what they lead to is replaced, there or not there yet.
///
/// # Errors
/// Where they lead in a circle.
pub fn target(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(to) = fs::read_link(&target) else { return Ok(target) };
        target = folder(&target).join(to);
    }
    Err(io::Error::other("its symbolic links lead in a circle"))
}

/// The number of the descriptor that a name leads to, of those that this process was given open: `/dev/stdout`, `/dev/fd/3`.
pub(crate) fn descriptor(path: &Path) -> Option<u32> {
    let own = fs::canonicalize("/proc/self/fd").ok()?;
    let mut name = path.to_owned();
    for _ in 0..MOST_LINKS {
        if fs::canonicalize(folder(&name)).is_ok_and(|folder| folder == own) {
            return name.file_name()?.to_str()?.parse().ok();
        }
        let to = fs::read_link(&name).ok()?;
        name = folder(&name).join(to);
    }
    None
}

/// The last part of a name; `None` of one that only a folder can have.
pub(crate) fn file_name(path: &Path) -> Option<&OsStr> {
    // `Path::file_name` passes over what makes a name that of a folder.
    let name = path.as_os_str().as_encoded_bytes();
    let is_folder = name.ends_with(b"/") || name.ends_with(b"/.");
    path.file_name().filter(|_| !is_folder)
}

/// The folder that a name is in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
