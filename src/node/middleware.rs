//! Which middleware the node talks over, as ROS chooses it, and what a process does with one.

use std::future::Future;
use std::net::Ipv4Addr;

use thiserror::Error;
use tokio::sync::mpsc::{Receiver, Sender};

use super::args::{ArgsError, Setup};
use super::record::Record;
use super::security::{Security, SecurityError};
use super::transport::{Event, Transport};

/// Whether Zenoh was built in.
pub const ZENOH_BUILT_IN: bool = cfg!(feature = "zenoh");

/// What ROS calls Zenoh.
const ZENOH: &str = "rmw_zenoh_cpp";

/// What ROS calls implementations of DDS, which all talk to each other.
const DDS: [&str; 6] = [
    "rmw_fastrtps_cpp",
    "rmw_fastrtps_dynamic_cpp",
    "rmw_cyclonedds_cpp",
    "rmw_connextdds",
    "rmw_connextddsmicro",
    "rmw_gurumdds_cpp",
];

/// The middleware that the node talks over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rmw {
    /// DDS.
    Dds,
    /// Zenoh.
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
    /// The one that `RMW_IMPLEMENTATION` names: DDS where it names none. `zenoh_built_in` says whether there is a choice.
    ///
    /// # Errors
    /// When it cannot be had.
    pub fn named(name: &str, zenoh_built_in: bool) -> Result<Self, RmwError> {
        match name {
            ZENOH if zenoh_built_in => Ok(Self::Zenoh),
            ZENOH => Err(RmwError::NotBuiltIn),
            name if name.is_empty() || DDS.contains(&name) => Ok(Self::Dds),
            other => Err(RmwError::Unknown(other.to_owned())),
        }
    }
}

/// The middleware refused something.
#[derive(Debug, Error)]
pub enum OpenError {
    /// With what it was asked for, and its own words.
    #[error("cannot open {what}: {text}")]
    Open {
        /// A topic, service or the participant.
        what: String,
        /// The middleware's words.
        text: String,
    },
    /// A message cannot be read.
    #[error("cannot read the map: {text}")]
    Read {
        /// The middleware's words.
        text: String,
    },
    /// An address that cannot be used.
    #[error("network_interfaces has {address}: {text}")]
    Interface {
        /// As given.
        address: Ipv4Addr,
        /// Why not.
        text: String,
    },
    /// A name that cannot be resolved.
    #[error(transparent)]
    Name(#[from] ArgsError),
    /// A variable of the environment that the middleware cannot be opened by.
    #[error("{name} is {value:?}: {text}")]
    Variable {
        /// The variable.
        name: &'static str,
        /// As given.
        value: String,
        /// What is wrong.
        text: String,
    },
    /// DDS Security was asked for and cannot be had; no socket was opened.
    #[error(transparent)]
    Security(#[from] SecurityError),
}

/// A transport as it was opened: with what others in this process add events by, and where they come out.
pub type Opened<T> = (T, Adding<T>, Receiver<Event<<T as Transport>::Request>>);

/// Adds events to those of a transport.
pub type Adding<T> = Sender<Event<<T as Transport>::Request>>;

/// A transport that a process opens and leaves.
pub trait Middleware: Transport<Request: Send> + Sized {
    /// For a person.
    const NAME: &str;

    /// What the node does about security over this middleware.
    ///
    /// # Errors
    /// When the node must not open a socket.
    fn security(setup: &Setup) -> Result<Security, SecurityError>;

    /// Says in the log what the system gives it, before it is opened.
    fn say_system(setup: &Setup);

    /// Opens the node and starts reading; call it inside a [`tokio::task::LocalSet`]. What it sends goes into `record` too.
    ///
    /// # Errors
    /// When the middleware refuses something, with what it was.
    fn open(
        setup: &Setup,
        security: Security,
        record: Option<Record>,
    ) -> impl Future<Output = Result<Opened<Self>, OpenError>>;

    /// Whether the middleware still does anything; where it does not, [`Self::close`] does not return.
    fn answers(&self) -> impl Future<Output = bool>;

    /// Takes the node off the network. Drop what this returns after the [`tokio::task::LocalSet`]: readers sign off at
    /// what must still be there.
    fn close(self) -> impl Future<Output = impl Sized>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rmw_implementation_chooses_as_in_ros_and_what_it_cannot_be_is_refused() {
        for name in ["", "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"] {
            assert_eq!((Rmw::named(name, true), Rmw::named(name, false)), (Ok(Rmw::Dds), Ok(Rmw::Dds)));
        }
        assert_eq!(Rmw::named("rmw_zenoh_cpp", true), Ok(Rmw::Zenoh));
        let error = Rmw::named("rmw_zenoh_cpp", false).unwrap_err().to_string();
        assert!(error.ends_with("build with `cargo install --path . --features zenoh`"), "{error}");
        let error = Rmw::named("rmw_zenoh", true).unwrap_err().to_string();
        assert!(
            error.starts_with("RMW_IMPLEMENTATION is \"rmw_zenoh\"; it must be `rmw_zenoh_cpp`"),
            "{error}"
        );
    }
}
