//! The engine of a session: one of the two methods, behind one interface.

use super::paper::Cfodi;
use super::params::Params;
use super::scan::Scan;
use super::snapshot::{Snapshot, Update};
use super::step::PipelineStep;

/// The map of one session: a grid of voxels and the clusters that they form.
#[derive(Clone, Debug)]
pub struct Engine(Cfodi);

impl Engine {
    /// An engine with an empty map.
    pub fn new(params: Params) -> Self {
        Self(Cfodi::new(params))
    }

    /// Takes in a scan.
    pub fn insert(&mut self, scan: &Scan) -> Update {
        self.insert_observed(scan, |_| {})
    }

    /// As [`Self::insert`]; `done` is called at the end of each step, for those who have a clock.
    pub fn insert_observed(&mut self, scan: &Scan, done: impl FnMut(PipelineStep)) -> Update {
        self.0.insert_observed(scan, done)
    }

    /// The parameters it works with.
    pub const fn params(&self) -> &Params {
        self.0.params()
    }

    /// Number of voxels that hold a point, dense or not.
    pub const fn voxel_count(&self) -> usize {
        self.0.voxel_count()
    }

    /// The whole map as it is now. Costs O(map).
    pub fn snapshot(&self) -> Snapshot {
        self.0.snapshot()
    }
}
