//! What is seen of the engine and its map where their outputs pass, for the node's reports.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::engine::{Snapshot, Stamp};
use crate::msg::clusters::MapVersion;
use crate::msg::labelled;
use crate::reach::Points;
use crate::worker::Took;

/// What the engine has done since the last report, and what its map is like.
#[derive(Debug, Default)]
pub(super) struct Vitals {
    /// How long the engine worked on each scan since that report.
    pub(super) took: Vec<Duration>,
    /// What the newest snapshot of the map took.
    pub(super) snapshot_took: Took,
    /// What was taken in of each sensor.
    taken_in: BTreeMap<usize, TakenIn>,
    /// Points of these scans, and how many of them lay beyond the grid.
    pub(super) points: Points,
    /// The newest map that was seen.
    pub(super) map: Option<MapSize>,
    /// The map as it is by the newest output.
    pub(super) newest: Option<MapVersion>,
}

impl Vitals {
    /// The scan of a sensor by which the map has become this one was taken in.
    pub(super) fn note_scan(
        &mut self,
        newest: MapVersion,
        (sensor, stamp): (usize, Stamp),
        took: Duration,
        points: Points,
    ) {
        self.took.push(took);
        let taken_in = self.taken_in.entry(sensor).or_default();
        taken_in.scans += 1;
        taken_in.newest = Some((newest.session, stamp));
        self.points.add(points);
        self.newest = Some(newest);
    }

    /// How many scans of a sensor were taken in since the last report.
    pub(super) fn taken_in(&self, sensor: usize) -> u64 {
        self.taken_in.get(&sensor).map_or(0, |taken_in| taken_in.scans)
    }

    /// The stamp of the scan of a sensor that was taken in last, where it is in the map of this session.
    pub(super) fn newest_of(&self, sensor: usize, session: u64) -> Option<Stamp> {
        let (of, stamp) = self.taken_in.get(&sensor)?.newest?;
        (of == session).then_some(stamp)
    }

    /// A map was seen. One that was long in making may have fewer scans than are known of already.
    pub(super) fn note_snapshot(&mut self, map: MapSize, took: Took) {
        self.newest = self.newest.max(Some(map.version));
        (self.map, self.snapshot_took) = (Some(map), took);
    }

    /// A report was made.
    pub(super) fn begin_period(&mut self) {
        self.took.clear();
        self.points = Points::default();
        self.taken_in.values_mut().for_each(|taken_in| taken_in.scans = 0);
    }

    /// How far points are off their surfaces beyond the sensor's noise (m), in the map of this session.
    pub(super) fn beyond_noise(&self, session: u64) -> Option<f64> {
        self.map.filter(|map| map.version.session == session)?.beyond_noise
    }

    /// What `~/points_labelled` leaves out of the map of this session.
    pub(super) fn left_out(&self, session: u64) -> Option<String> {
        let map = self.map.filter(|map| map.version.session == session)?;
        labelled::left_out(map.dense_voxels, map.unclustered_voxels)
    }
}

/// What was taken in of a sensor.
#[derive(Debug, Default)]
struct TakenIn {
    /// Scans since the last report.
    scans: u64,
    /// The session and the stamp of the last one; the latest of all stamps would stay where one was far ahead.
    newest: Option<(u64, Stamp)>,
}

/// How much a map holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MapSize {
    pub(super) version: MapVersion,
    pub(super) clusters: usize,
    pub(super) dense_voxels: usize,
    pub(super) unclustered_voxels: u32,
    /// How far points are off their surfaces beyond the sensor's noise (m), where that is known.
    pub(super) beyond_noise: Option<f64>,
}

impl MapSize {
    pub(super) fn of(session: u64, map: &Snapshot) -> Self {
        Self {
            version: MapVersion { session, sequence: map.sequence },
            clusters: map.clusters.len(),
            dense_voxels: map.voxels.len(),
            unclustered_voxels: map.unclustered_voxels,
            beyond_noise: map.beyond_noise(),
        }
    }
}
