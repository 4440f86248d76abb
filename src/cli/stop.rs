//! A signal ends a replay or a simulated drive early: what came before is still written.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Once};

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

fn listen() {
    let Ok(runtime) = tokio::runtime::Builder::new_current_thread().enable_io().build() else { return };
    runtime.block_on(async {
        let Ok(mut signals) = Signals::new() else { return };
        loop {
            signals.any().await;
            STOP.store(true, Ordering::Relaxed);
        }
    });
}
