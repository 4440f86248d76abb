//! How long clouds have waited: by the clock on the wall, and where time is simulated, by the slower of it and `/clock`.
//!
//! What a simulator sends comes as slowly as its time goes, or not at all while it is halted. Where it goes faster than
//! the one on the wall, the network does not.

use std::time::{Duration, Instant};

use crate::engine::Stamp;

/// A time that goes on and never back.
#[derive(Debug)]
pub(super) struct Stopwatch {
    /// Up to the newest stamp of `/clock`.
    until: Duration,
    /// When that came, or the watch was started.
    at: Instant,
    /// That stamp; `None` where `/clock` tells nothing, or nothing yet.
    newest: Option<Stamp>,
}

impl Stopwatch {
    pub(super) const fn new(start: Instant) -> Self {
        Self { until: Duration::ZERO, at: start, newest: None }
    }

    /// Time since the start.
    pub(super) fn elapsed(&self, now: Instant) -> Duration {
        self.until
            + if self.newest.is_none() { now.saturating_duration_since(self.at) } else { Duration::ZERO }
    }

    /// Goes on to a stamp of `/clock`; one before the newest is where it goes on from.
    pub(super) fn clock(&mut self, stamp: Stamp, now: Instant) {
        let on_the_wall = now.saturating_duration_since(self.at);
        let simulated = self.newest.map(|newest| seconds(stamp.seconds_since(newest)));
        self.until += simulated.map_or(on_the_wall, |simulated| simulated.min(on_the_wall));
        (self.at, self.newest) = (now, Some(stamp));
    }
}

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slower_of_two_clocks_counts_and_none_goes_back() {
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut watch = Stopwatch::new(start);
        assert_eq!(watch.elapsed(at(2.0)), Duration::from_secs(2), "nothing on /clock yet");
        // Simulated seconds, seconds on the wall, and what has passed.
        let steps = [
            (1e9, 3.0, 3.0),
            (1e9 + 1.0, 8.0, 4.0),
            (1e9 + 101.0, 10.0, 6.0),
            (5.0, 11.0, 6.0),
            (6.0, 13.0, 7.0),
        ];
        for (simulated, wall, passed) in steps {
            watch.clock(Stamp::from_nanos((simulated * 1e9) as i64), at(wall));
            assert_eq!(watch.elapsed(at(wall + 100.0)), Duration::from_secs_f64(passed), "at {wall} s");
        }
    }
}
