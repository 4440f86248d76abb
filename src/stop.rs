//! A signal ends what is under way: a node as `node/live/ending.rs` tells, and a replay, an experiment or a simulated drive early,
//! of which what came before is still written. Where that takes too long, or waits for the reader of a pipe who does not come, a
//! second signal ends the program at once, without the outputs that are not complete.

use std::process::exit;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, LazyLock, Once};
use std::thread::Builder;
use std::time::{Duration, Instant};

use crate::replace::remove_temporary;
use crate::signals::Signals;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// How many have something to bring to its end first.
static HOLDING: AtomicUsize = AtomicUsize::new(0);

/// Signals within this time are one request: a terminal that closes, or who starts programs, sends several.
const ONE_REQUEST: Duration = Duration::from_secs(1);

/// Set when a signal has come since this was asked for first.
pub fn flag() -> Arc<AtomicBool> {
    static LISTENING: Once = Once::new();
    LISTENING.call_once(|| {
        let (ready, listens) = channel::<()>();
        let listening = move || listen(|| drop(ready));
        // Without a thread to listen, a signal ends the program as it always does.
        if Builder::new().name("cfodi-signals".to_owned()).spawn(listening).is_ok() {
            let _ended = listens.recv();
        }
    });
    Arc::clone(&STOP)
}

/// While this is there, no signal ends the program at once.
#[derive(Debug)]
pub(crate) struct Hold(());

impl Hold {
    pub(crate) fn new() -> Self {
        HOLDING.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        HOLDING.fetch_sub(1, Ordering::SeqCst);
    }
}

/// How long the outputs that are not complete have for being removed: their disk may be what the program waits for.
const REMOVING: Duration = Duration::from_secs(1);

fn drop_outputs() {
    let (removing, removed) = channel::<()>();
    let remove = move || {
        remove_temporary();
        drop(removing);
    };
    if Builder::new().name("cfodi-leaving".to_owned()).spawn(remove).is_ok() {
        // It sends nothing, and ends this when it is done.
        let _ended = removed.recv_timeout(REMOVING);
    }
}

/// Calls `ready` once signals are heard, or cannot be.
fn listen(ready: impl FnOnce()) {
    let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_io().build() else { return };
    runtime.block_on(async {
        let Ok(mut signals) = Signals::new() else { return };
        ready();
        signals.any().await;
        STOP.store(true, Ordering::Relaxed);
        let first = Instant::now();
        loop {
            signals.any().await;
            if first.elapsed() >= ONE_REQUEST && HOLDING.load(Ordering::SeqCst) == 0 {
                break;
            }
        }
        drop_outputs();
        // Nothing more is said, and what was said not waited for: stderr may be what the program waits for.
        exit(1);
    });
}
