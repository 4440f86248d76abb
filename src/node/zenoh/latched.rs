//! Messages of a latched topic, sent by a thread of their own. While Zenoh hands a late reader what it keeps for it, which behind
//! a slow link takes up to 5 s, nothing more can be put there; the node does not wait for that.

use std::collections::VecDeque;
use std::fmt::Display;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};

use tokio::sync::mpsc;

/// The way to the thread. When it is dropped, what still waits is sent, and then the thread ends.
pub(super) struct Latched<T> {
    /// Messages that may wait; beyond, the oldest goes, which nobody would be given any more.
    places: usize,
    queue: Arc<Queue<T>>,
    /// Closed when the thread ends.
    alive: mpsc::Sender<()>,
    thread: Option<JoinHandle<()>>,
}

struct Queue<T> {
    inside: Mutex<Inside<T>>,
    filled: Condvar,
}

struct Inside<T> {
    waiting: VecDeque<T>,
    /// Why the newest that could not be sent was not, until that is told.
    failed: Option<String>,
    ends: bool,
}

impl<T: Send + 'static> Latched<T> {
    /// Starts the thread, which sends by `put` and drops that at its end.
    pub(super) fn start<E: Display>(
        places: usize,
        put: impl FnMut(T) -> Result<(), E> + Send + 'static,
    ) -> io::Result<Self> {
        let inside = Inside { waiting: VecDeque::new(), failed: None, ends: false };
        let queue = Arc::new(Queue { inside: Mutex::new(inside), filled: Condvar::new() });
        let there = Arc::clone(&queue);
        let (alive, lives) = mpsc::channel(1);
        let thread = Builder::new().name("cfodi-latched".to_owned());
        let thread = thread.spawn(move || {
            let _lives = lives;
            there.send_all(put);
        });
        Ok(Self { places, queue, alive, thread: Some(thread?) })
    }

    /// Hands over a message; returns why one before could not be sent.
    pub(super) fn send(&self, message: T) -> Option<String> {
        self.queue.change(|inside| {
            inside.waiting.push_back(message);
            if inside.waiting.len() > self.places {
                inside.waiting.pop_front();
            }
            inside.failed.take()
        })
    }

    /// Resolves when the thread has ended: nothing would be sent any more.
    pub(super) async fn ended(&self) {
        self.alive.closed().await;
    }
}

impl<T> Drop for Latched<T> {
    fn drop(&mut self) {
        self.queue.change(|inside| inside.ends = true);
        if let Some(thread) = self.thread.take() {
            // Who looked has been told of a panic there.
            drop(thread.join());
        }
    }
}

impl<T> Queue<T> {
    fn lock(&self) -> MutexGuard<'_, Inside<T>> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change<R>(&self, change: impl FnOnce(&mut Inside<T>) -> R) -> R {
        let result = change(&mut self.lock());
        self.filled.notify_one();
        result
    }

    fn send_all<E: Display>(&self, mut put: impl FnMut(T) -> Result<(), E>) {
        while let Some(message) = self.next() {
            if let Err(error) = put(message) {
                self.lock().failed = Some(error.to_string());
            }
        }
    }

    /// The next message; `None` at the end.
    fn next(&self) -> Option<T> {
        let idle = |inside: &mut Inside<T>| inside.waiting.is_empty() && !inside.ends;
        let inside = self.filled.wait_while(self.lock(), idle);
        inside.unwrap_or_else(PoisonError::into_inner).waiting.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{channel, sync_channel};
    use std::time::Duration;

    use futures::FutureExt as _;

    use super::*;

    #[test]
    fn while_one_is_held_up_the_newest_wait_and_all_that_wait_go_out_before_the_end() {
        let ((through, let_through), (sender, sent)) = (sync_channel(0), channel());
        let put = move |message: u32| {
            sender.send(message).unwrap();
            let_through.recv().unwrap();
            if message == 1 { Err("held up") } else { Ok(()) }
        };
        let latched = Latched::start(2, put).unwrap();
        assert_eq!(latched.send(1), None);
        assert_eq!(sent.recv().unwrap(), 1);
        assert!((2..=4).all(|message| latched.send(message).is_none()), "the first is still under way");
        through.send(()).unwrap();
        assert_eq!(sent.recv().unwrap(), 3);
        assert_eq!(latched.send(5).as_deref(), Some("held up"));
        let ending = std::thread::spawn(move || drop(latched));
        (0..3).for_each(|_| through.send(()).unwrap());
        ending.join().unwrap();
        assert_eq!(sent.iter().collect::<Vec<_>>(), [4, 5]);
    }

    #[tokio::test]
    async fn it_is_known_when_the_thread_has_died() {
        let put = |_: u32| -> Result<(), &str> { std::panic::resume_unwind(Box::new("died")) };
        let latched = Latched::start(2, put).unwrap();
        assert!(latched.ended().now_or_never().is_none());
        assert_eq!(latched.send(1), None);
        tokio::time::timeout(Duration::from_secs(60), latched.ended()).await.unwrap();
    }
}
