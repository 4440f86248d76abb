//! The topics of a setup: those that its sensors are read from, and whether the names of all can be.

use std::collections::BTreeMap;
use std::fmt;

use super::{ArgsError, Setup};
use crate::bag::TransformTopics;
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

/// A topic that a sensor is read from, and as what.
#[derive(Debug)]
struct Reading<'a> {
    topic: &'a str,
    sensor: &'a str,
    what: What,
    /// What a rule for it begins with.
    name: String,
}

/// What a sensor's topic carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Scans(Form),
    CameraInfo,
}

impl fmt::Display for Reading<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.what {
            What::Scans(Form::Points) => "clouds",
            What::Scans(Form::Depth) => "depth images",
            What::Scans(Form::CompressedDepth) => "compressed depth images",
            What::CameraInfo => "camera info",
        };
        write!(f, "{what} (`{}`)", self.name)
    }
}

impl Reading<'_> {
    /// Whether the same topic can be read so, too. The cameras of two sensors may share their intrinsics.
    fn check_beside(&self, other: &Reading<'_>) -> Result<(), ArgsError> {
        let topic = self.topic.to_owned();
        match (self.what, other.what) {
            (What::CameraInfo, What::CameraInfo) => Ok(()),
            (What::Scans(_), What::Scans(_)) if self.sensor != other.sensor => {
                let [first, second] = [self.sensor, other.sensor].map(str::to_owned);
                Err(ArgsError::SameTopic { first, second, topic })
            }
            _ => Err(ArgsError::TwoTypes { first: self.to_string(), second: other.to_string(), topic }),
        }
    }
}

impl SensorTopics {
    /// All topics of the sensor.
    fn readings(&self) -> Vec<Reading<'_>> {
        let mut readings = Vec::new();
        let mut add = |topic, what, name: &str| {
            readings.push(Reading { topic, sensor: &self.name, what, name: name.to_owned() });
        };
        if let Some(TopicName { plain, resolved }) = &self.points {
            add(resolved, What::Scans(Form::Points), plain);
        }
        if let Some(DepthTopics { image, camera_info, compressed }) = &self.depth {
            add(&image.resolved, What::Scans(Form::Depth), &image.plain);
            let beside = image.resolved.clone() + COMPRESSED_DEPTH;
            add(compressed, What::Scans(Form::CompressedDepth), &beside);
            add(&camera_info.resolved, What::CameraInfo, &camera_info.plain);
        }
        readings
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
    /// When a name is none, when two sensors would be read from one topic, or when one topic would be read as two things.
    pub fn sensor_topics(&self) -> Result<Vec<SensorTopics>, ArgsError> {
        let sensors: Vec<_> =
            self.config().sensors.iter().map(|sensor| self.topics_of(sensor)).collect::<Result<_, _>>()?;
        let mut readings = BTreeMap::new();
        for reading in sensors.iter().flat_map(SensorTopics::readings) {
            if let Some(first) = readings.insert(reading.topic, reading) {
                first.check_beside(&readings[first.topic])?;
            }
        }
        Ok(sensors)
    }

    /// The topics that transforms are read from, fully qualified.
    ///
    /// # Errors
    /// When a name, or what a rule makes of it, is none.
    pub fn transform_topics(&self) -> Result<TransformTopics, ArgsError> {
        let TransformTopics { changing, lasting } = TransformTopics::default();
        Ok(TransformTopics { changing: self.resolve(&changing)?, lasting: self.resolve(&lasting)? })
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

    #[test]
    fn a_topic_that_would_be_read_as_two_things_is_refused_with_both() {
        let line = |arguments: &str| {
            let args: Vec<_> = format!("run --ros-args {arguments}").split(' ').map(str::to_owned).collect();
            let checked = Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0.check_topics();
            checked.map_err(|error| error.to_string())
        };
        let refused = |topic: &str, first: &str, second: &str| {
            let end = "it can carry one of them; give the other another topic with -r";
            Err(format!("{topic} is read as {first} and as {second}: {end}"))
        };
        let (clouds, images) = ("clouds (`points`)", "depth images (`depth/image`)");
        assert_eq!(line("-r depth/image:=/points"), refused("/points", clouds, images));
        assert_eq!(line("-r points:=/depth/image"), refused("/depth/image", clouds, images));
        let compressed = "compressed depth images (`/depth/image/compressedDepth`)";
        let beside = "/depth/image/compressedDepth";
        assert_eq!(line(&format!("-r points:={beside}")), refused(beside, clouds, compressed));
        assert_eq!(line(&format!("-r {beside}:=/depth/image")), refused("/depth/image", images, compressed));
        let info = "camera info (`depth/camera_info`)";
        assert_eq!(line("-r depth/camera_info:=/points"), refused("/points", clouds, info));
        assert_eq!(line("-r depth/camera_info:=/depth/image"), refused("/depth/image", images, info));
        let two = "-p sensors:=[a,b] -p a.kind:=depth -p b.kind:=depth";
        let info = "camera info (`a/camera_info`)";
        let images = "depth images (`b/image`)";
        assert_eq!(
            line(&format!("{two} -r b/image:=/a/camera_info")),
            refused("/a/camera_info", info, images)
        );
        // Both images of one camera, say: they have its intrinsics.
        assert_eq!(line(&format!("{two} -r b/camera_info:=/a/camera_info")), Ok(()));
        assert_eq!(line("-p points.kind:=cloud -r depth/image:=/points"), Ok(()), "no image is read");
    }
}
