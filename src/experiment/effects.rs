//! Effects of parameters (section V.B): one of them at a time takes several values, the others stay.

use std::time::Duration;

use super::clustering::{Clustering, Quality};
use super::method::timed;
use super::statistics::median;
use crate::engine::paper::Cfodi;
use crate::engine::{Params, ParamsError, Scan};

/// A parameter that is varied.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    /// As in the configuration.
    pub(super) name: &'static str,
    /// The paper's letter, with the unit.
    pub(super) label: &'static str,
    /// What the paper concludes of it (section V.B).
    pub(super) conclusion: &'static str,
    values: &'static [f64],
    of: fn(&Params) -> f64,
    with: fn(Params, f64) -> Result<Params, ParamsError>,
}

const PARAMETERS: [Parameter; 4] = [
    Parameter {
        name: "depth",
        label: "depth d (steps)",
        conclusion: "results improve and time rises with d; 1 to 5 are good",
        values: &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        of: |params| f64::from(params.depth()),
        with: |params, value| params.with_depth(value as i64),
    },
    Parameter {
        name: "max_normal_angle",
        label: "max_normal_angle θ (rad)",
        conclusion: "a smaller θ gives more clusters, a large one joins different surfaces",
        values: &[0.1, 0.2, 0.35, 0.53, 0.8, 1.1],
        of: Params::max_normal_angle,
        with: Params::with_max_normal_angle,
    },
    Parameter {
        name: "voxel_size",
        label: "voxel_size ξ (m)",
        conclusion: "0.05 m gives good results",
        values: &[0.04, 0.05, 0.08, 0.12, 0.16],
        of: Params::voxel_size,
        with: Params::with_voxel_size,
    },
    Parameter {
        name: "min_vicinity",
        label: "min_vicinity minUnits (pairs)",
        conclusion: "a larger minUnits gives more clusters, since fewer are merged",
        values: &[1.0, 2.0, 3.0, 5.0, 10.0],
        of: |params| f64::from(params.min_vicinity()),
        with: |params, value| params.with_min_vicinity(value as i64),
    },
];

/// Names of the parameters that are varied.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    PARAMETERS.iter().map(|parameter| parameter.name)
}

/// What became of the map for each value of a parameter.
#[derive(Clone, Debug)]
pub(super) struct Effect {
    /// The parameter.
    pub(super) parameter: &'static Parameter,
    /// The value it has while others are varied.
    pub(super) usual: f64,
    /// By ascending value.
    pub(super) cases: Vec<Case>,
}

/// The map after the last scan, for one value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    /// The value.
    pub(super) value: f64,
    /// CFODI's clusters.
    pub(super) quality: Quality,
    /// Median time of a scan (ms), CFODI.
    pub(super) median_ms: Option<f64>,
    /// What STATIC makes of the same voxels with the same parameters.
    pub(super) statics: Quality,
    /// Adjusted Rand index of the two; `None` without a dense voxel.
    pub(super) rand_index: Option<f64>,
}

/// An engine for every set of parameters, each set once.
pub(super) struct Sweep {
    runs: Vec<Run>,
    varied: Vec<Varied>,
}

struct Varied {
    parameter: &'static Parameter,
    usual: f64,
    /// Each value, ascending, with the place of its run.
    cases: Vec<(f64, usize)>,
}

struct Run {
    engine: Cfodi,
    times: Vec<Duration>,
}

impl Sweep {
    pub(super) const fn none() -> Self {
        Self { runs: Vec::new(), varied: Vec::new() }
    }

    /// Around `params`, whose own value of each parameter is always among those tried.
    pub(super) fn new(params: Params) -> Self {
        let mut sweep = Self::none();
        for parameter in &PARAMETERS {
            let own = (parameter.of)(&params);
            let mut values = [parameter.values, &[own]].concat();
            values.sort_by(f64::total_cmp);
            values.dedup();
            let possible =
                values.into_iter().filter_map(|value| Some((value, (parameter.with)(params, value).ok()?)));
            let cases = possible.map(|(value, params)| (value, sweep.place(params))).collect();
            sweep.varied.push(Varied { parameter, usual: own, cases });
        }
        sweep
    }

    /// The place of the run with these parameters.
    fn place(&mut self, params: Params) -> usize {
        self.runs.iter().position(|run| *run.engine.params() == params).unwrap_or_else(|| {
            self.runs.push(Run { engine: Cfodi::new(params), times: Vec::new() });
            self.runs.len() - 1
        })
    }

    pub(super) fn scan(&mut self, scan: &Scan, mut clock: impl FnMut() -> Duration) {
        for run in &mut self.runs {
            let engine = &mut run.engine;
            let timing = timed(&mut clock, |done| drop(engine.insert_observed(scan, done)));
            run.times.push(timing.total);
        }
    }

    pub(super) fn finish(&self) -> Vec<Effect> {
        let case = |(value, place): (f64, usize)| self.runs[place].finish(value);
        let effect = |varied: &Varied| Effect {
            parameter: varied.parameter,
            usual: varied.usual,
            cases: varied.cases.iter().copied().map(case).collect(),
        };
        self.varied.iter().map(effect).collect()
    }
}

impl Run {
    fn finish(&self, value: f64) -> Case {
        let own = Clustering::from(&self.engine.snapshot());
        let statics = Clustering::from(&self.engine.static_map());
        let times: Vec<f64> = self.times.iter().map(|time| time.as_secs_f64() * 1e3).collect();
        Case {
            value,
            quality: own.quality(),
            median_ms: median(&times),
            statics: statics.quality(),
            rand_index: own.agreement(&statics),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_tried_and_no_set_of_parameters_twice() {
        let sweep = Sweep::new(Params::paper());
        let values: Vec<_> = sweep.varied.iter().map(|varied| varied.cases.len()).collect();
        assert_eq!(values, [8, 6, 5, 5]);
        assert_eq!(sweep.runs.len(), 8 + 5 + 4 + 4);
    }

    #[test]
    fn a_usual_value_of_its_own_is_among_those_tried() {
        let sweep = Sweep::new(Params::paper().with_max_normal_angle(0.6).unwrap());
        let Varied { usual, cases, .. } = &sweep.varied[1];
        assert_eq!(*usual, 0.6);
        assert_eq!(
            cases.iter().map(|case| case.0).collect::<Vec<_>>(),
            [0.1, 0.2, 0.35, 0.53, 0.6, 0.8, 1.1]
        );
        assert!(sweep.varied[0].cases.contains(&(4.0, cases[4].1)));
    }
}
