//! The methods that are held against each other, behind one trait, and how long they take.

use std::time::Duration;

use super::clustering::Clustering;
use crate::engine::consistent::Consistent;
use crate::engine::paper::Cfodi;
use crate::engine::paper::statics::Static;
use crate::engine::{Mode, Params, PipelineStep, Scan, Snapshot};

/// A method and how the figures show it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Method {
    /// As the paper calls it.
    pub(super) name: &'static str,
    /// In names of columns and keys.
    pub(super) key: &'static str,
    /// sRGB.
    pub(super) colour: [u8; 3],
    /// With an empty map.
    pub(super) start: fn(Params) -> Box<dyn Clusterer>,
}

/// Mode `consistent`.
const CONSISTENT: &str = "consistent";

/// All methods, the baseline last. Colours are those of Okabe and Ito (2008), told apart by every kind of eye.
pub(super) const METHODS: [Method; 3] = [
    Method {
        name: "CFODI",
        key: "cfodi",
        colour: [0, 114, 178],
        start: |params| Box::new(Cfodi::new(params)),
    },
    Method {
        name: CONSISTENT,
        key: CONSISTENT,
        colour: [0, 158, 115],
        start: |params| Box::new(Consistent::new(params.with_mode(Mode::Consistent))),
    },
    Method {
        name: "STATIC",
        key: "static",
        colour: [213, 94, 0],
        start: |params| Box::new(Static::new(params)),
    },
];

/// A method at work on a map of its own.
pub(super) trait Clusterer {
    /// Takes in a scan; `done` is called at the end of each step.
    fn insert(&mut self, scan: &Scan, done: &mut dyn FnMut(PipelineStep));

    /// What it has made of the dense voxels.
    fn clustering(&self) -> Clustering;

    /// Its map, where it is one whose clusters have lasting ids.
    fn snapshot(&self) -> Option<Snapshot>;
}

impl Clusterer for Cfodi {
    fn insert(&mut self, scan: &Scan, done: &mut dyn FnMut(PipelineStep)) {
        self.insert_observed(scan, done);
    }

    fn clustering(&self) -> Clustering {
        Clustering::from(&Cfodi::snapshot(self))
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Cfodi::snapshot(self))
    }
}

/// It has no steps of the paper's.
impl Clusterer for Consistent {
    fn insert(&mut self, scan: &Scan, _: &mut dyn FnMut(PipelineStep)) {
        Self::insert(self, scan);
    }

    fn clustering(&self) -> Clustering {
        Clustering::from(&Self::snapshot(self))
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Self::snapshot(self))
    }
}

impl Clusterer for Static {
    fn insert(&mut self, scan: &Scan, done: &mut dyn FnMut(PipelineStep)) {
        self.insert_observed(scan, done);
    }

    fn clustering(&self) -> Clustering {
        Clustering::from(&self.map())
    }

    fn snapshot(&self) -> Option<Snapshot> {
        None
    }
}

/// How long a method took for a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Timing {
    /// From the call to its return.
    pub(super) total: Duration,
    /// Each [`PipelineStep`], in their order; `None` where the method has no such step.
    pub(super) steps: [Option<Duration>; 4],
}

/// Calls `insert` and times it by `clock`.
pub(super) fn timed(
    mut clock: impl FnMut() -> Duration,
    insert: impl FnOnce(&mut dyn FnMut(PipelineStep)),
) -> Timing {
    let begin = clock();
    let (mut before, mut steps) = (begin, [None; 4]);
    insert(&mut |step| {
        let now = clock();
        steps[step as usize] = Some(now.saturating_sub(before));
        before = now;
    });
    Timing { total: clock().saturating_sub(begin), steps }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_step_lasts_from_the_end_of_the_one_before() {
        let mut times = [10, 13, 18, 19].into_iter().map(Duration::from_millis);
        let timing = timed(
            || times.next().unwrap(),
            |done| {
                done(PipelineStep::Binned);
                done(PipelineStep::Partials);
            },
        );
        let ms = Duration::from_millis;
        assert_eq!(timing, Timing { total: ms(9), steps: [Some(ms(3)), None, Some(ms(5)), None] });
    }
}
