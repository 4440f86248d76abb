//! The paper's figures (section V) on any recording: CFODI and mode `consistent` beside the baseline STATIC, and the effects of
//! parameters.
//!
//! Scans go by once and are not kept; of each remain its numbers, and of the map a bounded set of snapshots. Every method
//! has maps of its own, so that none works on what another has binned. Time comes from a clock that is handed in: with a
//! scripted one the same scans give the same files, byte for byte.
//!
//! The cost is that of all methods together, twice for the measured runs (each scan; only those that are managed at 30 Hz)
//! and once for every value of a parameter; the memory that of as many maps.

mod chart;
mod clustering;
mod effects;
mod figures;
mod files;
mod live;
mod method;
#[cfg(feature = "sim")]
pub mod quality;
mod results;
mod statistics;
mod summary;
mod tables;
#[cfg(test)]
mod tests;
mod thinned;

use std::time::Duration;

pub use figures::{Figure, MapPicture};
pub use results::Results;
pub use summary::{Live, MethodSummary, MomentSummary, ParametersSummary, StepsMs, Summary};

use crate::engine::{Params, Scan};
use effects::Sweep;
use live::LiveRun;
use method::{Clusterer, Method, timed};
use results::{Measured, Moment, ScanRecord};
use thinned::Thinned;

/// Most snapshots kept on the way; two of them are shown between the first scan and the last.
const SNAPSHOTS: usize = 12;

/// The figures in the making: scans in, [`Results`] out.
///
/// `C` is a clock that never runs backwards, from any zero.
///
/// ```no_run
/// use cfodi::engine::{Params, Scan};
/// use cfodi::experiment::Experiment;
///
/// # fn figures(scans: impl Iterator<Item = Scan>) -> Vec<cfodi::export::WriteError> {
/// let begin = std::time::Instant::now();
/// let mut experiment = Experiment::new(Params::paper(), move || begin.elapsed());
/// for scan in scans {
///     experiment.scan(&scan);
/// }
/// experiment.finish().write("figures".as_ref())
/// # }
/// ```
pub struct Experiment<C> {
    clock: C,
    params: Params,
    /// By method: the run that takes in every scan.
    runs: Vec<Box<dyn Clusterer>>,
    /// By method: the run that takes in what it manages.
    live: Vec<LiveRun>,
    sweep: Sweep,
    moments: Thinned<Moment>,
    records: Vec<ScanRecord>,
}

impl<C: FnMut() -> Duration> Experiment<C> {
    /// An experiment with these parameters, and with the values of section V.B for one of them at a time.
    pub fn new(params: Params, clock: C) -> Self {
        let start = |method: Method| method.start(params);
        Self {
            clock,
            params,
            runs: Method::ALL.into_iter().map(start).collect(),
            live: Method::ALL.into_iter().map(|method| LiveRun::new(start(method))).collect(),
            sweep: Sweep::new(params),
            moments: Thinned::new(SNAPSHOTS),
            records: Vec::new(),
        }
    }

    /// Leaves the effects of parameters out: about twenty maps less to feed.
    #[must_use]
    pub fn without_effects(self) -> Self {
        Self { sweep: Sweep::none(), ..self }
    }

    /// Takes in a scan.
    pub fn scan(&mut self, scan: &Scan) {
        let index = self.records.len();
        let measured = self.runs.iter_mut().map(|run| {
            let time = timed(&mut self.clock, |done| run.insert(scan, done));
            Measured { time, quality: run.clustering().quality() }
        });
        let methods = measured.collect();
        self.records.push(ScanRecord { stamp: scan.stamp, points: scan.points.len() as u64, methods });
        for run in &mut self.live {
            run.offer(index as u64, scan, &mut self.clock);
        }
        self.sweep.scan(scan, &mut self.clock);
        let runs = &self.runs;
        self.moments.offer(index as u64, || moment(runs, index));
    }

    /// The figures' numbers, when the last scan has been taken in.
    pub fn finish(self) -> Results {
        let Self { params, runs, live, sweep, moments, records, .. } = self;
        let count = records.len() as u64;
        let newest = records.len().checked_sub(1).and_then(|index| moment(&runs, index));
        let clusterings: Vec<_> = runs.iter().map(|run| run.clustering()).collect();
        let statics = &clusterings[Method::Static as usize];
        let rand_indices = clusterings.iter().map(|clustering| clustering.agreement(statics)).collect();
        Results {
            params,
            records,
            taken: live.into_iter().map(LiveRun::into_taken).collect(),
            rand_indices,
            moments: moments.between(count).into_iter().chain(newest).collect(),
            effects: sweep.finish(),
        }
    }
}

/// The map of the first method that keeps one, after scan `index`.
fn moment(runs: &[Box<dyn Clusterer>], index: usize) -> Option<Moment> {
    let snapshot = runs.iter().find_map(|run| run.snapshot())?;
    Some(Moment { scan: index, snapshot })
}
