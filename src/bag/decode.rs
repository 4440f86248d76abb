//! What the messages of a bag say: scans and transforms.

use std::collections::BTreeSet;

use super::cdr::{read, read_with};
use super::choose::{Sensor, SensorKind};
use super::read::Message;
use super::topic::Topic;
use crate::cloud::{Camera, Cloud, CloudError, CloudFilter, CloudSeed, CompressedSeed, DepthSeed, Optical};
use crate::msg::ros::{CameraInfo, TfMessage};

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
pub enum Recorded {
    /// A scan of a sensor.
    Cloud {
        /// Its place among those of [`Decoder::new`].
        sensor: usize,
        /// The scan, or what is wrong with it.
        cloud: Result<Cloud, CloudError>,
    },
    /// Transforms.
    Transforms {
        /// The message.
        message: TfMessage,
        /// Whether they hold for all time.
        is_static: bool,
    },
    /// A camera with lens distortion, which is not undone: said once a sensor.
    Distorted {
        /// The topic of its intrinsics.
        topic: String,
    },
    /// A message of a topic that is read, but not a readable one.
    Undecodable {
        /// The topic.
        topic: String,
        /// What is wrong.
        text: String,
    },
}

/// The topics that transforms are read from, with or without the slash before them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TransformTopics {
    /// Of those that change.
    pub changing: String,
    /// Of those that hold for all time.
    pub lasting: String,
}

impl Default for TransformTopics {
    fn default() -> Self {
        Self { changing: "/tf".to_owned(), lasting: "/tf_static".to_owned() }
    }
}

impl TransformTopics {
    /// Whether those of a topic hold for all time; `None` where it is neither.
    fn is_static(&self, topic: &str) -> Option<bool> {
        let is = |name: &str| bare(name) == bare(topic);
        if is(&self.lasting) { Some(true) } else { is(&self.changing).then_some(false) }
    }

    /// The topics of transforms in a bag that are not read, where one of those that are read is missing.
    pub fn passed_over(&self, topics: &[Topic]) -> Vec<String> {
        let of_transforms = || topics.iter().filter(|topic| is_transforms(&topic.type_name));
        let kinds: BTreeSet<_> = of_transforms().filter_map(|topic| self.is_static(&topic.name)).collect();
        let unread = of_transforms().filter(|topic| kinds.len() < 2 && self.is_static(&topic.name).is_none());
        unread.map(|topic| topic.name.clone()).collect()
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
    /// The newest, or what is wrong with it; before the first it is that one, where [`Decoder::look_for_cameras`] has found it.
    camera: Option<Result<Camera, CloudError>>,
    /// Whether it has come by itself.
    has_come: bool,
}

impl Decoder {
    /// Reads these sensors.
    pub fn new(sensors: Vec<Sensor>, filter: CloudFilter, transforms: TransformTopics) -> Self {
        let input = |sensor| Input { sensor, camera: None, has_come: false };
        Self { filter, sensors: sensors.into_iter().map(input).collect(), transforms }
    }

    /// The same without the sensors.
    #[must_use]
    pub fn of_transforms(&self) -> Self {
        Self { filter: self.filter, sensors: Vec::new(), transforms: self.transforms.clone() }
    }

    /// Whether the axes of what a sensor sends in this frame are optical: z ahead, x right, y down.
    pub fn is_optical(&self, sensor: usize, frame: &str) -> bool {
        let optical = self.filter.optical;
        let is_image = self.sensors.get(sensor).is_some_and(|input| input.sensor.kind != SensorKind::Cloud);
        // The name that REP 103 has, which is seldom that of a driver's cloud.
        let is_named = optical == Optical::Auto && frame.ends_with("_optical");
        is_image || is_named || optical.of_frame(frame)
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
        sensors.iter_mut().enumerate().filter_map(of_sensor).collect()
    }

    fn transforms(&self, message: &Message) -> Option<Recorded> {
        let is_static = self.transforms.is_static(message.topic())?;
        Some(match read(&message.data) {
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
            self.camera = read::<CameraInfo>(&message.data).ok().map(|info| Camera::from_info(&info));
        }
    }

    fn decode(&mut self, sensor: usize, message: &Message, filter: &CloudFilter) -> Option<Recorded> {
        if message.topic() == self.sensor.topic {
            return Some(Recorded::Cloud { sensor, cloud: self.scan(&message.data, filter) });
        }
        if self.is_info(message) { self.intrinsics(message) } else { None }
    }

    fn intrinsics(&mut self, message: &Message) -> Option<Recorded> {
        let topic = message.topic().to_owned();
        match read::<CameraInfo>(&message.data) {
            Ok(info) => {
                let camera = Camera::from_info(&info);
                let is_distorted = matches!(&camera, Ok(camera) if camera.is_distorted());
                self.camera = Some(camera);
                let is_first = !std::mem::replace(&mut self.has_come, true);
                (is_first && is_distorted).then_some(Recorded::Distorted { topic })
            }
            Err(text) => Some(Recorded::Undecodable { topic, text }),
        }
    }

    fn scan(&self, data: &[u8], filter: &CloudFilter) -> Result<Cloud, CloudError> {
        let camera = || self.camera.clone().unwrap_or(Err(CloudError::NoCameraInfo));
        let seeded = match self.sensor.kind {
            SensorKind::Cloud => read_with(data, CloudSeed::new(*filter)),
            SensorKind::Depth => read_with(data, DepthSeed::new(camera()?, *filter)),
            SensorKind::CompressedDepth => read_with(data, CompressedSeed::new(camera()?, *filter)),
        };
        seeded.unwrap_or_else(|text| Err(CloudError::Undecodable(text)))
    }
}

/// Whether messages of this type are transforms: as ROS 2 has it, and as bags from ROS 1 may still call it.
pub(super) fn is_transforms(type_name: &str) -> bool {
    matches!(type_name, "tf2_msgs/msg/TFMessage" | "tf/msg/tfMessage")
}
