//! What the messages of a bag say: scans and transforms.

use std::collections::BTreeSet;

use super::choose::{Sensor, form_of};
use super::read::Message;
use super::topic::Topic;
use crate::cloud::{
    Camera, CloudError, CloudFilter, CloudSeed, CompressedSeed, Decoded, DepthSeed, Optical, distortion,
    is_optical_by_name, is_rectified_by_name, other_frame,
};
use crate::msg::cdr::{read, read_with};
use crate::msg::form::Form;
use crate::msg::heard::{TF, TF_STATIC};
use crate::msg::ros::{CameraInfo, TfMessage};
use crate::msg::types;

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
pub enum Recorded {
    /// A scan of a sensor.
    Cloud {
        /// Its place among those of [`Decoder::new`].
        sensor: usize,
        /// The scan, or what is wrong with it.
        cloud: Decoded,
    },
    /// Transforms.
    Transforms {
        /// The message.
        message: TfMessage,
        /// Whether they hold for all time.
        is_static: bool,
    },
    /// What is to be said of a camera, once: its lens distortion, which is not undone, unless its images have the name of rectified
    /// ones; or that the intrinsics are of another frame than the images.
    Doubt(String),
    /// A message of a topic that is read, but not a readable one.
    Undecodable {
        /// The topic.
        topic: String,
        /// What is wrong.
        text: String,
    },
}

/// The topics that transforms are read from, with or without the slash before them.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TransformTopics {
    /// Of those that change.
    pub changing: String,
    /// Of those that hold for all time.
    pub lasting: String,
}

impl Default for TransformTopics {
    fn default() -> Self {
        Self { changing: TF.name.to_owned(), lasting: TF_STATIC.name.to_owned() }
    }
}

impl TransformTopics {
    /// Whether a topic is one of the two.
    pub fn has(&self, topic: &str) -> bool {
        self.is_static(topic).is_some()
    }

    /// The pairs that topics of these names are of, each once.
    pub fn pairs<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<Self> {
        names.into_iter().map(Self::like).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// Whether those of a topic hold for all time; `None` where it is neither.
    fn is_static(&self, topic: &str) -> Option<bool> {
        let is = |name: &str| bare(name) == bare(topic);
        if is(&self.lasting) { Some(true) } else { is(&self.changing).then_some(false) }
    }

    /// Which of a bag's topics have transforms.
    pub fn all(topics: &[Topic]) -> impl Iterator<Item = &str> {
        topics.iter().filter(|topic| is_transforms(&topic.type_name)).map(|topic| topic.name.as_str())
    }

    /// The topics of transforms in a bag that are not read, where one of those that are read is missing.
    pub fn passed_over(&self, topics: &[Topic]) -> Vec<String> {
        if let Some(Elsewhere::Pair(_)) = self.elsewhere(topics) {
            return Vec::new();
        }
        let of_transforms = || topics.iter().filter(|topic| is_transforms(&topic.type_name));
        let kinds: BTreeSet<_> = of_transforms().filter_map(|topic| self.is_static(&topic.name)).collect();
        let unread = of_transforms().filter(|topic| kinds.len() < 2 && self.is_static(&topic.name).is_none());
        unread.map(|topic| topic.name.clone()).collect()
    }

    /// Where the transforms of a bag are that has none on those topics; `None` where it has some there, or none at all.
    pub fn elsewhere(&self, topics: &[Topic]) -> Option<Elsewhere> {
        let has_some = |topic: &&Topic| is_transforms(&topic.type_name) && topic.messages != Some(0);
        let names: BTreeSet<_> = topics.iter().filter(has_some).map(|topic| topic.name.as_str()).collect();
        if names.is_empty() || names.iter().any(|name| self.has(name)) {
            return None;
        }
        let choices = Self::pairs(names);
        // Who has named other topics than the usual ones means those.
        let is_usual = *self == Self::default();
        let pair =
            choices.first().filter(|pair| is_usual && choices.len() == 1 && pair.lasting != pair.changing);
        Some(match pair {
            Some(pair) => Elsewhere::Pair(pair.clone()),
            None => Elsewhere::Several(choices),
        })
    }

    /// The pair that a topic is one of by its name; it alone, where its name does not tell.
    fn like(name: &str) -> Self {
        let namespace = name.strip_suffix(TF_STATIC.name).or_else(|| name.strip_suffix(TF.name));
        let named =
            |end: &str| namespace.map_or_else(|| name.to_owned(), |namespace| format!("{namespace}{end}"));
        Self { changing: named(TF.name), lasting: named(TF_STATIC.name) }
    }

    /// The arguments that have these read.
    fn remappings(&self) -> String {
        let Self { changing, lasting } = self;
        if changing == lasting {
            format!("-r /tf:={changing}")
        } else {
            format!("-r /tf:={changing} -r /tf_static:={lasting}")
        }
    }
}

/// Where the transforms of a bag are, if not on the topics that are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Elsewhere {
    /// On one other pair alone, where the usual one was to be read.
    Pair(TransformTopics),
    /// On these.
    Several(Vec<TransformTopics>),
}

impl Elsewhere {
    /// The arguments that have each of them read.
    pub fn remappings(topics: &[TransformTopics]) -> String {
        topics.iter().map(TransformTopics::remappings).collect::<Vec<_>>().join(", or ")
    }
}

fn bare(topic: &str) -> &str {
    topic.trim_start_matches('/')
}

/// Reads the messages of the chosen sensors, and the transforms.
#[derive(Clone, Debug)]
pub struct Decoder {
    filter: CloudFilter,
    sensors: Vec<Input>,
    transforms: TransformTopics,
}

#[derive(Clone, Debug)]
struct Input {
    sensor: Sensor,
    /// The newest so far, or what is wrong with it. Before its first message has come in its turn, it is that of this first
    /// message, where [`Decoder::look_for_cameras`] has found it.
    camera: Option<Result<Camera, CloudError>>,
    /// The frame of these intrinsics.
    frame: String,
    /// Whether a message of it has come in its turn.
    has_come: bool,
    /// Whether it was said that images are in another frame.
    has_other_frame: bool,
}

impl Decoder {
    /// Reads these sensors.
    pub fn new(sensors: Vec<Sensor>, filter: CloudFilter, transforms: TransformTopics) -> Self {
        let input = |sensor| Input {
            sensor,
            camera: None,
            frame: String::new(),
            has_come: false,
            has_other_frame: false,
        };
        Self { filter, sensors: sensors.into_iter().map(input).collect(), transforms }
    }

    /// The topics that transforms are read from.
    pub const fn transform_topics(&self) -> &TransformTopics {
        &self.transforms
    }

    /// Reads transforms from these topics.
    pub fn read_transforms_from(&mut self, transforms: TransformTopics) {
        self.transforms = transforms;
    }

    /// A decoder of the transforms alone, without sensors.
    #[must_use]
    pub fn of_transforms(&self) -> Self {
        Self { filter: self.filter, sensors: Vec::new(), transforms: self.transforms.clone() }
    }

    /// Whether the axes of what a sensor sends in this frame are optical: z ahead, x right, y down.
    pub fn is_optical(&self, sensor: usize, frame: &str) -> bool {
        let is_image = self.sensors.get(sensor).is_some_and(|input| input.sensor.form != Form::Points);
        is_image
            || match self.filter.optical {
                Optical::Auto => is_optical_by_name(frame),
                given => given.of_frame(frame),
            }
    }

    /// Takes the first intrinsics of each camera out of these messages, for the images before them: drivers send both together
    /// in either order, and some send intrinsics seldom. Reads no further than it must.
    pub fn look_for_cameras(&mut self, mut messages: impl Iterator<Item = Message>) {
        while self.sensors.iter().any(Input::lacks_camera) {
            let Some(message) = messages.next() else { return };
            self.sensors.iter_mut().for_each(|input| input.look_for_camera(&message));
        }
    }

    /// What a message says; nothing where its topic is not read.
    pub fn decode(&mut self, message: &Message) -> Vec<Recorded> {
        if is_transforms(message.type_name()) {
            return self.transforms(message).into_iter().collect();
        }
        let Self { filter, sensors, .. } = self;
        let of_sensor = |(place, input): (usize, &mut Input)| input.decode(place, message, filter);
        sensors.iter_mut().enumerate().flat_map(of_sensor).flatten().collect()
    }

    fn transforms(&self, message: &Message) -> Option<Recorded> {
        let is_static = self.transforms.is_static(message.topic())?;
        Some(match message.plain().and_then(read) {
            Ok(message) => Recorded::Transforms { message, is_static },
            Err(text) => Recorded::Undecodable { topic: message.topic().to_owned(), text },
        })
    }
}

impl Input {
    fn lacks_camera(&self) -> bool {
        self.sensor.info_topic.is_some() && self.camera.is_none()
    }

    fn is_info(&self, message: &Message) -> bool {
        self.sensor.info_topic.as_deref() == Some(message.topic())
    }

    fn look_for_camera(&mut self, message: &Message) {
        if self.lacks_camera() && self.is_info(message) {
            // What is not readable is said when its turn comes.
            if let Ok(info) = message.plain().and_then(read::<CameraInfo>) {
                self.take(&info);
            }
        }
    }

    fn take(&mut self, info: &CameraInfo) {
        self.camera = Some(Camera::from_info(info));
        self.frame.clone_from(&info.header.frame_id);
    }

    fn decode(&mut self, sensor: usize, message: &Message, filter: &CloudFilter) -> [Option<Recorded>; 2] {
        // A topic may have channels of several types.
        let form = || form_of(message.type_name(), &message.channel.message_encoding);
        if message.topic() == self.sensor.topic && form() == Some(self.sensor.form) {
            let cloud = self.cloud(message, filter);
            return [self.other_frame(&cloud), Some(Recorded::Cloud { sensor, cloud })];
        }
        if self.is_info(message) && message.type_name() == types::CAMERA_INFO {
            [self.intrinsics(message), None]
        } else {
            [None, None]
        }
    }

    /// What is to be said of the first image that is in another frame than its intrinsics.
    fn other_frame(&mut self, cloud: &Decoded) -> Option<Recorded> {
        let (Ok(cloud), Some(info), false) = (cloud, &self.sensor.info_topic, self.has_other_frame) else {
            return None;
        };
        let line = other_frame([&self.sensor.topic, info], [&cloud.frame_id, &self.frame])?;
        self.has_other_frame = true;
        Some(Recorded::Doubt(line))
    }

    fn intrinsics(&mut self, message: &Message) -> Option<Recorded> {
        let topic = message.topic().to_owned();
        match message.plain().and_then(read::<CameraInfo>) {
            Ok(info) => {
                self.take(&info);
                let image = &self.sensor.topic;
                let is_distorted = matches!(&self.camera, Some(Ok(camera)) if camera.is_distorted())
                    && !is_rectified_by_name(image);
                let is_first = !std::mem::replace(&mut self.has_come, true);
                (is_first && is_distorted).then(|| Recorded::Doubt(distortion(&topic, image)))
            }
            Err(text) => Some(Recorded::Undecodable { topic, text }),
        }
    }

    fn cloud(&self, message: &Message, filter: &CloudFilter) -> Decoded {
        let data = message.plain().map_err(CloudError::Undecodable)?;
        let camera = || self.camera.clone().unwrap_or(Err(CloudError::NoCameraInfo));
        let seeded = match self.sensor.form {
            Form::Points => read_with(data, CloudSeed::new(*filter)),
            Form::Depth => read_with(data, DepthSeed::new(camera()?, *filter)),
            Form::CompressedDepth => read_with(data, CompressedSeed::new(camera()?, *filter)),
        };
        seeded.unwrap_or_else(|text| Err(CloudError::Undecodable(text)))
    }
}

/// Whether messages of this type are transforms: as ROS 2 has it, and as bags from ROS 1 may still call it.
pub(super) fn is_transforms(type_name: &str) -> bool {
    matches!(type_name, types::TRANSFORMS | "tf/msg/tfMessage")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bag(names: &[&str]) -> Vec<Topic> {
        let topic = |name: &&str| Topic {
            name: (*name).to_owned(),
            type_name: "tf2_msgs/msg/TFMessage".to_owned(),
            encoding: "cdr".to_owned(),
            messages: Some(u64::from(!name.starts_with("/empty"))),
        };
        names.iter().map(topic).collect()
    }

    fn pair(changing: &str, lasting: &str) -> TransformTopics {
        TransformTopics { changing: changing.to_owned(), lasting: lasting.to_owned() }
    }

    #[test]
    fn the_only_other_pair_of_topics_is_taken_where_nothing_is_on_the_usual_one() {
        let usual = TransformTopics::default();
        let robot = || pair("/robot1/tf", "/robot1/tf_static");
        for names in
            [&["/robot1/tf", "/robot1/tf_static"][..], &["/robot1/tf", "/empty/tf"], &["/robot1/tf_static"]]
        {
            let topics = bag(names);
            assert_eq!(usual.elsewhere(&topics), Some(Elsewhere::Pair(robot())), "{names:?}");
            assert_eq!(usual.passed_over(&topics), [""; 0]);
        }
        for names in [&["/robot1/tf", "/tf_static"][..], &["tf"], &["/empty/tf"], &[]] {
            assert_eq!(usual.elsewhere(&bag(names)), None, "{names:?}");
        }
        let mine = pair("/mine/tf", "/mine/tf_static");
        assert_eq!(mine.elsewhere(&bag(&["/robot1/tf"])), Some(Elsewhere::Several(vec![robot()])));
    }

    #[test]
    fn of_several_pairs_each_is_named_with_what_has_it_read() {
        let remappings = |names: &[&str]| match TransformTopics::default().elsewhere(&bag(names)) {
            Some(Elsewhere::Several(choices)) => Elsewhere::remappings(&choices),
            other => panic!("{other:?}"),
        };
        assert_eq!(
            remappings(&["/a/tf", "/a/tf_static", "/b/tf"]),
            "-r /tf:=/a/tf -r /tf_static:=/a/tf_static, or -r /tf:=/b/tf -r /tf_static:=/b/tf_static"
        );
        assert_eq!(remappings(&["/poses"]), "-r /tf:=/poses");
    }
}
