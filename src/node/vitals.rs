//! What is seen of the engine and its map where their outputs pass, for the node's reports.

use std::time::Duration;

use crate::engine::Snapshot;

/// Since the last report, and at last.
#[derive(Debug, Default)]
pub(super) struct Vitals {
    /// How long the engine worked on each scan since the last report.
    pub(super) took: Vec<Duration>,
    /// The newest map that was seen.
    pub(super) map: Option<MapSize>,
}

/// How much a map holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MapSize {
    pub(super) session: u64,
    pub(super) sequence: u64,
    pub(super) clusters: usize,
    pub(super) dense_voxels: usize,
    pub(super) unclustered_voxels: u32,
}

impl MapSize {
    pub(super) fn of(session: u64, map: &Snapshot) -> Self {
        Self {
            session,
            sequence: map.sequence,
            clusters: map.clusters.len(),
            dense_voxels: map.voxels.len(),
            unclustered_voxels: map.unclustered_voxels,
        }
    }
}
