//! How far out of order the messages of a bag lie, by the times at which they were recorded.

use std::time::Duration;

/// From where on it is said: clouds and transforms come some tenths of a second apart.
const OUT_OF_ORDER: Duration = Duration::from_secs(1);

/// What has been seen of it until stamps jumped back: a second lap is no disorder, and sorting would make one map of both.
#[derive(Debug, Default)]
pub(super) struct Disorder {
    /// How long before the message that was read before it one was recorded, at most.
    most: Duration,
    /// The same without the last step back, which may be that of the jump.
    before: Duration,
    has_jumped: bool,
}

impl Disorder {
    /// A message was recorded so long before the one that was read before it.
    pub(super) fn note(&mut self, back: Duration) {
        if !self.has_jumped && back > OUT_OF_ORDER {
            (self.before, self.most) = (self.most, self.most.max(back));
        }
    }

    /// Stamps have jumped back, and with them the times of recording.
    pub(super) const fn jumped(&mut self) {
        if !self.has_jumped {
            (self.most, self.has_jumped) = (self.before, true);
        }
    }

    /// What is to be said at the end, where transforms were missing or the stamps jumped back.
    pub(super) fn about(&self, lacks_transforms: bool) -> Option<String> {
        let is_felt = self.most > OUT_OF_ORDER && (lacks_transforms || self.has_jumped);
        is_felt.then(|| {
            format!(
                "messages lie in the bag up to {:.1} s out of the order in which they were recorded, and are read as they lie: where \
                 transforms were missing for it, or sessions began, `mcap sort` helps",
                self.most.as_secs_f64()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(before_a_jump: &[u64], lacks_transforms: bool) -> [Option<String>; 2] {
        let mut disorder = Disorder::default();
        before_a_jump.iter().for_each(|seconds| disorder.note(Duration::from_secs(*seconds)));
        let without = disorder.about(lacks_transforms);
        disorder.jumped();
        disorder.note(Duration::from_secs(90));
        disorder.jumped();
        [without, disorder.about(lacks_transforms)]
    }

    #[test]
    fn what_lay_out_of_order_before_the_first_jump_is_said_and_the_jump_itself_is_not() {
        let has =
            |line: &Option<String>, seconds: &str| line.as_ref().is_some_and(|line| line.contains(seconds));
        let [without, with] = said(&[3, 0, 7], false);
        assert!(without.is_none() && has(&with, "up to 3.0 s"), "{with:?}");
        let [without, with] = said(&[3, 0, 7], true);
        assert!(has(&without, "up to 7.0 s") && has(&with, "up to 3.0 s"), "{without:?} {with:?}");
        for lap in [&[7][..], &[0, 1, 7], &[0, 1]] {
            assert_eq!(said(lap, true)[1], None, "{lap:?}");
        }
    }
}
