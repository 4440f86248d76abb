//! What a name of a file stands for, whether or not the file is there yet.

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

/// The folder that a name is in.
pub(crate) fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
