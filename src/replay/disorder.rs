//! How far out of order the messages of a bag lie, by the times at which they were recorded.

use std::time::Duration;

/// From where on it is said: clouds and transforms come some tenths of a second apart.
const OUT_OF_ORDER: Duration = Duration::from_secs(1);

/// What has been seen of it until stamps jumped back: a second lap is no disorder, and sorting would make one map of both.
#[derive(Debug, Default)]
pub(super) struct Disorder {
    /// When the message before was recorded.
    last: Duration,
    /// When the newest message so far was.
    newest: Duration,
    /// How long before the newest message that was read before it one was recorded, at most. Not before the last one alone: many
    /// small steps lead far back as well.
    most: Duration,
    /// The same before the last large step back, which may be that of the jump; `None` where there was none.
    before: Option<Duration>,
    has_jumped: bool,
}

impl Disorder {
    /// A message comes that was recorded at this time.
    pub(super) fn note(&mut self, at: Duration) {
        if self.has_jumped {
            return;
        }
        let last = std::mem::replace(&mut self.last, at);
        if last.saturating_sub(at) > OUT_OF_ORDER {
            self.before = Some(self.most);
        }
        self.newest = self.newest.max(at);
        self.most = self.most.max(self.newest.saturating_sub(at));
    }

    /// Stamps have jumped back, and with them the times of recording where these have made a large step.
    pub(super) fn jumped(&mut self) {
        if !self.has_jumped {
            (self.most, self.has_jumped) = (self.before.unwrap_or(self.most), true);
        }
    }

    /// What is to be said at the end, where transforms were missing or the stamps jumped back.
    pub(super) fn about(&self, lacks_transforms: bool) -> Option<String> {
        let is_felt = self.most > OUT_OF_ORDER && (lacks_transforms || self.has_jumped);
        is_felt.then(|| {
            format!(
                "messages lie in the bag up to {:.1} s out of the order in which they were recorded, and are read as they lie: where \
                 transforms were missing for it, or sessions began, `mcap sort` helps, and of several files `mcap merge`",
                self.most.as_secs_f64()
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of messages that were recorded at these times (s), before and after the stamps have jumped.
    fn said(recorded: &[f64], lacks_transforms: bool) -> [Option<String>; 2] {
        let mut disorder = Disorder::default();
        recorded.iter().for_each(|at| disorder.note(Duration::from_secs_f64(*at)));
        let without = disorder.about(lacks_transforms);
        disorder.jumped();
        disorder.note(Duration::ZERO);
        disorder.jumped();
        [without, disorder.about(lacks_transforms)]
    }

    fn has(line: Option<&String>, seconds: &str) -> bool {
        line.is_some_and(|line| line.contains(seconds))
    }

    #[test]
    fn what_lay_out_of_order_before_the_first_jump_is_said_and_the_jump_itself_is_not() {
        let late = [10.0, 7.0, 10.5, 3.5, 3.6];
        let [without, with] = said(&late, false);
        assert!(without.is_none() && has(with.as_ref(), "up to 3.0 s"), "{with:?}");
        let [without, with] = said(&late, true);
        assert!(
            has(without.as_ref(), "up to 7.0 s") && has(with.as_ref(), "up to 3.0 s"),
            "{without:?} {with:?}"
        );
        for lap in [&[7.0, 0.0, 0.1][..], &[5.0, 4.0, 7.0, 0.0], &[5.0, 4.5]] {
            assert_eq!(said(lap, true)[1], None, "{lap:?}");
        }
    }

    /// As where a bag was turned round.
    #[test]
    fn small_steps_back_that_lead_far_are_said() {
        let turned: Vec<_> = (0..20).map(|i| 5.0 - 0.2 * f64::from(i)).collect();
        for line in said(&turned, true) {
            assert!(has(line.as_ref(), "up to 3.8 s"), "{line:?}");
        }
        assert_eq!(said(&turned, false)[0], None);
    }
}
