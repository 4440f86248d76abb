//! Calls that found no place. With each that is dropped Zenoh tells the caller that there is no answer, and waits where that one
//! does not read: by a thread aside, for on Zenoh's own the messages of all others would wait too.

use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::Builder;

use crate::node::middleware::OpenError;

/// What may wait: as much as a caller sends in seconds. Of each there is only what its end needs, some hundred bytes and its key.
/// Who goes on beyond that is held up.
const PLACES: usize = 10_000;

/// The way to the thread, which ends with the last of them.
pub(super) struct Discards<T>(SyncSender<T>);

impl<T> Clone for Discards<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T: Send + 'static> Discards<T> {
    pub(super) fn start() -> Result<Self, OpenError> {
        let (sender, waiting) = sync_channel(PLACES);
        let thread = Builder::new().name("cfodi-discards".to_owned());
        thread.spawn(move || waiting.iter().for_each(drop::<T>)).map_err(OpenError::opening("a thread"))?;
        Ok(Self(sender))
    }

    /// Has them dropped there.
    pub(super) fn add(&self, all: impl IntoIterator<Item = T>) {
        // What finds no place there either is dropped here.
        all.into_iter().for_each(|one| drop(self.0.try_send(one)));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Sender, channel};
    use std::thread::{ThreadId, current};

    use super::*;

    struct Told(Sender<ThreadId>);

    impl Drop for Told {
        fn drop(&mut self) {
            self.0.send(current().id()).unwrap();
        }
    }

    #[test]
    fn what_is_discarded_is_dropped_by_another_thread() {
        let (sender, dropped) = channel();
        let discards = Discards::start().unwrap();
        discards.clone().add([Told(sender.clone()), Told(sender)]);
        let threads: Vec<_> = dropped.iter().collect();
        assert!(threads.len() == 2 && threads.iter().all(|thread| *thread != current().id()));
    }
}
