//! `cfodi experiment`: the paper's figures on a recording, CFODI and mode `consistent` beside STATIC, or the scores in a simulated scene.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::bail;
use cfodi::args::Setup;
use cfodi::bag::Message;
use cfodi::config::Value;
use cfodi::engine::{Mode, Scan};
use cfodi::experiment::{Experiment, Figure, Results, Summary};
use cfodi::export::WriteError;
use cfodi::line::one_line;
use cfodi::link::folder;
use cfodi::replay::{Ended, Finished, Go, Origin, Outputs, Replay, Settings, Tally, Visitor, feed};
use cfodi::report::{self, Story};
use cfodi::say::tell;

use super::input::{Input, open};
use super::progress::Bar;
use super::replay::{
    BEGINS_AGAIN, PAGE, begin_page, say_files, say_skipped, settings, with_remarks, write_page,
};
use super::{Ending, Wrong, check_home, first_of, laboratory, say_left_behind_in};

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// An MCAP file, one compressed as a whole (.mcap.zstd), or a folder that rosbags-convert or ros2 bag record made
    #[arg(required_unless_present = "scene")]
    input: Option<PathBuf>,
    /// The sensor's topic; again for a second sensor. Without it, `points` or `depth/image` (or its compressedDepth), else the only cloud or depth image
    #[arg(long)]
    topic: Vec<String>,
    /// Folder for the figures, the tables, and a report that shows them with the map
    #[arg(long)]
    out: PathBuf,
    /// Leaves out the effects of parameters, which take a map for each value
    #[arg(long)]
    no_effects: bool,
    #[command(flatten)]
    simulation: laboratory::Simulation,
}

pub(crate) fn experiment(setup: &Setup, options: &Options) -> anyhow::Result<Ending> {
    check_home(std::slice::from_ref(&options.out))?;
    match &options.input {
        Some(input) => on_recording(setup, options, input),
        None => laboratory::laboratory(setup, &options.simulation, &options.out),
    }
}

fn on_recording(setup: &Setup, options: &Options, path: &Path) -> anyhow::Result<Ending> {
    check_folder(&options.out, path)?;
    let input = open(setup, path, &options.topic)?;
    say_files(&input.bag);
    say_left_behind_in(&options.out);
    let page = begin_page(&options.out)?;
    let bar = Bar::new(input.bag.size());
    let mut say = |line: &str| bar.say(line);
    let (results, finished) = run(setup, &input, options, &bar, &mut say)?;
    bar.finish();
    if finished.summary.tally.scans == 0 {
        say_skipped(&finished.summary);
        bail!("no scan was taken in: nothing is written into {}", options.out.display());
    }
    // What can be written is, whatever becomes of the others.
    let failed = results.write(&options.out);
    let figure =
        |figure: Figure| report::Figure { title: figure.title, svg: figure.svg, caption: figure.caption };
    let figures = results.figures().into_iter().map(figure).collect();
    let told = write_page(page, path, &finished, figures);
    tell(table(&results.summary()))?;
    // What was not read is said whether or not the files can be written.
    let ending = say_skipped(&finished.summary);
    first_of(failed.into_iter().chain(told.err()))?;
    tell(format_args!(
        "figures and tables: {}, to look at: {}",
        options.out.display(),
        options.out.join(PAGE).display()
    ))?;
    Ok(ending)
}

/// Refuses the folder of the bag, and that of its file: nobody has named the files that would be replaced there.
fn check_folder(out: &Path, bag: &Path) -> Result<(), Wrong> {
    let of_bag = |out: PathBuf| {
        let bag_itself = bag.canonicalize().ok();
        let of_file = bag_itself.as_deref().filter(|bag| !bag.is_dir()).map(folder).map(Path::to_owned);
        // A link may lie elsewhere than its file.
        let of_name = of_file.as_ref().and_then(|_| folder(bag).canonicalize().ok());
        [bag_itself, of_file, of_name].into_iter().flatten().any(|folder| folder == out)
    };
    if !out.canonicalize().is_ok_and(of_bag) {
        return Ok(());
    }
    let name = one_line(&out.display().to_string()).into_owned();
    Err(Wrong(format!("{name} is the folder of the bag: an experiment takes a folder of its own (--out)")))
}

/// Feeds the bag to the experiment, again where the frame that was guessed turns out to be wrong.
fn run(
    setup: &Setup,
    input: &Input,
    options: &Options,
    bar: &Bar,
    say: &mut dyn FnMut(&str),
) -> anyhow::Result<(Results, Finished)> {
    let (mut fixed_frame, begun) = (input.fixed_frame.clone(), Instant::now());
    let letter = letter(setup);
    loop {
        let begin = Instant::now();
        let experiment = Experiment::new(letter.engine, move || begin.elapsed());
        let experiment = if options.no_effects { experiment.without_effects() } else { experiment };
        let replay =
            Replay::new(letter.clone(), Outputs { bag: None, story: Some(Story::new()), say }, begun);
        let mut scans = Scans { experiment, replay };
        match feed(input.feed(fixed_frame, false, &mut |progress| bar.set(progress)), &mut scans)? {
            Ended::Fed(fed) => {
                return Ok((scans.experiment.finish(), scans.replay.finish(with_remarks(setup, fed))));
            }
            Ended::WrongFrame(better) => fixed_frame = better,
        }
        say(BEGINS_AGAIN);
    }
}

/// The settings with the method to the letter, which the paper's figures are about, whatever the mode; and so they are told. What
/// mode `consistent` alone asks of them stays as given.
fn letter(setup: &Setup) -> Settings {
    let mut settings = settings(setup);
    // Where the mode was given as `paper`, that is off for it alone.
    let clears = !setup.is_given("clearing") || settings.engine.clearing();
    for (name, value) in &mut settings.parameters {
        match name.as_str() {
            "mode" => *value = Value::from(Mode::Paper),
            "clearing" => *value = Value::Boolean(clears),
            _ => {}
        }
    }
    settings.engine = settings.engine.with_mode(Mode::Paper).with_clearing(clears);
    settings
}

/// Hands scans to the experiment and to the report's map, up to where the stamps jump back.
struct Scans<'a, C> {
    experiment: Experiment<C>,
    replay: Replay<'a>,
}

impl<C: FnMut() -> Duration> Visitor for Scans<'_, C> {
    type Error = WriteError;

    fn scan(
        &mut self,
        scan: &Scan,
        origin: Origin,
        fixed_frame: &str,
        tally: &Tally,
    ) -> Result<(), WriteError> {
        self.experiment.scan(scan);
        self.replay.scan(scan, origin, fixed_frame, tally)
    }

    fn jumped_back(&mut self, seconds: f64) -> Result<Go, WriteError> {
        let line = format!("The stamps jump back by {seconds:.3} s: what follows is left out.");
        self.replay.say(&line);
        self.replay.note(&line);
        Ok(Go::Home)
    }

    fn message(&mut self, _: &Message) -> Result<(), WriteError> {
        Ok(())
    }

    fn say(&mut self, line: &str) {
        self.replay.say(line);
    }
}

/// One line a method; `-` where there is nothing to take a number of.
fn table(summary: &Summary) -> String {
    let number = |value: Option<f64>, digits| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let count = |value: Option<u32>| value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let mut lines = vec![format!(
        "{:<10} {:>8} {:>7} {:>6} {:>12} {:>13} {:>10} {:>13} {:>12} {:>14}",
        "method",
        "clusters",
        "of 10+",
        "of 1",
        "in clusters",
        "normals [rad]",
        "ms, median",
        "ms/1000 dense",
        "last/2nd 1/4",
        "points at 30Hz"
    )];
    lines.extend(summary.methods.iter().map(|method| {
        format!(
            "{:<10} {:>8} {:>7} {:>6} {:>12} {:>13} {:>10} {:>13} {:>12} {:>14}",
            method.method,
            count(method.clusters_last),
            count(method.large_clusters_last),
            count(method.single_clusters_last),
            number(method.share_in_clusters_last, 3),
            number(method.normal_error_mean_rad, 3),
            number(method.ms_median, 1),
            number(method.ms_per_1000_dense_voxels, 2),
            number(method.last_quarter_over_second, 2),
            number(method.live.share_of_points, 3),
        )
    }));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn the_folder_of_a_bag_and_that_of_its_file_are_refused_and_one_beside_them_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["bag", "links", "figures"] {
            fs::create_dir(at(name)).unwrap();
        }
        fs::write(at("bag/lab.mcap"), "").unwrap();
        symlink(at("bag/lab.mcap"), at("links/latest.mcap")).unwrap();
        let refused = |out: &str, bag: &str| check_folder(&at(out), &at(bag)).is_err();
        assert!(refused("bag", "bag") && refused("bag", "bag/lab.mcap"));
        assert!(refused("bag", "links/latest.mcap") && refused("links", "links/latest.mcap"));
        assert!(refused("figures/../bag/", "bag/lab.mcap"));
        for (out, bag) in [("figures", "bag"), ("figures", "bag/lab.mcap"), ("bag/new", "bag"), ("", "bag")] {
            assert!(!refused(out, bag), "{out} {bag}");
        }
        assert!(check_folder(Path::new("."), Path::new("no_such.mcap")).is_ok());
    }
}
