//! The names of what the node reads, sends and serves, over whatever middleware.

use super::parameters::{self, ParameterService};
use super::transport::Service;
use crate::args::{ArgsError, Setup};

/// A topic that nobody reads.
pub(super) const PULSE: &str = "~/_pulse";

/// Whether all names can be, before anything is done.
///
/// # Errors
/// At the first that cannot.
pub fn check_names(setup: &Setup) -> Result<(), ArgsError> {
    setup.check_topics()?;
    for name in [parameters::EVENTS.name, PULSE] {
        setup.resolve(name)?;
    }
    let services = [Service::Reset, Service::Save].map(Service::name);
    for name in services.into_iter().chain(ParameterService::ALL.map(|service| service.named().name)) {
        setup.resolve_service(name)?;
    }
    Ok(())
}

/// The type that DDS calls `sensor_msgs::msg::dds_::PointCloud2_`, as ROS writes it.
pub(super) fn ros_type(dds: &str) -> String {
    let plain = dds.replace("::dds_::", "::");
    plain.strip_suffix('_').unwrap_or(&plain).replace("::", "/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Environment;

    #[test]
    fn names_that_cannot_be_are_refused_before_anything_is_done() {
        let check = |rule: &str| {
            let args = ["cfodi", "run", "--ros-args", "-r", rule].map(str::to_owned);
            check_names(&Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0)
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
}
