//! A node on the network, before it has topics, and what its topics are opened with.

use std::cell::RefCell;
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::rc::Rc;
use std::thread::sleep;
use std::time::Duration;

use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher, QosProfile, Server,
    ServiceMapping, ServiceTypeName, Subscription,
};
use rustdds::policy::ResourceLimits;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, QosPolicyBuilder, Topic, TopicDescription as _, TopicKind,
};
use serde::Serialize;

use super::mismatch::Ends;
use super::secure;
use crate::args::Setup;
use crate::args::security::Security;
use crate::msg::topic::{Named, Qos};
use crate::node::middleware::OpenError;

/// Time on the network before the first topic. RustDDS 0.15.1 says that it is there 100 ms after it has joined, and whoever is there
/// already answers at once. To one who gets to know a node in the midst of its topics the first of these come last: Fast DDS 2.14 puts
/// what has come too early of two such nodes into one list, which is out of order then, and acknowledges what it does not find in it.
const INTRODUCTION: Duration = Duration::from_millis(200);

/// A node that nobody opens topics of any more, and its participant.
pub(super) type Kept = (Option<Node>, DomainParticipant);

/// A node on the network, before it has topics.
pub(super) struct Opener<'a> {
    pub(super) setup: &'a Setup,
    pub(super) security: &'a Security,
    pub(super) participant: DomainParticipant,
    pub(super) context: Context,
    /// Those who open a topic later have a weak one: it goes when the network is left.
    pub(super) node: Rc<RefCell<Node>>,
    pub(super) ends: Ends,
}

impl<'a> Opener<'a> {
    /// `security` is decided once: keys that are gone by now must not open the node to everyone.
    pub(super) fn new(setup: &'a Setup, security: &'a Security) -> Result<Self, OpenError> {
        let participant = participant(setup, security)?;
        sleep(INTRODUCTION);
        let context = Context::from_domain_participant(participant.clone())
            .map_err(OpenError::opening("a ROS context"))?;
        let name = NodeName::new(&setup.namespace, &setup.name).map_err(OpenError::opening("the node"))?;
        // The parameter services are those of `parameters`; what the node says goes where readers cannot hold it up.
        let options = NodeOptions::new().start_parameter_services(false).enable_rosout(false);
        let node = context.new_node(name, options).map_err(OpenError::opening("the node"))?;
        let node = Rc::new(RefCell::new(node));
        Ok(Self { setup, security, participant, context, node, ends: Ends::default() })
    }

    /// What keeps the topics that were opened on the network, to be dropped in this order.
    pub(super) fn into_kept(self) -> Kept {
        (Rc::into_inner(self.node).map(RefCell::into_inner), self.participant)
    }

    pub(super) fn topic(
        &self,
        Named { name, type_name }: Named<'_>,
        qos: &rustdds::QosPolicies,
    ) -> Result<Topic, OpenError> {
        self.resolved_topic(Named { name: &self.setup.resolve(name)?, type_name }, qos)
    }

    /// As [`Self::topic`], of a name that remappings have been applied to: they would make another of it.
    pub(super) fn resolved_topic(
        &self,
        Named { name, type_name }: Named<'_>,
        qos: &rustdds::QosPolicies,
    ) -> Result<Topic, OpenError> {
        let (package, kind) = package_and_kind(type_name);
        let kind = MessageTypeName::new(package, kind).dds_msg_type();
        let topic = self.participant.create_topic(format!("rt{name}"), kind, qos, TopicKind::NoKey);
        topic.map_err(OpenError::opening(name))
    }

    /// Reads a topic, by its resolved name.
    pub(super) fn subscribe<M: 'static>(
        &mut self,
        resolved: Named<'_>,
        qos: &rustdds::QosPolicies,
    ) -> Result<Subscription<M>, OpenError> {
        let topic = self.resolved_topic(resolved, qos)?;
        self.ends.reads(topic.name(), qos.clone());
        self.node.borrow_mut().create_subscription(&topic, None).map_err(OpenError::opening(resolved.name))
    }

    pub(super) fn publisher<M: Serialize>(
        &mut self,
        named: Named<'_>,
        qos: &rustdds::QosPolicies,
    ) -> Result<Publisher<M>, OpenError> {
        let topic = self.topic(named, qos)?;
        self.ends.publishes(topic.name(), qos.clone());
        self.node.borrow_mut().create_publisher(&topic, None).map_err(OpenError::opening(named.name))
    }

    pub(super) fn server<Q: ros2_client::Message + Clone + 'static, A: ros2_client::Message + 'static>(
        &mut self,
        Named { name, type_name }: Named<'_>,
        depth: usize,
    ) -> Result<Server<Q, A>, OpenError> {
        let resolved = self.setup.resolve_service(name)?;
        let service = Name::parse(&resolved).map_err(OpenError::opening(&resolved))?;
        let (package, kind) = package_and_kind(type_name);
        let kind = ServiceTypeName::new(package, kind);
        let qos = reliable(depth, Durability::Volatile);
        let mapping = mapping(self.setup);
        let server = self.node.borrow_mut().create_server(mapping, &service, &kind, qos.clone(), qos);
        server.map_err(OpenError::opening(&resolved))
    }
}

/// Of `sensor_msgs/msg/PointCloud2` the first and the last part.
fn package_and_kind(type_name: &str) -> (&str, &str) {
    let package = type_name.split_once('/').map_or("", |(package, _)| package);
    (package, type_name.rsplit_once('/').map_or(type_name, |(_, kind)| kind))
}

/// How calls are written: where they are taken for others they are run and never answered.
fn mapping(setup: &Setup) -> ServiceMapping {
    if setup.is_called_by_header() { ServiceMapping::Cyclone } else { ServiceMapping::Enhanced }
}

pub(super) fn participant(setup: &Setup, security: &Security) -> Result<DomainParticipant, OpenError> {
    let builder = DomainParticipantBuilder::new(setup.domain)
        .socket_receive_buffer_size(setup.config().receive_buffer)
        .socket_send_buffer_size(setup.config().receive_buffer);
    let only = those_there(&setup.config().network_interfaces)?;
    let builder =
        if only.is_empty() { builder } else { builder.with_only_networks(only.into_iter().map(IpAddr::V4)) };
    match security {
        Security::Off | Security::Unsecured(_) => {
            builder.build().map_err(OpenError::opening("a DDS participant"))
        }
        Security::Keys(enclave) => secure::build(builder, enclave.clone()),
    }
}

/// Those of the addresses that the machine has; where it has none of them, why not the first.
pub(super) fn those_there(addresses: &[Ipv4Addr]) -> Result<Vec<Ipv4Addr>, OpenError> {
    let there: Vec<_> =
        addresses.iter().copied().filter(|address| check_interface(*address).is_ok()).collect();
    if there.is_empty() {
        addresses.first().copied().map_or(Ok(()), check_interface)?;
    }
    Ok(there)
}

/// `RustDDS` takes any address, and is deaf where the machine does not have it.
pub(super) fn check_interface(address: Ipv4Addr) -> Result<(), OpenError> {
    let refused = |error: std::io::Error| OpenError::Interface { address, text: error.to_string() };
    UdpSocket::bind((address, 0)).map(drop).map_err(refused)
}

/// A reader that acknowledges nothing must not hold up the others: where too much waits for it, a message fails at once.
pub(super) fn reliable(depth: usize, durability: Durability) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth })
        .durability(durability)
}

/// For what we send reliably. A snapshot outgrows the socket buffer of a reader on a stock kernel, and RustDDS repairs
/// what was lost in rounds of 8 KB: 10 ms apart, slower than we publish, or a fifth of the deadline, 1 ms at the least.
/// An offered deadline binds no reader that asks for none, and ROS readers ask for none.
///
/// RustDDS forgets what every reader has acknowledged, every 6 s and but for `depth`: where there is none, or one that
/// acknowledges nothing, it would keep some thousand messages. `most` bounds them, and what may wait for one reader.
pub(super) fn reliable_output(Qos { latched, depth, .. }: Qos, most: i32) -> rustdds::QosPolicies {
    let durability = if latched { Durability::TransientLocal } else { Durability::Volatile };
    let profile = reliable(depth, durability).deadline(Some(Duration::from_millis(5)));
    let limits = ResourceLimits { max_samples: most, max_instances: 1, max_samples_per_instance: most };
    rustdds::QosPolicies::from(&profile).modify_by(&QosPolicyBuilder::new().resource_limits(limits).build())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Environment;

    #[test]
    fn calls_are_written_as_by_the_middleware_that_the_node_is_told_to_be() {
        let chosen = |rmw: Option<&str>| {
            let environment = Environment { rmw: rmw.map(str::to_owned), ..Environment::default() };
            mapping(&Setup::parse(&[], &environment, "cfodi").unwrap().0)
        };
        assert!(matches!(chosen(Some("rmw_cyclonedds_cpp")), ServiceMapping::Cyclone));
        for rmw in [None, Some(""), Some("rmw_fastrtps_cpp"), Some("rmw_connextdds")] {
            assert!(matches!(chosen(rmw), ServiceMapping::Enhanced), "{rmw:?}");
        }
    }

    #[test]
    fn a_type_has_a_package_and_a_kind() {
        assert_eq!(package_and_kind("sensor_msgs/msg/PointCloud2"), ("sensor_msgs", "PointCloud2"));
        assert_eq!(package_and_kind("std_srvs/srv/Trigger"), ("std_srvs", "Trigger"));
        assert_eq!(package_and_kind("PointCloud2"), ("", "PointCloud2"));
    }

    #[test]
    fn an_address_that_the_machine_does_not_have_is_refused() {
        check_interface(Ipv4Addr::LOCALHOST).unwrap();
        let error = check_interface(Ipv4Addr::new(192, 0, 2, 1)).unwrap_err().to_string();
        assert!(error.starts_with("network_interfaces has 192.0.2.1: "), "{error}");
    }
}
