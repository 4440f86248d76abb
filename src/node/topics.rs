//! The names of what the node reads, sends and serves, over whatever middleware.

use std::collections::BTreeMap;

use super::parameters::{self, ParameterService};
use super::transport::{DepthTopics, Form, SensorTopics, Service, TopicName};
use crate::args::{ArgsError, Setup};
use crate::config::Sensor;
use crate::msg::sent;
use crate::msg::types::COMPRESSED_DEPTH;

/// A topic that nobody reads.
pub(super) const PULSE: &str = "~/_pulse";

impl Setup {
    /// Whether all names can be, before anything is done.
    ///
    /// # Errors
    /// At the first that cannot.
    pub fn check_names(&self) -> Result<(), ArgsError> {
        self.inputs()?;
        let others = ["/tf", "/tf_static", "/clock", parameters::EVENTS.name, PULSE];
        for name in sent::TOPICS.map(|topic| topic.name).into_iter().chain(others) {
            self.resolve(name)?;
        }
        let services = [Service::Reset, Service::Save].map(Service::name);
        for name in services.into_iter().chain(ParameterService::ALL.map(|service| service.named().name)) {
            self.resolve_service(name)?;
        }
        Ok(())
    }

    /// The topics that scans are read from, by sensor.
    pub(super) fn inputs(&self) -> Result<Vec<SensorTopics>, ArgsError> {
        let sensors: Vec<_> =
            self.config().sensors.iter().map(|sensor| topics(self, sensor)).collect::<Result<_, _>>()?;
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
}

/// The type that DDS calls `sensor_msgs::msg::dds_::PointCloud2_`, as ROS writes it.
pub(super) fn ros_type(dds: &str) -> String {
    let plain = dds.replace("::dds_::", "::");
    plain.strip_suffix('_').unwrap_or(&plain).replace("::", "/")
}

fn topics(setup: &Setup, sensor: &Sensor) -> Result<SensorTopics, ArgsError> {
    let named = |plain: &str| -> Result<_, ArgsError> {
        Ok(TopicName { resolved: setup.resolve(plain)?, plain: plain.to_owned() })
    };
    let depth = |(image, camera_info): (String, String)| -> Result<_, ArgsError> {
        let image = named(&image)?;
        // `image_transport` puts it below the image, whatever that is remapped to; it can be remapped again.
        let compressed = setup.resolve(&(image.resolved.clone() + COMPRESSED_DEPTH))?;
        Ok(DepthTopics { image, camera_info: named(&camera_info)?, compressed })
    };
    Ok(SensorTopics {
        name: sensor.name.clone(),
        points: sensor.points().map(named).transpose()?,
        depth: sensor.image().zip(sensor.camera_info()).map(depth).transpose()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Environment;

    #[test]
    fn names_that_cannot_be_are_refused_before_anything_is_done() {
        let check = |rule: &str| {
            let args = ["cfodi", "run", "--ros-args", "-r", rule].map(str::to_owned);
            Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0.check_names()
        };
        check("points:=/a/b").unwrap();
        assert!(matches!(check("points:=/a//b"), Err(ArgsError::Name(..) | ArgsError::Form(_))));
        assert!(matches!(check("/tf:=a b"), Err(ArgsError::Name(..) | ArgsError::Form(_))));
        assert!(matches!(check("~/save:=1"), Err(ArgsError::Name(..) | ArgsError::Form(_))));
        assert!(matches!(check("rosservice://~/save:=1"), Err(ArgsError::Name(..) | ArgsError::Form(_))));
        check("rostopic://~/save:=1").unwrap();
    }

    #[test]
    fn a_type_name_of_dds_reads_as_in_ros() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::PointCloud2_"), "sensor_msgs/msg/PointCloud2");
        assert_eq!(ros_type("a::msg::dds_::B__"), "a/msg/B_", "one letter is of DDS");
        assert_eq!(ros_type("plain"), "plain");
    }

    #[test]
    fn two_sensors_on_one_topic_are_refused_by_their_names() {
        let check = |more: &[&str]| {
            let args = ["cfodi", "run", "--ros-args", "-p", "sensors:=[front, rear]"];
            let args: Vec<_> = args.iter().chain(more).map(|&arg| arg.to_owned()).collect();
            Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0.check_names()
        };
        check(&[]).unwrap();
        let error = check(&["-r", "rear:=/front"]).unwrap_err().to_string();
        assert!(error.starts_with("the sensors front and rear are both read from /front"), "{error}");
        let images = ["-p", "front.kind:=depth", "-p", "rear.kind:=depth", "-r", "rear/image:=/front/image"];
        assert!(matches!(check(&images), Err(ArgsError::SameTopic { .. })));
    }
}
