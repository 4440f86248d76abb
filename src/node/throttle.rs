//! So that a fault that repeats 30 times a second is said once in a while.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Remembers when each kind of line was written last.
#[derive(Debug, Default)]
pub(super) struct Throttle(BTreeMap<Cow<'static, str>, Instant>);

impl Throttle {
    const PERIOD: Duration = Duration::from_secs(5);

    /// Whether a line of this kind may be written now; if so it counts as written.
    pub(super) fn allows(&mut self, kind: impl Into<Cow<'static, str>>, now: Instant) -> bool {
        let kind = kind.into();
        let due = self.0.get(&kind).is_none_or(|last| now.duration_since(*last) >= Self::PERIOD);
        if due {
            self.0.insert(kind, now);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_said_once_in_five_seconds_and_kinds_do_not_hide_each_other() {
        let (mut throttle, start) = (Throttle::default(), Instant::now());
        assert!(throttle.allows("a", start));
        assert!(!throttle.allows("a", start + Duration::from_secs(4)));
        assert!(throttle.allows("b", start + Duration::from_secs(4)));
        assert!(throttle.allows("a", start + Duration::from_secs(5)));
    }
}
