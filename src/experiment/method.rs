//! The methods that are held against each other, behind one trait, and how long they take.

use std::time::Duration;

use super::clustering::Clustering;
use crate::engine::consistent::Consistent;
use crate::engine::paper::Cfodi;
use crate::engine::paper::statics::Static;
use crate::engine::{Mode, Params, PipelineStep, Scan, Snapshot};

/// A method, and how figures and tables show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// CFODI to the letter.
    Cfodi,
    /// Mode `consistent`.
    Consistent,
    /// The paper's baseline.
    Static,
}

impl Method {
    /// All of them, in their order: of what is kept by method, the place of one is `method as usize`.
    pub(super) const ALL: [Self; 3] = [Self::Cfodi, Self::Consistent, Self::Static];

    /// As the paper calls it, or the parameter `mode`.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Cfodi => "CFODI",
            Self::Consistent => Mode::Consistent.as_str(),
            Self::Static => "STATIC",
        }
    }

    /// In names of columns.
    pub(super) const fn key(self) -> &'static str {
        match self {
            Self::Cfodi => "cfodi",
            Self::Consistent => Mode::Consistent.as_str(),
            Self::Static => "static",
        }
    }

    /// sRGB, of the colours of Okabe and Ito (2008), which every kind of eye tells apart.
    pub(super) const fn colour(self) -> [u8; 3] {
        match self {
            Self::Cfodi => [0, 114, 178],
            Self::Consistent => [0, 158, 115],
            Self::Static => [213, 94, 0],
        }
    }

    /// The method with an empty map.
    pub(super) fn start(self, params: Params) -> Box<dyn Clusterer> {
        match self {
            Self::Cfodi => Box::new(Cfodi::new(params)),
            Self::Consistent => Box::new(Consistent::new(params.with_mode(Mode::Consistent))),
            Self::Static => Box::new(Static::new(params)),
        }
    }
}

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
    fn methods_stand_in_their_order() {
        assert_eq!(Method::ALL.map(|method| method as usize), [0, 1, 2]);
    }

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
