//! The numbers as CSV: a header, one line a scan or case, an empty cell where there is no number.

use std::fmt::Display;
use std::time::Duration;

use super::clustering::Quality;
use super::live::arrival;
use super::method::Method;
use super::results::{Measured, Results};

/// A table: its header, then its lines.
struct Table {
    text: String,
}

impl Table {
    fn new(header: &[String]) -> Self {
        Self { text: header.join(",") + "\n" }
    }

    fn line(&mut self, cells: &[String]) {
        self.text += &(cells.join(",") + "\n");
    }
}

fn cell(value: Option<impl Display>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

/// A number with `digits` digits behind the point.
fn fixed(value: Option<f64>, digits: usize) -> String {
    cell(value.map(|value| format!("{value:.digits$}")))
}

fn ms(time: Option<Duration>) -> String {
    fixed(time.map(|time| time.as_secs_f64() * 1e3), 4)
}

/// The columns `names` of each method.
fn of_each_method(names: &[&str]) -> Vec<String> {
    let of = |method: Method| names.iter().map(move |name| format!("{}_{name}", method.key()));
    Method::ALL.into_iter().flat_map(of).collect()
}

fn words(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

const OF_A_SCAN: [&str; 9] = [
    "dense_voxels",
    "clusters",
    "clusters_large",
    "normal_error_rad",
    "ms",
    "bin_ms",
    "normals_ms",
    "partials_ms",
    "globals_ms",
];
const LIVE: [&str; 4] = ["taken", "begun_s", "done_s", "points_total"];
const OF_A_CASE: [&str; 11] = [
    "parameter",
    "value",
    "dense_voxels",
    "clusters",
    "clusters_large",
    "normal_error_rad",
    "median_ms",
    "rand_index_to_static",
    "static_clusters",
    "static_clusters_large",
    "static_normal_error_rad",
];

impl Results {
    /// `scans.csv`: figures 3a to 3c, one line a scan.
    pub(super) fn scans_csv(&self) -> String {
        let header = words(&["scan", "stamp_ns", "points"]);
        let mut table = Table::new(&[header, of_each_method(&OF_A_SCAN)].concat());
        for (index, record) in self.records.iter().enumerate() {
            let mut cells =
                vec![(index + 1).to_string(), record.stamp.nanos().to_string(), record.points.to_string()];
            record.methods.iter().for_each(|measured| cells.extend(cells_of(measured)));
            table.line(&cells);
        }
        table.text
    }

    /// `throughput.csv`: figure 3d, one line a scan; cells are empty where a method missed it.
    pub(super) fn throughput_csv(&self) -> String {
        let header = words(&["scan", "arrived_s", "points", "points_arrived"]);
        let mut table = Table::new(&[header, of_each_method(&LIVE)].concat());
        let mut arrived = 0;
        let mut totals = [0; Method::ALL.len()];
        let mut taken: Vec<_> = self.taken.iter().map(|taken| taken.iter().peekable()).collect();
        for (index, record) in self.records.iter().enumerate() {
            arrived += record.points;
            let seconds = Some(arrival(index as u64).as_secs_f64());
            let mut cells = vec![
                (index + 1).to_string(),
                fixed(seconds, 4),
                record.points.to_string(),
                arrived.to_string(),
            ];
            for (taken, total) in taken.iter_mut().zip(&mut totals) {
                let scan = taken.next_if(|taken| taken.scan == index as u64);
                *total += scan.map_or(0, |scan| scan.points);
                cells.push(u8::from(scan.is_some()).to_string());
                cells.push(fixed(scan.map(|scan| scan.begun.as_secs_f64()), 4));
                cells.push(fixed(scan.map(|scan| scan.done.as_secs_f64()), 4));
                cells.push(total.to_string());
            }
            table.line(&cells);
        }
        table.text
    }

    /// `effects.csv`: one line for each value of each parameter.
    pub(super) fn effects_csv(&self) -> String {
        let mut table = Table::new(&words(&OF_A_CASE));
        for effect in &self.effects {
            for case in &effect.cases {
                let mut cells = vec![effect.parameter.name.to_owned(), case.value.to_string()];
                cells.push(case.quality.dense_voxels.to_string());
                cells.extend(cells_of_clusters(&case.quality));
                cells.push(fixed(case.median_ms, 4));
                cells.push(fixed(case.rand_index, 5));
                cells.extend(cells_of_clusters(&case.statics));
                table.line(&cells);
            }
        }
        table.text
    }
}

fn cells_of(measured: &Measured) -> Vec<String> {
    let mut cells = vec![measured.quality.dense_voxels.to_string()];
    cells.extend(cells_of_clusters(&measured.quality));
    cells.push(ms(Some(measured.time.total)));
    cells.extend(measured.time.steps.map(ms));
    cells
}

fn cells_of_clusters(quality: &Quality) -> [String; 3] {
    [quality.clusters.to_string(), quality.large_clusters.to_string(), fixed(quality.normal_error, 5)]
}
