//! What waits for the worker, and in which order it is done.

use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::Took;
use crate::engine::{Params, Scan};

/// A session to begin with an empty map.
pub(super) struct Beginning {
    pub(super) session: u64,
    /// Whether the map that it ends is to come out: nobody has asked for that to be thrown away.
    pub(super) keeps_map: bool,
}

/// What waits for the worker.
#[derive(Default)]
pub(super) struct Pending {
    /// Before anything else.
    pub(super) session: Option<Beginning>,
    /// What the engine is to go on with, before the next scan.
    pub(super) params: Option<Params>,
    /// Oldest first, each with its sensor.
    pub(super) scans: VecDeque<(usize, Scan)>,
    pub(super) snapshot: bool,
    /// What puts the next snapshot off.
    pub(super) off: Option<Off>,
    pub(super) save: bool,
    pub(super) stop: bool,
}

/// What puts a snapshot off.
#[derive(Clone, Copy)]
pub(super) enum Off {
    /// One that is being made.
    Making,
    /// One that took long.
    Rest {
        until: Instant,
        /// While scans wait.
        until_before_scans: Instant,
    },
}

impl Off {
    fn after(took: Took) -> Self {
        let now = Instant::now();
        Self::Rest { until: now + took.rest(), until_before_scans: now + took.rest_before_scans() }
    }
}

impl Pending {
    /// How much longer the requested snapshot is postponed: [`Duration::MAX`] while another is being made, `None` if it may be made now
    /// or none is requested. The snapshot at the end is never postponed.
    fn put_off(&self) -> Option<Duration> {
        let left = match self.off.filter(|_| self.snapshot && !self.stop)? {
            Off::Making => Duration::MAX,
            Off::Rest { until, until_before_scans } => {
                let until = if self.scans.is_empty() { until } else { until_before_scans };
                until.saturating_duration_since(Instant::now())
            }
        };
        Some(left).filter(|left| !left.is_zero())
    }

    /// Whether there is nothing to do but a snapshot that is put off.
    fn is_idle(&self, is_put_off: bool) -> bool {
        let has_nothing = self.session.is_none() && self.params.is_none() && self.scans.is_empty();
        has_nothing && (is_put_off || !self.snapshot) && !self.save && !self.stop
    }
}

/// What the worker does next, in this order.
pub(super) struct Task {
    pub(super) session: Option<Beginning>,
    pub(super) params: Option<Params>,
    /// With its sensor.
    pub(super) scan: Option<(usize, Scan)>,
    pub(super) snapshot: bool,
    pub(super) save: bool,
    pub(super) stop: bool,
}

impl Task {
    /// Whether the map may be another afterwards.
    pub(super) const fn touches_map(&self) -> bool {
        self.session.is_some() || self.params.is_some() || self.scan.is_some()
    }
}

#[derive(Default)]
pub(super) struct Mailbox {
    pending: Mutex<Pending>,
    filled: Condvar,
}

impl Mailbox {
    pub(super) fn lock(&self) -> MutexGuard<'_, Pending> {
        // No change of the mailbox can panic on its way: a panic elsewhere leaves nothing half done.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn put<T>(&self, change: impl FnOnce(&mut Pending) -> T) -> T {
        let result = change(&mut self.lock());
        self.filled.notify_one();
        result
    }

    pub(super) fn take(&self) -> Task {
        let mut pending = self.lock();
        let mut put_off = pending.put_off();
        while pending.is_idle(put_off.is_some()) {
            pending = match put_off {
                Some(left) if left < Duration::MAX => {
                    let waited = self.filled.wait_timeout(pending, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                _ => self.filled.wait(pending).unwrap_or_else(PoisonError::into_inner),
            };
            put_off = pending.put_off();
        }
        let scan = pending.scans.pop_front();
        // The end comes after all scans and with the whole map; a snapshot in between must not wait for a pause.
        let stop = pending.stop && pending.scans.is_empty();
        let is_time = stop || !pending.stop;
        let snapshot = is_time && put_off.is_none() && std::mem::take(&mut pending.snapshot);
        let save = is_time && std::mem::take(&mut pending.save);
        let (session, params) = (pending.session.take(), pending.params.take());
        Task { session, params, scan, snapshot, save, stop }
    }

    /// Puts the next snapshot off after one that took so long, but for that of a session which is to begin.
    pub(super) fn rest(&self, took: Took) {
        self.put(|pending| pending.off = Some(Off::after(took)).filter(|_| pending.session.is_none()));
    }
}

#[cfg(test)]
mod tests {
    use super::super::SHORT;
    use super::super::tests::scan;
    use super::*;

    #[test]
    fn after_a_snapshot_that_held_the_engine_up_the_next_is_put_off_for_long_only_while_scans_wait() {
        let after = |freezing: Duration, making: Duration, stop: bool, waiting: i64| {
            let mailbox = Mailbox::default();
            mailbox.rest(Took { freezing, making });
            mailbox.put(|pending| {
                (pending.snapshot, pending.stop) = (true, stop);
                pending.scans.extend((0..waiting).map(|stamp| (0, scan(stamp))));
                let is_put_off = pending.put_off().is_some();
                (is_put_off, pending.is_idle(is_put_off))
            })
        };
        let (no_time, long) = (Duration::ZERO, Duration::from_secs(60));
        assert_eq!(
            [after(long, no_time, false, 0), after(long, no_time, false, 2)],
            [(true, true), (true, false)]
        );
        assert_eq!(after(SHORT, no_time, false, 0), (false, false));
        // A busy machine may hold this thread up until the pause is over.
        assert!((0..3).any(|_| after(SHORT, no_time, false, 2) == (true, false)), "put off while scans wait");
        assert_eq!(
            [after(no_time, long, false, 0), after(no_time, long, false, 2)],
            [(true, true), (true, false)]
        );
        assert_eq!(after(long, long, true, 0), (false, false), "the last one is not put off");
    }
}
