//! When snapshots are due, by the stamps of the scans.

use std::time::Duration;

use crate::engine::Stamp;

/// A pace that is kept on average. A snapshot is due with the scan that is nearest to its time: stamps are never quite even, and
/// waiting for a scan behind that time, each time anew, would lose up to a whole scan each time.
#[derive(Debug)]
pub(super) struct Pace {
    /// Time between two (ns).
    period: i64,
    /// When the next one is due; `None` before the first scan.
    due: Option<Stamp>,
    /// The stamp of the scan before.
    last: Option<Stamp>,
}

impl Pace {
    pub(super) fn new(period: Duration) -> Self {
        Self { period: i64::try_from(period.as_nanos()).unwrap_or(i64::MAX), due: None, last: None }
    }

    /// A scan has come: says whether a snapshot is due with it.
    pub(super) fn is_due(&mut self, stamp: Stamp) -> bool {
        let step = self.last.replace(stamp).map_or(0, |last| stamp.nanos().saturating_sub(last.nanos()));
        let nearest = stamp.nanos().saturating_add(step.max(0) / 2);
        if self.due.is_some_and(|due| nearest < due.nanos()) {
            return false;
        }
        // What is late by a period or more is not made up for.
        let next = self.due.map(|due| due.nanos().saturating_add(self.period));
        let next = next.filter(|next| *next > stamp.nanos());
        let next = next.unwrap_or_else(|| stamp.nanos().saturating_add(self.period));
        self.due = Some(Stamp::from_nanos(next));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many snapshots of 1000 scans 1/30 s apart, give or take a millisecond, come at this rate.
    fn snapshots(rate: f64, jitter: i64) -> usize {
        let mut pace = Pace::new(Duration::from_secs_f64(1.0 / rate));
        let stamps = (0..1000).map(|i| i * 1_000_000_000 / 30 + (i * 7919 % 3 - 1) * jitter);
        stamps.filter(|stamp| pace.is_due(Stamp::from_nanos(*stamp))).count()
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

    #[test]
    fn a_pause_is_not_made_up_for_and_a_stamp_back_by_less_than_a_jump_waits() {
        let mut pace = Pace::new(Duration::from_secs(1));
        let due = [0, 200, 9_900, 10_100, 10_000, 10_500, 10_950]
            .map(|ms| pace.is_due(Stamp::from_nanos(ms * 1_000_000)));
        assert_eq!(due, [true, false, true, false, false, false, true]);
    }
}
