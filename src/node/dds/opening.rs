//! The network is opened in time, or the process ends.
//!
//! `RustDDS` 0.15.1 waits for itself without end where a topic is opened after its event loop has ended, as it does in a process that
//! is stopped and goes on just then. Nobody could end the node with a signal: the thread that would heed it is the one that waits.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;
use std::time::Duration;

use tracing::error;

use crate::say::exit;

/// For how many of these it is waited, as long as a busy machine may take: a process that is stopped meanwhile misses one.
const TICKS: u32 = 30;
const TICK: Duration = Duration::from_secs(1);

/// What `open` gives. Where it does not come back in time, the process ends with status 1, for whoever started it to start it again.
pub(super) fn in_time<T>(open: impl FnOnce() -> T) -> T {
    or_else(open, TICK, || {
        error!("the middleware has not come back for {TICKS} s: the process ends");
        exit(1)
    })
}

/// What `open` gives; `late` is called beside it once it has taken that many ticks.
fn or_else<T>(open: impl FnOnce() -> T, tick: Duration, late: impl FnOnce() + Send + 'static) -> T {
    let (opening, opened) = channel::<()>();
    let watch = move || {
        if (0..TICKS).all(|_| opened.recv_timeout(tick) == Err(RecvTimeoutError::Timeout)) {
            late();
        }
    };
    // Without a thread to be had it is opened as well.
    drop(Builder::new().name("cfodi-opening".to_owned()).spawn(watch));
    let result = open();
    drop(opening);
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn what_takes_too_long_is_told_of_while_it_still_takes() {
        let (told, tells) = channel();
        let late = move || told.send(()).unwrap_or_default();
        or_else(|| tells.recv_timeout(LONG).unwrap(), Duration::from_millis(1), late);
    }

    #[test]
    fn what_is_opened_in_time_is_given_and_nothing_told() {
        let (told, tells) = channel::<()>();
        let late = move || told.send(()).unwrap_or_default();
        assert_eq!(or_else(|| 7, LONG, late), 7);
        // The watch has ended, and what it would have told by with it.
        assert_eq!(tells.recv_timeout(LONG), Err(RecvTimeoutError::Disconnected));
    }
}
