//! The thread that reads, decompresses and decodes.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use crate::bag::{BagError, Decoder, Message, Messages, Recorded};

/// How long a bag may hold nothing to be read until it is looked whether to stop.
const LOOK: Duration = Duration::from_millis(100);

/// Messages between the two threads at most.
const BETWEEN: usize = 2;

/// What the reading thread hands over.
pub(super) enum Item {
    Message(Message),
    /// What a message says that was recorded at this time (since the epoch).
    Recorded {
        recorded: Recorded,
        at: Duration,
        decoding: Duration,
    },
    Unread(BagError),
}

/// The reading thread, as it is listened to.
pub(super) struct Reading {
    receiver: Receiver<Item>,
    bytes: Arc<AtomicU64>,
    quit: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Reading {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system's.
    pub(super) fn start(messages: Messages, decoder: Decoder, with_messages: bool) -> io::Result<Self> {
        let bytes = messages.bytes_read();
        let (sender, receiver) = sync_channel(BETWEEN);
        let quit = Arc::new(AtomicBool::new(false));
        let thread = Builder::new().name("cfodi-bag".to_owned()).spawn({
            let quit = Arc::clone(&quit);
            move || read(messages, decoder, with_messages, &sender, &quit)
        })?;
        Ok(Self { receiver, bytes, quit, thread })
    }

    /// The next item, where one comes soon.
    ///
    /// # Errors
    /// Where none does, and where none comes any more.
    pub(super) fn item(&self) -> Result<Item, RecvTimeoutError> {
        self.receiver.recv_timeout(LOOK)
    }

    /// Bytes read of the bag, as they are on disk.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Ends the thread; says whether it has panicked.
    pub(super) fn end(self) -> bool {
        let Self { receiver, quit, thread, .. } = self;
        quit.store(true, Ordering::Relaxed);
        // A full channel would hold the reading thread back for ever.
        drop(receiver);
        thread.join().is_err()
    }
}

/// Reads to the end, or until nobody listens any more.
fn read(
    messages: Messages,
    mut decoder: Decoder,
    with_messages: bool,
    sender: &SyncSender<Item>,
    quit: &AtomicBool,
) {
    for message in messages {
        if quit.load(Ordering::Relaxed) {
            return;
        }
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                drop(sender.send(Item::Unread(error)));
                return;
            }
        };
        let at = Duration::from_nanos(message.log_time);
        let begin = Instant::now();
        let decoded = decoder.decode(&message);
        let decoding = begin.elapsed() / decoded.len().max(1) as u32;
        for recorded in decoded {
            if sender.send(Item::Recorded { recorded, at, decoding }).is_err() {
                return;
            }
        }
        if with_messages && sender.send(Item::Message(message)).is_err() {
            return;
        }
    }
}
