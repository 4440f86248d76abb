//! Whether the threads of the middleware live.
//!
//! RustDDS leaves its event loops where a system call fails: that a process is stopped and continued is enough, for Linux
//! then interrupts `epoll_wait`. It tells nobody, and a node without them is alive, deaf and mute. Nothing in its interface
//! says whether they run, but Linux does. Elsewhere they are taken to live.

use std::collections::BTreeSet;
use std::fs;

/// What the names of its threads begin with.
const NAME: &str = "RustDDS";

/// Threads by their ids in the system.
#[derive(Debug)]
pub(super) struct Threads(BTreeSet<u32>);

impl Threads {
    /// The threads of the middleware that `open` starts, which nobody else may do meanwhile, and that have begun when it
    /// returns: each gives itself its name.
    pub(super) fn started_by<T>(open: impl FnOnce() -> T) -> (T, Self) {
        let before = running().unwrap_or_default();
        let opened = open();
        let after = running().unwrap_or_default();
        (opened, Self(after.difference(&before).copied().collect()))
    }

    /// Whether all of them run, as far as it can be known.
    pub(super) fn live(&self) -> bool {
        running().is_none_or(|running| self.0.is_subset(&running))
    }

    /// Whether none of them runs any more; `None` where it cannot be known.
    pub(super) fn have_ended(&self) -> Option<bool> {
        running().map(|running| self.0.is_disjoint(&running))
    }
}

/// `None` where the system does not tell.
fn running() -> Option<BTreeSet<u32>> {
    let tasks = fs::read_dir("/proc/self/task").ok()?;
    let named = tasks.filter_map(|task| {
        let task = task.ok()?;
        let name = fs::read_to_string(task.path().join("comm")).ok()?;
        let id = task.file_name().to_str()?.parse().ok()?;
        name.starts_with(NAME).then_some(id)
    });
    Some(named.collect())
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::thread::Builder;
    use std::time::{Duration, Instant};

    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_thread_that_has_ended_is_missed_and_others_are_none_of_its_concern() {
        let start = |name: &str| {
            let (end, ended) = channel::<()>();
            let (begin, begun) = channel();
            let body = move || {
                begin.send(()).unwrap();
                ended.recv().is_err()
            };
            let thread = Builder::new().name(name.to_owned()).spawn(body).unwrap();
            // A thread gives itself its name, before its body begins.
            begun.recv().unwrap();
            (end, thread)
        };
        let ((end, thread), threads) = Threads::started_by(|| start("RustDDS test"));
        let (other, other_thread) = start("RustDDS other");
        assert!(threads.0.len() == 1 && threads.live() && threads.have_ended() == Some(false));
        drop(other);
        other_thread.join().unwrap();
        assert!(threads.live());
        drop(end);
        thread.join().unwrap();
        let patience = Instant::now();
        while threads.live() && patience.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert!(!threads.live() && threads.have_ended() == Some(true));
    }
}
