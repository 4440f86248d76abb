//! What takes too long for the thread that hears is made on another.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread::Builder;

use tokio::sync::oneshot;

use crate::thread::{panic_text, spawn_or_run};

/// Makes something on a thread of its own; here, where the system gives none.
///
/// # Errors
/// What it has panicked with.
pub(super) async fn on_own_thread<T: Send + 'static>(
    thread: Builder,
    make: impl FnOnce() -> T + Send + 'static,
) -> Result<T, String> {
    let (tell, told) = oneshot::channel();
    spawn_or_run(thread, move || drop(tell.send(catch_unwind(AssertUnwindSafe(make)))));
    let made = told.await.map_err(|error| error.to_string())?;
    made.map_err(|panic| panic_text(&*panic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_is_made_on_its_own_thread_is_made_here_where_there_is_no_thread_and_a_panic_is_told_with_its_words()
     {
        let thread = || std::thread::current().id();
        let here = thread();
        // As much of a stack as no address has.
        let none = || Builder::new().stack_size(1 << 60);
        assert_eq!(on_own_thread(none(), thread).await, Ok(here));
        assert!(on_own_thread(Builder::new(), thread).await.unwrap() != here);
        for builder in [none(), Builder::new()] {
            let panics = || std::panic::resume_unwind(Box::new("no room"));
            assert_eq!(on_own_thread::<()>(builder, panics).await, Err("no room".to_owned()));
        }
    }
}
