//! How far a map has come: the number of scans that it has taken in, and the newest of their stamps.

use serde::{Deserialize, Serialize};

use super::scan::Stamp;

/// The scan that is being taken in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Now {
    /// Its number, from 1.
    pub(crate) sequence: u64,
    /// The newest stamp so far, which a scan that comes late does not turn back.
    pub(crate) stamp: Stamp,
}

/// The scans that a map has taken in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Taken {
    /// Number of scans.
    pub(crate) sequence: u64,
    /// Newest stamp; `None` before the first scan.
    pub(crate) stamp: Option<Stamp>,
    /// The next scan's stamp counts, even one before: the map was restored, and the clock may be another.
    #[serde(skip)]
    pub(crate) is_resumed: bool,
}

impl Taken {
    /// Counts the next scan.
    pub(crate) fn begin(&mut self, stamp: Stamp) -> Now {
        self.sequence += 1;
        let is_resumed = std::mem::take(&mut self.is_resumed);
        let newest = self.stamp.filter(|_| !is_resumed);
        let stamp = newest.map_or(stamp, |newest| newest.max(stamp));
        self.stamp = Some(stamp);
        Now { sequence: self.sequence, stamp }
    }

    /// The newest scan that was taken in.
    pub(crate) fn now(&self) -> Now {
        Now { sequence: self.sequence, stamp: self.stamp.unwrap_or_default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_that_comes_late_counts_and_does_not_turn_the_stamp_back() {
        let mut taken = Taken::default();
        let nows = [5, 9, 7].map(|nanos| taken.begin(Stamp::from_nanos(nanos)));
        assert_eq!(nows.map(|now| now.sequence), [1, 2, 3]);
        assert_eq!(nows.map(|now| now.stamp.nanos()), [5, 9, 9]);
        assert_eq!((taken.sequence, taken.stamp), (3, Some(Stamp::from_nanos(9))));
        assert_eq!(taken.now().stamp, nows[2].stamp);
    }

    #[test]
    fn after_a_restart_the_first_stamp_counts_whatever_was_before() {
        let mut taken = Taken { sequence: 7, stamp: Some(Stamp::from_nanos(100)), is_resumed: true };
        let nows = [5, 9, 7].map(|nanos| taken.begin(Stamp::from_nanos(nanos)));
        assert_eq!(nows.map(|now| (now.sequence, now.stamp.nanos())), [(8, 5), (9, 9), (10, 9)]);
    }

    #[test]
    fn after_a_restart_with_an_empty_map_a_late_second_scan_turns_nothing_back() {
        let mut taken = Taken { is_resumed: true, ..Taken::default() };
        let stamps = [9, 7].map(|nanos| taken.begin(Stamp::from_nanos(nanos)).stamp.nanos());
        assert_eq!(stamps, [9, 9]);
    }
}
