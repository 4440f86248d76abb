//! `cfodi replay`: a recorded bag through the same engine as the live node.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context as _;
use cfodi::args::{ArgsError, Setup};
use cfodi::bag::{self, Bag, Choice, Decoder, OutputTopics, Survey, TransformTopics, Wanted, choose};
use cfodi::config::{Kind, Sensor};
use cfodi::export::{WholeFile, WriteError};
use cfodi::line::one_line;
use cfodi::link::target;
use cfodi::node::transport::Outgoing;
use cfodi::replay::{
    Ended, Feed, Finished, FixedFrame, MapFiles, Outputs, Progress, Replay, ResultFile, Settings, Summary,
    clock_offset, feed,
};
use cfodi::report::{Facts, Figure, Story, write_report};
use cfodi::say::say;

use super::progress::Bar;
use super::stop;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// An MCAP file, one compressed as a whole (.mcap.zstd), or a folder that rosbags-convert made
    input: PathBuf,
    /// The sensor's topic; again for a second sensor. Without it, `points` or `depth/image`, else the only cloud or depth image
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

/// How long a cloud waits for its transform at least, by the times at which messages were recorded: nobody waits for it.
const PATIENCE: Duration = Duration::from_secs(1);

/// Wrong arguments, as opposed to an input that fails.
pub(crate) const WRONG: u8 = 2;

/// A bag with its sensors.
pub(crate) struct Input {
    pub(crate) bag: Bag,
    decoder: Decoder,
    pub(crate) fixed_frame: FixedFrame,
    patience: Duration,
}

impl Input {
    /// All of the bag, or what comes of it before a signal.
    pub(crate) fn feed<'a>(
        &'a self,
        fixed_frame: FixedFrame,
        with_messages: bool,
        progress: &'a mut dyn FnMut(Progress),
    ) -> Feed<'a> {
        let (bag, decoder, stop) = (&self.bag, self.decoder.clone(), stop::flag());
        Feed { bag, decoder, fixed_frame, patience: self.patience, with_messages, stop, progress }
    }

    fn clock_offset(&self) -> Option<i64> {
        clock_offset(&self.bag, self.decoder.clone(), &stop::flag())
    }
}

pub(crate) fn replay(setup: &Setup, options: &Options) -> anyhow::Result<ExitCode> {
    let input = match open(setup, &options.input, &options.topic)? {
        Ok(input) => input,
        Err(status) => return Ok(status),
    };
    if let Some(clash) = clash(&options.outputs(), &input.bag.paths()) {
        say(format_args!("cfodi: {clash}"));
        return Ok(ExitCode::from(WRONG));
    }
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
    let written = files.write(session, map, summary);
    let told = page.map_or(Ok(()), |page| write_page(page, &options.input, &finished, Vec::new()));
    account(summary);
    result.and(written).and(told)?;
    Ok(say_skipped(summary))
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
    let mut fixed_frame = input.fixed_frame.clone();
    loop {
        let (bag, story) = make()?;
        let is_direct = bag.as_ref().is_some_and(ResultFile::is_direct);
        let mut replay = Replay::new(settings(setup), Outputs { bag, story, say });
        match feed(input.feed(fixed_frame, with_messages, &mut |progress| bar.set(progress)), &mut replay)? {
            Ended::Fed(fed) => return Ok(replay.finish(fed)),
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

/// What is said where a guessed frame is not the root.
pub(crate) const BEGINS_AGAIN: &str =
    "a later transform shows more of the tree of frames: reading begins again";

pub(crate) fn settings(setup: &Setup) -> Settings {
    Settings {
        engine: setup.config.engine,
        publish_period: setup.config.publish_period,
        parameters: setup.parameters.clone(),
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

/// The topic of a camera's intrinsics without a list of sensors, before remapping.
const INFO: &str = "depth/camera_info";

/// Opens the bag and chooses its sensors; gives the exit status where that is not possible.
pub(crate) fn open(setup: &Setup, path: &Path, wanted: &[String]) -> anyhow::Result<Result<Input, ExitCode>> {
    if setup.config.snapshot_path.is_some() {
        say("snapshot_path is not used: only `cfodi run` saves its map");
    }
    // Listened for before the first reading, which may take long.
    let stop = stop::flag();
    let bag = match Bag::open(path) {
        Ok(bag) => bag,
        Err(error) => {
            say(format_args!("cfodi: {}", one_line(&error.to_string())));
            let status = if error.is_wrong_argument() { ExitCode::from(WRONG) } else { ExitCode::FAILURE };
            return Ok(Err(status));
        }
    };
    say_copies(&bag);
    let Survey { topics, is_complete } = bag.survey(&stop);
    // What the node would listen to is meant: where it was remapped in any case, else where the bag has scans there.
    let is_told = setup.is_given("sensors") || setup.config.sensors.iter().any(|it| it.kind != Kind::Auto);
    let (meant, usual) =
        if is_told { (of_sensors(setup)?, Vec::new()) } else { (remapped(setup)?, usual(setup)?) };
    let named = wanted.iter().map(|topic| Wanted { topic: topic.clone(), info: None });
    let wanted = if wanted.is_empty() { meant } else { named.collect() };
    // Who has given the intrinsics another name means these; else each image has its own.
    let info = setup.is_remapped(INFO).then(|| setup.resolve(INFO)).transpose()?;
    let choice = match choose(&topics, &wanted, &usual, info.as_deref()) {
        Ok(choice) => choice,
        Err(error) => {
            // The error itself has several lines: what the bag holds.
            say(format_args!("cfodi: {}: {error}", one_line(&path.display().to_string())));
            // What is not in a bag that is cut may have been behind the cut: nothing can be read, but nobody was wrong.
            if is_complete || !error.is_for_lack() {
                return Ok(Err(ExitCode::from(WRONG)));
            }
            Choice { sensors: Vec::new(), passed_over: Vec::new() }
        }
    };
    say_choice(&choice);
    let fixed_frame = if setup.is_given("fixed_frame") {
        FixedFrame::Settled(setup.config.fixed_frame.clone())
    } else {
        FixedFrame::Open { default: setup.config.fixed_frame.clone() }
    };
    let transforms =
        TransformTopics { changing: setup.resolve("/tf")?, lasting: setup.resolve("/tf_static")? };
    say_unread(&transforms, &topics);
    let decoder = Decoder::new(choice.sensors, setup.config.filter, transforms);
    let patience = setup.config.tf_timeout.max(PATIENCE);
    Ok(Ok(Input { bag, decoder, fixed_frame, patience }))
}

/// Says which files are not read.
fn say_copies(bag: &Bag) {
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<_> = bag.copies().iter().map(name).collect();
    if !names.is_empty() {
        let names = names.join(", ");
        say(one_line(&format!(
            "not read, as the folder has each compressed in another way or not at all: {names}"
        )));
    }
}

/// Says where the transforms are that nobody has asked for.
fn say_unread(transforms: &TransformTopics, topics: &[bag::Topic]) {
    let unread = transforms.passed_over(topics);
    if !unread.is_empty() {
        let TransformTopics { changing, lasting } = transforms;
        say(one_line(&format!(
            "transforms are read from {changing} and {lasting}, not from {} (choose with -r /tf:=... -r /tf_static:=...)",
            unread.join(" and ")
        )));
    }
}

/// The topics of the sensors that are listed.
fn of_sensors(setup: &Setup) -> Result<Vec<Wanted>, ArgsError> {
    let of_sensor = |sensor: &Sensor| {
        let topic = sensor.points().map(str::to_owned).or_else(|| sensor.image())?;
        Some((topic, sensor.camera_info()))
    };
    let wanted = |(topic, info): (String, Option<String>)| {
        let info = info.map(|info| setup.resolve(&info)).transpose()?;
        Ok(Wanted { topic: setup.resolve(&topic)?, info })
    };
    setup.config.sensors.iter().filter_map(of_sensor).map(wanted).collect()
}

/// The names on which the node listens without a list.
const DEFAULT: [&str; 2] = ["points", "depth/image"];

/// The topic that somebody has put in the place of one of those.
fn remapped(setup: &Setup) -> Result<Vec<Wanted>, ArgsError> {
    let remapped = DEFAULT.into_iter().find(|name| setup.is_remapped(name));
    let wanted = |name| Ok(Wanted { topic: setup.resolve(name)?, info: None });
    remapped.into_iter().map(wanted).collect()
}

/// The topics of those names.
fn usual(setup: &Setup) -> Result<Vec<String>, ArgsError> {
    DEFAULT.into_iter().map(|name| setup.resolve(name)).collect()
}

fn say_choice(choice: &Choice) {
    let with_info = |sensor: &bag::Sensor| match &sensor.info_topic {
        Some(info) => format!("{} with {info}", sensor.topic),
        None => sensor.topic.clone(),
    };
    let read: Vec<_> = choice.sensors.iter().map(with_info).collect();
    let others = if choice.passed_over.is_empty() {
        String::new()
    } else {
        format!(" (not {}: choose with --topic)", choice.passed_over.join(", "))
    };
    if !read.is_empty() {
        say(one_line(&format!("reading {}{others}", read.join(" and "))));
    }
}

pub(crate) fn output_topics(setup: &Setup) -> anyhow::Result<OutputTopics> {
    let name = |name| setup.resolve(name).context("an output's name");
    Ok(OutputTopics {
        clusters: name(Outgoing::CLUSTERS)?,
        clusters_delta: name(Outgoing::DELTA)?,
        markers: name(Outgoing::MARKERS)?,
        points_labelled: name(Outgoing::LABELLED)?,
        detections: setup.config.twins.detections.then(|| name(Outgoing::DETECTIONS)).transpose()?,
        polygons: setup.config.twins.polygons.then(|| name(Outgoing::POLYGONS)).transpose()?,
    })
}

/// An output that would replace the input or another output.
pub(crate) fn clash(outputs: &[PathBuf], inputs: &[PathBuf]) -> Option<String> {
    // A file that is not there yet is the same as another where its folder and name are.
    let place = |path: &PathBuf| {
        path.canonicalize().ok().or_else(|| {
            let path = target(path).ok()?;
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            Some(folder.unwrap_or(Path::new(".")).canonicalize().ok()?.join(path.file_name()?))
        })
    };
    let inputs: Vec<_> = inputs.iter().filter_map(place).collect();
    let mut seen = Vec::new();
    for path in outputs {
        let Some(real) = place(path).filter(|real| !real.exists() || real.is_file()) else { continue };
        if inputs.contains(&real) {
            return Some(format!("the output {} would replace the input", path.display()));
        }
        if seen.contains(&real) {
            return Some(format!("two outputs would be written to {}", path.display()));
        }
        seen.push(real);
    }
    None
}

/// What came of it.
fn account(summary: &Summary) {
    let rate = summary.tally.scans as f64 / summary.wall.as_secs_f64().max(1e-9);
    let unused = summary.points_unused();
    let unused = if unused.is_empty() { unused } else { format!(" ({unused})") };
    say(format_args!(
        "{} scans in {:.1} s ({rate:.0} a second) in frame {}: {} of {} points used{unused}, {} dense voxels, {} clusters, {} of them active",
        summary.tally.scans,
        summary.wall.as_secs_f64(),
        one_line(&summary.fixed_frame),
        summary.points_used(),
        summary.tally.points,
        summary.dense_voxels,
        summary.clusters,
        summary.clusters_active,
    ));
}

/// The last word: what was not read, as an exit status too.
pub(crate) fn say_skipped(summary: &Summary) -> ExitCode {
    let skipped: u64 = summary.tally.skipped.values().sum();
    if skipped > 0 {
        let reasons: Vec<_> =
            summary.tally.skipped.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        say(format_args!("{skipped} scans skipped: {}", reasons.join(", ")));
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
    if is_whole { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
