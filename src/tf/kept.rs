//! How many samples a dynamic frame keeps, from above: the registry forgets by age, and does not tell.
//!
//! Samples are counted in windows of [`MAX_AGE`] by their stamps. When one begins, all samples from before the window
//! before it are too old to be kept, so that the sum of two windows is a bound.

use super::MAX_AGE;
use crate::engine::Stamp;

/// Bound of the samples of one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept {
    /// When the window began.
    since: Stamp,
    /// The newest stamp; sent again, it replaces its sample.
    newest: Stamp,
    recent: usize,
    before: usize,
}

impl Kept {
    /// One sample.
    pub(super) const fn first(stamp: Stamp) -> Self {
        Self { since: stamp, newest: stamp, recent: 1, before: 0 }
    }

    pub(super) const fn newest(&self) -> Stamp {
        self.newest
    }

    /// No more samples than this are kept.
    pub(super) const fn bound(&self) -> usize {
        self.recent + self.before
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
        self.newest = self.newest.max(stamp);
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
    fn a_stamp_sent_again_is_one_sample_and_a_long_pause_leaves_one() {
        let mut kept = Kept::first(Stamp::from_nanos(5));
        (0..1000).for_each(|_| kept = kept.with(Stamp::from_nanos(5)));
        assert_eq!(kept.bound(), 1);
        (6..100).for_each(|nanos| kept = kept.with(Stamp::from_nanos(nanos)));
        assert_eq!(kept.bound(), 95);
        assert_eq!(kept.with(Stamp::from_nanos(20_000_000_010)).bound(), 1);
    }
}
