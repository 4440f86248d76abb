//! The figures: charts of the numbers, pictures of the map.

use super::chart::{Panel, Series, Style, svg};
use super::clustering::Quality;
use super::effects::{Case, Effect};
use super::live::arrival;
use super::method::Method;
use super::results::{Measured, Results};
use super::statistics::line;
use crate::count::count_of;
use crate::engine::MIN_RELIABLE_VOXELS;
use crate::export::{Picture, View, draw_alike};

/// A chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// Of its file, without `.svg`.
    pub name: String,
    /// One line.
    pub title: String,
    /// What it shows and what it says, in numbers.
    pub caption: String,
    /// A document of its own, with a white background; it refers to nothing outside.
    pub svg: String,
}

/// A picture of the map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MapPicture {
    /// Of its file, without `.png`.
    pub name: String,
    /// One line.
    pub title: String,
    /// What it shows.
    pub caption: String,
    /// All pictures of an experiment are drawn through one window.
    pub picture: Picture,
}

const GREY: [u8; 3] = [205, 205, 205];

/// Name of the picture of a moment, from 0.
pub(super) fn figure2_name(place: usize) -> String {
    format!("figure2_{}", ["a", "b", "c", "d"][place.min(3)])
}

impl Results {
    /// The charts: figures 3a to 3d, growth, and the effect of each parameter unless they were left out.
    pub fn figures(&self) -> Vec<Figure> {
        let figures = [self.figure3a(), self.figure3b(), self.figure3c(), self.figure3d(), self.growth()];
        figures.into_iter().chain(self.effects.iter().map(effect_figure)).collect()
    }

    /// Figure 2: the map after the first scan, after two between, and after the last; fewer where scans are fewer.
    pub fn pictures(&self) -> Vec<MapPicture> {
        let snapshots: Vec<_> = self.moments.iter().map(|moment| &moment.snapshot).collect();
        let pictures = draw_alike(&snapshots, &View::default());
        let summary = self.summary();
        let with_text = pictures.into_iter().zip(&summary.figure2).enumerate();
        with_text
            .map(|(place, (picture, moment))| MapPicture {
                name: figure2_name(place),
                title: format!("Figure 2{}: after scan {}", ["a", "b", "c", "d"][place.min(3)], moment.scan),
                caption: format!(
                    "{}{}. Each colour is a cluster, the same in every picture; grey is in none.",
                    count_of(moment.clusters, "cluster"),
                    moment.recorded_s.map(|s| format!(" after {s:.1} s")).unwrap_or_default()
                ),
                picture,
            })
            .collect()
    }

    /// Stream time of each scan with what the axis says.
    fn times(&self) -> (Vec<f64>, String) {
        let numbers = || (1..=self.records.len()).map(|number| number as f64).collect();
        self.seconds()
            .map_or_else(|| (numbers(), "scan".to_owned()), |seconds| (seconds, "stream time (s)".to_owned()))
    }

    fn over_time(&self, method: Method, of: impl Fn(&Measured) -> f64) -> Vec<(f64, f64)> {
        self.times().0.into_iter().zip(self.of_method(method).map(of)).collect()
    }

    /// A line for each method.
    fn lines(&self, of: impl Fn(&Measured) -> f64 + Copy) -> Vec<Series> {
        let line = |method| series(method, Style::Line, self.over_time(method, of));
        Method::ALL.into_iter().map(line).collect()
    }

    fn single(&self, name: &str, title: &str, caption: String, y: &str, series: Vec<Series>) -> Figure {
        let panel = Panel { x: self.times().1, y: y.to_owned(), series, ..Panel::default() };
        figure(name, title, caption, &[panel])
    }

    fn figure3a(&self) -> Figure {
        let of = |measured: &Measured| measured.quality.normal_error.unwrap_or(f64::NAN);
        let summary = self.summary();
        let cfodi = &summary.methods[Method::Cfodi as usize];
        let caption = format!(
            "Angle between the normal of each cluster and those of its members, mean over all members. Mean over the \
             scans: {}; {} is above STATIC by {} (in the paper by 0.12 rad).",
            of_methods(&summary, |method| number(method.normal_error_mean_rad, 3, " rad")),
            cfodi.method,
            number(cfodi.normal_error_above_static_rad, 3, " rad"),
        );
        let title = "Figure 3a: average error of normals";
        self.single("figure3a", title, caption, "mean error (rad)", self.lines(of))
    }

    fn figure3b(&self) -> Figure {
        let mut lines = self.lines(|measured| f64::from(measured.quality.clusters));
        for method in Method::ALL {
            let of = |measured: &Measured| f64::from(measured.quality.large_clusters);
            lines.push(large(method, series(method, Style::Dashed, self.over_time(method, of))));
        }
        let summary = self.summary();
        let cfodi = &summary.methods[Method::Cfodi as usize];
        let caption = format!(
            "Clusters, and those of {MIN_RELIABLE_VOXELS} voxels or more. After the last scan: {}; adjusted Rand index \
             of {} to STATIC {}. In the paper both methods find similar numbers.",
            of_methods(&summary, |method| format!(
                "{} ({})",
                number(method.clusters_last.map(f64::from), 0, ""),
                number(method.large_clusters_last.map(f64::from), 0, "")
            )),
            cfodi.method,
            number(cfodi.rand_index_to_static_last, 2, ""),
        );
        self.single("figure3b", "Figure 3b: number of clusters", caption, "clusters", lines)
    }

    fn figure3c(&self) -> Figure {
        let caption = format!(
            "Time from a scan to the clusters of the whole map: all of {}'s insertion; STATIC bins the scan and clusters \
             everything anew. Median: {}. In the paper CFODI stays near 340 ms and STATIC grows linearly.",
            Method::Cfodi.name(),
            of_methods(&self.summary(), |method| number(method.ms_median, 1, " ms")),
        );
        let title = "Figure 3c: time of a scan";
        self.single("figure3c", title, caption, "time (ms)", self.lines(Measured::ms))
    }

    fn growth(&self) -> Figure {
        let mut all = Vec::new();
        for method in Method::ALL {
            let points = self.time_by_size(method);
            let ends = line(&points).map(|(slope, start)| {
                let xs = points.iter().map(|point| point.0);
                let (least, most) = (xs.clone().fold(f64::MAX, f64::min), xs.fold(f64::MIN, f64::max));
                [least, most].map(|x| (x, (start + slope * x).max(0.0))).to_vec()
            });
            all.push(series(method, Style::Dots, points));
            all.push(Series { name: String::new(), ..series(method, Style::Line, ends.unwrap_or_default()) });
        }
        let summary = self.summary();
        let caption = format!(
            "Time of a scan by the size of the map, with least squares lines. Slope, for 1000 dense voxels more: {}. Last \
             quarter of the scans over the second: {}.",
            of_methods(&summary, |method| number(method.ms_per_1000_dense_voxels, 2, " ms")),
            of_methods(&summary, |method| number(method.last_quarter_over_second, 2, "")),
        );
        let (x, y) = ("dense voxels in the map".to_owned(), "time (ms)".to_owned());
        let panel = Panel { x, y, series: all, ..Panel::default() };
        figure("growth", "Time of a scan by the size of the map", caption, &[panel])
    }

    fn figure3d(&self) -> Figure {
        let mut all = vec![Series {
            name: "all points that arrived".to_owned(),
            colour: GREY,
            style: Style::Broad,
            points: cumulated(
                self.records.iter().zip(0..).map(|(record, i)| (arrival(i).as_secs_f64(), record.points)),
            ),
        }];
        for (method, taken) in Method::ALL.into_iter().zip(&self.taken) {
            let done = taken.iter().map(|taken| (taken.done.as_secs_f64(), taken.points));
            all.push(series(method, Style::Line, cumulated(done)));
        }
        let summary = self.summary();
        let share = |method: &super::MethodSummary| {
            let percent = method.live.share_of_points.map(|share| 100.0 * share);
            format!("{}, {} of the points", count_of(method.live.scans, "scan"), number(percent, 0, " %"))
        };
        let caption = format!(
            "Points taken in when a scan arrives every 1/30 s and a method takes the newest one whenever it is free. Of {}: \
             {}. In the paper STATIC misses more and more.",
            count_of(summary.scans, "scan"),
            of_methods(&summary, share),
        );
        let panel = Panel {
            x: "stream time at 30 Hz (s)".to_owned(),
            y: "points taken in (millions)".to_owned(),
            series: all,
            ..Panel::default()
        };
        figure("figure3d", "Figure 3d: points taken in", caption, &[panel])
    }
}

fn effect_figure(effect: &Effect) -> Figure {
    let parameter = effect.parameter;
    let line = |method, of: &dyn Fn(&Case) -> Option<f64>| {
        let points = effect.cases.iter().map(|case| (case.value, of(case).unwrap_or(f64::NAN)));
        series(method, Style::Marked, points.collect())
    };
    let both = |of: fn(&Quality) -> Option<f64>| {
        let own = line(Method::Cfodi, &|case| of(&case.quality));
        vec![own, line(Method::Static, &|case| of(&case.statics))]
    };
    let cfodi = |of: fn(&Case) -> Option<f64>| vec![line(Method::Cfodi, &of)];
    let large = format!("clusters of {MIN_RELIABLE_VOXELS} voxels or more");
    let panels = [
        ("clusters", "clusters", both(|quality| Some(f64::from(quality.clusters)))),
        (&large, "clusters", both(|quality| Some(f64::from(quality.large_clusters)))),
        ("average error of normals", "mean error (rad)", both(|quality| quality.normal_error)),
        ("agreement with STATIC", "adjusted Rand index", cfodi(|case| case.rand_index)),
        ("time of a scan", "median (ms)", cfodi(|case| case.median_ms)),
        ("dense voxels", "voxels", cfodi(|case| Some(f64::from(case.quality.dense_voxels)))),
    ];
    let panels = panels.map(|(title, y, series)| Panel {
        title: title.to_owned(),
        x: parameter.label.to_owned(),
        y: y.to_owned(),
        series,
        mark: Some(effect.usual),
    });
    let title = format!("Effect of {}", parameter.name);
    let caption = format!(
        "The map after the last scan for each value of {}, and what STATIC makes of the same voxels; the dashed line marks \
         the value used elsewhere, {}. The paper: {}.",
        parameter.name, effect.usual, parameter.conclusion
    );
    figure(&format!("effects_{}", parameter.name), &title, caption, &panels)
}

fn figure(name: &str, title: &str, caption: String, panels: &[Panel]) -> Figure {
    let legend = panels.first().map_or(&[][..], |panel| &panel.series);
    let svg = svg(title, legend, panels);
    Figure { name: name.to_owned(), title: title.to_owned(), caption, svg }
}

fn series(method: Method, style: Style, points: Vec<(f64, f64)>) -> Series {
    Series { name: method.name().to_owned(), colour: method.colour(), style, points }
}

/// The series as that of the large clusters. The legend has room to tell so of one.
fn large(method: Method, series: Series) -> Series {
    let name = match method {
        Method::Cfodi => format!("dashed: {MIN_RELIABLE_VOXELS} voxels or more"),
        Method::Consistent | Method::Static => String::new(),
    };
    Series { name, ..series }
}

/// Sums of points (millions) up to each time.
fn cumulated(points: impl Iterator<Item = (f64, u64)>) -> Vec<(f64, f64)> {
    let sums = points.scan(0, |sum, (time, points)| {
        *sum += points;
        Some((time, *sum as f64 / 1e6))
    });
    sums.collect()
}

/// "CFODI 1 ms, STATIC 2 ms".
fn of_methods(summary: &super::Summary, of: impl Fn(&super::MethodSummary) -> String) -> String {
    let of = |method: &super::MethodSummary| format!("{} {}", method.method, of(method));
    summary.methods.iter().map(of).collect::<Vec<_>>().join(", ")
}

fn number(value: Option<f64>, digits: usize, unit: &str) -> String {
    value.map_or_else(|| "no data".to_owned(), |value| format!("{value:.digits$}{unit}"))
}
