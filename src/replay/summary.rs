//! The account of a replay: `S.json`.

use std::collections::BTreeMap;
use std::time::Duration;

use serde_json::{Map, Value as Json, json};

use super::said::Remark;
use crate::cloud::CloudError;
use crate::config::Value;
use crate::count::count_of;
use crate::memory::peak_resident_mb;
use crate::reason::Reason;
use crate::report::Facts;

/// Why scans are skipped that nobody wants.
pub(super) const AFTER_JUMP: Reason =
    Reason::new("after_jump", "The scan came after the jump back of the stamps at which this ends.");

/// Where every cloud of a bag went.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Scans taken in.
    pub scans: u64,
    /// Scans that could not be used, by reason.
    pub skipped: BTreeMap<Reason, u64>,
    /// Transforms that could not be used, by reason.
    pub transforms_refused: BTreeMap<Reason, u64>,
    /// Messages of topics that are read, but not readable ones, by topic.
    pub undecodable: BTreeMap<String, u64>,
    /// Time for decoding scans, those among them that were skipped afterwards.
    pub decoding: Duration,
    /// Points of all of these.
    pub points_decoded: u64,
    /// Points of the scans taken in, valid or not.
    pub points: u64,
    /// Those of them without a measurement.
    pub points_invalid: u64,
    /// Those that were valid and in range.
    pub points_valid: u64,
    /// Clouds of which hardly a point is used.
    pub hardly_used: u64,
}

impl Tally {
    /// Measured points that were too near or too far.
    pub const fn points_out_of_range(&self) -> u64 {
        self.points - self.points_invalid - self.points_valid
    }

    /// Whether scans were left out because the stamps had jumped back before them.
    pub fn ends_at_jump(&self) -> bool {
        self.skipped.contains_key(&AFTER_JUMP)
    }

    pub(super) fn decoded(&mut self, total: u32, time: Duration) {
        self.decoding += time;
        self.points_decoded += u64::from(total);
    }

    pub(super) fn take(&mut self, total: u32, invalid: u32, valid: usize) {
        self.scans += 1;
        self.points += u64::from(total);
        self.points_invalid += u64::from(invalid);
        self.points_valid += valid as u64;
    }

    /// Counts a cloud of which hardly a point is used; says whether it is the first.
    pub(super) const fn note_hardly_used(&mut self) -> bool {
        self.hardly_used += 1;
        self.hardly_used == 1
    }

    /// Counts a scan; says whether it is the first with this reason.
    pub(super) fn skip(&mut self, reason: Reason) -> bool {
        count(&mut self.skipped, reason)
    }

    pub(super) fn skip_all(&mut self, reason: Reason, scans: usize) {
        if scans > 0 {
            *self.skipped.entry(reason).or_default() += scans as u64;
        }
    }

    pub(super) fn undecodable(&mut self, topic: &str) -> bool {
        let count = self.undecodable.entry(topic.to_owned()).or_default();
        *count += 1;
        *count == 1
    }

    pub(super) fn refuse_transform(&mut self, reason: Reason) {
        count(&mut self.transforms_refused, reason);
    }
}

fn count(counts: &mut BTreeMap<Reason, u64>, reason: Reason) -> bool {
    let count = counts.entry(reason).or_default();
    *count += 1;
    *count == 1
}

/// What a replay has come to.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Where every cloud went.
    pub tally: Tally,
    /// Where the map lives.
    pub fixed_frame: String,
    /// What was said at the end: of the order of the messages, of cameras and clouds, of how the frame was found, and of points beyond
    /// the grid.
    pub remarks: Vec<Remark>,
    /// How often a map was begun: 1, and one more for each jump back of the stamps.
    pub sessions: u64,
    /// Voxels of the map, dense or not.
    pub voxels: usize,
    /// Dense voxels of the map.
    pub dense_voxels: usize,
    /// Clusters of the map.
    pub clusters: usize,
    /// Those that still grow.
    pub clusters_active: usize,
    /// How far points are off their surfaces beyond the sensor's noise (m), where it is known.
    pub beyond_noise: Option<f64>,
    /// Time in the engine of each scan (ms), ascending.
    pub engine_ms: Vec<f32>,
    /// Time for binning points.
    pub binning: Duration,
    /// Valid points that lay beyond the grid's reach and are in no voxel.
    pub points_beyond_grid: u64,
    /// Time for all of it.
    pub wall: Duration,
    /// The parameters it was made with.
    pub parameters: Vec<(String, Value)>,
    /// What of the bag could not be read.
    pub unread: Option<String>,
    /// Whether it was stopped before the end of the bag.
    pub stopped: bool,
    /// Whole sentences about what was left out.
    pub notes: Vec<String>,
}

impl Summary {
    /// Points that were put into voxels.
    pub const fn points_used(&self) -> u64 {
        self.tally.points_valid - self.points_beyond_grid
    }

    /// What became of the others: the reasons there are.
    pub fn points_unused(&self) -> String {
        let Self { tally, points_beyond_grid, .. } = self;
        let reasons = [
            ("invalid", tally.points_invalid),
            ("out of range", tally.points_out_of_range()),
            ("beyond the grid", *points_beyond_grid),
        ];
        let there = reasons.iter().filter(|(_, points)| *points > 0);
        there.map(|(reason, points)| format!("{points} {reason}")).collect::<Vec<_>>().join(", ")
    }

    /// Time for decoding a point and for binning it (ns); `None` where none was taken in.
    fn ingest_ns_per_point(&self) -> Option<f64> {
        let Tally { decoding, points_decoded, points, .. } = self.tally;
        let each = |time: Duration, points: u64| time.as_nanos() as f64 / points as f64;
        (points > 0).then(|| each(decoding, points_decoded) + each(self.binning, points))
    }

    /// As the contract has it.
    pub fn json(&self) -> Json {
        let tally = &self.tally;
        let Tally { scans, skipped, transforms_refused, undecodable, points, .. } = tally;
        let mut parameters: Map<String, Json> =
            self.parameters.iter().map(|(name, value)| (name.clone(), parameter(value))).collect();
        parameters.insert("fixed_frame".to_owned(), json!(self.fixed_frame));
        let at = |share| percentile(&self.engine_ms, share);
        json!({
            "scans": scans,
            "scans_skipped": by_key(skipped),
            "transforms_refused": by_key(transforms_refused),
            "messages_undecodable": undecodable,
            "sessions": self.sessions,
            "points": points,
            "points_valid": tally.points_valid,
            "points_invalid": tally.points_invalid,
            "points_out_of_range": tally.points_out_of_range(),
            "points_beyond_grid": self.points_beyond_grid,
            "clouds_hardly_used": tally.hardly_used,
            "voxels": self.voxels,
            "dense_voxels": self.dense_voxels,
            "clusters": self.clusters,
            "clusters_active": self.clusters_active,
            "beyond_noise_m": self.beyond_noise,
            "engine_ms": { "p50": at(0.5), "p90": at(0.9), "p99": at(0.99), "max": at(1.0) },
            "ingest_ns_per_point": self.ingest_ns_per_point(),
            "wall_s": self.wall.as_secs_f64(),
            "peak_rss_mb": peak_resident_mb(),
            "remarks": self.remarks.iter().map(|remark| &remark.text).collect::<Vec<_>>(),
            "unread": self.unread,
            "stopped": self.stopped,
            "parameters": parameters,
        })
    }

    /// What the report says in words.
    pub fn facts(&self, title: &str) -> Facts {
        let values = self.parameters.iter().filter(|(name, _)| name != "fixed_frame");
        let reasons = self.tally.skipped.iter().chain(&self.tally.transforms_refused);
        let undecodable: u64 = self.tally.undecodable.values().sum();
        let mut skipped: BTreeMap<Reason, u64> = BTreeMap::new();
        let not_read = CloudError::Undecodable(String::new()).reason();
        let other = (undecodable > 0).then_some((&not_read, &undecodable));
        for (reason, count) in reasons.chain(other) {
            *skipped.entry(*reason).or_default() += count;
        }
        Facts {
            title: title.to_owned(),
            fixed_frame: self.fixed_frame.clone(),
            parameters: values.map(|(name, value)| (name.clone(), value.to_string())).collect(),
            skipped,
            points_unused: self.points_unused(),
            wall_seconds: self.wall.as_secs_f64(),
            warnings: self.warnings(),
            remarks: self.remarks(false).collect(),
            figures: Vec::new(),
        }
    }

    /// The remarks that are warnings, or those that are none, as sentences.
    fn remarks(&self, are_warnings: bool) -> impl Iterator<Item = String> {
        let remarks = self.remarks.iter().filter(move |remark| remark.is_warning == are_warnings);
        remarks.map(|remark| sentence(&remark.text))
    }

    /// What a reader must know.
    fn warnings(&self) -> Vec<String> {
        let tally = &self.tally;
        let unread = self.unread.iter().map(|unread| format!("Not all of the bag was read: {unread}."));
        let stopped = self.stopped.then(|| "The replay was stopped before the end of the bag.".to_owned());
        let begun = (self.sessions > 1).then(|| {
            let often = if self.sessions == 2 { "once".to_owned() } else { format!("{} times", self.sessions - 1) };
            format!(
                "The stamps jumped back ({often}); what is shown is what came after the last jump, but for the messages that were \
                 skipped and the points that were not used, which are those of the whole bag."
            )
        });
        let hardly_used = (tally.hardly_used > 0).then(|| {
            let clouds = count_of(tally.hardly_used, "cloud");
            format!("Of {clouds} hardly a point was used: see min_range, max_range and optical.")
        });
        let others = self.notes.iter().cloned();
        unread
            .chain(stopped)
            .chain(begun)
            .chain(hardly_used)
            .chain(self.remarks(true))
            .chain(others)
            .collect()
    }
}

/// A line of the log as a sentence.
fn sentence(line: &str) -> String {
    let mut letters = line.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters).chain(['.']).collect()
}

fn by_key(counts: &BTreeMap<Reason, u64>) -> Map<String, Json> {
    counts.iter().map(|(reason, count)| (reason.key.to_owned(), json!(count))).collect()
}

fn parameter(value: &Value) -> Json {
    match value {
        Value::Boolean(value) => json!(value),
        Value::Integer(value) => json!(value),
        Value::Double(value) => json!(value),
        Value::Text(value) => json!(value),
        Value::TextList(value) => json!(value),
    }
}

/// The smallest value that at least this share of the values does not exceed; `None` without values.
fn percentile(ascending: &[f32], share: f64) -> Option<f32> {
    let rank = (share * ascending.len() as f64).ceil() as usize;
    ascending.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bag whose clouds are in millimetres, of a camera that no transform places.
    #[test]
    fn why_a_map_is_empty_is_among_the_facts() {
        let tally = Tally {
            scans: 2,
            points: 100,
            points_invalid: 30,
            points_valid: 1,
            hardly_used: 2,
            ..Tally::default()
        };
        let remarks = [("the bag has no frame `odom`", false), ("messages lie out of order", true)]
            .map(|(text, is_warning)| Remark { text: text.to_owned(), is_warning });
        let summary = Summary { tally, remarks: remarks.to_vec(), ..nothing() };
        let facts = summary.facts("a.mcap");
        assert_eq!((summary.points_used(), facts.points_unused.as_str()), (1, "30 invalid, 69 out of range"));
        assert_eq!(
            facts.warnings,
            [
                "Of 2 clouds hardly a point was used: see min_range, max_range and optical.",
                "Messages lie out of order.",
            ]
        );
        assert_eq!(facts.remarks, ["The bag has no frame `odom`."]);
        assert_eq!(
            summary.json()["remarks"],
            json!(["the bag has no frame `odom`", "messages lie out of order"])
        );
        let facts = nothing().facts("a.mcap");
        assert_eq!((facts.points_unused.as_str(), facts.warnings.len(), facts.remarks.len()), ("", 0, 0));
    }

    #[test]
    fn how_often_stamps_jumped_back_is_one_less_than_the_sessions() {
        for (sessions, often) in [(2, "(once)"), (3, "(2 times)")] {
            let [warning] = Summary { sessions, ..nothing() }.facts("a.mcap").warnings.try_into().unwrap();
            assert!(warning.starts_with(&format!("The stamps jumped back {often}; ")), "{warning}");
        }
    }

    fn nothing() -> Summary {
        Summary {
            tally: Tally::default(),
            fixed_frame: "odom".to_owned(),
            remarks: Vec::new(),
            sessions: 1,
            voxels: 0,
            dense_voxels: 0,
            clusters: 0,
            clusters_active: 0,
            beyond_noise: None,
            engine_ms: Vec::new(),
            binning: Duration::ZERO,
            points_beyond_grid: 0,
            wall: Duration::ZERO,
            parameters: Vec::new(),
            unread: None,
            stopped: false,
            notes: Vec::new(),
        }
    }

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values: Vec<f32> = (1..=10).map(|i| i as f32).collect();
        assert_eq!(
            [0.5, 0.9, 0.99, 1.0].map(|share| percentile(&values, share)),
            [5.0, 9.0, 10.0, 10.0].map(Some)
        );
        assert_eq!(percentile(&values[..1], 0.01), Some(1.0));
        assert_eq!(percentile(&[], 0.5), None);
    }
}
