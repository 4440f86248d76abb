//! Maps on their way into a file, on a thread of its own: a slow disk holds up neither the engine nor the network.

use std::path::PathBuf;
use std::sync::mpsc::{Sender, channel};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tracing::{debug, info, warn};

use crate::config::Config;
use crate::engine::{Engine, RestoreError, SavedMap};
use crate::msg::ros::TriggerResponse;
use crate::store::{self, StoreError};

/// A map that has been written: its number of scans and its bytes.
pub(super) type Written = Result<(u64, u64), StoreError>;

/// Starts the thread `cfodi-saver`, which writes what it is sent, one map after the other, and ends when the sender is gone.
///
/// # Errors
/// When the system gives no thread.
pub(super) fn start(path: PathBuf) -> std::io::Result<(Sender<Box<SavedMap>>, UnboundedReceiver<Written>)> {
    let (maps, waiting) = channel::<Box<SavedMap>>();
    let (written, results) = unbounded_channel();
    std::thread::Builder::new().name("cfodi-saver".to_owned()).spawn(move || {
        for map in waiting {
            let result = store::write(&path, &map).map(|bytes| (map.sequence(), bytes));
            if written.send(result).is_err() {
                return;
            }
        }
    })?;
    Ok((maps, results))
}

/// Who waits for a map to be written. At most one is under way, so that none piles up before a slow disk.
#[derive(Debug)]
pub(super) struct Saving<Request> {
    is_under_way: bool,
    /// Calls that the map under way answers.
    asked: Vec<Request>,
    /// Calls that came after it was asked for.
    waiting: Vec<Request>,
}

impl<Request> Default for Saving<Request> {
    fn default() -> Self {
        Self { is_under_way: false, asked: Vec::new(), waiting: Vec::new() }
    }
}

impl<Request> Saving<Request> {
    /// Whether a map is to be asked for now; `call` waits for it, or for the next one.
    pub(super) fn begin(&mut self, call: Option<Request>) -> bool {
        let calls = if self.is_under_way { &mut self.waiting } else { &mut self.asked };
        calls.extend(call);
        !std::mem::replace(&mut self.is_under_way, true)
    }

    /// The calls that are answered by a map that has been written; whether the next is to be asked for.
    pub(super) fn end(&mut self) -> (Vec<Request>, bool) {
        let answered = std::mem::replace(&mut self.asked, std::mem::take(&mut self.waiting));
        self.is_under_way = !self.asked.is_empty();
        (answered, self.is_under_way)
    }

    /// All that wait.
    pub(super) fn into_calls(self) -> impl Iterator<Item = Request> {
        self.asked.into_iter().chain(self.waiting)
    }
}

/// What a caller of `~/save` is told.
pub(super) fn response(written: &Written) -> TriggerResponse {
    match written {
        Ok((scans, bytes)) => {
            TriggerResponse { success: true, message: format!("{scans} scans saved, {bytes} bytes") }
        }
        Err(error) => TriggerResponse { success: false, message: error.to_string() },
    }
}

/// The engine that a session begins with: with the map of `snapshot_path` where it is to be resumed and there is one. What
/// cannot be used is set aside, never written over: a damaged or newer file, and one that is not to be resumed.
///
/// # Errors
/// When there is no path, the map was made with other parameters, or a file cannot be set aside.
pub fn begin(config: &Config, resume: bool) -> Result<Engine, BeginError> {
    let empty = || Engine::new(config.engine);
    let Some(path) = config.snapshot_path.as_deref() else {
        return if resume { Err(BeginError::NoPath) } else { Ok(empty()) };
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) || path.is_dir() {
        return Err(BeginError::NoFolder(path.to_owned()));
    }
    let set_aside =
        |why| store::set_aside(path, why).map_err(|error| BeginError::Kept { path: path.to_owned(), error });
    if !resume {
        if path.exists() {
            let kept = set_aside("before")?;
            info!("not resumed: the map that was saved is kept as {}", kept.display());
        }
        return Ok(empty());
    }
    let restored = store::read(path).and_then(|map| {
        let error = |error| StoreError::Map { path: path.to_owned(), error };
        Engine::restore(config.engine, &map).map(|engine| (engine, map.sequence())).map_err(error)
    });
    match restored {
        Ok((engine, scans)) => {
            info!("resumed: {} voxels of {scans} scans from {}", engine.voxel_count(), path.display());
            Ok(engine)
        }
        Err(error) if error.is_missing() => {
            info!("nothing to resume: there is no {} yet", path.display());
            Ok(empty())
        }
        Err(StoreError::Map { error: error @ RestoreError::Parameter { .. }, .. }) => {
            Err(BeginError::Parameter { path: path.to_owned(), error })
        }
        // The file may be whole, and the disk is not to be trusted with a new name for it.
        Err(error @ StoreError::Io { .. }) => Err(BeginError::Unreadable(error)),
        Err(error) => {
            let kept = set_aside("refused")?;
            warn!("not resumed: {error}; it is kept as {}", kept.display());
            Ok(empty())
        }
    }
}

/// A session cannot begin with what is in `snapshot_path`.
#[derive(Debug, thiserror::Error)]
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
        error: std::io::Error,
    },
}

/// Says how a map was written that nobody has called for.
pub(super) fn log(written: &Written) {
    match written {
        Ok((scans, bytes)) => debug!("map of {scans} scans saved, {bytes} bytes"),
        Err(error) => warn!("the map was not saved: {error}"),
    }
}
