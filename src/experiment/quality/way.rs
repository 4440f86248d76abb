//! How the methods do on the way, while the map grows: what a planner sees, of which the end of a drive tells nothing.

use std::fmt::Write as _;

use super::super::statistics::{mean, median};
use super::laboratory::Scored;
use super::measure::Measure;
use super::pooled::Pooled;
use super::table::{centimetres, number};
use super::told;
use crate::sim::PoseNoise;

/// What one method did up to one scan of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Time of the scan since the first one (s).
    pub seconds: f64,
    /// Edge of a voxel (m).
    pub voxel_size: f64,
    /// The method.
    pub method: &'static str,
    /// What methods are compared by, in the order of [`Measure::ALL`]; `None` = no value.
    figures: [Option<f64>; Measure::ALL.len()],
}

impl Moment {
    pub(super) fn new(seconds: f64, scored: &Scored) -> Self {
        let Scored { voxel_size, method, quality } = scored;
        let mut pooled = Pooled::default();
        pooled.add("", quality);
        let figure = |measure| pooled.line(measure).map(|line| line.figure(measure));
        Self { seconds, voxel_size: *voxel_size, method, figures: Measure::ALL.map(figure) }
    }

    /// The number that methods are compared by; infinite where what should be there is missing.
    pub const fn figure(&self, measure: Measure) -> Option<f64> {
        self.figures[measure as usize]
    }
}

/// The moments of several runs, each with its seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Way {
    moments: Vec<(u64, Moment)>,
    /// By how much the poses of the runs were told wrong.
    pose_noise: Option<PoseNoise>,
}

impl Way {
    /// What the words and numbers of [`Self::markdown`] mean beyond those of [`Table::legend`](super::Table::legend).
    pub const LEGEND: &str = "
On the way a cell has the mean of what the methods are compared by, its median and the worst, each over the moments that have a value,
and in how many there was `none`. What counts as seen grows from moment to moment, and with it what is asked of the methods.
";

    /// No moments yet, of runs whose poses are told wrong by so much; `None` where they are exact.
    pub const fn new(pose_noise: Option<PoseNoise>) -> Self {
        Self { moments: Vec::new(), pose_noise }
    }

    /// Adds those of a run.
    pub fn add_run(&mut self, seed: u64, moments: impl IntoIterator<Item = Moment>) {
        self.moments.extend(moments.into_iter().map(|moment| (seed, moment)));
    }

    /// Whether nothing was scored on the way.
    pub const fn is_empty(&self) -> bool {
        self.moments.is_empty()
    }

    /// A section for each voxel size with a line for each measure.
    pub fn markdown(&self) -> String {
        let (mut sizes, mut methods): (Vec<f64>, Vec<&str>) = (Vec::new(), Vec::new());
        for (_, moment) in &self.moments {
            if !sizes.contains(&moment.voxel_size) {
                sizes.push(moment.voxel_size);
            }
            if !methods.contains(&moment.method) {
                methods.push(moment.method);
            }
        }
        sizes.iter().map(|&size| self.section(size, &methods)).collect::<Vec<_>>().join("\n")
    }

    fn section(&self, voxel_size: f64, methods: &[&str]) -> String {
        let size = centimetres(voxel_size);
        let noise = told::in_heading(self.pose_noise);
        let mut text =
            format!("## On the way, voxels of {size}{noise}\n\n| measure | {} |\n", methods.join(" | "));
        _ = writeln!(text, "|---|{}", "---|".repeat(methods.len()));
        for measure in Measure::ALL {
            let cells: Vec<_> = methods.iter().map(|method| self.cell(voxel_size, method, measure)).collect();
            _ = writeln!(text, "| {} | {} |", measure.name(), cells.join(" | "));
        }
        text
    }

    /// The mean over the moments, their median, and the worst of them; `-` where the method computes no such thing.
    fn cell(&self, voxel_size: f64, method: &str, measure: Measure) -> String {
        let here = |moment: &Moment| moment.voxel_size == voxel_size && moment.method == method;
        let of = self.moments.iter().filter(|(_, moment)| here(moment));
        let figures: Vec<_> =
            of.filter_map(|(seed, moment)| Some((moment.figure(measure)?, *seed, moment.seconds))).collect();
        let told: Vec<_> =
            figures.iter().map(|(figure, ..)| *figure).filter(|value| value.is_finite()).collect();
        let none = match figures.len() - told.len() {
            0 => String::new(),
            none => format!("none in {none} of {}", figures.len()),
        };
        let worst = measure.bar().worst(told.iter().copied());
        let (Some(mean), Some(median), Some(worst)) = (mean(&told), median(&told), worst) else {
            return if none.is_empty() { "-".to_owned() } else { none };
        };
        let at = figures.iter().find(|(figure, ..)| *figure == worst);
        let at = at.map_or(String::new(), |(_, seed, seconds)| format!(" at {seconds:.1} s of seed {seed}"));
        let [mean, median, worst] = [mean, median, worst].map(|value| measure.show(value));
        let none = if none.is_empty() { none } else { format!(", {none}") };
        format!("{mean} (median {median}, worst {worst}{at}{none})")
    }

    /// A line for each seed, moment, voxel size and method, with what the methods are compared by: lengths in m, angles in
    /// degrees, shares of 1; an empty cell where there is no such value, `inf` where what should be there is missing. Poses that
    /// are wrong have two columns more, m and rad.
    pub fn csv(&self) -> String {
        let keys = Measure::ALL.map(Measure::key).join(",");
        let mut text = format!("seed,seconds,voxel_size_m,method,{keys}\n");
        for (seed, moment) in &self.moments {
            let Moment { seconds, voxel_size, method, figures } = moment;
            let figures = figures.map(|figure| figure.map_or(String::new(), number)).join(",");
            _ = writeln!(text, "{seed},{seconds:.3},{voxel_size},{method},{figures}");
        }
        told::in_csv(self.pose_noise, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moment(seconds: f64, index: f64, angle: Option<f64>) -> Moment {
        let mut figures = [None; Measure::ALL.len()];
        figures[Measure::RandIndex as usize] = Some(index);
        figures[Measure::Angle as usize] = angle;
        Moment { seconds, voxel_size: 0.08, method: "consistent", figures }
    }

    fn way() -> Way {
        let mut way = Way::default();
        way.add_run(3, [moment(1.0, 0.5, Some(f64::INFINITY)), moment(2.0, 0.9, Some(0.25))]);
        way.add_run(4, [moment(1.0, 0.7, None), moment(2.0, 0.9, Some(0.75))]);
        way
    }

    #[test]
    fn measures_stand_in_their_order() {
        let places = Measure::ALL.map(|measure| measure as usize);
        assert!(places.iter().copied().eq(0..places.len()), "{places:?}");
    }

    #[test]
    fn the_page_says_what_the_mean_is_and_when_it_was_worst() {
        let text = way().markdown();
        assert!(
            text.starts_with("## On the way, voxels of 8 cm\n\n| measure | consistent |\n|---|---|\n"),
            "{text}"
        );
        let line = |start: &str| text.lines().find(|line| line.starts_with(start)).unwrap();
        assert_eq!(
            line("| adjusted Rand index"),
            "| adjusted Rand index | 0.750 (median 0.800, worst 0.500 at 1.0 s of seed 3) |"
        );
        let angle = "0.50 deg (median 0.50 deg, worst 0.75 deg at 2.0 s of seed 4, none in 1 of 3)";
        assert_eq!(line("| angle of planes"), format!("| angle of planes from 2 m2 on | {angle} |"));
        assert_eq!(line("| NEES of planes"), "| NEES of planes | - |");
        assert_eq!(Way::default().markdown(), "");
        let mut never = Way::default();
        never.add_run(1, [moment(1.0, 0.5, Some(f64::INFINITY))]);
        let text = never.markdown();
        assert!(text.contains("| angle of planes from 2 m2 on | none in 1 of 1 |"), "{text}");
    }

    #[test]
    fn the_csv_has_a_line_for_each_moment() {
        let csv = way().csv();
        let lines: Vec<Vec<_>> = csv.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!((lines.len(), lines[0].len()), (5, 4 + Measure::ALL.len()));
        assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{csv}");
        let at = |name: &str| lines[0].iter().position(|key| *key == name).unwrap();
        assert_eq!(lines[1][..4], ["3", "1.000", "0.08", "consistent"]);
        assert_eq!((lines[1][at("rand_index")], lines[1][at("plane_angle_deg")]), ("0.500000", "inf"));
        assert_eq!((lines[3][at("plane_angle_deg")], lines[3][at("plane_nees")]), ("", ""));
    }

    #[test]
    fn wrong_poses_are_named_in_headings_and_in_columns() {
        let noisy = Way { pose_noise: Some(PoseNoise { metres: 0.02, radians: 0.005 }), ..way() };
        let text = noisy.markdown();
        assert!(
            text.starts_with("## On the way, voxels of 8 cm, poses wrong by 0.02 m and 0.005 rad\n\n"),
            "{text}"
        );
        let columns = ["pose_noise_m,pose_noise_rad"].into_iter().chain(["0.02,0.005"; 4]);
        let expected: Vec<_> =
            way().csv().lines().zip(columns).map(|(line, columns)| format!("{line},{columns}")).collect();
        assert_eq!(noisy.csv().lines().collect::<Vec<_>>(), expected);
    }
}
