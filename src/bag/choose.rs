//! Which topics of a bag are taken for sensors.

use std::fmt::Write;

use thiserror::Error;

use super::topic::Topic;
use crate::line::one_line;
use crate::msg::form::Form;
use crate::msg::types;

/// A topic whose messages are scans.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// Its name.
    pub topic: String,
    /// What its messages are.
    pub form: Form,
    /// Where its intrinsics come from; `None` for clouds.
    pub info_topic: Option<String>,
}

/// A topic that somebody has named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Its name.
    pub topic: String,
    /// Where its images' intrinsics are looked for first.
    pub info: Option<Info>,
}

/// The topic of images' intrinsics, which is preferred to all others if the bag has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Info {
    /// Its name.
    pub topic: String,
    /// The name that a remapping has it read from another topic by, as `depth/camera_info`.
    pub plain: String,
    /// Whether somebody has named it: no other takes its place, for it may be that of another camera.
    pub is_named: bool,
}

impl Info {
    /// The plain name without a list of sensors.
    pub const PLAIN: &str = "depth/camera_info";
}

/// The sensors of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// At least one.
    pub sensors: Vec<Sensor>,
    /// Topics that could have been chosen instead.
    pub passed_over: Vec<String>,
}

/// What the bag holds does not fit; each says what it holds.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ChoiceError {
    /// The bag has no such topic.
    #[error("the bag has no topic {topic}{hint}; it holds:{held}")]
    NoTopic {
        /// As given.
        topic: String,
        /// What could have been meant.
        hint: String,
        /// The list.
        held: String,
    },
    /// The topic's messages are no scans.
    #[error(
        "{topic} carries {type_name} as {encoding}, no point cloud and no depth image in CDR{hint}; the bag holds:{held}"
    )]
    NoScans {
        /// As given.
        topic: String,
        /// Its type.
        type_name: String,
        /// Its encoding.
        encoding: String,
        /// How it could be had.
        hint: &'static str,
        /// The list.
        held: String,
    },
    /// No topic has scans.
    #[error("the bag has no point cloud and no depth image{hint}; it holds:{held}")]
    Nothing {
        /// What may have been meant.
        hint: String,
        /// The list.
        held: String,
    },
    /// Several topics have scans.
    #[error("several topics could be meant: choose with {choices}; the bag holds:{held}")]
    Several {
        /// The words that choose.
        choices: String,
        /// The list.
        held: String,
    },
    /// Depth images without intrinsics.
    #[error("the depth images on {topic} need a sensor_msgs/msg/CameraInfo{hint}; the bag holds:{held}")]
    NoCameraInfo {
        /// The images.
        topic: String,
        /// What was looked for.
        hint: String,
        /// The list.
        held: String,
    },
}

impl ChoiceError {
    /// Whether more of a bag that is cut could have helped.
    pub fn is_for_lack(&self) -> bool {
        matches!(self, Self::NoTopic { .. } | Self::Nothing { .. } | Self::NoCameraInfo { .. })
    }
}

/// The sensors to read: those `wanted`, each by its name; where none is, the first of the `usual` names that has scans, else the
/// only point cloud, else the only depth image. `info` is the topic of the intrinsics of images for which no other is wanted,
/// where it is not their sibling.
///
/// # Errors
/// A [`ChoiceError`] that lists what the bag holds.
pub fn choose(
    topics: &[Topic],
    wanted: &[Wanted],
    usual: &[String],
    info: Option<&Info>,
) -> Result<Choice, ChoiceError> {
    if wanted.is_empty() {
        let candidates: Vec<_> = topics.iter().filter_map(|topic| Some((topic, form(topic)?))).collect();
        let named = |name: &String| candidates.iter().copied().find(|(topic, _)| topic.is_called(name));
        let chosen = usual.iter().find_map(named).map_or_else(|| only(topics, &candidates), Ok)?;
        let others = candidates.iter().filter(|(topic, _)| topic.name != chosen.0.name);
        let passed_over = others.map(|(topic, _)| topic.name.clone()).collect();
        return Ok(Choice { sensors: vec![sensor(topics, chosen, info)?], passed_over });
    }
    let mut sensors: Vec<Sensor> = Vec::new();
    for wanted in wanted {
        let candidate = named(topics, &wanted.topic)?;
        if sensors.iter().all(|chosen| chosen.topic != candidate.0.name) {
            sensors.push(sensor(topics, candidate, wanted.info.as_ref().or(info))?);
        }
    }
    Ok(Choice { sensors, passed_over: Vec::new() })
}

type Candidate<'a> = (&'a Topic, Form);

fn named<'a>(topics: &'a [Topic], name: &str) -> Result<Candidate<'a>, ChoiceError> {
    let of_name: Vec<&Topic> = topics.iter().filter(|topic| topic.is_called(name)).collect();
    let Some(first) = of_name.first() else {
        let usable = topics.iter().filter(|topic| form_of(&topic.type_name, &topic.encoding).is_some());
        let hint = match topics.iter().filter(|topic| form(topic).is_some()).collect::<Vec<_>>()[..] {
            [one] => is_meant(&one.name),
            _ => nearest(usable, name),
        };
        return Err(ChoiceError::NoTopic { topic: name.to_owned(), hint, held: held(topics) });
    };
    let usable = of_name.iter().find_map(|topic| Some((*topic, form_of(&topic.type_name, &topic.encoding)?)));
    usable.ok_or_else(|| {
        let [type_name, encoding] =
            [&first.type_name, &first.encoding].map(|text| one_line(text).into_owned());
        let hint = if is_of_ros_1(first) { OF_ROS_1 } else { "" };
        ChoiceError::NoScans { topic: name.to_owned(), type_name, encoding, hint, held: held(topics) }
    })
}

/// The topic whose name is nearest, where that is near enough to be meant.
fn nearest<'a>(usable: impl Iterator<Item = &'a Topic>, name: &str) -> String {
    let distances = usable.map(|topic| (strsim::damerau_levenshtein(&topic.name, name), &topic.name));
    match distances.min() {
        Some((distance, near)) if 2 * distance < name.len() => is_meant(near),
        _ => String::new(),
    }
}

fn is_meant(name: &str) -> String {
    format!(" (is {} meant?)", one_line(name))
}

fn only<'a>(topics: &[Topic], candidates: &[Candidate<'a>]) -> Result<Candidate<'a>, ChoiceError> {
    for wanted in Form::ALL {
        let of_form: Vec<_> = candidates.iter().copied().filter(|candidate| candidate.1 == wanted).collect();
        match of_form[..] {
            [] => {}
            [one] => return Ok(one),
            _ => {
                let words = of_form.iter().map(|(topic, _)| format!("--topic {}", one_line(&topic.name)));
                let choices = words.collect::<Vec<_>>().join(" or ");
                return Err(ChoiceError::Several { choices, held: held(topics) });
            }
        }
    }
    Err(ChoiceError::Nothing { hint: otherwise(topics), held: held(topics) })
}

/// How scans could be had of a bag that has none as it is.
fn otherwise(topics: &[Topic]) -> String {
    let has_messages = || topics.iter().filter(|topic| topic.messages != Some(0));
    if has_messages().any(is_of_ros_1) {
        return format!(" in CDR{OF_ROS_1}");
    }
    if let Some(other) = has_messages().find(|topic| is_scan_in_another_encoding(topic)) {
        let (name, encoding) = (one_line(&other.name), &other.encoding);
        return format!(
            " in CDR: the messages on {name} are in {encoding:?}, which is not read; ros2 bag record writes CDR"
        );
    }
    let mut images =
        has_messages().filter(|topic| form_of(&topic.type_name, &topic.encoding) == Some(Form::Depth));
    images.next().map_or_else(String::new, |image| {
        format!(
            " that is called one; an image of depths by another name is taken with --topic {}",
            one_line(&image.name)
        )
    })
}

/// What is said of scans in a bag that is none of ROS 2 but for its storage.
const OF_ROS_1: &str = ": its messages are serialised as in ROS 1; convert the .bag that it was made of: rosbags-convert --src \
                        X.bag --dst X --dst-storage mcap";

/// By its encoding, for some tools keep ROS 2's names of types.
fn is_of_ros_1(topic: &Topic) -> bool {
    let is_scan = |name: &str| SCANS_OF_ROS_1.contains(&name) || Form::of_type(name).is_some();
    topic.encoding == "ros1" && is_scan(&topic.type_name)
}

fn is_scan_in_another_encoding(topic: &Topic) -> bool {
    let form = Form::of_type(&topic.type_name).filter(|_| topic.encoding != "cdr");
    form.is_some_and(|form| form.is_of_sensor(&topic.name))
}

/// What ROS 1 calls the types of scans.
const SCANS_OF_ROS_1: [&str; 3] =
    ["sensor_msgs/PointCloud2", "sensor_msgs/Image", "sensor_msgs/CompressedImage"];

/// What a topic is taken for when nobody has named it.
fn form(topic: &Topic) -> Option<Form> {
    // Recorders write channels for topics that nobody has fed.
    let form = form_of(&topic.type_name, &topic.encoding).filter(|_| topic.messages != Some(0))?;
    form.is_of_sensor(&topic.name).then_some(form)
}

/// What messages of a type are, in this encoding.
pub(super) fn form_of(type_name: &str, encoding: &str) -> Option<Form> {
    Form::of_type(type_name).filter(|_| encoding == "cdr")
}

fn sensor(
    topics: &[Topic],
    (topic, form): Candidate<'_>,
    info: Option<&Info>,
) -> Result<Sensor, ChoiceError> {
    let info_topic = match form {
        Form::Points => None,
        Form::Depth | Form::CompressedDepth => Some(info_topic(topics, topic, form, info)?),
    };
    Ok(Sensor { topic: topic.name.clone(), form, info_topic })
}

/// The topic that somebody has named; else the one named `camera_info` beside the image (as `image_transport` looks for it), else
/// the only one there is.
fn info_topic(
    topics: &[Topic],
    image: &Topic,
    form: Form,
    info: Option<&Info>,
) -> Result<String, ChoiceError> {
    let refused = |hint: &str| {
        let [topic, hint] = [&image.name, hint].map(|text| one_line(text).into_owned());
        ChoiceError::NoCameraInfo { topic, hint, held: held(topics) }
    };
    // Recorders write channels for topics that nobody has fed; who names one is to be told that.
    let has_any =
        |topic: &Topic| topic.messages != Some(0) || info.is_some_and(|info| topic.is_called(&info.topic));
    let infos = topics.iter().filter(|topic| topic.type_name == types::CAMERA_INFO && has_any(topic));
    let infos: Vec<_> = infos.collect();
    let wanted = info.and_then(|info| infos.iter().find(|topic| topic.is_called(&info.topic)));
    if let (None, Some(Info { topic, is_named: true, .. })) = (wanted, info) {
        let meant = nearest(infos.into_iter(), topic);
        return Err(refused(&format!(" on {topic}, where -r has it read{meant}")));
    }
    let [sibling, beside] = form.camera_infos_beside(&image.name);
    let named = |name: &str| infos.iter().find(|topic| topic.name == name);
    let found = wanted.or_else(|| named(&sibling)).or_else(|| named(&beside));
    match (found, &infos[..]) {
        (Some(found), _) | (None, [found]) => Ok(found.name.clone()),
        _ => Err(refused(&format!(
            " on {sibling}, or where -r {}:=TOPIC says ({} in the bag)",
            info.map_or(Info::PLAIN, |info| &info.plain),
            infos.len()
        ))),
    }
}

/// The bag's topics, one a line.
fn held(topics: &[Topic]) -> String {
    if topics.is_empty() {
        return " nothing".to_owned();
    }
    topics.iter().fold(String::new(), |mut list, topic| {
        let count = topic.messages.map_or_else(|| "?".to_owned(), |count| count.to_string());
        let kind = if topic.type_name.is_empty() { "a type it does not tell" } else { &topic.type_name };
        let encoding = if topic.encoding == "cdr" { String::new() } else { format!(" ({})", topic.encoding) };
        let line = format!("{} {count} x {kind}{encoding}", topic.name);
        // Writing to a text does not fail.
        let _ = write!(list, "\n  {}", one_line(&line));
        list
    })
}

#[cfg(test)]
mod tests;
