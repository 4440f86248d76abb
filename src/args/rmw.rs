//! Which middleware the node talks over, as ROS chooses it.

use thiserror::Error;

/// What ROS calls Zenoh.
const ZENOH: &str = "rmw_zenoh_cpp";

/// What ROS calls `CycloneDDS`.
const CYCLONE: &str = "rmw_cyclonedds_cpp";

/// What ROS calls implementations of DDS, which all hear each other; calls are another matter, see [`Rmw::calls_by_header`].
const DDS: [&str; 6] = [
    "rmw_fastrtps_cpp",
    "rmw_fastrtps_dynamic_cpp",
    CYCLONE,
    "rmw_connextdds",
    "rmw_connextddsmicro",
    "rmw_gurumdds_cpp",
];

/// The middleware that the node talks over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rmw {
    /// DDS.
    Dds,
    /// Zenoh, where it was built in.
    #[cfg(feature = "zenoh")]
    Zenoh,
}

/// A middleware that was asked for and cannot be had: the node's peers would not hear it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum RmwError {
    /// `RMW_IMPLEMENTATION` names none that is known.
    #[error("RMW_IMPLEMENTATION is {0:?}; it must be `{ZENOH}`, or for DDS one of {list}", list = DDS.join(", "))]
    Unknown(String),
    /// The cargo feature `zenoh` is absent.
    #[error(
        "RMW_IMPLEMENTATION is {ZENOH}, and Zenoh was not built in: build with `cargo install --path . --features zenoh`"
    )]
    NotBuiltIn,
}

impl Rmw {
    /// The one that `RMW_IMPLEMENTATION` names: DDS where it names none.
    ///
    /// # Errors
    /// When it cannot be had.
    pub fn named(name: &str) -> Result<Self, RmwError> {
        match name {
            #[cfg(feature = "zenoh")]
            ZENOH => Ok(Self::Zenoh),
            #[cfg(not(feature = "zenoh"))]
            ZENOH => Err(RmwError::NotBuiltIn),
            name if name.is_empty() || DDS.contains(&name) => Ok(Self::Dds),
            other => Err(RmwError::Unknown(other.to_owned())),
        }
    }

    /// Whether its calls of services begin with a header of their own, as those of `CycloneDDS` do: the others read past the
    /// request there, and none of the two understands the other's calls.
    pub fn calls_by_header(name: &str) -> bool {
        name == CYCLONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rmw_implementation_chooses_as_in_ros_and_what_it_cannot_be_is_refused() {
        for name in ["", "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"] {
            assert_eq!(Rmw::named(name), Ok(Rmw::Dds));
        }
        #[cfg(feature = "zenoh")]
        assert_eq!(Rmw::named("rmw_zenoh_cpp"), Ok(Rmw::Zenoh));
        #[cfg(not(feature = "zenoh"))]
        assert_eq!(Rmw::named("rmw_zenoh_cpp"), Err(RmwError::NotBuiltIn));
        let error = RmwError::NotBuiltIn.to_string();
        assert!(error.ends_with("build with `cargo install --path . --features zenoh`"), "{error}");
        let error = Rmw::named("rmw_zenoh").unwrap_err().to_string();
        assert!(
            error.starts_with("RMW_IMPLEMENTATION is \"rmw_zenoh\"; it must be `rmw_zenoh_cpp`"),
            "{error}"
        );
    }
}
