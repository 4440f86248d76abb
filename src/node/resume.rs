//! What a session begins with: an empty map, or the one that was saved.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;
use tracing::{info, warn};

use crate::config::Config;
use crate::engine::{Engine, RestoreError};
use crate::store::{self, Lock, StoreError, Stored};

/// The engine that a session begins with: with the map of `snapshot_path` where it is to be resumed and there is one. What
/// cannot be used is set aside, never written over: a damaged or newer file, and one that is not to be resumed. The lock is
/// the right to save there, to be kept as long as the node runs.
///
/// # Errors
/// When there is no path, another process saves there, the map was made with other parameters, or a file cannot be read or
/// set aside.
pub fn begin(config: &Config, resume: bool) -> Result<(Engine, Option<Lock>), BeginError> {
    let Some(path) = config.snapshot_path.as_deref() else {
        return if resume { Err(BeginError::NoPath) } else { Ok((Engine::new(config.engine), None)) };
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) || path.is_dir() {
        return Err(BeginError::NoFolder(path.to_owned()));
    }
    let lock = store::lock(path).map_err(BeginError::Locked)?;
    if resume {
        return Ok((resumed(config, path)?, Some(lock)));
    }
    if path.exists() {
        let kept = set_aside(path, "before")?;
        info!("not resumed: the map that was saved is kept as {}", kept.display());
    }
    Ok((Engine::new(config.engine), Some(lock)))
}

fn resumed(config: &Config, path: &Path) -> Result<Engine, BeginError> {
    let params = config.engine;
    match read(config, path) {
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
fn read(config: &Config, path: &Path) -> Result<(Engine, u64), StoreError> {
    let Stored { frame_id, map } = store::read(path)?;
    let refused = |error| StoreError::Map { path: path.to_owned(), error };
    if frame_id != config.fixed_frame {
        let (name, now) = ("fixed_frame", config.fixed_frame.clone());
        return Err(refused(RestoreError::Parameter { name, saved: frame_id, now }));
    }
    Ok((Engine::restore(config.engine, &map).map_err(refused)?, map.sequence()))
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
    /// Another process saves there, or it cannot be known.
    #[error(transparent)]
    Locked(StoreError),
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

impl BeginError {
    /// Whether starting the node in the same way will fail again.
    pub const fn is_configuration(&self) -> bool {
        matches!(self, Self::NoPath | Self::NoFolder(_) | Self::Parameter { .. })
    }
}
