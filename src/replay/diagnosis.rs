//! What a result bag has on `/diagnostics`: what became of the scans so far. Nothing in it comes from a clock.

use super::summary::Tally;
use crate::count::count_of;
use crate::engine::{Engine, Stamp};
use crate::msg::reports::{DiagnosticArray, Level};
use crate::msg::ros::Header;
use crate::msg::status::StatusBuilder;

#[derive(Debug, Default)]
pub(super) struct Diagnosis {
    /// Scans that were skipped before the last report.
    skipped: u64,
}

impl Diagnosis {
    /// The report of this moment.
    pub(super) fn report(
        &mut self,
        node: &str,
        stamp: Stamp,
        tally: &Tally,
        engine: &Engine,
    ) -> DiagnosticArray {
        let mut part =
            StatusBuilder::new(node, "replay", format!("{} taken in", count_of(tally.scans, "scan")));
        part.value("taken in in all", tally.scans);
        for (reason, number) in &tally.skipped {
            part.value(format!("skipped in all, {}", reason.key), number);
        }
        part.value("dense voxels", engine.dense_count());
        let skipped = tally.skipped.values().sum();
        let new = skipped - std::mem::replace(&mut self.skipped, skipped);
        if new > 0 {
            part.raise(Level::Warn, format!("{} skipped since the last report", count_of(new, "scan")));
        }
        let header = Header { stamp: stamp.into(), ..Header::default() };
        DiagnosticArray { header, status: vec![part.finish()] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Params;
    use crate::reason::Reason;

    #[test]
    fn what_was_skipped_is_counted_and_a_warning_once() {
        let (mut diagnosis, engine) = (Diagnosis::default(), Engine::new(Params::default()));
        let png = Reason::new("png", "An image is damaged.");
        let tally = Tally { scans: 5, skipped: [(png, 2)].into_iter().collect(), ..Tally::default() };
        let mut report = || diagnosis.report("/cfodi", Stamp::from_nanos(3_000_000_000), &tally, &engine);
        let [first, second] = [report(), report()];
        assert_eq!((first.header.stamp.sec, &*first.status[0].name), (3, "cfodi: replay"));
        assert_eq!(first.status[0].message, "2 scans skipped since the last report");
        assert_eq!([&first, &second].map(|report| report.status[0].level), [1, 0]);
        assert_eq!(second.status[0].message, "5 scans taken in");
        let value = &second.status[0].values[1];
        assert_eq!((&*value.key, &*value.value), ("skipped in all, png", "2"));
    }
}
