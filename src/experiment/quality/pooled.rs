//! Several runs of one method, taken together.

use std::collections::BTreeMap;

use super::super::statistics::{mean, median};
use super::measure::{Bar, Measure};
use super::score::Quality;

/// The values of several runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pooled {
    /// Number of runs.
    pub runs: u32,
    /// Seen surfaces of all runs.
    pub seen: u32,
    /// Clusters that hold scored voxels, of all runs.
    pub clusters: u32,
    values: BTreeMap<Measure, Vec<f64>>,
    /// What does not hold, in words, by run.
    pub failures: Vec<String>,
}

/// What comes out for one measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Values that hold the bar by themselves.
    pub held: usize,
    /// All values.
    pub of: usize,
    /// The value furthest to the wrong side.
    pub worst: f64,
    /// The middle value.
    pub median: f64,
    /// The mean of the values; infinite where one is.
    pub mean: f64,
    /// Whether the measure's bar holds.
    pub holds: bool,
}

impl Line {
    /// The number that methods are compared by.
    pub const fn figure(&self, measure: Measure) -> f64 {
        if measure.is_by_mean() { self.mean } else { self.median }
    }
}

impl Pooled {
    /// Adds a run; `name` says which, in front of each of its failures.
    pub fn add(&mut self, name: &str, quality: &Quality) {
        self.runs += 1;
        self.seen += quality.surfaces.len() as u32;
        self.clusters += quality.clusters.len() as u32;
        for measure in Measure::ALL {
            self.values.entry(measure).or_default().extend(measure.values(quality));
        }
        self.failures.extend(quality.failures.iter().map(|failure| format!("{name}: {failure}")));
    }

    /// What comes out for a measure; `None` without a value.
    pub fn line(&self, measure: Measure) -> Option<Line> {
        let values = self.values.get(&measure)?;
        let (mean, median) = (mean(values)?, median(values)?);
        let bar = measure.bar();
        let held = values.iter().filter(|value| bar.holds_for(**value)).count();
        let worst = bar.worst(values.iter().copied())?;
        let holds = match bar {
            Bar::EachAtLeast(_) | Bar::EachAtMost(_) => held == values.len(),
            Bar::MeanWithin { cases, .. } => bar.holds_for(mean) && values.len() >= cases,
            Bar::MedianAtMost(_) => bar.holds_for(median),
        };
        Some(Line { held, of: values.len(), worst, median, mean, holds })
    }
}
