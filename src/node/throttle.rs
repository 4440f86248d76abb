//! So that a fault that repeats 30 times a second is said once in a while.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use tracing::{Level, debug, info, warn};

use crate::line::one_line;

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

    /// Whether a line of this kind was never written; if so it counts as written.
    pub(super) fn allows_once(&mut self, kind: &'static str, now: Instant) -> bool {
        self.0.insert(kind.into(), now).is_none()
    }

    /// The level of a line of this kind that is written now: as it is meant, or for debugging alone where it was written of late.
    pub(super) fn level_now(&mut self, kind: impl Into<Cow<'static, str>>, meant: Level) -> Level {
        if self.allows(kind, Instant::now()) { meant } else { Level::DEBUG }
    }
}

/// Remembers how often each kind of line was written of late.
#[derive(Debug, Default)]
pub(super) struct Often(BTreeMap<String, (Instant, u32)>);

impl Often {
    /// Lines of a kind within a [`Throttle::PERIOD`]: more than one person asks for.
    const MOST: u32 = 10;

    /// Whether a line of this kind may be written now; if so it counts as written.
    pub(super) fn allows(&mut self, kind: &str, now: Instant) -> bool {
        let (since, lines) = self.0.entry(kind.to_owned()).or_insert((now, 0));
        if now.duration_since(*since) >= Throttle::PERIOD {
            (*since, *lines) = (now, 0);
        }
        *lines += 1;
        *lines <= Self::MOST
    }
}

/// Remembers what lasts, by its line, and when that was written last.
#[derive(Debug, Default)]
pub(super) struct Lasting(BTreeMap<String, Instant>);

impl Lasting {
    const PERIOD: Duration = Duration::from_secs(60);

    /// Of all that is so now what is to be written: what has begun, and what was written long ago.
    pub(super) fn due(&mut self, lines: &[String], now: Instant) -> Vec<String> {
        let mut due = lines.to_vec();
        due.retain(|line| self.0.get(line).is_none_or(|last| now.duration_since(*last) >= Self::PERIOD));
        self.0.extend(due.iter().map(|line| (line.clone(), now)));
        due
    }

    /// A line that was due was not written: it is due again the next time.
    pub(super) fn put_off(&mut self, line: &str) {
        self.0.remove(line);
    }

    /// Conditions that were logged and no longer hold.
    pub(super) fn over(&mut self, lines: &[String]) -> Vec<String> {
        let over = self.0.keys().filter(|line| !lines.contains(line)).cloned().collect();
        self.0.retain(|line, _| lines.contains(line));
        over
    }
}

/// Writes a line into the log; at levels beyond these, for debugging alone.
pub(super) fn log(level: Level, line: &str) {
    let line = one_line(line);
    match level {
        Level::WARN => warn!("{line}"),
        Level::INFO => info!("{line}"),
        _ => debug!("{line}"),
    }
}

#[cfg(test)]
mod tests {
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;
    use crate::node::rosout::listen;

    #[test]
    fn a_line_is_written_at_its_level_once_and_then_for_debugging_and_stays_one_line() {
        let (listener, mut lines) = listen();
        tracing::subscriber::with_default(tracing_subscriber::registry().with(listener), || {
            let mut throttle = Throttle::default();
            for (kind, meant) in
                [("a", Level::WARN), ("b", Level::INFO), ("a", Level::WARN), ("b", Level::INFO)]
            {
                log(throttle.level_now(kind, meant), "two\nlines");
            }
        });
        let said: Vec<_> = std::iter::from_fn(|| lines.0.try_recv().ok()).collect();
        let said: Vec<_> = said.iter().map(|line| (line.level, line.msg.as_str())).collect();
        assert_eq!(said, [(30, "two\\nlines"), (20, "two\\nlines")]);
    }

    #[test]
    fn what_lasts_is_said_when_it_begins_and_every_minute_and_when_it_is_over() {
        let (mut lasting, start) = (Lasting::default(), Instant::now());
        let (both, one) = (["a", "b"].map(str::to_owned), ["b".to_owned()]);
        let said = [0, 1, 59, 60, 119].map(|s| lasting.due(&both, start + Duration::from_secs(s)).len());
        assert_eq!(said, [2, 0, 0, 2, 0]);
        assert!(lasting.over(&both).is_empty());
        assert_eq!(lasting.over(&one), ["a"]);
        assert!(lasting.over(&one).is_empty());
        assert_eq!(lasting.due(&both, start + Duration::from_secs(119)), ["a"], "it has begun again");
        lasting.put_off("a");
        assert!(lasting.over(&one).is_empty(), "nobody was told that it had begun");
        assert_eq!(lasting.due(&both, start + Duration::from_secs(119)), ["a"]);
    }

    #[test]
    fn what_may_be_said_often_is_said_ten_times_in_five_seconds() {
        let (mut often, start) = (Often::default(), Instant::now());
        let said = |often: &mut Often, at| (0..100).filter(|_| often.allows("a", at)).count();
        assert_eq!([said(&mut often, start), said(&mut often, start + Duration::from_secs(4))], [10, 0]);
        assert!(often.allows("b", start));
        assert_eq!(said(&mut often, start + Duration::from_secs(5)), 10);
    }

    #[test]
    fn a_kind_is_said_once_in_five_seconds_and_kinds_do_not_hide_each_other() {
        let (mut throttle, start) = (Throttle::default(), Instant::now());
        assert!(throttle.allows("a", start));
        assert!(!throttle.allows("a", start + Duration::from_secs(4)));
        assert!(throttle.allows("b", start + Duration::from_secs(4)));
        assert!(throttle.allows("a", start + Duration::from_secs(5)));
    }
}
