//! `cfodi experiment --scene`: every method driven through a simulated scene and scored against its truth.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::num::NonZeroU32;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

use anyhow::{Context as _, anyhow, bail};
use cfodi::args::Setup;
use cfodi::count::count_of;
use cfodi::engine::Params;
use cfodi::experiment::quality::{Laboratory, Run, Table, Way};
use cfodi::export::{WholeFile, write_whole};
use cfodi::line::one_line;
use cfodi::say::{say, tell};
use cfodi::sim::{PoseNoise, Scene};
use cfodi::stop;

use super::pose_noise::pose_noise;
use super::progress::Bar;
use super::{Ending, Wrong, first_of, say_left_behind_in};

/// Most runs that are made at once: each holds all maps of its methods.
const MOST_AT_ONCE: usize = 2;

/// Where the help lists what `--scene` alone takes.
const WITH_SCENE: &str = "With --scene";

#[derive(Debug, clap::Args)]
pub(crate) struct Simulation {
    /// A simulated scene instead of a recording, scored against its truth. Every mode is run: parameters of mode, voxel size,
    /// frames and sensing are refused
    #[arg(long, value_parser = clap::builder::PossibleValuesParser::new(Scene::NAMES))]
    #[arg(conflicts_with_all = ["input", "topic", "no_effects"])]
    scene: Option<String>,
    /// Runs, each with noise of its own
    #[arg(long, help_heading = WITH_SCENE, default_value_t = 8, conflicts_with = "input")]
    #[arg(allow_negative_numbers = true, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    /// How long the robot drives [s]
    #[arg(long, help_heading = WITH_SCENE, default_value_t = 217.0, conflicts_with = "input")]
    #[arg(allow_negative_numbers = true, value_parser = seconds)]
    seconds: f64,
    /// Takes every n-th of the 30 scans a second
    #[arg(long, help_heading = WITH_SCENE, default_value_t = NonZeroU32::MIN, conflicts_with = "input", allow_negative_numbers = true)]
    scan_step: NonZeroU32,
    /// Scores on the way as well, each time that so many seconds have gone by [s]
    #[arg(long, help_heading = WITH_SCENE, conflicts_with = "input", allow_negative_numbers = true, value_parser = seconds)]
    score_every: Option<f64>,
    /// Edge of a voxel [m], again for another; in place of the parameter of that name
    #[arg(long, help_heading = WITH_SCENE, default_values_t = [0.05, 0.08], conflicts_with = "input")]
    #[arg(allow_negative_numbers = true, value_parser = metres)]
    voxel_size: Vec<f64>,
    /// By how much the poses told are wrong: standard deviations of each coordinate (m) and about each axis (rad)
    #[arg(long, help_heading = WITH_SCENE, value_name = "M,RAD", conflicts_with = "input")]
    #[arg(allow_hyphen_values = true, value_parser = pose_noise)]
    pose_noise: Option<PoseNoise>,
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|error| format!("{error}"))?;
    let possible = (0.1..=3600.0).contains(&seconds);
    possible.then_some(seconds).ok_or_else(|| "it must be from 0.1 to 3600 s".to_owned())
}

fn metres(text: &str) -> Result<f64, String> {
    let metres = text.parse().map_err(|error| format!("{error}"))?;
    Params::default().with_voxel_size(metres).map(|_| metres).map_err(|error| error.to_string())
}

/// The parameters that shape what the methods do; of the others each method, the simulator or an option decides.
const USED: [&str; 10] = [
    "min_points",
    "depth",
    "max_normal_angle",
    "min_vicinity",
    "expansion_interval",
    "noise_model",
    "pose_sigma",
    "clearing",
    "max_voxels",
    "keep_radius",
];

/// Refuses arguments that are wrong.
fn check(setup: &Setup, sizes: &[f64]) -> Result<(), Wrong> {
    if let Some(size) = given_twice(sizes) {
        return Err(Wrong(format!("--voxel-size {size} is given twice: its runs would be counted twice")));
    }
    let sigma = setup.config().engine.pose_sigma();
    if let Some(size) = sizes.iter().find(|size| **size < sigma) {
        return Err(Wrong(format!(
            "--voxel-size {size} is less than pose_sigma, which is {sigma} m: give only larger ones"
        )));
    }
    let unused = setup.given_beside(&USED);
    if unused.is_empty() {
        return Ok(());
    }
    Err(Wrong(format!(
        "--scene does not use {}: all methods are run, at each --voxel-size, on what the simulated Kinect sees",
        one_line(&unused.join(", "))
    )))
}

/// A value that is there more than once.
fn given_twice(sizes: &[f64]) -> Option<f64> {
    let twice = sizes.iter().enumerate().find(|&(place, size)| sizes[..place].contains(size));
    twice.map(|(_, size)| *size)
}

/// What came out of the runs that were made.
struct Outcome {
    table: Table,
    way: Way,
}

impl Outcome {
    fn of(runs: BTreeMap<u64, Run>, noise: Option<PoseNoise>) -> Self {
        let mut outcome = Self { table: Table::new(noise), way: Way::new(noise) };
        for (seed, run) in runs {
            outcome.table.add_run(seed, &run.end);
            outcome.way.add_run(seed, run.moments);
        }
        outcome
    }

    /// What is printed.
    fn tables(&self) -> String {
        let parts = [self.table.markdown(), self.way.markdown()];
        parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("\n")
    }

    fn page(&self, title: &str) -> String {
        format!(
            "# {title}\n\n{}\n# What the lines mean\n\n{}{}\n# What does not hold\n{}",
            self.tables(),
            self.table.legend(),
            if self.way.is_empty() { "" } else { Way::LEGEND },
            self.table.failures()
        )
    }
}

/// Makes the runs, writes `quality.md`, `quality.csv` and, if it scores on the way, `on_the_way.csv`, and prints the tables. The
/// `on_the_way.csv` of an earlier run goes where there is none to replace it, for it would be taken for this one's.
pub(crate) fn laboratory(setup: &Setup, options: &Simulation, out: &Path) -> anyhow::Result<Ending> {
    let name = options.scene.as_deref().unwrap_or_default();
    let scene = Scene::named(name).with_context(|| format!("there is no scene {name}"))?;
    let Simulation { seeds, seconds, scan_step, score_every, voxel_size, pose_noise, .. } = options;
    check(setup, voxel_size)?;
    let mut laboratory = Laboratory::new(scene, *seconds, *scan_step, &setup.config().engine, voxel_size)?;
    if let Some(noise) = pose_noise {
        laboratory = laboratory.with_pose_noise(*noise);
    }
    if let Some(every) = score_every {
        let end = laboratory.ends_at();
        laboratory = laboratory.with_score_every(*every).ok_or_else(|| {
            Wrong(format!("--score-every {every}: the last scan is taken at {end:.3} s, so nothing would be scored on the way"))
        })?;
    }
    say_left_behind_in(out);
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let [page, csv, way] = ["quality.md", "quality.csv", "on_the_way.csv"].map(|name| out.join(name));
    let (way, stale) = if score_every.is_some() { (Some(way), None) } else { (None, Some(way)) };
    // Who has named a folder that cannot be written to is not to wait for the runs. The files are given up again: a signal
    // during the runs would leave them half-made.
    for file in [&page, &csv].into_iter().chain(&way) {
        drop(WholeFile::create(file)?);
    }
    let made = runs(&laboratory, *seeds)?;
    if made.is_empty() {
        bail!("stopped by a signal before the first run was made: nothing is written");
    }
    let is_whole = made.len() as u64 == *seeds;
    let all = count_of(*seeds, "run");
    let count = if is_whole { all } else { format!("{} of {all}", made.len()) };
    let outcome = Outcome::of(made, laboratory.pose_noise());
    let sigma = setup.config().engine.pose_sigma();
    let told = if sigma > 0.0 { format!(", pose_sigma {sigma} m") } else { String::new() };
    let title =
        format!("Scene {name}: {count} of {seconds} s, {} each{told}", count_of(laboratory.scans(), "scan"));
    let files = [(&page, outcome.page(&title)), (&csv, outcome.table.csv())];
    let files = files.into_iter().chain(way.as_ref().map(|way| (way, outcome.way.csv())));
    let written = files.map(|(path, text)| write_whole(path, |file| file.write_all(text.as_bytes())));
    first_of(written.collect::<Vec<_>>().into_iter().filter_map(Result::err))?;
    stale.map_or(Ok(()), |stale| remove(&stale))?;
    let (tables, page) = (outcome.tables(), page.display());
    tell(format_args!("{tables}\nwhat the lines mean, and what does not hold: {page}"))?;
    if is_whole {
        return Ok(Ending::Whole);
    }
    say(format_args!("cfodi: stopped by a signal: the tables are of {count}"));
    Ok(Ending::InPart)
}

/// Takes away a file, if there is one.
fn remove(path: &Path) -> anyhow::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// The runs by seed, from 1, or those that were made before a signal; as many at once as there are processors, and two at most.
fn runs(laboratory: &Laboratory, seeds: u64) -> anyhow::Result<BTreeMap<u64, Run>> {
    let bar = Bar::of_scans(seeds * u64::from(laboratory.scans()));
    let all = count_of(seeds, "run");
    bar.tell(&format!("0 of {all}"));
    let (next, done) = (AtomicU64::new(1), Mutex::new(BTreeMap::new()));
    let stop = stop::flag();
    let taken = || {
        bar.advance();
        // A run may take minutes, and half of one cannot be scored.
        if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > seeds {
                return Some(());
            }
            let Some(run) = laboratory.run(seed, taken) else { return Some(()) };
            let mut done = done.lock().ok()?;
            done.insert(seed, run);
            bar.tell(&format!("{} of {all}", done.len()));
        }
    };
    let at_once = thread::available_parallelism().map_or(1, usize::from).min(MOST_AT_ONCE);
    thread::scope(|scope| {
        let threads: Vec<_> = (0..at_once)
            .map(|number| {
                thread::Builder::new().name(format!("cfodi-run-{number}")).spawn_scoped(scope, work)
            })
            .collect();
        for thread in threads {
            thread?.join().ok().flatten().ok_or_else(|| anyhow!("a run has failed"))?;
        }
        Ok::<_, anyhow::Error>(())
    })?;
    bar.finish();
    done.into_inner().map_err(|_| anyhow!("a run has failed"))
}
