//! Work on threads of its own, and what a panic there says.

use std::any::Any;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

/// What something has panicked with.
pub(crate) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "without a message".to_owned())
}

/// Has something done on a thread of its own; here, where the system gives none.
pub(crate) fn spawn_or_run(thread: Builder, work: impl FnOnce() + Send + 'static) -> Option<JoinHandle<()>> {
    let work = Arc::new(Mutex::new(Some(work)));
    let there = Arc::clone(&work);
    let take = |work: &Mutex<Option<_>>| work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let thread = thread.spawn(move || take(&there).into_iter().for_each(|work| work())).ok();
    if thread.is_none() {
        take(&work).into_iter().for_each(|work| work());
    }
    thread
}
