//! How many samples a dynamic frame keeps, from above: the registry forgets by age, and does not tell.
//!
//! Samples are counted in windows of [`MAX_AGE`] by their stamps. When one begins, all samples from before the window
//! before it are too old to be kept, so that the sum of two windows is a bound.
//!
//! Keeps true: samples that come in order are never too many, however often they come, so that none of their time is lacking.

use super::{MAX_AGE, MAX_FRAME_SAMPLES};
use crate::engine::Stamp;

/// Between two samples of a frame that comes more often than can be kept (ns).
const SPACING: u64 = 1_000_000;

/// So many samples are kept whatever lies between them: two windows with one each [`SPACING`], both ends counted, fit in beside them.
const ANY: usize = MAX_FRAME_SAMPLES - 2 * (MAX_AGE.as_nanos() as usize / SPACING as usize + 1);

/// Bound of the samples of one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept {
    /// When the window began.
    since: Stamp,
    /// The newest stamp; sent again, it replaces its sample.
    newest: Stamp,
    /// That of the sample that came last.
    last: Stamp,
    recent: usize,
    before: usize,
}

impl Kept {
    /// One sample.
    pub(super) const fn first(stamp: Stamp) -> Self {
        Self { since: stamp, newest: stamp, last: stamp, recent: 1, before: 0 }
    }

    pub(super) const fn newest(&self) -> Stamp {
        self.newest
    }

    /// No more samples than this are kept.
    pub(super) const fn bound(&self) -> usize {
        self.recent + self.before
    }

    /// Whether a sample can be spared: there are many, and it lies so near to another that interpolation is as good. Near the newest
    /// or the last, so that those which come out of order are thinned out too.
    pub(super) fn can_spare(&self, stamp: Stamp) -> bool {
        let is_near = |other: Stamp| (1..SPACING).contains(&stamp.nanos().abs_diff(other.nanos()));
        self.bound() >= ANY && (is_near(self.newest) || is_near(self.last))
    }

    /// The bound with one sample more.
    pub(super) fn with(mut self, stamp: Stamp) -> Self {
        if stamp == self.newest {
            return self;
        }
        let windows = stamp.seconds_since(self.since) / MAX_AGE.as_secs_f64();
        if windows > 1.0 {
            self.before = if windows > 2.0 { 0 } else { self.recent };
            (self.since, self.recent) = (stamp, 0);
        }
        self.recent += 1;
        (self.newest, self.last) = (self.newest.max(stamp), stamp);
        self
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_more_samples_are_kept_than_the_bound_says_and_it_is_near(
            steps in prop::collection::vec(-8_000..20_000_i64, 1..200),
        ) {
            let mut stamp = 0;
            let mut kept = Kept::first(Stamp::from_nanos(0));
            let mut samples = BTreeSet::from([0]);
            for step in steps {
                stamp += step * 1_000_000;
                kept = kept.with(Stamp::from_nanos(stamp));
                samples.insert(stamp);
                let newest = *samples.last().unwrap();
                samples.retain(|sample| newest - sample <= MAX_AGE.as_nanos() as i64);
                prop_assert!(samples.len() <= kept.bound());
                prop_assert_eq!(kept.newest().nanos(), newest);
            }
        }
    }

    #[test]
    fn samples_in_order_are_never_too_many_and_those_at_1000_hz_are_all_kept() {
        let stamp = Stamp::from_nanos;
        for (burst, step) in
            [(0, 1_000_000), (0, 999_999), (0, 500_000), (ANY as i64, 1_000_000), (ANY as i64, 7_001)]
        {
            let mut kept = Kept::first(stamp(0));
            let stamps = (1..burst).chain((1..45_000_000_000 / step).map(|count| burst + count * step));
            for nanos in stamps {
                let spared = kept.can_spare(stamp(nanos));
                assert!(!spared || step < 1_000_000, "{nanos}");
                if !spared {
                    assert!(nanos - kept.newest().nanos() < 2_000_000, "{nanos}");
                    kept = kept.with(stamp(nanos));
                }
                assert!(kept.bound() <= MAX_FRAME_SAMPLES, "{nanos}");
            }
        }
    }

    #[test]
    fn a_stamp_sent_again_is_one_sample_and_a_long_pause_leaves_one() {
        let mut kept = Kept::first(Stamp::from_nanos(5));
        (0..1000).for_each(|_| kept = kept.with(Stamp::from_nanos(5)));
        assert_eq!(kept.bound(), 1);
        (6..100).for_each(|nanos| kept = kept.with(Stamp::from_nanos(nanos)));
        assert_eq!(kept.bound(), 95);
        assert_eq!(kept.with(Stamp::from_nanos(20_000_000_010)).bound(), 1);
    }
}
