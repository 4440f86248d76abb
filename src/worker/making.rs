//! Snapshots, made on a thread of their own, one at a time; the newest is kept for as long as the map is as it shows it.

use std::panic::resume_unwind;
use std::sync::{Arc, OnceLock};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use super::mailbox::Mailbox;
use super::{Output, Took};
use crate::engine::{Frozen, Snapshot};
use crate::thread::spawn_or_run;

/// A snapshot, and what it took.
type Made = (Arc<Snapshot>, Took);

/// The thread that makes a snapshot, and what comes of it.
#[derive(Default)]
pub(super) struct Making {
    thread: Option<JoinHandle<()>>,
    /// Of the map as it is. To keep it takes no memory: whoever publishes maps has the same one until the next is made.
    newest: Arc<OnceLock<Made>>,
}

impl Making {
    /// The map is another from now on; what is being made comes all the same.
    pub(super) fn forget(&mut self) {
        self.newest = Arc::default();
    }

    /// What was made of the map as it is; `None` also while it is being made.
    pub(super) fn newest(&self) -> Option<Made> {
        self.newest.get().cloned()
    }

    /// Has a snapshot made of the map as it is, which it took so long to freeze; here, where the system gives no thread.
    pub(super) fn begin(
        &mut self,
        mailbox: &Arc<Mailbox>,
        session: u64,
        (map, freezing): (Arc<Frozen>, Duration),
        mut sink: impl FnMut(Output) + Send + 'static,
    ) {
        self.forget();
        let (mailbox, newest) = (Arc::clone(mailbox), Arc::clone(&self.newest));
        let make = move || {
            let mut next = Next { mailbox: &mailbox, took: None };
            let start = Instant::now();
            let snapshot = Arc::new(map.snapshot());
            drop(map);
            let took = Took { freezing, making: start.elapsed() };
            _ = newest.set((Arc::clone(&snapshot), took));
            sink(Output::Snapshot { session, snapshot, took });
            next.took = Some(took);
        };
        self.thread = spawn_or_run(Builder::new().name("cfodi-map".to_owned()), make);
    }

    /// Waits for its end, and panics as it has.
    pub(super) fn finish(&mut self) {
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
            resume_unwind(panic);
        }
    }
}

/// Lets the next snapshot begin when it is dropped, after a pause where this one was made.
struct Next<'a> {
    mailbox: &'a Mailbox,
    took: Option<Took>,
}

impl Drop for Next<'_> {
    fn drop(&mut self) {
        match self.took {
            Some(took) => self.mailbox.rest(took),
            None => self.mailbox.put(|pending| pending.off = None),
        }
    }
}
