//! Between a thread of Zenoh and the node: places for messages, within bounds of number and bytes. Who puts never waits; where
//! there is no room the oldest go.

use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};

use tokio::sync::Notify;

/// What may wait.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    pub(super) messages: usize,
    pub(super) bytes: usize,
}

pub(super) struct Mailbox<T> {
    room: Room,
    inside: Mutex<Inside<T>>,
    arrived: Notify,
}

struct Inside<T> {
    waiting: VecDeque<(T, usize)>,
    bytes: usize,
    /// Messages that found no room since one was taken.
    dropped: u64,
}

impl<T> Mailbox<T> {
    pub(super) fn new(room: Room) -> Self {
        let inside = Inside { waiting: VecDeque::new(), bytes: 0, dropped: 0 };
        Self { room, inside: Mutex::new(inside), arrived: Notify::new() }
    }

    /// Adds a message of so many bytes; returns what has no room for it: where it is too large for itself, that too.
    pub(super) fn put(&self, message: T, bytes: usize) -> Vec<T> {
        let mut gone = Vec::new();
        {
            let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
            inside.waiting.push_back((message, bytes));
            inside.bytes = inside.bytes.saturating_add(bytes);
            while inside.waiting.len() > self.room.messages || inside.bytes > self.room.bytes {
                let Some((oldest, bytes)) = inside.waiting.pop_front() else { break };
                inside.bytes = inside.bytes.saturating_sub(bytes);
                inside.dropped += 1;
                gone.push(oldest);
            }
        }
        self.arrived.notify_one();
        gone
    }

    /// The oldest message, and how many before it were dropped.
    pub(super) async fn take(&self) -> (T, u64) {
        loop {
            if let Some(taken) = self.try_take() {
                return taken;
            }
            self.arrived.notified().await;
        }
    }

    fn try_take(&self) -> Option<(T, u64)> {
        let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        let (message, bytes) = inside.waiting.pop_front()?;
        inside.bytes = inside.bytes.saturating_sub(bytes);
        Some((message, std::mem::take(&mut inside.dropped)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_stay_within_number_and_bytes_and_the_others_are_counted() {
        let mailbox = Mailbox::new(Room { messages: 3, bytes: 100 });
        let gone = ['a', 'b', 'c', 'd'].map(|message| mailbox.put(message, 10));
        assert_eq!(gone.concat(), ['a']);
        assert_eq!(mailbox.try_take(), Some(('b', 1)));
        assert_eq!(mailbox.put('e', 85), ['c']);
        assert_eq!(mailbox.try_take(), Some(('d', 1)));
        assert_eq!((mailbox.try_take(), mailbox.try_take()), (Some(('e', 0)), None));
    }

    #[test]
    fn a_message_that_is_larger_than_the_room_is_dropped_and_counted_with_the_next() {
        let mailbox = Mailbox::new(Room { messages: 3, bytes: 100 });
        assert_eq!(mailbox.put('a', usize::MAX), ['a']);
        assert_eq!(mailbox.put('b', 101), ['b']);
        assert_eq!(mailbox.try_take(), None);
        assert!(mailbox.put('c', 100).is_empty());
        assert_eq!(mailbox.try_take(), Some(('c', 2)));
    }

    #[tokio::test]
    async fn who_waits_is_woken_by_another_thread() {
        let mailbox = std::sync::Arc::new(Mailbox::new(Room { messages: 1, bytes: 1 }));
        let there = std::sync::Arc::clone(&mailbox);
        let thread = std::thread::spawn(move || there.put('a', 1));
        assert_eq!(mailbox.take().await, ('a', 0));
        thread.join().unwrap();
    }
}
