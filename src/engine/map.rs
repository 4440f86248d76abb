//! The engine of a session: one of the two methods, behind one interface.

use super::consistent::Consistent;
use super::frozen::{self, Frozen};
use super::now::Taken;
use super::paper::Cfodi;
use super::params::{Mode, Params};
use super::saved::{self, RestoreError, SavedMap};
use super::scan::Scan;
use super::snapshot::{Snapshot, Update};
use super::step::PipelineStep;

/// The map of one session: a grid of voxels and the clusters that they form.
#[derive(Clone, Debug)]
pub struct Engine(Method);

#[derive(Clone, Debug)]
enum Method {
    Paper(Box<Cfodi>),
    Consistent(Box<Consistent>),
}

impl Engine {
    /// An engine with an empty map.
    pub fn new(params: Params) -> Self {
        Self(match params.mode() {
            Mode::Paper => Method::Paper(Box::new(Cfodi::new(params))),
            Mode::Consistent => Method::Consistent(Box::new(Consistent::new(params))),
        })
    }

    /// Takes in a scan.
    pub fn insert(&mut self, scan: &Scan) -> Update {
        self.insert_observed(scan, |_| {})
    }

    /// Takes in a scan like [`Self::insert`]; `done` is called at the end of each step, for those who have a clock.
    pub fn insert_observed(&mut self, scan: &Scan, done: impl FnMut(PipelineStep)) -> Update {
        match &mut self.0 {
            Method::Paper(map) => map.insert_observed(scan, done),
            Method::Consistent(map) => map.insert_observed(scan, done),
        }
    }

    /// The map as it is now, which no later scan changes: snapshots and savings can be made of it while the engine goes on.
    /// Costs O(map), in mode `consistent` less than a hundredth of [`Self::snapshot`]: what the two share is copied page by page when a
    /// scan changes it.
    pub fn freeze(&self) -> Frozen {
        let method = match &self.0 {
            Method::Paper(map) => frozen::Method::Paper(map.clone()),
            Method::Consistent(map) => frozen::Method::Consistent(Box::new(map.freeze())),
        };
        Frozen { params: *self.params(), method }
    }

    /// The engine that [`Frozen::save`] saved: its next scan gives what it would have given without a stop. Bounds, clearing and
    /// `expansion_interval` may be others. Costs O(map); of what was saved each piece goes when it is taken in.
    ///
    /// # Errors
    /// When the map was made with other parameters, or is none that an engine saves.
    pub fn restore(params: Params, map: SavedMap) -> Result<Self, RestoreError> {
        let SavedMap(map) = map;
        map.check(&params)?;
        let taken = Taken { is_resumed: true, ..map.taken };
        Ok(Self(match (map.method, params.mode()) {
            (saved::Method::Paper(map), Mode::Paper) => {
                Method::Paper(Box::new(Cfodi::restore(params, taken, &map)?))
            }
            (saved::Method::Consistent(map), Mode::Consistent) => {
                Method::Consistent(Box::new(Consistent::restore(params, taken, *map)?))
            }
            (_, mode) => {
                return Err(RestoreError::Contradiction(format!(
                    "it is said to be of mode {mode:?}, and is not"
                )));
            }
        }))
    }

    /// Takes over the parameters that [`Params::tuned`] names, from the next scan on, as if the map had been saved and restored with
    /// them. Does nothing in `paper`. Costs O(map) where `max_voxels` begins to hold, O(1) elsewhere.
    pub fn tune(&mut self, params: &Params) {
        if let Method::Consistent(map) = &mut self.0 {
            map.tune(params);
        }
    }

    /// The parameters it works with.
    pub const fn params(&self) -> &Params {
        match &self.0 {
            Method::Paper(map) => map.params(),
            Method::Consistent(map) => map.params(),
        }
    }

    /// Number of voxels that hold a point, dense or not.
    pub const fn voxel_count(&self) -> usize {
        match &self.0 {
            Method::Paper(map) => map.voxel_count(),
            Method::Consistent(map) => map.voxel_count(),
        }
    }

    /// Number of dense voxels.
    pub fn dense_count(&self) -> usize {
        match &self.0 {
            Method::Paper(map) => map.dense_count(),
            Method::Consistent(map) => map.dense_count(),
        }
    }

    /// The whole map as it is now. Costs O(map).
    pub fn snapshot(&self) -> Snapshot {
        match &self.0 {
            Method::Paper(map) => map.snapshot(),
            Method::Consistent(map) => map.snapshot(),
        }
    }
}
