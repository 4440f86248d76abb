//! A signal ends a replay, an experiment or a simulated drive early: what came before is still written. Where that takes too
//! long, or waits for the reader of a pipe who does not come, a second signal ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Once};
use std::time::{Duration, Instant};

use cfodi::signals::Signals;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Set when a signal has come.
pub(crate) fn flag() -> Arc<AtomicBool> {
    static LISTENING: Once = Once::new();
    LISTENING.call_once(|| {
        // Without a thread to listen, a signal ends the program as it always does.
        drop(std::thread::Builder::new().name("cfodi-signals".to_owned()).spawn(listen));
    });
    Arc::clone(&STOP)
}

/// Signals within this time are one request: a terminal that closes, or who starts programs, sends several.
const ONE_REQUEST: Duration = Duration::from_secs(1);

fn listen() {
    let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_io().build() else { return };
    runtime.block_on(async {
        let Ok(mut signals) = Signals::new() else { return };
        signals.any().await;
        STOP.store(true, Ordering::Relaxed);
        let first = Instant::now();
        while first.elapsed() < ONE_REQUEST {
            signals.any().await;
        }
        // Nothing is said: stderr may be what the program waits for.
        std::process::exit(1);
    });
}
