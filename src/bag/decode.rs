//! What the messages of a bag say: scans and transforms.

use std::collections::{BTreeSet, VecDeque};

use super::cdr::{read, read_with};
use super::choose::{Sensor, SensorKind};
use super::read::Message;
use super::topic::Topic;
use crate::cloud::{Camera, Cloud, CloudError, CloudFilter, CloudSeed, CompressedSeed, DepthSeed};
use crate::msg::ros::{CameraInfo, TfMessage};

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
pub enum Recorded {
    /// A scan of a sensor.
    Cloud(Result<Cloud, CloudError>),
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

/// Images that may wait for their intrinsics: drivers send both together, in either order.
const IMAGES: usize = 8;

/// Bytes of images that may wait, those of all sensors together: eight of 1920 x 1080 pixels in floating point have 63 MiB.
const WAITING_BYTES: usize = 64 << 20;

/// What becomes of an image that has waited in vain.
const NO_CAMERA_INFO: Recorded = Recorded::Cloud(Err(CloudError::NoCameraInfo));

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
    /// The newest, or what is wrong with it.
    camera: Option<Result<Camera, CloudError>>,
    /// Images that came before their intrinsics.
    waiting: VecDeque<Vec<u8>>,
    /// The most that they may have together (bytes).
    room: usize,
}

impl Decoder {
    /// Reads these sensors.
    pub fn new(sensors: Vec<Sensor>, filter: CloudFilter, transforms: TransformTopics) -> Self {
        let cameras = sensors.iter().filter(|sensor| sensor.info_topic.is_some()).count();
        let room = WAITING_BYTES / cameras.max(1);
        let input = |sensor| Input { sensor, camera: None, waiting: VecDeque::new(), room };
        Self { filter, sensors: sensors.into_iter().map(input).collect(), transforms }
    }

    /// The same without the sensors.
    #[must_use]
    pub fn of_transforms(&self) -> Self {
        Self { filter: self.filter, sensors: Vec::new(), transforms: self.transforms.clone() }
    }

    /// What a message says; nothing where its topic is not read. An image can come out later, with its intrinsics.
    pub fn decode(&mut self, message: &Message) -> Vec<Recorded> {
        if is_transforms(message.type_name()) {
            return self.transforms(message).into_iter().collect();
        }
        let Self { filter, sensors, .. } = self;
        sensors.iter_mut().flat_map(|input| input.decode(message, filter)).collect()
    }

    /// The images whose intrinsics have not come.
    pub fn finish(&mut self) -> Vec<Recorded> {
        let waiting = self.sensors.iter_mut().flat_map(|input| std::mem::take(&mut input.waiting));
        waiting.map(|_| NO_CAMERA_INFO).collect()
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
    fn decode(&mut self, message: &Message, filter: &CloudFilter) -> Vec<Recorded> {
        if message.topic() == self.sensor.topic {
            return self.scan(&message.data, filter);
        }
        if self.sensor.info_topic.as_deref() == Some(message.topic()) {
            return self.intrinsics(message, filter);
        }
        Vec::new()
    }

    fn intrinsics(&mut self, message: &Message, filter: &CloudFilter) -> Vec<Recorded> {
        match read::<CameraInfo>(&message.data) {
            Ok(info) => {
                let before = self.camera.replace(Camera::from_info(&info));
                let is_distorted = matches!(&self.camera, Some(Ok(camera)) if camera.is_distorted());
                let told = (before.is_none() && is_distorted)
                    .then(|| Recorded::Distorted { topic: message.topic().to_owned() });
                let waiting = std::mem::take(&mut self.waiting);
                let scans = waiting.iter().flat_map(|image| self.scan(image, filter));
                told.into_iter().chain(scans).collect()
            }
            Err(text) => vec![Recorded::Undecodable { topic: message.topic().to_owned(), text }],
        }
    }

    /// The scan in a message; one that has to wait is none yet, and may push out others.
    fn scan(&mut self, data: &[u8], filter: &CloudFilter) -> Vec<Recorded> {
        let seeded = match (self.sensor.kind, &self.camera) {
            (SensorKind::Cloud, _) => read_with(data, CloudSeed::new(*filter)),
            (_, Some(Err(error))) => return vec![Recorded::Cloud(Err(error.clone()))],
            (SensorKind::Depth, Some(Ok(camera))) => read_with(data, DepthSeed::new(*camera, *filter)),
            (SensorKind::CompressedDepth, Some(Ok(camera))) => {
                read_with(data, CompressedSeed::new(*camera, *filter))
            }
            (_, None) => return self.wait(data),
        };
        let cloud = seeded.unwrap_or_else(|text| Err(CloudError::Undecodable(text)));
        vec![Recorded::Cloud(cloud)]
    }

    /// Keeps an image; the oldest are given up where too many wait or have too many bytes, and one that is too large alone.
    fn wait(&mut self, image: &[u8]) -> Vec<Recorded> {
        if image.len() > self.room {
            return vec![NO_CAMERA_INFO];
        }
        let mut given_up = Vec::new();
        while self.waiting.len() >= IMAGES || self.waiting_bytes() + image.len() > self.room {
            self.waiting.pop_front();
            given_up.push(NO_CAMERA_INFO);
        }
        self.waiting.push_back(image.to_owned());
        given_up
    }

    fn waiting_bytes(&self) -> usize {
        self.waiting.iter().map(Vec::len).sum()
    }
}

/// Whether messages of this type are transforms: as ROS 2 has it, and as bags from ROS 1 may still call it.
pub(super) fn is_transforms(type_name: &str) -> bool {
    matches!(type_name, "tf2_msgs/msg/TFMessage" | "tf/msg/tfMessage")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::*;
    use crate::cloud::Optical;

    /// Reads the depth images of `/0`, `/1` and so on, whose intrinsics do not come.
    fn decoder(sensors: usize) -> Decoder {
        let sensor = |i| Sensor {
            topic: format!("/{i}"),
            kind: SensorKind::Depth,
            info_topic: Some(format!("/{i}/camera_info")),
        };
        let filter = CloudFilter { min_range: 0.4, max_range: 6.0, optical: Optical::Auto, max_points: 1 };
        Decoder::new((0..sensors).map(sensor).collect(), filter, TransformTopics::default())
    }

    /// How many images are given up when one of so many bytes comes on `/0`.
    fn given_up(decoder: &mut Decoder, bytes: usize) -> usize {
        let channel = mcap::Channel {
            id: 0,
            topic: "/0".to_owned(),
            schema: None,
            message_encoding: "cdr".to_owned(),
            metadata: BTreeMap::new(),
        };
        let said = decoder.decode(&Message { channel: Arc::new(channel), log_time: 0, data: vec![0; bytes] });
        assert!(said.iter().all(|recorded| *recorded == NO_CAMERA_INFO), "{said:?}");
        said.len()
    }

    #[test]
    fn eight_images_wait_for_their_camera_and_the_oldest_is_given_up() {
        let mut decoder = decoder(1);
        assert_eq!([100; 10].map(|bytes| given_up(&mut decoder, bytes)), [0, 0, 0, 0, 0, 0, 0, 0, 1, 1]);
        assert_eq!(decoder.finish().len(), 8);
    }

    #[test]
    fn no_more_than_64_mib_of_images_wait_for_their_cameras() {
        let mut decoder_of_one = decoder(1);
        let mebibytes = [20, 20, 20, 20, 30, 65, 60, 4];
        let counts = mebibytes.map(|size: usize| given_up(&mut decoder_of_one, size << 20));
        assert_eq!(counts, [0, 0, 0, 1, 2, 1, 2, 0]);
        assert_eq!(decoder_of_one.finish().len(), 2);
        // Two sensors have half of it each.
        assert_eq!([32, 33].map(|size: usize| given_up(&mut decoder(2), size << 20)), [0, 1]);
    }
}
