//! Which sensor's scans the engine has taken in, which its outputs do not say.
//!
//! The worker takes scans in the order in which they were handed over. Of those that wait it replaces the first, and for a new
//! session throws away all: the same is done here. So as many are kept as wait for the engine and among its outputs at most.

use std::collections::{BTreeMap, VecDeque};

use crate::engine::Stamp;

/// Scans on their way through the engine, and what it has taken in of each sensor.
#[derive(Debug, Default)]
pub(super) struct Handed {
    /// Sensors and stamps of the scans of which nothing is known yet, the one that was handed over first at the front.
    under_way: VecDeque<(usize, Stamp)>,
    /// How many of them, from the front, are of a session that has ended.
    of_before: usize,
    /// By sensor.
    taken_in: BTreeMap<usize, TakenIn>,
}

/// What the engine has taken in of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct TakenIn {
    /// Scans since the last report.
    pub(super) scans: u64,
    /// The stamp of the last one that is in the map of this session; the latest of all stamps would stay where one was far ahead.
    pub(super) newest: Option<Stamp>,
}

impl Handed {
    /// A scan of a sensor was handed over.
    pub(super) fn hand(&mut self, sensor: usize, stamp: Stamp) {
        self.under_way.push_back((sensor, stamp));
    }

    /// The scan that was handed over last has replaced the oldest of those that waited for the engine, so that `places` wait now; gives
    /// the sensor of the replaced one. If more wait, because there were more places until lately, a newer scan is taken for it: what is
    /// told of sensors may then be off by these scans until they are through.
    pub(super) fn replace(&mut self, places: usize) -> Option<usize> {
        let first = self.under_way.len().checked_sub(places + 1)?;
        self.under_way.remove(first).map(|(sensor, _)| sensor)
    }

    /// A session begins with an empty map, for which so many that waited were thrown away.
    pub(super) fn begin_session(&mut self, thrown_away: usize) {
        self.under_way.truncate(self.under_way.len().saturating_sub(thrown_away));
        self.of_before = self.under_way.len();
        self.taken_in.values_mut().for_each(|taken_in| taken_in.newest = None);
    }

    /// The engine has taken in the next one.
    pub(super) fn take_in(&mut self) {
        let Some((sensor, stamp)) = self.under_way.pop_front() else { return };
        let taken_in = self.taken_in.entry(sensor).or_default();
        taken_in.scans += 1;
        if self.of_before == 0 {
            taken_in.newest = Some(stamp);
        }
        self.of_before = self.of_before.saturating_sub(1);
    }

    /// What was taken in of a sensor.
    pub(super) fn of(&self, sensor: usize) -> TakenIn {
        self.taken_in.get(&sensor).copied().unwrap_or_default()
    }

    /// A report was made.
    pub(super) fn begin_period(&mut self) {
        self.taken_in.values_mut().for_each(|taken_in| taken_in.scans = 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: usize = 2;

    /// Scans of two sensors in turn, the first at 0 ns.
    fn handed(scans: usize) -> Handed {
        let mut handed = Handed::default();
        (0..scans).for_each(|number| handed.hand(number % 2, Stamp::from_nanos(number as i64)));
        handed
    }

    fn taken_in(scans: u64, newest: Option<i64>) -> TakenIn {
        TakenIn { scans, newest: newest.map(Stamp::from_nanos) }
    }

    #[test]
    fn each_scan_that_is_taken_in_is_its_sensors_and_counts_until_the_report() {
        let mut handed = handed(3);
        (0..3).for_each(|_| handed.take_in());
        let found = |handed: &Handed| [0, 1, 2].map(|sensor| handed.of(sensor));
        assert_eq!(found(&handed), [taken_in(2, Some(2)), taken_in(1, Some(1)), taken_in(0, None)]);
        handed.begin_period();
        handed.take_in();
        assert_eq!(found(&handed), [taken_in(0, Some(2)), taken_in(0, Some(1)), taken_in(0, None)]);
    }

    /// The engine is at the first when the fourth comes, and has taken in nothing more when the fifth does.
    #[test]
    fn of_the_scans_that_wait_the_first_is_replaced_and_not_the_one_that_the_engine_is_at() {
        let mut handed = handed(4);
        assert_eq!(handed.replace(PLACES), Some(1));
        handed.hand(0, Stamp::from_nanos(4));
        assert_eq!(handed.replace(PLACES), Some(0));
        (0..3).for_each(|_| handed.take_in());
        assert_eq!([0, 1].map(|sensor| handed.of(sensor)), [taken_in(2, Some(4)), taken_in(1, Some(3))]);
        assert_eq!(Handed::default().replace(PLACES), None);
    }

    #[test]
    fn of_a_session_that_has_ended_nothing_is_in_the_map_though_it_is_taken_in_after_that() {
        let mut handed = handed(4);
        handed.take_in();
        // The engine is at the second.
        handed.begin_session(2);
        assert_eq!(handed.of(0), taken_in(1, None));
        handed.hand(0, Stamp::from_nanos(9));
        handed.take_in();
        assert_eq!(handed.of(1), taken_in(1, None));
        handed.take_in();
        assert_eq!(handed.of(0), taken_in(2, Some(9)));
    }
}
