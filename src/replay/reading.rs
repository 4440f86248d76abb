//! The thread that reads, decompresses and decodes.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use crate::bag::{BagError, Decoder, Message, Messages, Recorded};

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

/// The reading thread; ends when nobody listens any more.
pub(super) fn read(
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
