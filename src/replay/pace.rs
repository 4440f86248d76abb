//! When snapshots are due, by the stamps of the scans.
//!
//! Scans that leave the newest stamp where it is are those of a sensor whose clock is behind that of another. The other one, an hour
//! ahead, may have fallen silent: once the newest stamp has stood still for [`PATIENCE`], and until it goes on, time goes by as they
//! were recorded.

use std::time::Duration;

use crate::engine::Stamp;

/// A pace that is kept on average. A snapshot is due with the scan that is nearest to its time: stamps are never quite even, and
/// waiting for a scan behind that time, each time anew, would lose up to a whole scan each time.
#[derive(Debug)]
pub(super) struct Pace {
    /// Time between two (ns).
    period: i64,
    /// How long until the next one is due, from the scan before (ns); 0 before the first scan.
    left: i64,
    /// `None` before the first scan.
    last: Option<Last>,
}

/// The scan before.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// The newest stamp until then.
    newest: Stamp,
    /// When it was recorded.
    recorded: Duration,
    /// How long before that, by recording, the newest stamp came (ns).
    still: i64,
}

/// How long the newest stamp may stand still, by recording, and no time go by (ns). With a sensor of 30 Hz, a simulator that takes
/// ten seconds for one still moves it in less.
const PATIENCE: i64 = 1_000_000_000;

impl Pace {
    pub(super) fn new(period: Duration) -> Self {
        Self { period: i64::try_from(period.as_nanos()).unwrap_or(i64::MAX), left: 0, last: None }
    }

    /// A scan of this stamp has come, and was recorded at this time: says whether a snapshot is due with it.
    pub(super) fn is_due(&mut self, stamp: Stamp, recorded: Duration) -> bool {
        let step = self.step(stamp, recorded);
        self.left = self.left.saturating_sub(step);
        if self.left > step / 2 {
            return false;
        }
        // What is late by a period or more is not made up for.
        let next = self.left.saturating_add(self.period);
        self.left = if next > 0 { next } else { self.period };
        true
    }

    /// How far time has gone on since the scan before (ns).
    fn step(&mut self, stamp: Stamp, recorded: Duration) -> i64 {
        let last = self.last.unwrap_or(Last { newest: stamp, recorded, still: 0 });
        let (step, still) = if stamp > last.newest {
            // What has gone by already by recording does not go by again.
            let by_stamps = stamp.nanos().saturating_sub(last.newest.nanos());
            (by_stamps.saturating_sub(beyond_patience(last.still)).max(0), 0)
        } else {
            let by_recording = recorded.saturating_sub(last.recorded).as_nanos();
            let still = last.still.saturating_add(i64::try_from(by_recording).unwrap_or(i64::MAX));
            (beyond_patience(still) - beyond_patience(last.still), still)
        };
        self.last = Some(Last { newest: last.newest.max(stamp), recorded, still });
        step
    }
}

fn beyond_patience(still: i64) -> i64 {
    still.saturating_sub(PATIENCE).max(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;
    const HOUR: i64 = 3600 * SECOND;

    fn is_due(pace: &mut Pace, stamp: i64, recorded: i64) -> bool {
        pace.is_due(Stamp::from_nanos(stamp), Duration::from_nanos(recorded.cast_unsigned()))
    }

    /// How many snapshots of 1000 scans 1/30 s apart, give or take a millisecond, come at this rate.
    fn snapshots(rate: f64, jitter: i64) -> usize {
        let mut pace = Pace::new(Duration::from_secs_f64(1.0 / rate));
        let stamps = (0..1000).map(|i| SECOND + i * SECOND / 30 + (i * 7919 % 3 - 1) * jitter);
        // A simulator goes at half the speed.
        stamps.filter(|stamp| is_due(&mut pace, *stamp, 2 * *stamp)).count()
    }

    #[test]
    fn the_rate_is_kept_whether_or_not_the_stamps_are_even() {
        for (rate, expected) in [(60.0, 1000), (30.0, 1000), (20.0, 667), (15.0, 500), (7.0, 233), (2.0, 67)]
        {
            for jitter in [0, 1_000_000] {
                let made = snapshots(rate, jitter);
                assert!(made.abs_diff(expected) <= 1, "{made} at {rate} Hz with {jitter} ns, not {expected}");
            }
        }
    }

    /// Of 3000 scans of two sensors at 30 Hz, one of them an hour ahead, which sends one in `each`.
    fn beside_a_sensor_ahead(each: i64) -> usize {
        let mut pace = Pace::new(Duration::from_millis(500));
        let mut newest = 0;
        let due = (0..3000).filter(|i| {
            let recorded = SECOND + i * SECOND / 30;
            newest = newest.max(if i % each == 0 { recorded + HOUR } else { recorded });
            is_due(&mut pace, newest, recorded)
        });
        due.count()
    }

    #[test]
    fn the_rate_is_kept_beside_a_sensor_that_is_ahead_and_falls_silent() {
        for (each, expected) in [(1, 200), (7, 200), (3000, 198)] {
            let due = beside_a_sensor_ahead(each);
            assert!(due.abs_diff(expected) <= 1, "one of {each}: {due}");
        }
        // One that sends seldom makes it no less than one a second.
        for each in [30, 60, 300] {
            let due = beside_a_sensor_ahead(each);
            assert!((99..=201).contains(&due), "one of {each}: {due}");
        }
    }

    /// Every other scan is of a sensor whose stamps are a little behind.
    #[test]
    fn of_two_sensors_in_a_slow_simulator_the_stamps_alone_count() {
        let mut pace = Pace::new(Duration::from_millis(500));
        let mut newest = 0;
        let due = (0..6000).filter(|i| {
            let stamp = SECOND + i / 2 * SECOND / 30;
            newest = newest.max(if i % 2 == 0 { stamp } else { stamp - 5_000_000 });
            is_due(&mut pace, newest, 10 * stamp + i % 2 * 150_000_000)
        });
        assert!(due.count().abs_diff(200) <= 1);
    }

    /// Times (s) by stamps and by recording.
    #[test]
    fn time_by_recording_holds_up_nothing_once_the_newest_stamp_goes_on() {
        let mut pace = Pace::new(Duration::from_secs(1));
        let scans =
            [(10, 10), (10, 11), (10, 15), (10, 5_000), (10, 11), (10, 12), (11, 13), (12, 14), (12, 14)];
        let due = scans.map(|(stamp, recorded)| is_due(&mut pace, stamp * SECOND, recorded * SECOND));
        assert_eq!(due, [true, false, true, true, false, true, false, true, false]);
    }

    #[test]
    fn a_pause_is_not_made_up_for_and_a_stamp_back_by_less_than_a_jump_waits() {
        let mut pace = Pace::new(Duration::from_secs(1));
        let due = [0, 200, 9_900, 10_100, 10_000, 10_500, 10_950]
            .map(|ms| is_due(&mut pace, ms * 1_000_000, ms * 1_000_000));
        assert_eq!(due, [true, false, true, false, false, false, true]);
    }
}
