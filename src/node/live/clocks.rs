//! The clocks that the live node goes by: the system's, and the simulated one where there is one.

use std::time::{Duration, Instant};

use tracing::{info, warn};

use super::QUIET;
use crate::engine::Stamp;
use crate::join::Moment;
use crate::node::clock::now;

#[derive(Debug)]
pub(super) struct Clocks {
    start: Instant,
    /// Whether the time is simulated.
    is_simulated: bool,
    /// Newest stamp of the simulated clock.
    newest: Option<Stamp>,
    /// When it came last, or else the start.
    heard: Instant,
    /// Whether it was said that it does not come.
    said_fault: bool,
}

impl Clocks {
    /// Of a node that starts.
    pub(super) const fn new(start: Instant, is_simulated: bool) -> Self {
        Self { start, is_simulated, newest: None, heard: start, said_fault: false }
    }

    /// Whether the time is simulated.
    pub(super) const fn is_simulated(&self) -> bool {
        self.is_simulated
    }

    /// Takes in what the simulated clock says at this moment; the seconds by which it has jumped back.
    pub(super) fn hear(&mut self, stamp: Stamp, moment: Instant) -> Option<f64> {
        self.heard = moment;
        let back = self.newest.and_then(|newest| stamp.jump_back_from(newest));
        self.newest = if back.is_some() { Some(stamp) } else { self.newest.max(Some(stamp)) };
        back
    }

    /// What is to be said at this moment of the simulated clock where none comes.
    pub(super) fn fault(&self, moment: Instant) -> Option<String> {
        let silence = moment.duration_since(self.heard);
        if !self.is_simulated || silence < QUIET {
            return None;
        }
        Some(if self.newest.is_some() {
            format!("no /clock has come for {} s: the simulated time stands still", silence.as_secs())
        } else {
            "no /clock has come, which use_sim_time asks for: a bag is played with --clock, and a robot's time is not simulated"
                .to_owned()
        })
    }

    /// Says it once, and when it comes.
    pub(super) fn say(&mut self, moment: Instant) {
        let fault = self.fault(moment);
        let was_said = std::mem::replace(&mut self.said_fault, fault.is_some());
        match fault {
            Some(fault) if !was_said => warn!("{fault}"),
            None if was_said => info!("/clock comes now"),
            _ => {}
        }
    }

    /// The scans have jumped back to this stamp: the simulated clock comes after them, and has then not jumped.
    pub(super) fn follow(&mut self, stamp: Stamp) {
        self.newest = self.newest.map(|newest| newest.min(stamp));
    }

    /// Since the start, by the system's clock.
    pub(super) fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// What clouds wait by.
    pub(super) fn moment(&self) -> Moment {
        Moment { wall: self.elapsed(), simulated: self.newest }
    }

    /// The simulated time where that is what counts.
    pub(super) fn now(&self) -> Stamp {
        self.newest.unwrap_or_else(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_comes_late_is_none_that_has_jumped_nor_is_one_that_follows_the_scans() {
        let mut clocks = Clocks::new(Instant::now(), false);
        let at = |seconds: i64| Stamp::from_nanos(seconds * 1_000_000_000);
        assert_eq!(clocks.moment().simulated, None);
        assert_eq!([20, 19].map(|seconds| clocks.hear(at(seconds), Instant::now())), [None; 2]);
        assert_eq!((clocks.now(), clocks.moment().simulated), (at(20), Some(at(20))));
        assert!(clocks.hear(at(5), Instant::now()).is_some_and(|back| (back - 15.0).abs() < 1e-6));
        assert_eq!(clocks.now(), at(5));
        clocks.follow(at(7));
        assert_eq!(clocks.now(), at(5), "it is behind them already");
        clocks.follow(at(1));
        assert_eq!(clocks.hear(at(2), Instant::now()), None);
        assert_eq!(clocks.now(), at(2));
    }

    #[test]
    fn a_clock_that_was_never_heard_follows_no_scan() {
        let mut clocks = Clocks::new(Instant::now(), false);
        clocks.follow(Stamp::from_nanos(1));
        assert_eq!(clocks.moment().simulated, None);
    }
}
