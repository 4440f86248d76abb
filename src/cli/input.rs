//! A bag opened for a verb: which of its topics are its sensors, and what must not be written over.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{anyhow, bail};
use cfodi::args::{DepthTopics, SensorTopics, Setup, TopicName};
use cfodi::bag::{self, Bag, Choice, Decoder, Info, Survey, TransformTopics, Wanted, choose};
use cfodi::config::{Kind, Sensor};
use cfodi::line::one_line;
use cfodi::link::{folder, target};
use cfodi::msg::form::Form;
use cfodi::msg::heard::{TF, TF_STATIC};
use cfodi::node::check_names;
use cfodi::replay::{Feed, FixedFrame, Progress, clock_offset};
use cfodi::say::say;
use cfodi::stop;

use super::{Wrong, arguments, check_home};

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

/// Opens the bag and chooses its sensors.
pub(crate) fn open(setup: &Setup, path: &Path, wanted: &[String]) -> anyhow::Result<Input> {
    if setup.config().snapshot_path.is_some() {
        say("snapshot_path is not used: only `cfodi run` saves its map");
    }
    let (bag, survey) = surveyed(path)?;
    // As the node does.
    check_names(setup)?;
    let Choice { sensors, .. } = chosen(setup, path, wanted, &survey)?;
    let transforms = setup.transform_topics()?;
    let Survey { topics, is_complete } = survey;
    if is_complete {
        check_named(setup, &transforms, &topics)?;
    }
    say_unread(&transforms, &topics);
    let decoder = Decoder::new(sensors, setup.config().filter, transforms);
    let patience = setup.config().tf_timeout.max(PATIENCE);
    Ok(Input { bag, decoder, fixed_frame: fixed_frame(setup), patience })
}

/// The bag, and what is in it.
fn surveyed(path: &Path) -> anyhow::Result<(Bag, Survey)> {
    if path == Path::new(DASH) {
        return Err(Wrong(format!(
            "`{DASH}` is no input: give a file, or /dev/stdin where one is redirected to it"
        ))
        .into());
    }
    // Listened for before the first reading, which may take long.
    let stop = stop::flag();
    let bag = Bag::open(path).map_err(|error| {
        let text = one_line(&error.to_string()).into_owned();
        if error.is_wrong_argument() { Wrong(text).into() } else { anyhow!("{text}") }
    })?;
    say_copies(&bag);
    let survey = bag.survey(&stop);
    if !survey.is_complete && stop.load(Ordering::Relaxed) {
        bail!("stopped by a signal before the topics of the bag were known: nothing is written");
    }
    Ok((bag, survey))
}

/// The sensors that the parameters mean, or those on the topics that are wanted; says which.
fn chosen(
    setup: &Setup,
    path: &Path,
    wanted: &[String],
    Survey { topics, is_complete }: &Survey,
) -> anyhow::Result<Choice> {
    // What the node would listen to is meant: where it was remapped in any case, else where the bag has scans there.
    let sensors = setup.sensor_topics()?;
    let is_auto = is_left_open(setup);
    let (meant, usual) = match &sensors[..] {
        [sensor] if is_auto => (remapped(setup, sensor, topics), usual(sensor, topics)),
        listed => (of_sensors(setup, listed, topics), Vec::new()),
    };
    let named: Vec<_> = wanted.iter().map(|topic| Wanted { topic: topic.clone(), info: None }).collect();
    let is_meant = named.is_empty();
    let wanted = if is_meant { &meant } else { &named };
    // Who has given the intrinsics another name means these; else each image has its own.
    let info = Some(info(setup, &setup.topic_name(Info::PLAIN)?)).filter(|info| info.is_named);
    let mut choice = choose(topics, wanted, &usual, info.as_ref()).or_else(|error| {
        // The error itself has several lines: what the bag holds.
        let text = format!("{}: {error}", one_line(&path.display().to_string()));
        if *is_complete || !error.is_for_lack() {
            return Err(Wrong(text));
        }
        // What is not in a bag that is cut may have been behind the cut: nothing can be read, but nobody was wrong.
        say(format_args!("cfodi: {text}"));
        Ok(Choice { sensors: Vec::new(), passed_over: Vec::new() })
    })?;
    if is_meant && !is_auto {
        check_kinds(&setup.config().sensors, &choice.sensors)?;
    }
    if !is_meant {
        choice.passed_over = passed_over(&meant, &choice.sensors, topics);
    }
    say_choice(&choice);
    Ok(choice)
}

/// The topics with messages that the parameters mean and that are not read.
fn passed_over(meant: &[Wanted], read: &[bag::Sensor], topics: &[bag::Topic]) -> Vec<String> {
    let is_fed = |topic: &&bag::Topic| topic.messages != Some(0);
    let of = |name: &str| topics.iter().filter(is_fed).find(|topic| topic.is_called(name));
    let meant = meant.iter().filter_map(|meant| Some(of(&meant.topic)?.name.clone()));
    meant.filter(|name| read.iter().all(|sensor| sensor.topic != *name)).collect()
}

/// The fixed frame that was given, or else one that the bag shows.
fn fixed_frame(setup: &Setup) -> FixedFrame {
    let name = setup.config().fixed_frame.clone();
    if setup.is_given("fixed_frame") { FixedFrame::Settled(name) } else { FixedFrame::Open { default: name } }
}

/// Says which files are not read.
fn say_copies(bag: &Bag) {
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<_> = bag.copies().iter().map(name).collect();
    if !names.is_empty() {
        let names = names.join(", ");
        say(one_line(&format!(
            "not read, as the folder has each under another name, or compressed in another way or not at all: {names}"
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

/// Refuses a topic of transforms that somebody has named and that the bag does not have: without those that move the sensor its
/// scans would lie on one another. Where the bag has no static ones at all, their topic is only said: none can be missing, and who
/// has named it may have named those of a robot.
fn check_named(
    setup: &Setup,
    TransformTopics { changing, lasting }: &TransformTopics,
    topics: &[bag::Topic],
) -> Result<(), Wrong> {
    let there: BTreeSet<_> = TransformTopics::all(topics).collect();
    for (usual, name) in [(TF.name, changing), (TF_STATIC.name, lasting)] {
        let bare = |name: &str| name.trim_start_matches('/').to_owned();
        if !setup.is_remapped(usual) || there.iter().any(|topic| bare(topic) == bare(name)) {
            continue;
        }
        let line = format!("the bag has no transforms on {name}, from which -r {usual}:=... has them read");
        if name == changing || there.iter().any(|topic| topic.contains("static")) {
            let held = there.iter().copied().collect::<Vec<_>>().join(" and ");
            let held =
                if held.is_empty() { "it has none".to_owned() } else { format!("it has some on {held}") };
            return Err(Wrong(one_line(&format!("{line}; {held}")).into_owned()));
        }
        say(one_line(&line));
    }
    Ok(())
}

/// Whether it is left open what the sensor sends, which is then the only one.
fn is_left_open(setup: &Setup) -> bool {
    setup.config().sensors.iter().any(|sensor| sensor.kind == Kind::Auto)
}

/// Refuses a listed sensor whose topic has what the node would not listen to there.
fn check_kinds(listed: &[Sensor], chosen: &[bag::Sensor]) -> Result<(), Wrong> {
    for (Sensor { name, kind }, found) in listed.iter().zip(chosen) {
        let carried = if found.form == Form::Points { Kind::Cloud } else { Kind::Depth };
        if *kind != carried {
            let [kind, carried] = [kind, &carried].map(|kind| kind.as_str());
            let line = format!(
                "the sensor {name} is of kind {kind}, and {} carries {carried} (-p {name}.kind:={carried})",
                found.topic
            );
            return Err(Wrong(one_line(&line).into_owned()));
        }
    }
    Ok(())
}

/// The topics of the sensors that are listed.
fn of_sensors(setup: &Setup, listed: &[SensorTopics], topics: &[bag::Topic]) -> Vec<Wanted> {
    let wanted = |sensor: &SensorTopics| {
        let (_, topic) = read_from(sensor, topics).next()?;
        let info = sensor.depth.as_ref().map(|depth| info(setup, &depth.camera_info));
        Some(Wanted { topic: topic.to_owned(), info })
    };
    listed.iter().filter_map(wanted).collect()
}

/// The topic of intrinsics.
fn info(setup: &Setup, TopicName { plain, resolved }: &TopicName) -> Info {
    Info { topic: resolved.clone(), plain: plain.clone(), is_named: setup.is_remapped(plain) }
}

/// The topics that a sensor may be read from, clouds first: each by what a remapping names it, and as the bag has it.
fn read_from<'a>(
    SensorTopics { points, depth, .. }: &'a SensorTopics,
    topics: &[bag::Topic],
) -> impl Iterator<Item = (&'a TopicName, &'a str)> {
    let points = points.as_ref().map(|points| (points, points.resolved.as_str()));
    let images = depth.as_ref().map(|depth| (&depth.image, images(depth, topics)));
    points.into_iter().chain(images)
}

/// The topic of images; compressed ones beside it where the bag has none there, as the node reads them.
fn images<'a>(DepthTopics { image, compressed, .. }: &'a DepthTopics, topics: &[bag::Topic]) -> &'a str {
    // Recorders write channels for topics that nobody has fed.
    let is_fed = |name: &str| topics.iter().any(|topic| topic.is_called(name) && topic.messages != Some(0));
    if !is_fed(&image.resolved) && is_fed(compressed) { compressed } else { &image.resolved }
}

/// The topic that somebody has put in the place of one of those: of two the first that the bag has.
fn remapped(setup: &Setup, sensor: &SensorTopics, topics: &[bag::Topic]) -> Vec<Wanted> {
    let remapped = read_from(sensor, topics).filter(|(name, _)| setup.is_remapped(&name.plain));
    let remapped: Vec<_> = remapped.map(|(_, topic)| topic).collect();
    let first = remapped.iter().find(|topic| is_in(topics, topic)).or(remapped.first());
    first.map(|&topic| Wanted { topic: topic.to_owned(), info: None }).into_iter().collect()
}

/// All of those.
fn usual(sensor: &SensorTopics, topics: &[bag::Topic]) -> Vec<String> {
    read_from(sensor, topics).map(|(_, topic)| topic.to_owned()).collect()
}

fn is_in(topics: &[bag::Topic], name: &str) -> bool {
    topics.iter().any(|topic| topic.is_called(name))
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

/// What other programs take for the standard input or output; a file of this name is `./-`.
const DASH: &str = "-";

/// Refuses an output that would replace the input, a file of parameters or another output, and one that is taken for the standard
/// output and would be a file.
pub(crate) fn check_outputs(outputs: &[PathBuf], inputs: &[PathBuf]) -> Result<(), Wrong> {
    if outputs.iter().any(|path| path == Path::new(DASH)) {
        return Err(Wrong(format!("`{DASH}` is no output: the standard output is /dev/stdout")));
    }
    check_home(outputs)?;
    // A file that is not there yet is the same as another where its folder and name are.
    let place = |path: &PathBuf| {
        path.canonicalize().ok().or_else(|| {
            let path = target(path).ok()?;
            Some(folder(&path).canonicalize().ok()?.join(path.file_name()?))
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

#[cfg(test)]
mod tests {
    use cfodi::args::Environment;

    use super::*;

    fn topics(names: &[&str], type_name: &str) -> Vec<bag::Topic> {
        let topic = |name: &&str| bag::Topic {
            name: (*name).to_owned(),
            type_name: type_name.to_owned(),
            encoding: "cdr".to_owned(),
            messages: Some(1),
        };
        names.iter().map(topic).collect()
    }

    /// Whether a bag with transforms on these topics is taken with these arguments; what is said where not.
    fn checked(arguments: &str, names: &[&str]) -> Result<(), String> {
        let arguments: Vec<_> = arguments.split_whitespace().map(str::to_owned).collect();
        let (setup, _) = Setup::parse(&arguments, &Environment::default(), "cfodi").unwrap();
        let topics = topics(names, "tf2_msgs/msg/TFMessage");
        check_named(&setup, &setup.transform_topics().unwrap(), &topics).map_err(|error| error.0)
    }

    #[test]
    fn transforms_that_somebody_has_named_must_be_there_but_static_ones_where_there_are_none() {
        let error = checked("--ros-args -r /tf:=/foo", &["/tf", "/tf_static"]).unwrap_err();
        let words = "the bag has no transforms on /foo, from which -r /tf:=... has them read; it has some on /tf and /tf_static";
        assert_eq!(error, words);
        let error = checked("--ros-args -r /tf_static:=/foo", &["/tf", "/tf_static"]).unwrap_err();
        assert!(
            error.starts_with("the bag has no transforms on /foo, from which -r /tf_static:=..."),
            "{error}"
        );
        assert!(checked("--ros-args -r /tf:=/foo", &[]).unwrap_err().ends_with("; it has none"));
        let robot = "--ros-args -r /tf:=/a/tf -r /tf_static:=/a/tf_static";
        for names in [&["/a/tf", "/a/tf_static"][..], &["a/tf", "/b/tf"]] {
            assert_eq!(checked(robot, names), Ok(()), "{names:?}");
        }
        assert!(checked(robot, &["/a/tf", "/b/tf_static"]).is_err());
        assert_eq!(checked("", &[]), Ok(()), "nobody has named any");
    }

    #[test]
    fn compressed_images_are_read_beside_images_and_not_beside_clouds() {
        let (setup, _) = Setup::parse(&[], &Environment::default(), "cfodi").unwrap();
        let sensors = setup.sensor_topics().unwrap();
        let packed = ["/points/compressedDepth", "/depth/image/compressedDepth"];
        let topics = topics(&packed, "sensor_msgs/msg/CompressedImage");
        assert_eq!(usual(&sensors[0], &topics), ["/points", packed[1]]);
        assert_eq!(usual(&sensors[0], &[]), ["/points", "/depth/image"]);
    }

    #[test]
    fn what_other_programs_take_for_the_standard_output_is_refused_and_a_file_of_that_name_is_not() {
        let checked = |name: &str| check_outputs(&[PathBuf::from(name)], &[]).map_err(|error| error.0);
        assert!(checked("-").unwrap_err().ends_with("/dev/stdout"));
        for name in ["./-", "-a", "/dev/stdout"] {
            assert_eq!(checked(name), Ok(()), "{name}");
        }
    }
}
