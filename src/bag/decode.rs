//! What the messages of a bag say: scans and transforms.

use std::collections::VecDeque;

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::de::{DeserializeOwned, DeserializeSeed};

use super::choose::{Sensor, SensorKind};
use super::read::Message;
use crate::cloud::{Camera, Cloud, CloudError, CloudFilter, CloudSeed, CompressedSeed, DepthSeed, Optical};
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

/// Reads the messages of the chosen sensors, and all transforms.
#[derive(Clone, Debug)]
pub struct Decoder {
    filter: CloudFilter,
    sensors: Vec<Input>,
}

#[derive(Clone, Debug)]
struct Input {
    sensor: Sensor,
    /// The newest, or what is wrong with it.
    camera: Option<Result<Camera, CloudError>>,
    /// Images that came before their intrinsics.
    waiting: VecDeque<Vec<u8>>,
}

impl Decoder {
    /// Reads these sensors.
    pub fn new(sensors: Vec<Sensor>, filter: CloudFilter) -> Self {
        let input = |sensor| Input { sensor, camera: None, waiting: VecDeque::new() };
        Self { filter, sensors: sensors.into_iter().map(input).collect() }
    }

    /// Reads transforms alone.
    pub fn transforms_only() -> Self {
        let filter = CloudFilter { min_range: 0.0, max_range: 0.0, optical: Optical::Auto, max_points: 0 };
        Self { filter, sensors: Vec::new() }
    }

    /// What a message says; nothing where its topic is not read. An image can come out later, with its intrinsics.
    pub fn decode(&mut self, message: &Message) -> Vec<Recorded> {
        if is_transforms(message.type_name()) {
            return transforms(message).into_iter().collect();
        }
        let Self { filter, sensors } = self;
        sensors.iter_mut().flat_map(|input| input.decode(message, filter)).collect()
    }

    /// The images whose intrinsics have not come.
    pub fn finish(&mut self) -> Vec<Recorded> {
        let waiting = self.sensors.iter_mut().flat_map(|input| std::mem::take(&mut input.waiting));
        waiting.map(|_| Recorded::Cloud(Err(CloudError::NoCameraInfo))).collect()
    }
}

impl Input {
    fn decode(&mut self, message: &Message, filter: &CloudFilter) -> Vec<Recorded> {
        if message.topic() == self.sensor.topic {
            return self.scan(&message.data, filter).into_iter().collect();
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
                let scans = waiting.iter().filter_map(|image| self.scan(image, filter));
                told.into_iter().chain(scans).collect()
            }
            Err(text) => vec![Recorded::Undecodable { topic: message.topic().to_owned(), text }],
        }
    }

    fn scan(&mut self, data: &[u8], filter: &CloudFilter) -> Option<Recorded> {
        let seeded = match (self.sensor.kind, &self.camera) {
            (SensorKind::Cloud, _) => read_with(data, CloudSeed::new(*filter)),
            (_, Some(Err(error))) => return Some(Recorded::Cloud(Err(error.clone()))),
            (SensorKind::Depth, Some(Ok(camera))) => read_with(data, DepthSeed::new(*camera, *filter)),
            (SensorKind::CompressedDepth, Some(Ok(camera))) => {
                read_with(data, CompressedSeed::new(*camera, *filter))
            }
            (_, None) => return self.wait(data.to_owned()),
        };
        let cloud = seeded.unwrap_or_else(|text| Err(CloudError::Undecodable(text)));
        Some(Recorded::Cloud(cloud))
    }

    /// Keeps an image; the oldest is given up where too many wait.
    fn wait(&mut self, image: Vec<u8>) -> Option<Recorded> {
        self.waiting.push_back(image);
        let too_many = self.waiting.len() > IMAGES;
        too_many.then(|| self.waiting.pop_front())?.map(|_| Recorded::Cloud(Err(CloudError::NoCameraInfo)))
    }
}

/// Whether messages of this type are transforms: as ROS 2 has it, and as bags from ROS 1 may still call it.
pub(super) fn is_transforms(type_name: &str) -> bool {
    matches!(type_name, "tf2_msgs/msg/TFMessage" | "tf/msg/tfMessage")
}

fn transforms(message: &Message) -> Option<Recorded> {
    let is_static = match message.topic().trim_start_matches('/') {
        "tf" => false,
        "tf_static" => true,
        _ => return None,
    };
    Some(match read(&message.data) {
        Ok(message) => Recorded::Transforms { message, is_static },
        Err(text) => Recorded::Undecodable { topic: message.topic().to_owned(), text },
    })
}

fn read<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    read_with(data, std::marker::PhantomData)
}

/// Reads CDR: four bytes that tell the order of bytes, then the message.
fn read_with<'de, S: DeserializeSeed<'de>>(data: &'de [u8], seed: S) -> Result<S::Value, String> {
    let read = match data {
        [0, 1, _, _, body @ ..] => seed.deserialize(&mut CdrDeserializer::<LittleEndian>::new(body)),
        [0, 0, _, _, body @ ..] => seed.deserialize(&mut CdrDeserializer::<BigEndian>::new(body)),
        _ => {
            let begin = data[..data.len().min(4)].escape_ascii();
            return Err(format!("{} bytes that begin with \"{begin}\" are no message in CDR", data.len()));
        }
    };
    read.map_err(|error| error.to_string())
}
