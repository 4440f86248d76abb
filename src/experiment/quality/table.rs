//! The scores of several methods, voxel sizes and runs as a table.

use std::fmt::Write as _;

use super::super::method::Method;
use super::measure::{Bar, Measure, Scale};
use super::pooled::{Line, Pooled};
use super::score::Quality;
use super::told;
use crate::count::count_of;
use crate::sim::PoseNoise;

/// The method that is asked to hold the bars and to be better than the others.
const JUDGED: &str = Method::Consistent.name();

/// What stands in the cells, and of which things the measures speak.
const WORDS: &str = "\
A cell has the mean or the median of the values, by which the methods are compared; then how many values meet the bar by
themselves, the worst, and the median. `none` stands where a surface is in no cluster, or in one without such a description.
The last column is `yes` where `consistent` meets the bar and is better than both other methods, or as good as can be.

- **surface**: what hangs together of the true surface's dense voxels; in several pieces they are `wall #1`, `wall #2` and so on
- **seen**: 0.5 m2 of it or more were to be seen, of which only what lies by voxels that became dense counts, here and in areas; what
  was not is marked `(scrap)`, and nothing is asked of it
- **scored**: a voxel with 80 % or more of its points on one surface, and their mean close to it
";

/// Pooled runs by voxel size and method, both in the order they came in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    sizes: Vec<Size>,
    /// By how much the poses of the runs were told wrong.
    pose_noise: Option<PoseNoise>,
}

/// The methods at one voxel size.
#[derive(Clone, Debug, PartialEq)]
struct Size {
    voxel_size: f64,
    methods: Vec<(String, Pooled)>,
}

impl Table {
    /// An empty table of runs whose poses are told wrong by so much; `None` where they are exact.
    pub const fn new(pose_noise: Option<PoseNoise>) -> Self {
        Self { sizes: Vec::new(), pose_noise }
    }

    /// Adds what a method did in a run; `run` names the run in front of its failures.
    pub fn add(&mut self, voxel_size: f64, method: &str, run: &str, quality: &Quality) {
        let at = self.sizes.iter().position(|size| size.voxel_size == voxel_size).unwrap_or_else(|| {
            self.sizes.push(Size { voxel_size, methods: Vec::new() });
            self.sizes.len() - 1
        });
        let methods = &mut self.sizes[at].methods;
        let at = methods.iter().position(|(name, _)| name == method).unwrap_or_else(|| {
            methods.push((method.to_owned(), Pooled::default()));
            methods.len() - 1
        });
        methods[at].1.add(run, quality);
    }

    /// The pooled runs of a method; `None` where there are none.
    pub fn pooled(&self, voxel_size: f64, method: &str) -> Option<&Pooled> {
        self.sizes.iter().find(|size| size.voxel_size == voxel_size)?.of(method)
    }

    /// A section for each voxel size with a line for each measure, then what does not hold in words.
    pub fn markdown(&self) -> String {
        let noise = told::in_heading(self.pose_noise);
        self.sizes.iter().map(|size| size.markdown(&noise)).collect::<Vec<_>>().join("\n")
    }

    /// What the words and numbers of [`Self::markdown`] and of [`Self::failures`] mean.
    pub fn legend(&self) -> String {
        let measures =
            Measure::ALL.map(|measure| format!("- **{}**: {}\n", measure.name(), measure.meaning()));
        format!("{WORDS}{}\n{}", told::in_legend(self.pose_noise), measures.concat())
    }

    /// What does not hold in words, a list for each voxel size and method.
    pub fn failures(&self) -> String {
        let mut text = String::new();
        for size in &self.sizes {
            for (method, pooled) in &size.methods {
                let failures = count_of(pooled.failures.len(), "failure");
                _ = writeln!(text, "\n### {method}, {}: {failures}\n", centimetres(size.voxel_size));
                for failure in &pooled.failures {
                    _ = writeln!(text, "- {failure}");
                }
            }
        }
        text
    }

    /// A line for each voxel size and measure; lengths in m, angles in degrees, shares of 1; an empty cell where a method
    /// has no such value, `inf` where what should be there is missing. Poses that are wrong have two columns more, m and rad.
    pub fn csv(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in self.sizes.iter().flat_map(|size| &size.methods) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        let details = ["held", "of", "worst", "median", "mean", "bar_holds"];
        let details = names.iter().flat_map(|name| details.map(|detail| format!("{name}_{detail}")));
        let header =
            ["voxel_size_m", "measure"].into_iter().chain(names.iter().copied()).chain(["bar", "holds"]);
        let header = header.map(str::to_owned).chain(details).collect::<Vec<_>>();
        let mut text = header.join(",") + "\n";
        for size in &self.sizes {
            for measure in Measure::ALL {
                text += &(size.csv_cells(measure, &names).join(",") + "\n");
            }
        }
        told::in_csv(self.pose_noise, text)
    }
}

impl Size {
    fn of(&self, method: &str) -> Option<&Pooled> {
        self.methods.iter().find(|(name, _)| name == method).map(|(_, pooled)| pooled)
    }

    fn line(&self, method: &str, measure: Measure) -> Option<Line> {
        self.of(method)?.line(measure)
    }

    /// `noise` stands at the end of the heading.
    fn markdown(&self, noise: &str) -> String {
        let runs = self.methods.first().map_or(0, |(_, pooled)| pooled.runs);
        let names: Vec<_> = self.methods.iter().map(|(name, _)| name.as_str()).collect();
        let runs = count_of(runs, "run");
        let mut text = format!("## Voxels of {}, {runs}{noise}\n\n", centimetres(self.voxel_size));
        _ = writeln!(text, "| measure | bar | {} | holds |", names.join(" | "));
        _ = writeln!(text, "|---|---|{}---|", "---|".repeat(names.len()));
        let counts =
            self.methods.iter().map(|(_, p)| format!("{} in {}", p.seen, count_of(p.clusters, "cluster")));
        _ = writeln!(
            text,
            "| seen surfaces, clusters with scored voxels | | {} | |",
            counts.collect::<Vec<_>>().join(" | ")
        );
        for measure in Measure::ALL {
            let cells = names.iter().map(|name| cell(measure, self.line(name, measure)));
            let cells = cells.collect::<Vec<_>>().join(" | ");
            let (name, bar, holds) = (measure.name(), bar(measure), self.holds(measure));
            _ = writeln!(text, "| {name} | {bar} | {cells} | {holds} |");
        }
        text
    }

    fn csv_cells(&self, measure: Measure, names: &[&str]) -> Vec<String> {
        let lines: Vec<_> = names.iter().map(|name| self.line(name, measure)).collect();
        let mut cells = vec![self.voxel_size.to_string(), measure.key().to_owned()];
        cells.extend(lines.iter().map(|line| line.map_or(String::new(), |l| number(l.figure(measure)))));
        cells.extend([bar(measure), self.holds(measure)]);
        for line in &lines {
            cells.extend(line.map_or_else(<[String; 6]>::default, |line| {
                let Line { held, of, worst, median, mean, holds } = line;
                let [worst, median, mean] = [worst, median, mean].map(number);
                [held.to_string(), of.to_string(), worst, median, mean, u8::from(holds).to_string()]
            }));
        }
        cells
    }

    /// Whether the judged method holds the bar and is better than every other; `-` where it is not there.
    fn holds(&self, measure: Measure) -> String {
        if self.of(JUDGED).is_none() {
            return "-".to_owned();
        }
        let Some(judged) = self.line(JUDGED, measure) else { return "no: no value".to_owned() };
        let others = self.methods.iter().filter(|(name, _)| name != JUDGED);
        let as_good = others
            .filter(|(_, pooled)| {
                pooled.line(measure).is_some_and(|other| !is_better(measure, &judged, &other))
            })
            .map(|(name, _)| name.as_str());
        let as_good: Vec<_> = as_good.collect();
        if let Bar::MeanWithin { cases, .. } = measure.bar()
            && judged.of < cases
        {
            return format!("no: {} of {cases} cases", judged.of);
        }
        match (judged.holds, as_good.is_empty()) {
            (true, true) => "yes".to_owned(),
            (false, true) => "no: bar missed".to_owned(),
            (true, false) => format!("no: bar met but not better than {}", as_good.join(" and ")),
            (false, false) => format!("no: bar missed and not better than {}", as_good.join(" and ")),
        }
    }
}

/// Whether a line is better than another, or nothing can be better than it.
fn is_better(measure: Measure, line: &Line, other: &Line) -> bool {
    let (mine, others) = (line.figure(measure), other.figure(measure));
    match measure.bar() {
        Bar::EachAtLeast(_) => mine > others || mine >= 1.0,
        Bar::EachAtMost(_) | Bar::MedianAtMost(_) => mine < others || mine <= 0.0,
        Bar::MeanWithin { .. } => line.holds && !other.holds,
    }
}

/// The number that methods are compared by, and what it is made of.
fn cell(measure: Measure, line: Option<Line>) -> String {
    let Some(line) = line else { return "-".to_owned() };
    let [figure, worst] = [line.figure(measure), line.worst].map(|value| measure.show(value));
    let count = match measure.bar() {
        Bar::EachAtLeast(_) | Bar::EachAtMost(_) => format!("{} of {} hold", line.held, line.of),
        // Of a single value these say nothing.
        Bar::MeanWithin { .. } | Bar::MedianAtMost(_) => format!("of {}", line.of),
    };
    if measure.is_by_mean() {
        format!("mean {figure} ({count}, worst {worst}, median {})", measure.show(line.median))
    } else {
        format!("median {figure} ({count}, worst {worst})")
    }
}

fn bar(measure: Measure) -> String {
    let Scale { factor, unit, .. } = measure.scale();
    // Rounded, since 0.95 times 100 is not quite 95.
    let shown = |value: f64| (value * factor * 1e6).round() / 1e6;
    match measure.bar() {
        Bar::EachAtLeast(least) => format!("each at least {}{unit}", shown(least)),
        Bar::EachAtMost(most) => format!("each at most {}{unit}", shown(most)),
        Bar::MeanWithin { least, most, cases } => {
            format!("mean {} to {}{unit} over {cases} or more", shown(least), shown(most))
        }
        Bar::MedianAtMost(most) => format!("median at most {}{unit}", shown(most)),
    }
}

pub(super) fn number(value: f64) -> String {
    if value.is_infinite() { "inf".to_owned() } else { format!("{value:.6}") }
}

pub(super) fn centimetres(metres: f64) -> String {
    format!("{} cm", (metres * 1e4).round() / 100.0)
}

#[cfg(test)]
mod tests {
    use super::super::score::{ClusterScore, Computes, SurfaceScore};
    use super::*;

    /// A surface of which a cluster holds `held` of 100 scored voxels, and nothing else.
    fn run(held: u32) -> Quality {
        let surface = SurfaceScore {
            name: "wall".to_owned(),
            seen_area: 3.0,
            has_plane: true,
            is_one_plane: true,
            scored: 100,
            clustered: held,
            holders: vec![(1, held)],
            class_right: 0.0,
            stated: Vec::new(),
            described: None,
        };
        let surfaces = vec![("wall".to_owned(), held)];
        let cluster = ClusterScore { number: 1, voxels: held, scored: held, of_seen: true, surfaces };
        Quality {
            surfaces: vec![surface],
            clusters: vec![cluster],
            rand_index: Some(0.5),
            as_from_scratch: None,
            computes: Computes::default(),
            failures: vec!["wall: worn".to_owned()],
        }
    }

    fn table(judged: u32) -> Table {
        let mut table = Table::default();
        for (method, held) in [("CFODI", 80), ("STATIC", 95), (JUDGED, judged)] {
            table.add(0.08, method, "seed 1", &run(held));
            table.add(0.08, method, "seed 2", &run(held));
        }
        table
    }

    fn holds(table: &Table, measure: Measure) -> String {
        table.sizes[0].holds(measure)
    }

    #[test]
    fn the_judged_method_holds_a_bar_when_it_is_also_better_than_the_others() {
        assert_eq!(holds(&table(96), Measure::Coverage), "yes");
        assert_eq!(holds(&table(94), Measure::Coverage), "no: bar met but not better than STATIC");
        assert_eq!(holds(&table(85), Measure::Coverage), "no: bar missed and not better than STATIC");
        assert_eq!(
            holds(&table(60), Measure::Coverage),
            "no: bar missed and not better than CFODI and STATIC"
        );
        assert_eq!(holds(&table(96), Measure::Impurity), "yes", "nothing is purer than pure");
        assert_eq!(holds(&table(96), Measure::Class), "no: no value");
        let mut without = table(96);
        without.sizes[0].methods.pop();
        assert_eq!(holds(&without, Measure::Coverage), "-");
    }

    #[test]
    fn the_markdown_table_has_a_line_for_each_measure() {
        let text = table(96).markdown();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "## Voxels of 8 cm, 2 runs");
        assert_eq!(lines[2], "| measure | bar | CFODI | STATIC | consistent | holds |");
        let hold =
            |share: &str, held| format!("mean {share} ({held} of 2 hold, worst {share}, median {share})");
        let cells = [hold("80.0 %", 0), hold("95.0 %", 2), hold("96.0 %", 2)].join(" | ");
        assert_eq!(lines[5], format!("| scored voxels in clusters | each at least 90 % | {cells} | yes |"));
        assert_eq!(lines.len(), 5 + Measure::ALL.len());
        assert!(lines.iter().skip(2).all(|line| line.matches('|').count() == 7), "{text}");
        assert!(lines[10].contains("| median none (0 of 2 hold, worst none) |"), "{}", lines[10]);
    }

    #[test]
    fn of_a_single_run_and_a_single_failure_there_is_one() {
        let mut table = Table::default();
        table.add(0.05, "CFODI", "seed 1", &run(90));
        assert!(table.markdown().starts_with("## Voxels of 5 cm, 1 run\n"));
        assert!(table.failures().contains("### CFODI, 5 cm: 1 failure\n"), "{}", table.failures());
    }

    #[test]
    fn the_legend_tells_of_each_measure_and_of_each_word_of_the_failures() {
        let legend = Table::default().legend();
        let told = |name: &str| legend.contains(&format!("**{name}**: "));
        assert!(Measure::ALL.iter().all(|measure| told(measure.name())), "{legend}");
        for word in ["scrap", "scored", "seen", "#2", "`none`", "normalised estimation error squared"] {
            assert!(legend.contains(word), "{word}");
        }
    }

    #[test]
    fn the_csv_has_as_many_cells_on_every_line() {
        let mut table = table(96);
        table.add(0.05, "CFODI", "seed 1", &run(90));
        let csv = table.csv();
        let lines: Vec<Vec<_>> = csv.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines.len(), 1 + 2 * Measure::ALL.len());
        assert_eq!(
            lines[0][..7],
            ["voxel_size_m", "measure", "CFODI", "STATIC", "consistent", "bar", "holds"]
        );
        assert!(lines.iter().all(|line| line.len() == lines[0].len()), "{csv}");
        let start =
            ["0.08", "coverage", "0.800000", "0.950000", "0.960000", "each at least 90 %", "yes", "0", "2"];
        assert_eq!(lines[1][..9], start);
        assert_eq!(
            lines[1 + Measure::ALL.len()][..7],
            ["0.05", "coverage", "0.900000", "", "", "each at least 90 %", "-"]
        );
    }

    #[test]
    fn wrong_poses_are_named_in_headings_columns_and_legend() {
        let noisy = Table { pose_noise: Some(PoseNoise { metres: 0.05, radians: 0.01 }), ..table(96) };
        assert!(
            noisy.markdown().starts_with("## Voxels of 8 cm, 2 runs, poses wrong by 0.05 m and 0.01 rad\n"),
            "{}",
            noisy.markdown()
        );
        assert!(noisy.legend().contains("**poses wrong by**") && !table(96).legend().contains("pose"));
        let columns = ["pose_noise_m,pose_noise_rad"].into_iter().chain(["0.05,0.01"; Measure::ALL.len()]);
        let expected: Vec<_> =
            table(96).csv().lines().zip(columns).map(|(line, columns)| format!("{line},{columns}")).collect();
        assert_eq!(noisy.csv().lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn failures_are_listed_by_method_and_run() {
        let text = table(96).failures();
        assert!(
            text.contains("### STATIC, 8 cm: 2 failures\n\n- seed 1: wall: worn\n- seed 2: wall: worn\n"),
            "{text}"
        );
    }
}
