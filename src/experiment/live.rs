//! Figure 3d: scans arrive at 30 Hz, and a method that is not yet free misses them.
//!
//! A simulation on a virtual clock. Scan `i` arrives at `i / 30` s. A method that is free takes in the newest scan that has
//! arrived; how long it then is busy is measured. What it misses never reaches its map, so its work is what it would have
//! been live.

use std::time::Duration;

use super::method::{Clusterer, timed};
use crate::engine::Scan;

/// Scans that arrive in a second: as many as a Kinect sends, whatever the rate of the recording.
const ARRIVALS_PER_SECOND: u64 = 30;

/// A scan that a method managed to take in; times are those of the stream, from the arrival of scan 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Taken {
    /// Index of the scan, from 0.
    pub(super) scan: u64,
    /// Its points.
    pub(super) points: u64,
    /// When it was begun.
    pub(super) begun: Duration,
    /// When it was done.
    pub(super) done: Duration,
}

/// When scan `index` arrives.
pub(super) fn arrival(index: u64) -> Duration {
    // Whole seconds apart, so that no product is too large.
    let rest = index % ARRIVALS_PER_SECOND;
    Duration::from_secs(index / ARRIVALS_PER_SECOND)
        + Duration::from_nanos(rest * 1_000_000_000 / ARRIVALS_PER_SECOND)
}

/// A method that takes in what it manages.
pub(super) struct LiveRun {
    run: Box<dyn Clusterer>,
    /// From when on it is free.
    free: Duration,
    taken: Vec<Taken>,
}

impl LiveRun {
    pub(super) fn new(run: Box<dyn Clusterer>) -> Self {
        Self { run, free: Duration::ZERO, taken: Vec::new() }
    }

    pub(super) fn offer(&mut self, index: u64, scan: &Scan, clock: impl FnMut() -> Duration) {
        if let Some(begun) = begins(index, self.free) {
            let run = &mut self.run;
            let took = timed(clock, |done| run.insert(scan, done)).total;
            self.free = begun + took;
            self.taken.push(Taken { scan: index, points: scan.points.len() as u64, begun, done: self.free });
        }
    }

    pub(super) fn into_taken(self) -> Vec<Taken> {
        self.taken
    }
}

/// When a method that is free from `free` on begins with scan `index`; `None` where a newer scan has arrived by then.
///
/// The stream ends when the scan after the last one would arrive: what would begin later is missed too.
fn begins(index: u64, free: Duration) -> Option<Duration> {
    let begun = free.max(arrival(index));
    (begun < arrival(index + 1)).then_some(begun)
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::engine::paper::statics::Static;
    use crate::engine::{Params, Points, Stamp};

    /// Offers scans of one point to a method; `took` is how long (ms) it takes for each that it takes in.
    fn taken(scans: u64, took: impl IntoIterator<Item = u64>) -> Vec<Taken> {
        let mut run = LiveRun::new(Box::new(Static::new(Params::paper())));
        let mut took = took.into_iter();
        let scan = Scan {
            stamp: Stamp::default(),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F32(vec![[0.5; 3]]),
        };
        for index in 0..scans {
            // The clock is read before, at the end of three steps and after; it stands still but for the last time.
            let mut reads = 0;
            run.offer(index, &scan, || {
                reads += 1;
                Duration::from_millis(if reads == 5 { took.next().unwrap() } else { 0 })
            });
        }
        run.into_taken()
    }

    fn indices(taken: &[Taken]) -> Vec<u64> {
        taken.iter().map(|taken| taken.scan).collect()
    }

    #[test]
    fn who_is_fast_enough_takes_in_every_scan_as_it_arrives() {
        let taken = taken(100, std::iter::repeat(33));
        assert_eq!(indices(&taken), (0..100).collect::<Vec<_>>());
        assert!(taken.iter().all(|taken| taken.begun == arrival(taken.scan)));
    }

    #[test]
    fn who_is_slower_takes_the_newest_scan_when_free_and_misses_those_between() {
        // Scans arrive at 0, 33.3, 66.7, 100, 133.3, 166.7, 200, 233.3, 266.7, 300 ms.
        let taken = taken(10, [100, 40, 10, 150, 20]);
        // Free at 100: scan 3, just arrived. Free at 140: scan 4 of 133. Free at 150, idle until 166.7: scan 5.
        // Free at 316.7: scan 9 of 300.
        assert_eq!(indices(&taken), [0, 3, 4, 5, 9]);
        let begun: Vec<_> = taken.iter().map(|taken| taken.begun.as_millis()).collect();
        assert_eq!(begun, [0, 100, 140, 166, 316]);
        assert_eq!(taken[4].done.as_millis(), 336);
    }

    #[test]
    fn what_would_begin_after_the_end_of_the_stream_is_missed() {
        // The stream of three scans ends at 100 ms.
        assert_eq!(indices(&taken(3, [99, 1])), [0, 2]);
        assert_eq!(indices(&taken(3, [100])), [0]);
    }

    #[test]
    fn scans_arrive_thirty_times_a_second_for_ever() {
        assert_eq!(arrival(1), Duration::from_nanos(33_333_333));
        assert_eq!(arrival(6510), Duration::from_secs(217));
        assert_eq!(arrival(u64::MAX).as_secs(), u64::MAX / 30);
    }
}
