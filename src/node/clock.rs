//! The time of day: the only place that asks for it.

use std::cell::Cell;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use crate::engine::Stamp;

/// Now; the epoch where the machine's clock is before it.
pub fn now() -> Stamp {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX))
}

/// By how much the time of day may fall behind unnoticed: what depends on it then rests no longer than that.
const FALL: Duration = Duration::from_millis(100);

/// The time of day, read between two looks at a clock that nobody sets: the thread may rest between any two of the three.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimeOfDay {
    before: Instant,
    time: SystemTime,
    after: Instant,
}

impl TimeOfDay {
    pub(super) fn read() -> Self {
        Self { before: Instant::now(), time: SystemTime::now(), after: Instant::now() }
    }

    /// By how much it was set back since an earlier reading, where that is more than [`FALL`].
    pub(super) fn set_back_since(&self, earlier: &Self) -> Option<Duration> {
        let at_least = earlier.time + self.before.duration_since(earlier.after);
        at_least.duration_since(self.time).ok().filter(|back| *back > FALL)
    }
}

/// The time of day, for as long as something goes by it.
#[derive(Debug)]
pub(super) struct Watch {
    begun: Instant,
    /// When it had last not been set back.
    newest: Cell<TimeOfDay>,
}

impl Watch {
    pub(super) const fn begin(now: TimeOfDay) -> Self {
        Self { begun: now.after, newest: Cell::new(now) }
    }

    /// By how much it was set back, while it is not past where it was before, and once it has been watched for `stay`: what is over by
    /// then, or was put right, is no loss.
    pub(super) fn set_back(&self, now: TimeOfDay, stay: Duration) -> Option<Duration> {
        let newest = self.newest.get();
        let back = now.set_back_since(&newest).filter(|_| now.time < newest.time);
        if back.is_none() {
            self.newest.set(now);
        }
        back.filter(|_| now.before.duration_since(self.begun) >= stay)
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;

    fn sources(folder: &Path) -> Vec<PathBuf> {
        let paths = folder.read_dir().unwrap().map(|entry| entry.unwrap().path());
        paths.flat_map(|path| if path.is_dir() { sources(&path) } else { vec![path] }).collect()
    }

    #[test]
    fn nothing_else_asks_for_the_time_of_day() {
        let all = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
        let asks =
            |path: &PathBuf| std::fs::read_to_string(path).is_ok_and(|text| text.contains("SystemTime"));
        let asking: Vec<_> = all.into_iter().filter(asks).collect();
        assert!(asking.len() == 1 && asking[0].ends_with("node/clock.rs"), "{asking:?}");
    }

    fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    /// Makes readings: when it was read between `before` and `after`, and how much it was set by until then (ms).
    fn readings() -> impl Fn([u64; 3], u64, u64) -> TimeOfDay {
        let (start, first) = (Instant::now(), UNIX_EPOCH + Duration::from_secs(1000));
        move |[before, read, after], set_forward, set_back| TimeOfDay {
            before: start + ms(before),
            time: first + ms(read) + ms(set_forward) - ms(set_back),
            after: start + ms(after),
        }
    }

    #[test]
    fn a_time_of_day_that_is_set_back_again_soon_is_told_of_after_a_while_where_it_still_is() {
        // What a watch tells of looks at these times, when it was set back so far (ms).
        let told = |looks: [[u64; 2]; 4]| {
            let reading = readings();
            let watch = Watch::begin(reading([0; 3], 0, 0));
            looks.map(|[at, set_back]| watch.set_back(reading([at; 3], 0, set_back), ms(5000)))
        };
        let long = [[250, 0], [500, 9000], [4999, 9000], [5000, 9000]];
        assert_eq!(told(long), [None, None, None, Some(ms(9000))]);
        assert_eq!(told([[250, 9000], [1200, 0], [5000, 0], [5250, 0]]), [None; 4], "it was put right");
        assert_eq!(
            told([[250, 0], [500, 900], [1500, 900], [5250, 900]]),
            [None; 4],
            "it is past where it was"
        );
        assert_eq!(told([[9000, 0], [9250, 300], [9500, 300], [9750, 0]]), [None, Some(ms(300)), None, None]);
    }

    #[test]
    fn a_time_of_day_that_was_set_back_is_told_from_one_that_was_read_late() {
        let reading = readings();
        let earlier = reading([0; 3], 0, 0);
        let since = |later: TimeOfDay| later.set_back_since(&earlier);
        assert_eq!(since(reading([250; 3], 0, 0)), None);
        assert_eq!(since(reading([250; 3], 3_600_000, 0)), None, "set forward, or the machine slept");
        assert_eq!(since(reading([250; 3], 0, 100)), None);
        assert_eq!(since(reading([250; 3], 0, 101)), Some(ms(101)));
        assert_eq!(since(reading([250; 3], 0, 900_000)), Some(ms(900_000)));
        // The thread rested for two seconds, before or after it had read the time of day.
        let late = [reading([0, 2000, 2000], 0, 0), reading([0, 0, 2000], 0, 0)];
        for earlier in late {
            for later in [[2250, 2250, 2250], [2250, 4250, 4250], [2250, 2250, 4250]] {
                assert_eq!(reading(later, 0, 0).set_back_since(&earlier), None);
            }
        }
    }
}
