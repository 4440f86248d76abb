//! `cfodi simulate`: a drive through a built-in scene as a bag, with the truth about what was to be seen.

use std::io::Write as _;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

use anyhow::Context as _;
use cfodi::args::Setup;
use cfodi::bag::SensorBag;
use cfodi::count::count_of;
use cfodi::engine::Stamp;
use cfodi::export::WholeFile;
use cfodi::say::say;
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::{Drive, PoseNoise, Scene};
use cfodi::stop;
use clap::builder::PossibleValuesParser;

use super::input::check_outputs;
use super::pose_noise::pose_noise;
use super::progress::Bar;
use super::truth::truth;
use super::{Ending, Wrong, say_left_behind};

/// The topic of the clouds.
const POINTS: &str = "/camera/depth/points";

/// When every simulated drive begins, so that the same arguments give the same bytes (ns since the epoch).
const START: Stamp = Stamp::from_nanos(1_700_000_000_000_000_000);

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The recording: transforms, and on /camera/depth/points clouds whose points carry the label of their true surface
    #[arg(long, value_name = "BAG.mcap")]
    out: PathBuf,
    /// Where the robot drives
    #[arg(long, default_value = "lab", value_parser = PossibleValuesParser::new(Scene::NAMES))]
    scene: String,
    /// How long it drives [s]
    #[arg(long, default_value = "30", value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    seconds: f64,
    /// Decides the noise of sensor and pose
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// The truth: every surface with label, name, class and place
    #[arg(long, value_name = "T.json")]
    truth: Option<PathBuf>,
    /// By how much the poses told are wrong: standard deviations of each coordinate (m) and about each axis (rad)
    #[arg(long, value_name = "M,RAD", allow_hyphen_values = true, value_parser = pose_noise)]
    pose_noise: Option<PoseNoise>,
}

/// Longest drive (s).
const LONGEST: f64 = 3600.0;

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    let fits = seconds > 0.0 && seconds <= LONGEST;
    if fits { Ok(seconds) } else { Err(format!("{text} is not above 0 and at most {LONGEST}")) }
}

pub(crate) fn simulate(setup: &Setup, options: &Options) -> anyhow::Result<Ending> {
    if setup.is_adapted() {
        let text = "simulate takes no parameters and no other names: its options decide what is in the bag";
        return Err(Wrong(text.to_owned()).into());
    }
    let outputs: Vec<_> =
        [Some(&options.out), options.truth.as_ref()].into_iter().flatten().cloned().collect();
    check_outputs(&outputs, &[])?;
    say_left_behind(&outputs);
    let scene = Scene::named(&options.scene).context("the scene is not built in")?;
    let drive = Drive::new(scene, options.seed, START);
    let drive = match options.pose_noise {
        Some(noise) => drive.with_pose_noise(noise),
        None => drive,
    };
    let scans = ((options.seconds * f64::from(SCANS_PER_SECOND)).round() as u32).max(1);
    // Before the drive: who has named a file that cannot be written is not to wait for it.
    let truth_file = options.truth.as_deref().map(WholeFile::create).transpose()?;
    let written = record(&drive, scans, options)?;
    if let Some(file) = truth_file {
        let seconds = f64::from(written) / f64::from(SCANS_PER_SECOND);
        let truth = truth(&options.scene, options.seed, seconds, &drive);
        file.complete(|out| writeln!(out, "{truth:#}"))?;
    }
    let (scene, out) = (&options.scene, options.out.display());
    say(format_args!("{} of scene {scene} in {out}", count_of(written, "scan")));
    if written < scans {
        let scans = count_of(scans, "scan");
        say(format_args!("cfodi: stopped by a signal before the end of the drive, which has {scans}"));
        return Ok(Ending::InPart);
    }
    Ok(Ending::Whole)
}

/// The number of scans written: all, or those before a signal. The bag is whole either way.
fn record(drive: &Drive, scans: u32, options: &Options) -> anyhow::Result<u32> {
    let failed = || format!("cannot write {}", options.out.display());
    let stop = stop::flag();
    let mut bag = SensorBag::new(WholeFile::create(&options.out)?, POINTS).with_context(failed)?;
    bag.transforms(&drive.static_transforms(), true).with_context(failed)?;
    let bar = Bar::of_scans(u64::from(scans));
    let mut written = 0;
    while written < scans && !stop.load(Ordering::Relaxed) {
        let step = drive.step(written);
        bag.transforms(&step.tf, false).with_context(failed)?;
        bag.points(&step.cloud).with_context(failed)?;
        bar.advance();
        written += 1;
    }
    bar.finish();
    bag.finish().with_context(failed)?.commit()?;
    Ok(written)
}
