//! How saving goes, in figures for `/diagnostics`.

use std::time::{Duration, Instant};

use crate::msg::clusters::MapVersion;
use crate::node::saving::{InFile, Written};

/// How long a map may be on its way before it is said: a gigabyte takes less.
const PATIENCE: Duration = Duration::from_secs(30);

/// What has become of the maps that were to be saved.
#[derive(Debug, Default)]
pub(super) struct SavingFigures {
    /// When the map that is on its way was asked for.
    asked: Option<Instant>,
    /// The newest map in the file, and when it was that of the engine.
    written: Option<(InFile, Instant)>,
    /// Why the newest was not.
    failure: Option<String>,
}

impl SavingFigures {
    /// A map was asked for.
    pub(super) fn ask(&mut self, now: Instant) {
        self.asked = Some(now);
    }

    /// A map was written, or was not; `next` says whether another is on its way. One that was written is of the time when it was asked
    /// for: a slow disk makes it no younger.
    pub(super) fn note(&mut self, written: &Written, next: bool, now: Instant) {
        let asked = std::mem::replace(&mut self.asked, next.then_some(now));
        match written {
            Ok(map) => (self.written, self.failure) = (Some((*map, asked.unwrap_or(now))), None),
            Err(error) => self.failure = Some(error.to_string()),
        }
    }

    /// Whether this map is in the file already; it is then of now.
    pub(super) fn has(&mut self, version: MapVersion, now: Instant) -> bool {
        let newest = self.written.as_mut().filter(|_| self.failure.is_none());
        let same = newest.filter(|(map, _)| map.version == version);
        same.map(|(_, written)| *written = now).is_some()
    }

    /// The age of the map in the file; `None` where this process has written none.
    pub(super) fn age(&self, now: Instant) -> Option<Duration> {
        self.written.map(|(_, written)| now - written)
    }

    /// What is wrong.
    pub(super) fn fault(&self, now: Instant) -> Option<String> {
        if let Some(failure) = &self.failure {
            return Some(format!("the map was not saved: {failure}"));
        }
        let waited = self.asked.map(|asked| now - asked).filter(|&waited| waited >= PATIENCE)?;
        Some(format!(
            "the map has been on its way into its file for {:.0} s, as where a disk does not answer",
            waited.as_secs_f64()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::StoreError;

    const FILE: InFile = InFile { version: version(1, 2), bytes: 3 };

    const fn version(session: u64, sequence: u64) -> MapVersion {
        MapVersion { session, sequence }
    }

    #[test]
    fn a_map_is_in_the_file_until_it_changes_another_session_begins_or_a_saving_fails() {
        let (mut figures, start) = (SavingFigures::default(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        assert!(!figures.has(version(1, 2), start), "none was written");
        figures.note(&Ok(FILE), false, at(10));
        assert!(!figures.has(version(1, 3), at(70)) && !figures.has(version(2, 2), at(70)));
        assert_eq!(figures.age(at(70)), Some(Duration::from_secs(60)));
        assert!(figures.has(version(1, 2), at(70)));
        assert_eq!(figures.age(at(70)), Some(Duration::ZERO), "it is that of the engine");
        figures.note(&Err(StoreError::InUse { path: "map".into() }), false, at(80));
        assert!(!figures.has(version(1, 2), at(130)), "it is tried again, which ends the warning");
    }

    #[test]
    fn a_saved_map_is_of_the_time_when_it_was_asked_for_however_long_the_disk_takes() {
        let (mut figures, start) = (SavingFigures::default(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        figures.ask(at(100));
        figures.note(&Ok(FILE), true, at(130));
        assert_eq!(figures.age(at(130)), Some(Duration::from_secs(30)));
        figures.note(&Ok(FILE), false, at(140));
        assert_eq!(figures.age(at(140)), Some(Duration::from_secs(10)), "the next was asked for at 130");
    }

    #[test]
    fn a_failure_is_a_fault_until_a_map_is_written_and_so_is_a_disk_that_does_not_answer() {
        let (mut figures, start) = (SavingFigures::default(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        let fault = |figures: &SavingFigures, seconds| figures.fault(at(seconds)).unwrap_or_default();
        assert_eq!((figures.fault(at(99)), figures.age(at(99))), (None, None), "nothing was asked for");
        figures.ask(at(100));
        assert_eq!(figures.fault(at(129)), None);
        let stuck = "the map has been on its way into its file for 30 s, as where a disk does not answer";
        assert_eq!(fault(&figures, 130), stuck);
        figures.note(&Err(StoreError::InUse { path: "map".into() }), true, at(140));
        assert_eq!(fault(&figures, 141), "the map was not saved: map is in use by another process");
        figures.note(&Ok(FILE), false, at(150));
        assert_eq!((figures.fault(at(999)), figures.age(at(155))), (None, Some(Duration::from_secs(15))));
    }
}
