//! [`Transport`] over ROS 2's DDS. The only module that imports `ros2_client` and `rustdds`.
//!
//! Everything runs on the thread of one [`tokio::task::LocalSet`]. Clouds are decoded while the middleware's buffer is
//! borrowed, so no cloud is copied; each subscription is a task that hands events to one bounded channel and waits
//! when it is full: what the middleware then drops shows as a gap in the publisher's sequence numbers.

mod heard;
mod map_reader;
mod network;
mod outlet;
mod parameters;
mod pulse;
mod read;
mod robot;
mod secure;
mod threads;

use std::cell::RefCell;
use std::net::{IpAddr, UdpSocket};
use std::rc::Rc;
use std::time::Duration;

use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, QosProfile, RmwRequestId, Server,
    ServiceMapping, ServiceTypeName, Subscription,
};
use rustdds::policy::ResourceLimits;
use rustdds::{DomainParticipant, DomainParticipantBuilder, QosPolicyBuilder, Topic, TopicKind};
use serde::Serialize;
use thiserror::Error;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tracing::warn;

pub use self::map_reader::MapReader;
use self::network::Network;
use self::read::Memory;
pub use self::robot::Robot;
use super::args::{ArgsError, Setup};
use super::parameters::Parameters;
use super::record::Record;
use super::security::{Security, SecurityError};
use super::transport::{Event, Inputs, Outgoing, SendError, Service, Source, Transport};
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
type Readers = JoinSet<&'static str>;

/// Adds events to those of the network.
pub type Events = mpsc::Sender<Event<RmwRequestId>>;

impl ros2_client::Message for TriggerRequest {}
impl ros2_client::Message for TriggerResponse {}

fn opening<E: std::fmt::Display>(what: &str) -> impl FnOnce(E) -> DdsError {
    move |error| DdsError::Open { what: what.to_owned(), text: error.to_string() }
}

/// A node on the network, before it has topics.
struct Opener<'a> {
    setup: &'a Setup,
    security: &'a Security,
    participant: DomainParticipant,
    context: Context,
    node: Node,
}

impl<'a> Opener<'a> {
    /// `security` is decided once: keys that are gone by now must not open the node to everyone.
    fn new(setup: &'a Setup, security: &'a Security) -> Result<Self, DdsError> {
        let participant = participant(setup, security)?;
        let context =
            Context::from_domain_participant(participant.clone()).map_err(opening("a ROS context"))?;
        let name = NodeName::new(&setup.namespace, &setup.name).map_err(opening("the node"))?;
        // The services of the node are those of `parameters`.
        let node = context.new_node(name, NodeOptions::new().start_parameter_services(false));
        Ok(Self { setup, security, participant, context, node: node.map_err(opening("the node"))? })
    }

    fn topic(
        &self,
        name: &str,
        package: &str,
        kind: &str,
        qos: &rustdds::QosPolicies,
    ) -> Result<Topic, DdsError> {
        let resolved = self.setup.resolve(name)?;
        let kind = MessageTypeName::new(package, kind).dds_msg_type();
        let topic = self.participant.create_topic(format!("rt{resolved}"), kind, qos, TopicKind::NoKey);
        topic.map_err(opening(&resolved))
    }

    fn subscribe<M: 'static>(
        &mut self,
        (name, package, kind): (&str, &str, &str),
        qos: &rustdds::QosPolicies,
    ) -> Result<Subscription<M>, DdsError> {
        let topic = self.topic(name, package, kind, qos)?;
        self.node.create_subscription(&topic, None).map_err(opening(name))
    }

    fn publisher<M: Serialize>(
        &mut self,
        (name, package, kind): (&str, &str, &str),
        qos: &rustdds::QosPolicies,
    ) -> Result<Publisher<M>, DdsError> {
        let topic = self.topic(name, package, kind, qos)?;
        self.node.create_publisher(&topic, None).map_err(opening(name))
    }

    fn server<Q: ros2_client::Message + Clone + 'static, A: ros2_client::Message + 'static>(
        &mut self,
        name: &str,
        (package, kind): (&str, &str),
        depth: usize,
    ) -> Result<Server<Q, A>, DdsError> {
        let resolved = self.setup.resolve(name)?;
        let service = Name::parse(&resolved).map_err(opening(&resolved))?;
        let kind = ServiceTypeName::new(package, kind);
        let qos = reliable(depth, Durability::Volatile);
        let mapping = ServiceMapping::Enhanced;
        self.node.create_server(mapping, &service, &kind, qos.clone(), qos).map_err(opening(&resolved))
    }
}

fn participant(setup: &Setup, security: &Security) -> Result<DomainParticipant, DdsError> {
    let builder = DomainParticipantBuilder::new(setup.domain)
        .socket_receive_buffer_size(setup.config.receive_buffer)
        .socket_send_buffer_size(setup.config.receive_buffer);
    let only: &[IpAddr] = &setup.config.network_interfaces;
    only.iter().copied().try_for_each(check_interface)?;
    let builder = if only.is_empty() { builder } else { builder.with_only_networks(only.iter().copied()) };
    match security {
        Security::Off | Security::Unsecured(_) => builder.build().map_err(opening("a DDS participant")),
        Security::Keys(enclave) => secure::build(builder, enclave.clone()),
    }
}

/// `RustDDS` takes any address, and is deaf where the machine does not have it.
fn check_interface(address: IpAddr) -> Result<(), DdsError> {
    let refused = |text| DdsError::Interface { address, text };
    if address.is_ipv6() {
        return Err(refused("only IPv4 is spoken".to_owned()));
    }
    UdpSocket::bind((address, 0)).map(drop).map_err(|error| refused(error.to_string()))
}

/// Whether all names can be, before anything is done.
///
/// # Errors
/// At the first that cannot.
pub fn check_names(setup: &Setup) -> Result<(), DdsError> {
    ros2args::names::validate_namespace(&setup.namespace).map_err(ArgsError::from)?;
    read::inputs(setup)?;
    let others = [Service::Reset.name(), Service::Save.name(), "/tf", "/tf_static", pulse::TOPIC];
    let services = parameters::SERVICES.map(|(name, _)| name);
    for name in Outgoing::TOPICS.into_iter().chain(others).chain(services) {
        setup.resolve(name)?;
    }
    Ok(())
}

/// A reader that acknowledges nothing must not hold up the others: where too much waits for it, a message fails at once.
fn reliable(depth: usize, durability: Durability) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth })
        .durability(durability)
}

/// For what we send reliably. A snapshot outgrows the socket buffer of a reader on a stock kernel, and RustDDS repairs
/// what was lost in rounds of 8 KB: 10 ms apart, slower than we publish, or a fifth of the deadline, 1 ms at the least.
/// An offered deadline binds no reader that asks for none, and ROS readers ask for none.
///
/// RustDDS forgets what every reader has acknowledged: where there is none, or one that acknowledges nothing, it would keep
/// some thousand messages. `most` bounds them, and what may wait for one reader.
fn reliable_output(depth: usize, durability: Durability, most: i32) -> rustdds::QosPolicies {
    let profile = reliable(depth, durability).deadline(Some(Duration::from_millis(5)));
    let limits = ResourceLimits { max_samples: most, max_instances: 1, max_samples_per_instance: most };
    rustdds::QosPolicies::from(&profile).modify_by(&QosPolicyBuilder::new().resource_limits(limits).build())
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
    inputs: Inputs,
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

    fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    fn sources(&self) -> Vec<Source> {
        self.network().sources()
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
    fn an_address_that_the_machine_does_not_have_is_refused_and_so_is_ipv6() {
        check_interface(IpAddr::from([127, 0, 0, 1])).unwrap();
        let error = check_interface(IpAddr::from([192, 0, 2, 1])).unwrap_err().to_string();
        assert!(error.starts_with("network_interfaces has 192.0.2.1: "), "{error}");
        let error = check_interface(IpAddr::from([0, 0, 0, 0, 0, 0, 0, 1])).unwrap_err().to_string();
        assert_eq!(error, "network_interfaces has ::1: only IPv4 is spoken");
    }

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
    fn a_dds_type_name_reads_as_in_ros() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::PointCloud2_"), "sensor_msgs/msg/PointCloud2");
    }
}
