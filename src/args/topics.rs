//! The topics of a setup: those that its sensors are read from, and whether the names of all can be.

use std::collections::BTreeMap;

use super::{ArgsError, Setup};
use crate::config::Sensor;
use crate::msg::form::Form;
use crate::msg::types::COMPRESSED_DEPTH;
use crate::msg::{heard, sent};

/// A topic that is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TopicName {
    /// As a remapping names it: `points`.
    pub plain: String,
    /// Fully qualified, remappings applied.
    pub resolved: String,
}

/// The topics that one sensor's scans come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SensorTopics {
    /// The sensor's name.
    pub name: String,
    /// Its clouds.
    pub points: Option<TopicName>,
    /// Its depth images.
    pub depth: Option<DepthTopics>,
}

/// The topics of depth images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DepthTopics {
    /// The images.
    pub image: TopicName,
    /// The camera's intrinsics, which both kinds of depth image need.
    pub camera_info: TopicName,
    /// Fully qualified; `compressedDepth` below the images.
    pub compressed: String,
}

impl SensorTopics {
    /// The topic of a form, where the sensor is read in it.
    pub fn topic(&self, form: Form) -> Option<&str> {
        match form {
            Form::Points => self.points.as_ref().map(|points| points.resolved.as_str()),
            Form::Depth => self.depth.as_ref().map(|depth| depth.image.resolved.as_str()),
            Form::CompressedDepth => self.depth.as_ref().map(|depth| depth.compressed.as_str()),
        }
    }
}

impl Setup {
    /// Whether the names of all topics that are read or sent can be, before anything is done.
    ///
    /// # Errors
    /// At the first that cannot.
    pub fn check_topics(&self) -> Result<(), ArgsError> {
        self.sensor_topics()?;
        let mut names = sent::TOPICS.into_iter().chain(heard::TOPICS).map(|topic| topic.name);
        names.try_for_each(|name| self.resolve(name).map(drop))
    }

    /// The topics that scans are read from, by sensor.
    ///
    /// # Errors
    /// When a name is none, or when two sensors would be read from one topic.
    pub fn sensor_topics(&self) -> Result<Vec<SensorTopics>, ArgsError> {
        let sensors: Vec<_> =
            self.config().sensors.iter().map(|sensor| self.topics_of(sensor)).collect::<Result<_, _>>()?;
        let mut read = BTreeMap::new();
        for sensor in &sensors {
            for topic in Form::ALL.into_iter().filter_map(|form| sensor.topic(form)) {
                if let Some(first) = read.insert(topic, &sensor.name) {
                    let [first, second, topic] = [first, &sensor.name, topic].map(str::to_owned);
                    return Err(ArgsError::SameTopic { first, second, topic });
                }
            }
        }
        Ok(sensors)
    }

    /// A topic by its name before remapping.
    ///
    /// # Errors
    /// When the name, or what a rule makes of it, is none.
    pub fn topic_name(&self, plain: &str) -> Result<TopicName, ArgsError> {
        Ok(TopicName { resolved: self.resolve(plain)?, plain: plain.to_owned() })
    }

    fn topics_of(&self, sensor: &Sensor) -> Result<SensorTopics, ArgsError> {
        let depth = |(image, camera_info): (String, String)| -> Result<_, ArgsError> {
            let image = self.topic_name(&image)?;
            // `image_transport` puts it below the image, whatever that is remapped to; it can be remapped again.
            let compressed = self.resolve(&(image.resolved.clone() + COMPRESSED_DEPTH))?;
            Ok(DepthTopics { image, camera_info: self.topic_name(&camera_info)?, compressed })
        };
        Ok(SensorTopics {
            name: sensor.name.clone(),
            points: sensor.points().map(|points| self.topic_name(points)).transpose()?,
            depth: sensor.image().zip(sensor.camera_info()).map(depth).transpose()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Environment;

    #[test]
    fn two_sensors_on_one_topic_are_refused_by_their_names() {
        let check = |more: &[&str]| {
            let args = ["cfodi", "run", "--ros-args", "-p", "sensors:=[front, rear]"];
            let args: Vec<_> = args.iter().chain(more).map(|&arg| arg.to_owned()).collect();
            Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0.check_topics()
        };
        check(&[]).unwrap();
        let error = check(&["-r", "rear:=/front"]).unwrap_err().to_string();
        assert!(error.starts_with("the sensors front and rear are both read from /front"), "{error}");
        let images = ["-p", "front.kind:=depth", "-p", "rear.kind:=depth", "-r", "rear/image:=/front/image"];
        assert!(matches!(check(&images), Err(ArgsError::SameTopic { .. })));
    }
}
