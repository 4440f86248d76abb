//! What a block has to tell since its states were published, and whether it is time to publish them.

use serde::{Deserialize, Serialize};

use super::rest::REST;
use crate::engine::consistent::block::{BlockKey, CELLS};
use crate::engine::params::MAX_POINTS;
use crate::engine::saved::{RestoreError, ensure};

/// Scans between two publications of a block.
const PUBLICATION_INTERVAL: u64 = 3;
/// Scans without a point after which a block is published whatever has changed in it.
const LEFT_ALONE: u64 = 15;

/// What a scan has made of a dense voxel into which it put points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Folded {
    /// How many.
    pub(crate) points: u32,
    /// Whether it was published before.
    pub(crate) is_known: bool,
    /// Whether it has become dense, or has doubled its weight, since it was published.
    pub(crate) has_doubled: bool,
    /// Whether it has begun to drift by that scan.
    pub(crate) drifts: bool,
}

/// When it is asked what is to be published.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    /// Number of the scan that has been taken in.
    pub(crate) scan: u64,
    /// The scan since which the sensor has stood still.
    pub(crate) still_since: u64,
}

/// What a block has to tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct News {
    /// Whether a voxel has become dense, or has doubled its weight, since the block was published; or a scan has put points into
    /// one, and the block is to rest.
    changed: bool,
    /// Whether a scan has put points into a dense voxel since then. Not saved: whoever restores a map finds it again.
    #[serde(skip)]
    touched: bool,
    /// A dense voxel has gone: its place must not be told of any longer. Never so when a scan has been taken in.
    #[serde(skip)]
    lost: bool,
    /// Published voxels that have drifted since then.
    drifted: u32,
    /// Points that the newest scan put into dense voxels, and those of them that are in voxels that were not published.
    points: u32,
    unknown: u32,
    /// The scan in which it was published last; 0 = never.
    published: u64,
    /// The scan in which it was published first since the sensor turned to it.
    begun: u64,
    /// The scan that put a point here last.
    seen: u64,
}

impl News {
    /// Whether the states of a block with this many `dense` voxels are to be published. The first of these that holds decides:
    ///
    /// - a dense voxel has gone: yes, at once;
    /// - nothing has changed ([`Self::is_stale`]): no;
    /// - the block was never published: yes;
    /// - the sensor has gone, [`LEFT_ALONE`] scans ago: yes;
    /// - the block was published less than [`PUBLICATION_INTERVAL`] scans ago: no;
    /// - the block is young: it was published last within that interval of its first publication since the sensor turned to it: yes;
    /// - else, if more than a quarter is new: of its dense voxels by drift, or of the points that the newest scan put into them, as
    ///   lying in voxels that were not published. Where the sensor has stood still since before it was published, more than half:
    ///   new things show so, and what has moved by less than a voxel, and its noise, which goes on making voxels dense, hardly
    ///   ever.
    pub(crate) const fn is_due(&self, dense: u32, timing: Timing) -> bool {
        let Timing { scan, still_since } = timing;
        let is_young = self.published <= self.begun + PUBLICATION_INTERVAL;
        let is_other = if self.published < still_since {
            self.unknown * 4 > self.points || self.drifted * 4 > dense
        } else {
            self.unknown * 2 > self.points || self.drifted * 2 > dense
        };
        let waited = self.published == 0 || scan - self.published >= PUBLICATION_INTERVAL;
        self.lost || self.is_stale() && (waited && (is_young || is_other) || self.is_left_alone(scan))
    }

    /// Whether the states, where they are due, are to be published in this very scan: nothing may be told of what is gone,
    /// nothing is told yet of what was never published, and what the sensor sees from where it stands still is soon whole.
    pub(crate) const fn is_urgent(&self, timing: Timing) -> bool {
        self.lost || self.published == 0 || self.published >= timing.still_since
    }

    /// Whether anything has changed since the states were published.
    pub(crate) const fn is_stale(&self) -> bool {
        self.lost || self.changed
    }

    /// Whether all that dense voxels hold is published.
    pub(crate) const fn is_told(&self) -> bool {
        !self.is_stale() && !self.touched
    }

    const fn is_left_alone(&self, sequence: u64) -> bool {
        sequence - self.seen >= LEFT_ALONE
    }

    /// Whether no scan has put a point into the block for so long that it is to rest.
    pub(crate) const fn is_left(&self, sequence: u64) -> bool {
        sequence - self.seen >= REST
    }

    /// The scan that put a point into the block last.
    pub(crate) const fn seen(&self) -> u64 {
        self.seen
    }

    /// The scan in which the block was published last; 0 = never.
    pub(crate) const fn published(&self) -> u64 {
        self.published
    }

    /// Notes that the scan `sequence` put a point into the block. Once a scan: what it puts there is counted from here on.
    pub(crate) const fn note_seen(&mut self, sequence: u64) {
        (self.seen, self.points, self.unknown) = (sequence, 0, 0);
    }

    /// Notes what that scan has made of a dense voxel.
    pub(crate) const fn note_folded(&mut self, voxel: Folded) {
        self.touched = true;
        self.changed |= voxel.has_doubled;
        self.drifted += voxel.drifts as u32;
        self.points += voxel.points;
        self.unknown += if voxel.is_known { 0 } else { voxel.points };
    }

    /// Notes that dense voxels hold what is not published.
    pub(crate) const fn note_touched(&mut self) {
        self.touched = true;
    }

    /// Notes that a dense voxel has gone.
    pub(crate) const fn note_lost(&mut self) {
        self.lost = true;
    }

    /// Notes that it is time to rest; whether there is something that is to be published first.
    pub(crate) const fn note_left(&mut self) -> bool {
        self.changed |= self.touched;
        self.is_stale()
    }

    /// Notes that the states are published as they are now.
    pub(crate) const fn note_published(&mut self, sequence: u64) {
        let begins = self.published == 0 || self.is_left_alone(sequence);
        let begun = if begins { sequence } else { self.begun };
        let Self { seen, .. } = *self;
        *self = Self {
            changed: false,
            touched: false,
            lost: false,
            drifted: 0,
            points: 0,
            unknown: 0,
            published: sequence,
            begun,
            seen,
        };
    }

    /// What a saved map holds of it.
    pub(crate) const fn saved(&self) -> Self {
        Self { touched: false, lost: false, ..*self }
    }

    /// Checks what was saved of the block at `key`, of a map that has taken in `sequence` scans.
    pub(crate) fn check(&self, key: BlockKey, sequence: u64) -> Result<(), RestoreError> {
        let scans = [self.published, self.begun, self.seen];
        let few =
            self.drifted as usize <= CELLS && self.unknown <= self.points && self.points <= MAX_POINTS / 4;
        ensure(few && scans.iter().all(|&scan| scan <= sequence), || {
            format!(
                "block {key:?} counts what cannot be: scans {scans:?}, {} drifted, {} of {} points unknown",
                self.drifted, self.unknown, self.points
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a block is due after scan `scan`, and urgent, where the sensor has stood still since scan `still_since`. The block was
    /// published in scan 10, and in scan 1 first. The last points came with scan 20, 100 of them, into 40 dense voxels, and some
    /// of these have changed. `change` says what is different.
    fn judged(scan: u64, still_since: u64, change: impl Fn(&mut News)) -> (bool, bool) {
        let (published, begun, seen) = (10, 1, 20);
        let mut news = News { published, begun, seen, points: 100, changed: true, ..News::default() };
        change(&mut news);
        let timing = Timing { scan, still_since };
        (news.is_due(40, timing), news.is_urgent(timing))
    }

    const NOT_DUE: (bool, bool) = (false, false);
    const DUE: (bool, bool) = (true, false);
    const AT_ONCE: (bool, bool) = (true, true);

    #[test]
    fn a_block_whose_voxels_have_changed_is_due_when_a_quarter_is_new_or_the_sensor_has_turned_away() {
        assert_eq!(judged(20, 15, |_| ()), NOT_DUE);
        assert_eq!(judged(20, 15, |news| news.unknown = 25), NOT_DUE);
        assert_eq!(judged(20, 15, |news| news.unknown = 26), DUE);
        assert_eq!(judged(20, 15, |news| news.drifted = 10), NOT_DUE);
        assert_eq!(judged(20, 15, |news| news.drifted = 11), DUE);
        // Of what was published it is nothing, however much of it.
        assert_eq!(judged(20, 15, |news| (news.changed, news.unknown) = (false, 100)), NOT_DUE);
        assert_eq!(judged(34, 30, |_| ()), NOT_DUE);
        assert_eq!(judged(35, 30, |_| ()), DUE);
    }

    #[test]
    fn where_the_sensor_has_stood_since_a_block_was_published_half_must_be_new_and_that_is_urgent() {
        assert_eq!(judged(20, 10, |news| news.unknown = 50), (false, true));
        assert_eq!(judged(20, 10, |news| news.unknown = 51), AT_ONCE);
        assert_eq!(judged(20, 10, |news| news.drifted = 20), (false, true));
        assert_eq!(judged(20, 10, |news| news.drifted = 21), AT_ONCE);
        assert_eq!(judged(20, 11, |news| news.unknown = 50), DUE);
    }

    #[test]
    fn a_block_is_published_every_third_scan_at_most_but_where_a_voxel_has_gone() {
        assert_eq!(judged(20, 19, |news| (news.published, news.unknown) = (18, 100)), NOT_DUE);
        assert_eq!(judged(21, 19, |news| (news.published, news.unknown) = (18, 100)), DUE);
        assert_eq!(judged(20, 19, |news| (news.published, news.lost) = (19, true)), AT_ONCE);
    }

    #[test]
    fn a_young_block_is_due_with_whatever_has_changed_and_one_that_was_never_published_at_once() {
        assert_eq!(judged(20, 15, |news| news.begun = 6), NOT_DUE);
        assert_eq!(judged(20, 15, |news| news.begun = 7), DUE);
        assert_eq!(judged(20, 15, |news| (news.published, news.begun) = (0, 0)), AT_ONCE);
        assert_eq!(judged(20, 15, |news| (news.published, news.changed) = (0, false)), (false, true));
    }
}
