//! Maps on their way into a file, on a thread of its own: a slow disk holds up neither the engine nor the network.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Weak};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tracing::{Level, warn};

use super::kept::{has_no_scan, remove_oldest};
use super::throttle::{Throttle, log};
use crate::engine::Frozen;
use crate::msg::clusters::MapVersion;
use crate::store::{self, Kept, StoreError};

/// A map that has been written, or why it was not.
pub(super) type Written = Result<InFile, StoreError>;

/// A map in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InFile {
    pub(super) version: MapVersion,
    pub(super) bytes: u64,
}

/// What the thread that writes is told.
#[derive(Debug)]
enum Task {
    /// Write the map of a session, in place of the one before; with `last` where a jump has ended it, and nobody waits for that.
    Write { session: u64, map: Arc<Frozen>, last: Option<OnItsWay> },
    /// Before the first map of session `before` or later is written, give the file a second name, since nobody asked to lose it. Maps
    /// of earlier sessions that still wait are written first, so the newest of them is what is kept.
    Keep { before: u64 },
}

/// Dropped with the session's last map, so that [`Saver`] sees when it is done.
type OnItsWay = Arc<()>;

/// Most that waits for the thread. `CallsForMap` lets one map be under way, a jump adds one, and the node's end asks for one more;
/// before, between and after them a [`Task::Keep`] has its place.
const PLACES: usize = 7;

/// The way to the thread that writes. Nobody waits here, however long the disk does not answer.
#[derive(Debug)]
pub(super) struct Saver {
    tasks: SyncSender<Task>,
    /// The newest task is a [`Task::Keep`].
    keeps: Cell<bool>,
    /// The last map of a session, while it is on its way.
    last: RefCell<Weak<()>>,
}

impl Saver {
    /// Has the map of a session written, in place of the one before.
    pub(super) fn write(&self, session: u64, map: Arc<Frozen>) {
        self.send(Task::Write { session, map, last: None });
        self.keeps.set(false);
    }

    /// Has the map written that a jump has ended a session with, and kept. While one such is on its way another is given up, and
    /// what is in the file of its session is kept instead: a clock that jumps for ever is faster than any disk.
    pub(super) fn end(&self, session: u64, map: Arc<Frozen>) {
        if self.last.borrow().strong_count() == 0 {
            let last = OnItsWay::default();
            self.last.replace(Arc::downgrade(&last));
            self.send(Task::Write { session, map, last: Some(last) });
            self.keeps.set(false);
        }
        self.keep(session + 1);
    }

    /// Has the file kept under another name before the map of a session takes its place. Where no map was sent since this was
    /// asked for last, there is nothing more to keep: a clock that jumps for ever piles nothing up before a disk that does not
    /// answer.
    fn keep(&self, before: u64) {
        if !self.keeps.get() {
            self.keeps.set(self.send(Task::Keep { before }));
        }
    }

    /// Whether the task waits now.
    fn send(&self, task: Task) -> bool {
        match self.tasks.try_send(task) {
            Ok(()) => true,
            // Where that thread has died, the node learns so by itself.
            Err(TrySendError::Disconnected(_)) => false,
            Err(TrySendError::Full(_)) => {
                warn!("the disk does not answer: {PLACES} tasks wait for it, and one more is given up");
                false
            }
        }
    }
}

fn queue() -> (Saver, Receiver<Task>) {
    let (tasks, waiting) = sync_channel(PLACES);
    (Saver { tasks, keeps: Cell::default(), last: RefCell::default() }, waiting)
}

/// Starts the thread `cfodi-saver`, which does what it is sent, one after the other, and ends when the senders are gone.
///
/// # Errors
/// When the system gives no thread.
pub(super) fn start(path: PathBuf, frame_id: String) -> std::io::Result<(Saver, UnboundedReceiver<Written>)> {
    start_on(path, frame_id, store::write)
}

/// As [`start`], on a disk to which a map is brought by this.
fn start_on(
    path: PathBuf,
    frame_id: String,
    mut write: impl FnMut(&Path, &str, Arc<Frozen>) -> Result<u64, StoreError> + Send + 'static,
) -> std::io::Result<(Saver, UnboundedReceiver<Written>)> {
    let (saver, waiting) = queue();
    let (written, results) = unbounded_channel();
    std::thread::Builder::new().name("cfodi-saver".to_owned()).spawn(move || {
        let mut keeping = Keeping::default();
        for task in waiting {
            match task {
                Task::Keep { before } => keeping.before.push(before),
                Task::Write { session, map, last } => {
                    let version = MapVersion { session, sequence: map.sequence() };
                    let result = keeping.keep(&path, session).and_then(|()| write(&path, &frame_id, map));
                    let result = result.map(|bytes| InFile { version, bytes });
                    if last.is_some() {
                        keeping.say_last(&result);
                    } else if written.send(result).is_err() {
                        return;
                    }
                }
            }
        }
    })?;
    Ok((saver, results))
}

/// What is kept of files that are written over: of a robot whose clock jumps for ever as many as [`remove_oldest`] leaves.
#[derive(Debug, Default)]
struct Keeping {
    /// The file is to be kept before a map of one of these sessions, or of a later one, takes its place.
    before: Vec<u64>,
    throttle: Throttle,
}

impl Keeping {
    /// Keeps the file where it is to be kept, for a map of this session is about to take its place. One that has taken in no scan is
    /// left to be written over.
    ///
    /// # Errors
    /// When it cannot be kept; it is then still to be, and must not be written over.
    fn keep(&mut self, path: &Path, session: u64) -> Result<(), StoreError> {
        let is_due = self.before.extract_if(.., |before| session >= *before).count() > 0;
        if !is_due || has_no_scan(path) {
            return Ok(());
        }
        match store::keep_aside(path, Kept::Before) {
            Ok(None) => {}
            Ok(Some(name)) => {
                self.say("kept", &[format!("the map that was saved is kept as {}", name.display())]);
                self.say("removed", &remove_oldest(path, Kept::Before));
            }
            Err(error) => {
                self.before.push(session);
                return Err(StoreError::NotKept { path: path.to_owned(), error });
            }
        }
        Ok(())
    }

    /// Says how it went with a map that a jump has ended a session with.
    fn say_last(&mut self, written: &Written) {
        if let Err(error) = written {
            self.say("not_saved", &[format!("the map that a jump has ended was not saved: {error}")]);
        }
    }

    fn say(&mut self, kind: &'static str, lines: &[String]) {
        if lines.is_empty() {
            return;
        }
        let level = self.throttle.level_now(kind, Level::WARN);
        lines.iter().for_each(|line| log(level, line));
    }
}

#[cfg(test)]
mod tests;
