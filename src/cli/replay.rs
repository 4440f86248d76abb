//! `cfodi replay`: a recorded bag through the same engine as the live node.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context as _;
use cfodi::args::Setup;
use cfodi::bag::{Bag, OutputTopics};
use cfodi::count::count_of;
use cfodi::export::{WholeFile, WriteError};
use cfodi::line::one_line;
use cfodi::replay::{
    Ended, Fed, Finished, MapFiles, Outputs, Remark, Replay, ResultFile, Settings, Summary, Tally, feed,
};
use cfodi::report::{Facts, Figure, Story, write_report};
use cfodi::say::say;

use super::input::{Input, check_outputs, open};
use super::progress::Bar;
use super::{Ending, first_of, say_left_behind};

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// An MCAP file, one compressed as a whole (.mcap.zstd), or a folder that rosbags-convert or ros2 bag record made
    input: PathBuf,
    /// The sensor's topic; again for a second sensor. Without it, `points` or `depth/image` (or its compressedDepth), else the only cloud or depth image
    #[arg(long)]
    topic: Vec<String>,
    /// The result as a bag: clusters, deltas, markers, labelled points, transforms
    #[arg(long, value_name = "RESULT.mcap")]
    out: Option<PathBuf>,
    /// Adds the input's own messages to the result bag
    #[arg(long, requires = "out")]
    with_input: bool,
    /// The account: scans, skipped ones by reason, times, memory, parameters
    #[arg(long, value_name = "S.json")]
    summary: Option<PathBuf>,
    /// The dense voxels of the map as a table
    #[arg(long, value_name = "V.csv")]
    voxels: Option<PathBuf>,
    /// The clusters of the map
    #[arg(long, value_name = "C.json")]
    clusters: Option<PathBuf>,
    /// The dense voxels of the map as a cloud, coloured by cluster
    #[arg(long, value_name = "P.ply")]
    ply: Option<PathBuf>,
    /// Folder for a report to look at: index.html, with the clusters in 3-D over time
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
}

impl Options {
    fn map_files(&self) -> MapFiles {
        MapFiles {
            summary: self.summary.clone(),
            voxels: self.voxels.clone(),
            clusters: self.clusters.clone(),
            ply: self.ply.clone(),
        }
    }

    /// The files to write.
    fn outputs(&self) -> Vec<PathBuf> {
        let files = [&self.out, &self.summary, &self.voxels, &self.clusters, &self.ply];
        let report = self.report.as_ref().map(|folder| folder.join(PAGE));
        files.into_iter().flatten().cloned().chain(report).collect()
    }
}

/// The file of a report, in its folder.
pub(crate) const PAGE: &str = "index.html";

pub(crate) fn replay(setup: &Setup, options: &Options) -> anyhow::Result<Ending> {
    let input = open(setup, &options.input, &options.topic)?;
    say_files(&input.bag);
    check_outputs(&options.outputs(), &input.bag.paths())?;
    say_left_behind(&options.outputs());
    let files = options.map_files().create()?;
    let page = options.report.as_deref().map(begin_page).transpose()?;
    let bar = Bar::new(input.bag.size());
    let mut say = |line: &str| bar.say(line);
    let topics = output_topics(setup)?;
    let offset = options.out.as_ref().and_then(|_| input.clock_offset());
    let has_others = options.outputs().len() > 1;
    let make = || {
        let begin = |path| {
            let file = ResultFile::create(path, &topics, options.with_input, offset);
            file.map(|file| file.beside_others(has_others))
        };
        let result = options.out.as_deref().map(begin);
        Ok((result.transpose()?, options.report.as_ref().map(|_| Story::new())))
    };
    let mut finished = run(setup, &input, options.out.is_some(), &bar, make, &mut say)?;
    bar.finish();
    // What can be written is, whatever becomes of the others.
    let result = std::mem::replace(&mut finished.written, Ok(()));
    let Finished { map, session, summary, .. } = &finished;
    let failed = files.write(session, map, summary);
    let told = page.map_or(Ok(()), |page| write_page(page, &options.input, &finished, Vec::new()));
    account(summary);
    // What was not read is said whether or not the outputs can be written.
    let ending = say_skipped(summary);
    first_of(result.err().into_iter().chain(failed).chain(told.err()))?;
    Ok(ending)
}

/// Says which files of a folder are read and which are not.
pub(crate) fn say_files(bag: &Bag) {
    bag.remarks().iter().for_each(|line| say(one_line(line)));
}

/// What is said where there is no result.
fn for_nothing(Tally { skipped, .. }: &Tally) -> String {
    let skipped: Vec<_> = skipped.iter().map(|(reason, count)| format!("{} {count}", reason.key)).collect();
    let skipped =
        if skipped.is_empty() { String::new() } else { format!(" (skipped: {})", skipped.join(", ")) };
    format!("stopped by a signal before a scan was taken in{skipped}: nothing is written")
}

/// Feeds the bag to an engine, again where the frame that was guessed turns out to be wrong.
fn run(
    setup: &Setup,
    input: &Input,
    with_messages: bool,
    bar: &Bar,
    mut make: impl FnMut() -> anyhow::Result<(Option<ResultFile>, Option<Story>)>,
    say: &mut dyn FnMut(&str),
) -> anyhow::Result<Finished> {
    let (mut fixed_frame, begin) = (input.fixed_frame.clone(), Instant::now());
    loop {
        let (bag, story) = make()?;
        let is_direct = bag.as_ref().is_some_and(ResultFile::is_direct);
        let mut replay = Replay::new(settings(setup), Outputs { bag, story, say }, begin);
        match feed(input.feed(fixed_frame, with_messages, &mut |progress| bar.set(progress)), &mut replay)? {
            Ended::Fed(fed) if fed.is_for_nothing() => anyhow::bail!(for_nothing(&fed.tally)),
            Ended::Fed(fed) => return Ok(replay.finish(with_remarks(setup, fed))),
            Ended::WrongFrame(better) => fixed_frame = better,
        }
        if is_direct {
            let name = fixed_frame.name().unwrap_or_default();
            anyhow::bail!(
                "a late transform shows that the frame is `{name}`, and --out cannot be begun again: -p fixed_frame:={name}"
            );
        }
        say(BEGINS_AGAIN);
    }
}

/// Adds what the parameters let expect of the map; the log has it from the start.
pub(crate) fn with_remarks(setup: &Setup, mut fed: Fed) -> Fed {
    fed.remarks.extend(setup.config().too_coarse().map(|text| Remark { text, is_warning: true }));
    fed
}

/// What is said where a guessed frame is not the root.
pub(crate) const BEGINS_AGAIN: &str =
    "a later transform shows more of the tree of frames: reading begins again";

pub(crate) fn settings(setup: &Setup) -> Settings {
    Settings {
        node: setup.fully_qualified_name(),
        engine: setup.config().engine,
        publish_period: setup.config().publish_period,
        parameters: setup.parameters.values().map(|(name, value)| (name.clone(), value.clone())).collect(),
    }
}

/// Begins the report in its folder, before the work shows what it tells.
pub(crate) fn begin_page(folder: &Path) -> anyhow::Result<WholeFile> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(WholeFile::create(&folder.join(PAGE))?)
}

/// Writes the report of a replay that has told a story.
pub(crate) fn write_page(
    page: WholeFile,
    input: &Path,
    finished: &Finished,
    figures: Vec<Figure>,
) -> Result<(), WriteError> {
    let Some(story) = &finished.story else { return Ok(()) };
    let title = input.file_name().unwrap_or(input.as_os_str()).to_string_lossy();
    let facts = Facts { figures, ..finished.summary.facts(&title) };
    page.complete(|out| write_report(out, story, &facts))
}

pub(crate) fn output_topics(setup: &Setup) -> anyhow::Result<OutputTopics> {
    OutputTopics::new(setup.config().twins, |name| setup.resolve(name)).context("an output's name")
}

/// What came of it.
fn account(summary: &Summary) {
    let rate = summary.tally.scans as f64 / summary.wall.as_secs_f64().max(1e-9);
    let unused = summary.points_unused();
    let unused = if unused.is_empty() { unused } else { format!(" ({unused})") };
    say(format_args!(
        "{} in {:.1} s ({rate:.0} a second) in frame {}: {} of {} used{unused}, {}, {}, {} of them active",
        count_of(summary.tally.scans, "scan"),
        summary.wall.as_secs_f64(),
        one_line(&summary.fixed_frame),
        summary.points_used(),
        count_of(summary.tally.points, "point"),
        count_of(summary.dense_voxels, "dense voxel"),
        count_of(summary.clusters, "cluster"),
        summary.clusters_active,
    ));
}

/// What was not read.
pub(crate) fn say_skipped(summary: &Summary) -> Ending {
    let skipped: u64 = summary.tally.skipped.values().sum();
    if skipped > 0 {
        let reasons: Vec<_> =
            summary.tally.skipped.iter().map(|(reason, count)| format!("{} {count}", reason.key)).collect();
        say(format_args!("{} skipped: {}", count_of(skipped, "scan"), reasons.join(", ")));
    }
    if let Some(unread) = &summary.unread {
        say(format_args!("cfodi: not all of the bag was read: {}", one_line(unread)));
    }
    let ends_at_jump = summary.tally.ends_at_jump();
    if ends_at_jump {
        say("cfodi: not all of the bag was taken in, but what came before the stamps jumped back");
    }
    if summary.stopped {
        say("cfodi: stopped by a signal before the end of the bag");
    }
    let is_whole = summary.unread.is_none() && !ends_at_jump && !summary.stopped;
    if is_whole { Ending::Whole } else { Ending::InPart }
}
