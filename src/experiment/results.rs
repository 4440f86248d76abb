//! The numbers of an experiment; tables, figures and the summary are made of them alone.

use super::clustering::Quality;
use super::effects::Effect;
use super::live::Taken;
use super::method::{Method, Timing};
use crate::engine::{Params, Snapshot, Stamp};

/// What an experiment has found. Lists "by method" are in one order: CFODI, `consistent`, STATIC.
#[derive(Clone, Debug)]
pub struct Results {
    pub(super) params: Params,
    /// One for each scan.
    pub(super) records: Vec<ScanRecord>,
    /// By method: the scans that it managed at 30 Hz.
    pub(super) taken: Vec<Vec<Taken>>,
    /// By method: the adjusted Rand index to STATIC after the last scan.
    pub(super) rand_indices: Vec<Option<f64>>,
    /// At most four: the first scan, two between, the last.
    pub(super) moments: Vec<Moment>,
    /// Empty where they were left out.
    pub(super) effects: Vec<Effect>,
}

/// A scan and what the methods made of it.
#[derive(Clone, Debug)]
pub(super) struct ScanRecord {
    pub(super) stamp: Stamp,
    /// Valid points.
    pub(super) points: u64,
    /// By method.
    pub(super) methods: Vec<Measured>,
}

/// One method's time for a scan, and its map afterwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measured {
    pub(super) time: Timing,
    pub(super) quality: Quality,
}

/// The map after a scan.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// Index of the scan, from 0.
    pub(super) scan: usize,
    pub(super) snapshot: Snapshot,
}

impl Measured {
    /// The whole time (ms).
    pub(super) fn ms(&self) -> f64 {
        self.time.total.as_secs_f64() * 1e3
    }
}

impl Results {
    /// Points of all scans.
    pub(super) fn points(&self) -> u64 {
        self.records.iter().map(|record| record.points).sum()
    }

    /// What was measured of one method, by scan.
    pub(super) fn of_method(&self, method: Method) -> impl Iterator<Item = &Measured> {
        self.records.iter().map(move |record| &record.methods[method as usize])
    }

    /// The time of each scan (s) from the stamp of the first; `None` where the stamps do not go forward, and so say
    /// nothing about time.
    pub(super) fn seconds(&self) -> Option<Vec<f64>> {
        let first = self.records.first()?.stamp;
        let forward = self.records.is_sorted_by_key(|record| record.stamp);
        let seconds: Vec<_> = self.records.iter().map(|record| record.stamp.seconds_since(first)).collect();
        (forward && *seconds.last()? > 0.0).then_some(seconds)
    }

    /// How much larger a method's normal errors are than STATIC's, mean over the scans (rad).
    pub(super) fn error_above_static(&self, method: Method) -> Option<f64> {
        let errors = self.of_method(method).zip(self.of_method(Method::Static));
        let differences: Vec<f64> = errors
            .filter_map(|(own, other)| Some(own.quality.normal_error? - other.quality.normal_error?))
            .collect();
        super::statistics::mean(&differences)
    }
}
