//! What a session begins with: an empty map, or the one that was saved.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;
use tracing::{info, warn};

use crate::config::Config;
use crate::engine::{Engine, Params, RestoreError};
use crate::store::{self, StoreError};

/// The engine that a session begins with: with the map of `snapshot_path` where it is to be resumed and there is one. What
/// cannot be used is set aside, never written over: a damaged or newer file, and one that is not to be resumed.
///
/// # Errors
/// When there is no path, the map was made with other parameters, or a file cannot be read or set aside.
pub fn begin(config: &Config, resume: bool) -> Result<Engine, BeginError> {
    let Some(path) = config.snapshot_path.as_deref() else {
        return if resume { Err(BeginError::NoPath) } else { Ok(Engine::new(config.engine)) };
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) || path.is_dir() {
        return Err(BeginError::NoFolder(path.to_owned()));
    }
    if resume {
        return resumed(config.engine, path);
    }
    if path.exists() {
        let kept = set_aside(path, "before")?;
        info!("not resumed: the map that was saved is kept as {}", kept.display());
    }
    Ok(Engine::new(config.engine))
}

fn resumed(params: Params, path: &Path) -> Result<Engine, BeginError> {
    match read(params, path) {
        Ok((engine, scans)) => {
            info!("resumed: {} voxels of {scans} scans from {}", engine.voxel_count(), path.display());
            Ok(engine)
        }
        Err(error) if error.is_missing() => {
            info!("nothing to resume: there is no {} yet", path.display());
            Ok(Engine::new(params))
        }
        Err(StoreError::Map { error: error @ RestoreError::Parameter { .. }, .. }) => {
            Err(BeginError::Parameter { path: path.to_owned(), error })
        }
        // The file may be whole, and such a disk is not to be trusted with another name for it.
        Err(error @ StoreError::Io { .. }) => Err(BeginError::Unreadable(error)),
        Err(error) => {
            let kept = set_aside(path, "refused")?;
            warn!("not resumed: {error}; it is kept as {}", kept.display());
            Ok(Engine::new(params))
        }
    }
}

/// The engine of a file, and how many scans it has taken in.
fn read(params: Params, path: &Path) -> Result<(Engine, u64), StoreError> {
    let map = store::read(path)?;
    let engine = Engine::restore(params, &map);
    let engine = engine.map_err(|error| StoreError::Map { path: path.to_owned(), error })?;
    Ok((engine, map.sequence()))
}

fn set_aside(path: &Path, why: &str) -> Result<PathBuf, BeginError> {
    store::set_aside(path, why).map_err(|error| BeginError::Kept { path: path.to_owned(), error })
}

/// A session cannot begin with what is in `snapshot_path`.
#[derive(Debug, Error)]
pub enum BeginError {
    /// There is nothing to resume from.
    #[error("--resume needs the parameter snapshot_path: the file of the map")]
    NoPath,
    /// It cannot be written later.
    #[error("snapshot_path is {0}; it must be a file in a folder that exists")]
    NoFolder(PathBuf),
    /// It is another map.
    #[error("{path}: {error}; start with that, or without --resume")]
    Parameter {
        /// The file.
        path: PathBuf,
        /// What is other.
        error: RestoreError,
    },
    /// It is there and cannot be read.
    #[error("cannot resume: {0}")]
    Unreadable(StoreError),
    /// The file would be written over.
    #[error("{path} cannot be set aside: {error}")]
    Kept {
        /// The file.
        path: PathBuf,
        /// The system's words.
        error: io::Error,
    },
}
