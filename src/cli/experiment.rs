//! `cfodi experiment`: the paper's figures on a recording, CFODI beside STATIC.
#![expect(clippy::print_stdout, reason = "the table is what the experiment is for")]

use std::convert::Infallible;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use cfodi::bag::Message;
use cfodi::engine::Scan;
use cfodi::experiment::{Experiment, Summary};
use cfodi::node::Setup;
use cfodi::replay::{Feed, Visitor, feed};

use super::progress::Bar;
use super::replay::{Input, open};
use super::stop;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// An MCAP file, one compressed as a whole (.mcap.zstd), or a folder that rosbags-convert made
    input: PathBuf,
    /// The sensor's topic; again for a second sensor. Without it, the only point cloud or depth image
    #[arg(long)]
    topic: Vec<String>,
    /// Folder for the figures and tables
    #[arg(long)]
    out: PathBuf,
}

pub(crate) fn experiment(setup: &Setup, options: &Options) -> anyhow::Result<ExitCode> {
    let input = match open(setup, &options.input, &options.topic)? {
        Ok(input) => input,
        Err(status) => return Ok(status),
    };
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make {}", options.out.display()))?;
    let Input { bag, decoder, fixed_frame } = input;
    let bar = Bar::new(bag.size());
    let begin = Instant::now();
    let mut scans = Scans {
        experiment: Experiment::new(setup.config.engine, move || begin.elapsed()),
        bar: &bar,
        after_jump: false,
    };
    let mut progress = |progress| bar.set(progress);
    let stop = stop::on_signal();
    let fed = feed(
        Feed { bag: &bag, decoder, fixed_frame, with_messages: false, stop, progress: &mut progress },
        &mut scans,
    )?;
    bar.finish();
    let results = scans.experiment.finish();
    results.write(&options.out)?;
    println!("{}", table(&results.summary()));
    println!("figures and tables: {}", options.out.display());
    if let Some(unread) = &fed.unread {
        eprintln!("cfodi: not all of the bag was read: {unread}");
    }
    Ok(if fed.unread.is_some() || fed.stopped { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Hands scans to the experiment, up to where the stamps jump back.
struct Scans<'a, C> {
    experiment: Experiment<C>,
    bar: &'a Bar,
    after_jump: bool,
}

impl<C: FnMut() -> Duration> Visitor for Scans<'_, C> {
    type Error = Infallible;

    fn scan(&mut self, scan: &Scan, _: &str, _: Duration) -> Result<(), Infallible> {
        if !self.after_jump {
            self.experiment.scan(scan);
        }
        Ok(())
    }

    fn jumped_back(&mut self, seconds: f64) {
        self.after_jump = true;
        self.say(&format!("the stamps jump back by {seconds:.3} s: what follows is left out of the figures"));
    }

    fn message(&mut self, _: &Message) -> Result<(), Infallible> {
        Ok(())
    }

    fn say(&mut self, line: &str) {
        self.bar.say(line);
    }
}

/// One line a method; `-` where there is nothing to take a number of.
fn table(summary: &Summary) -> String {
    let number = |value: Option<f64>, digits| {
        value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let count = |value: Option<u32>| value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let mut lines = vec![format!(
        "{:<8} {:>8} {:>9} {:>14} {:>8} {:>14} {:>13} {:>14}",
        "method",
        "clusters",
        "of 10+",
        "normals [rad]",
        "ms",
        "ms/1000 dense",
        "last/2nd 1/4",
        "points at 30Hz"
    )];
    lines.extend(summary.methods.iter().map(|method| {
        format!(
            "{:<8} {:>8} {:>9} {:>14} {:>8} {:>14} {:>13} {:>14}",
            method.method,
            count(method.clusters_last),
            count(method.large_clusters_last),
            number(method.normal_error_mean_rad, 3),
            number(method.ms_median, 1),
            number(method.ms_per_1000_dense_voxels, 2),
            number(method.last_quarter_over_second, 2),
            number(method.live.share_of_points, 3),
        )
    }));
    lines.join("\n")
}
