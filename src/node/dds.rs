//! [`Transport`] over ROS 2's DDS. The only module that imports `ros2_client` and `rustdds`.
//!
//! Everything runs on the thread of one [`tokio::task::LocalSet`]. Clouds are decoded while the middleware's buffer is
//! borrowed, so no cloud is copied; each subscription is a task that hands events to one bounded channel and waits
//! when it is full: what the middleware then drops shows as a gap in the publisher's sequence numbers.

mod heard;
mod latched;
mod map_reader;
mod mismatch;
mod namesakes;
mod network;
mod opener;
mod outlet;
mod parameters;
mod pulse;
mod read;
mod robot;
mod secure;
mod threads;

use std::borrow::Cow;
use std::cell::RefCell;
use std::net::IpAddr;
use std::rc::Rc;
use std::time::Duration;

use ros2_client::RmwRequestId;
use thiserror::Error;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tracing::warn;

pub use self::map_reader::MapReader;
use self::network::Network;
use self::opener::{Opener, reliable, reliable_output};
use self::read::Memory;
pub use self::robot::Robot;
use super::args::{ArgsError, Setup};
use super::parameters::Parameters;
use super::process::receive_buffer;
use super::record::Record;
use super::security::{Security, SecurityError};
use super::transport::{Event, NetworkState, Outgoing, SendError, SensorTopics, Service, Source, Transport};
use crate::msg::ros::{TriggerRequest, TriggerResponse};

/// The middleware refused something.
#[derive(Debug, Error)]
pub enum DdsError {
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
        address: IpAddr,
        /// Why not.
        text: String,
    },
    /// A name that cannot be resolved.
    #[error(transparent)]
    Name(#[from] ArgsError),
    /// DDS Security was asked for and cannot be had; no socket was opened.
    #[error(transparent)]
    Security(#[from] SecurityError),
}

/// Events that wait for the node; a cloud that finds no place waits in the middleware.
const EVENTS: usize = 16;

/// Time until the network is joined again where an address was not there.
const AGAIN: Duration = Duration::from_secs(5);

/// Tasks that read; each ends with the name of what it read.
type Readers = JoinSet<Cow<'static, str>>;

/// Adds events to those of the network.
pub type Events = mpsc::Sender<Event<RmwRequestId>>;

impl ros2_client::Message for TriggerRequest {}
impl ros2_client::Message for TriggerResponse {}

fn opening<E: std::fmt::Display>(what: &str) -> impl FnOnce(E) -> DdsError {
    move |error| DdsError::Open { what: what.to_owned(), text: error.to_string() }
}

/// Whether all names can be, before anything is done.
///
/// # Errors
/// At the first that cannot.
pub fn check_names(setup: &Setup) -> Result<(), DdsError> {
    ros2args::names::validate_namespace(&setup.namespace).map_err(ArgsError::from)?;
    read::inputs(setup)?;
    let others = [
        Service::Reset.name(),
        Service::Save.name(),
        "/tf",
        "/tf_static",
        "/clock",
        "/parameter_events",
        pulse::TOPIC,
    ];
    let services = parameters::SERVICES.map(|(name, _)| name);
    for name in Outgoing::TOPICS.into_iter().chain(others).chain(services) {
        setup.resolve(name)?;
    }
    Ok(())
}

/// The node on DDS, for as long as it runs: where a thread of the middleware ends, or topics were opened anew too often, the
/// network is joined anew under the same name, and nothing that is known is forgotten.
pub struct Dds {
    setup: Setup,
    security: Security,
    events: Events,
    memory: Memory,
    parameters: Rc<Parameters>,
    network: RefCell<Rc<Network>>,
    inputs: Vec<SensorTopics>,
    /// Fully qualified.
    name: String,
    /// Of its sockets (bytes).
    receive_buffer: usize,
    /// What is sent goes there too.
    record: Option<Record>,
}

impl Dds {
    /// Opens the node and starts reading; call it inside a [`tokio::task::LocalSet`]. What it sends goes into `record` too;
    /// the sender lets others in this process add events.
    ///
    /// # Errors
    /// When the middleware refuses something, with what it was.
    pub fn open(
        setup: &Setup,
        security: Security,
        record: Option<Record>,
    ) -> Result<(Self, Events, mpsc::Receiver<Event<RmwRequestId>>), DdsError> {
        let (events, receiver) = mpsc::channel(EVENTS);
        let memory = Memory::default();
        let begun_with = Parameters::new(setup.fully_qualified_name(), setup.parameters.clone());
        let parameters = Rc::new(begun_with.map_err(ArgsError::from)?);
        let network = Network::open(setup, &security, &memory, &parameters, &events)?;
        let dds = Self {
            setup: setup.clone(),
            security,
            events: events.clone(),
            memory,
            parameters,
            network: RefCell::new(Rc::new(network)),
            inputs: read::inputs(setup)?,
            name: setup.fully_qualified_name(),
            receive_buffer: receive_buffer(setup),
            record,
        };
        Ok((dds, events, receiver))
    }

    /// Takes the node off the network. Drop what this returns after the [`tokio::task::LocalSet`]: readers sign off
    /// at the participant, which must still be there.
    pub async fn close(self) -> impl Sized {
        match Rc::into_inner(self.network.into_inner()) {
            Some(network) => Some(network.close().await),
            None => None,
        }
    }

    /// Whether the middleware still does anything; where it does not, [`Self::close`] does not return.
    pub async fn answers(&self) -> bool {
        self.network().answers().await
    }

    fn network(&self) -> Rc<Network> {
        Rc::clone(&self.network.borrow())
    }

    /// The network before is left without a farewell, for which its threads may be gone.
    async fn join_anew(&self, reason: &str) -> Result<(), DdsError> {
        warn!("{reason}: the network is joined anew, the map stays");
        let anew = Network::open(&self.setup, &self.security, &self.memory, &self.parameters, &self.events)?;
        let before = self.network.replace(Rc::new(anew));
        before.deafen().await;
        Ok(())
    }
}

impl Transport for Dds {
    type Request = RmwRequestId;

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        if let Some(record) = &self.record {
            record.outgoing(&message);
        }
        self.network().publish(message).await
    }

    async fn answer(
        &self,
        service: Service,
        request: RmwRequestId,
        response: TriggerResponse,
    ) -> Result<(), SendError> {
        self.network().answer(service, request, response).await
    }

    fn inputs(&self) -> &[SensorTopics] {
        &self.inputs
    }

    fn sources(&self) -> Vec<Source> {
        self.network().sources()
    }

    fn node_name(&self) -> &str {
        &self.name
    }

    fn network_state(&self) -> NetworkState {
        let network = self.network();
        NetworkState {
            receive_buffer: self.receive_buffer,
            mismatches: network.mismatches(),
            namesakes: network.namesakes(&self.memory),
        }
    }

    async fn failed(&self) -> String {
        loop {
            let network = self.network();
            let reason = tokio::select! {
                reason = network.reader_ended() => return reason,
                reason = network.held() => return reason,
                reason = network.worn_out() => reason,
            };
            drop(network);
            match self.join_anew(&reason).await {
                Ok(()) => {}
                // After a sleep a wireless interface comes back late.
                Err(error @ DdsError::Interface { .. }) => {
                    warn!("{error}; it is tried again in {} s", AGAIN.as_secs());
                    tokio::time::sleep(AGAIN).await;
                }
                Err(error) => return error.to_string(),
            }
        }
    }
}

/// `sensor_msgs::msg::dds_::PointCloud2_` as ROS writes it.
fn ros_type(dds: &str) -> String {
    let plain = dds.replace("::dds_::", "::");
    plain.trim_end_matches('_').replace("::", "/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::args::Environment;

    #[test]
    fn names_that_cannot_be_are_refused_before_anything_is_done() {
        let check = |rule: &str| {
            let args = ["cfodi", "run", "--ros-args", "-r", rule].map(str::to_owned);
            check_names(&Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0)
        };
        check("points:=/a/b").unwrap();
        assert!(matches!(check("points:=/a//b"), Err(DdsError::Name(_))));
        assert!(matches!(check("/tf:=a b"), Err(DdsError::Name(_))));
        assert!(matches!(check("~/save:=1"), Err(DdsError::Name(_))));
        for namespace in ["__ns:=/a//b", "__ns:=/a/", "__ns:=/1"] {
            assert!(matches!(check(namespace), Err(DdsError::Name(_))), "{namespace}");
        }
    }

    #[test]
    fn two_sensors_on_one_topic_are_refused_by_their_names() {
        let check = |more: &[&str]| {
            let args = ["cfodi", "run", "--ros-args", "-p", "sensors:=[front, rear]"];
            let args: Vec<_> = args.iter().chain(more).map(|&arg| arg.to_owned()).collect();
            check_names(&Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0)
        };
        check(&[]).unwrap();
        let error = check(&["-r", "rear:=/front"]).unwrap_err().to_string();
        assert!(error.starts_with("the sensors front and rear are both read from /front"), "{error}");
        let images = ["-p", "front.kind:=depth", "-p", "rear.kind:=depth", "-r", "rear/image:=/front/image"];
        assert!(matches!(check(&images), Err(DdsError::Name(ArgsError::SameTopic { .. }))));
    }

    #[test]
    fn a_dds_type_name_reads_as_in_ros() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::PointCloud2_"), "sensor_msgs/msg/PointCloud2");
    }
}
