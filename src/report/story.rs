//! What happened in a replay, told while it happens.

use rustc_hash::FxHashSet;

use super::moment::{Latest, Moment};
use super::series::{Column, Series, Taken};
use crate::engine::{ClusterId, Snapshot, Update};

/// Most moments that a [`Story`] keeps; even.
pub const MOMENTS: usize = 64;

/// What becomes of the map of one session, scan by scan in numbers and now and then as a whole.
///
/// It keeps at most [`MOMENTS`] moments: where one more comes every second one is given up, and from then on a moment is
/// wanted half as often. Which ones are kept follows from the number of scans alone. A moment holds what differs from the
/// moment before.
#[derive(Clone, Debug)]
pub struct Story {
    bound: usize,
    /// Scans from one wanted moment to the next.
    interval: u64,
    /// Number of scans taken in.
    scans: u64,
    living: FxHashSet<ClusterId>,
    pub(super) voxel_size: f64,
    pub(super) latest: Latest,
    pub(super) moments: Vec<Moment>,
    pub(super) series: Series,
    pub(super) merges: Vec<Merge>,
}

/// A cluster took in others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Merge {
    /// Number of scans taken in.
    pub(super) scan: u64,
    pub(super) into: ClusterId,
    pub(super) from: Vec<ClusterId>,
}

impl Default for Story {
    fn default() -> Self {
        Self::new()
    }
}

impl Story {
    /// A story without a scan.
    pub fn new() -> Self {
        Self::of_moments(MOMENTS)
    }

    /// `bound` is even, so that the newest moment stays when every second one goes.
    pub(super) fn of_moments(bound: usize) -> Self {
        Self {
            bound,
            interval: 1,
            scans: 0,
            living: FxHashSet::default(),
            voxel_size: f64::NAN,
            latest: Latest::default(),
            moments: Vec::new(),
            series: Series::default(),
            merges: Vec::new(),
        }
    }

    /// Notes a scan that the engine took in. Costs O(what the scan changed).
    pub fn scan(&mut self, update: &Update, taken: &Taken) {
        self.scans += 1;
        self.living.extend(update.changed.iter().map(|changed| changed.cluster.id));
        for id in &update.removed {
            self.living.remove(id);
        }
        self.note_merges(update);
        self.series.push(Column {
            scans: 1,
            stamp: update.stamp,
            points: taken.points,
            engine_ms: taken.engine_ms,
            slowest_ms: taken.engine_ms,
            newly_dense: update.newly_dense.into(),
            clusters: self.living.len() as u64,
            dense: taken.dense,
            sensor: taken.sensor,
        });
    }

    /// Whether the map after the newest scan is to be told: ask before making a snapshot, which costs O(map).
    pub fn wants_moment(&self) -> bool {
        self.scans > 0
            && (self.scans - 1).is_multiple_of(self.interval)
            && self.moments.last().is_none_or(|last| last.scan < self.scans)
    }

    /// Keeps the map as it is after the newest scan. Costs O(map).
    pub fn moment(&mut self, snapshot: &Snapshot) {
        self.voxel_size = snapshot.voxel_size;
        let mut moment = self.latest.advance(snapshot, self.scans);
        if let Some(same) = self.moments.pop_if(|last| last.scan == self.scans) {
            moment.take_in(same);
        }
        self.moments.push(moment);
        if self.moments.len() > self.bound {
            self.keep_every_second();
        }
    }

    /// Keeps the map as it is at the end, whether or not a moment is wanted; without a scan there is none.
    pub fn finish(&mut self, snapshot: &Snapshot) {
        if self.scans > 0 {
            self.moment(snapshot);
        }
    }

    /// The first, third ... moment; what the others told is told by those after them.
    fn keep_every_second(&mut self) {
        self.interval *= 2;
        let mut before = None;
        for (i, mut moment) in std::mem::take(&mut self.moments).into_iter().enumerate() {
            if i % 2 == 1 {
                before = Some(moment);
                continue;
            }
            if let Some(before) = before.take() {
                moment.take_in(before);
            }
            self.moments.push(moment);
        }
    }

    fn note_merges(&mut self, update: &Update) {
        let merged = update.changed.iter().filter(|changed| !changed.merged_from.is_empty());
        self.merges.extend(merged.map(|changed| Merge {
            scan: self.scans,
            into: changed.cluster.id,
            from: changed.merged_from.clone(),
        }));
    }
}
