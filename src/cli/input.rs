//! A bag opened for a verb: which of its topics are its sensors, and what must not be written over.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{anyhow, bail};
use cfodi::args::{ArgsError, Setup};
use cfodi::bag::{self, Bag, Choice, Decoder, Survey, TransformTopics, Wanted, choose};
use cfodi::config::{Kind, Sensor};
use cfodi::line::one_line;
use cfodi::link::target;
use cfodi::replay::{Feed, FixedFrame, Progress, clock_offset};
use cfodi::say::say;

use super::{Wrong, arguments, stop};

/// How long a cloud waits for its transform at least, by the times at which messages were recorded: nobody waits for it.
const PATIENCE: Duration = Duration::from_secs(1);

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

    /// How far the stamps lie after the times of recording (ns), where these are of two clocks.
    pub(crate) fn clock_offset(&self) -> Option<i64> {
        clock_offset(&self.bag, self.decoder.clone(), &stop::flag())
    }
}

/// The topic of a camera's intrinsics without a list of sensors, before remapping.
const INFO: &str = "depth/camera_info";

/// Opens the bag and chooses its sensors.
pub(crate) fn open(setup: &Setup, path: &Path, wanted: &[String]) -> anyhow::Result<Input> {
    if setup.config().snapshot_path.is_some() {
        say("snapshot_path is not used: only `cfodi run` saves its map");
    }
    // Listened for before the first reading, which may take long.
    let stop = stop::flag();
    let bag = Bag::open(path).map_err(|error| {
        let text = one_line(&error.to_string()).into_owned();
        if error.is_wrong_argument() { Wrong(text).into() } else { anyhow!("{text}") }
    })?;
    say_copies(&bag);
    let Survey { topics, is_complete } = bag.survey(&stop);
    if !is_complete && stop.load(Ordering::Relaxed) {
        bail!("stopped by a signal before the topics of the bag were known: nothing is written");
    }
    // What the node would listen to is meant: where it was remapped in any case, else where the bag has scans there.
    let is_told = setup.is_given("sensors") || setup.config().sensors.iter().any(|it| it.kind != Kind::Auto);
    let (meant, usual) =
        if is_told { (of_sensors(setup)?, Vec::new()) } else { (remapped(setup)?, usual(setup)?) };
    let named = wanted.iter().map(|topic| Wanted { topic: topic.clone(), info: None });
    let wanted = if wanted.is_empty() { meant } else { named.collect() };
    // Who has given the intrinsics another name means these; else each image has its own.
    let info = setup.is_remapped(INFO).then(|| setup.resolve(INFO)).transpose()?;
    let choice = choose(&topics, &wanted, &usual, info.as_deref()).or_else(|error| {
        // The error itself has several lines: what the bag holds.
        let text = format!("{}: {error}", one_line(&path.display().to_string()));
        if is_complete || !error.is_for_lack() {
            return Err(Wrong(text));
        }
        // What is not in a bag that is cut may have been behind the cut: nothing can be read, but nobody was wrong.
        say(format_args!("cfodi: {text}"));
        Ok(Choice { sensors: Vec::new(), passed_over: Vec::new() })
    })?;
    say_choice(&choice);
    let fixed_frame = if setup.is_given("fixed_frame") {
        FixedFrame::Settled(setup.config().fixed_frame.clone())
    } else {
        FixedFrame::Open { default: setup.config().fixed_frame.clone() }
    };
    let transforms =
        TransformTopics { changing: setup.resolve("/tf")?, lasting: setup.resolve("/tf_static")? };
    say_unread(&transforms, &topics);
    if is_complete {
        say_absent(setup, &transforms, &topics);
    }
    let decoder = Decoder::new(choice.sensors, setup.config().filter, transforms);
    let patience = setup.config().tf_timeout.max(PATIENCE);
    Ok(Input { bag, decoder, fixed_frame, patience })
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

/// Says which topic of transforms, of those that somebody has named, the bag does not have.
fn say_absent(setup: &Setup, TransformTopics { changing, lasting }: &TransformTopics, topics: &[bag::Topic]) {
    for (usual, name) in [("/tf", changing), ("/tf_static", lasting)] {
        let name = name.trim_start_matches('/');
        if setup.is_remapped(usual) && !topics.iter().any(|topic| topic.name.trim_start_matches('/') == name)
        {
            say(one_line(&format!("the bag has no /{name}, from which -r {usual}:=... has transforms read")));
        }
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
    setup.config().sensors.iter().filter_map(of_sensor).map(wanted).collect()
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

/// The files of parameters that the command line names.
fn parameter_files() -> Result<Vec<PathBuf>, Wrong> {
    let arguments = arguments()?;
    let named = arguments.windows(2).filter(|pair| pair[0] == "--params-file");
    Ok(named.map(|pair| PathBuf::from(&pair[1])).collect())
}

/// Refuses an output that would replace the input, a file of parameters or another output.
pub(crate) fn check_outputs(outputs: &[PathBuf], inputs: &[PathBuf]) -> Result<(), Wrong> {
    // A file that is not there yet is the same as another where its folder and name are.
    let place = |path: &PathBuf| {
        path.canonicalize().ok().or_else(|| {
            let path = target(path).ok()?;
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            Some(folder.unwrap_or(Path::new(".")).canonicalize().ok()?.join(path.file_name()?))
        })
    };
    let name = |path: &Path| one_line(&path.display().to_string()).into_owned();
    let inputs: Vec<_> = inputs.iter().chain(&parameter_files()?).filter_map(place).collect();
    let mut seen = Vec::new();
    for path in outputs {
        let Some(real) = place(path).filter(|real| !real.exists() || real.is_file()) else { continue };
        if inputs.contains(&real) {
            return Err(Wrong(format!("the output {} would replace the input", name(path))));
        }
        if seen.contains(&real) {
            return Err(Wrong(format!("two outputs would be written to {}", name(path))));
        }
        seen.push(real);
    }
    Ok(())
}
