//! [`Transport`] over ROS 2's DDS. The only module that imports `ros2_client` and `rustdds`.
//!
//! Everything runs on the thread of one [`tokio::task::LocalSet`]. Clouds are decoded while the middleware's buffer is
//! borrowed, so no cloud is copied; each subscription is a task that hands events to one bounded channel and waits
//! when it is full: what the middleware then drops shows as a gap in the publisher's sequence numbers.

mod heard;
mod map_reader;
mod read;
mod secure;

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::rc::Rc;
use std::time::Duration;

use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{
    Context, MessageTypeName, Name, Node, NodeName, NodeOptions, ParameterValue, Publisher, QosProfile,
    RmwRequestId, Server, ServiceMapping, ServiceTypeName, Subscription,
};
use rustdds::{DomainParticipant, DomainParticipantBuilder, Topic, TopicKind};
use serde::Serialize;
use thiserror::Error;
use tokio::sync::{Mutex, mpsc};
use tokio::task::JoinSet;

pub use self::map_reader::MapReader;
use super::args::{ArgsError, Setup};
use super::record::Record;
use super::security::{Security, SecurityError};
use super::transport::{Event, Inputs, Outgoing, SendError, Service, Source, Transport};
use crate::config::Value;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::ros::{MarkerArray, PointCloud2, TfMessage, TriggerRequest, TriggerResponse};

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
    /// A name that cannot be resolved.
    #[error(transparent)]
    Name(#[from] ArgsError),
    /// DDS Security was asked for and cannot be had; no socket was opened.
    #[error(transparent)]
    Security(#[from] SecurityError),
}

/// Events that wait for the node; a cloud that finds no place waits in the middleware.
const EVENTS: usize = 16;

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
    participant: DomainParticipant,
    node: Node,
}

impl<'a> Opener<'a> {
    fn new(setup: &'a Setup) -> Result<Self, DdsError> {
        let participant = participant(setup)?;
        let context =
            Context::from_domain_participant(participant.clone()).map_err(opening("a ROS context"))?;
        let name = NodeName::new(&setup.namespace, &setup.name).map_err(opening("the node"))?;
        let mut options = NodeOptions::new();
        for (name, value) in &setup.parameters {
            // The library declares this one itself; it is set below.
            if *name != "use_sim_time" {
                options = options.declare_parameter(name, parameter(value));
            }
        }
        let begun_with: BTreeMap<_, _> =
            setup.parameters.iter().map(|(name, value)| (*name, parameter(value))).collect();
        // The library also asks when a parameter is declared.
        let fixed = move |name: &str, value: &ParameterValue| {
            let same = begun_with.get(name) == Some(value) || name == "use_sim_time" && begun_with.is_empty();
            let why = || format!("{name} is read when the node starts: start it again with -p {name}:=...");
            if same { Ok(()) } else { Err(why()) }
        };
        let node = context.new_node(name, options.parameter_validator(Box::new(fixed)));
        Ok(Self { setup, participant, node: node.map_err(opening("the node"))? })
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
        qos: &QosProfile,
    ) -> Result<Publisher<M>, DdsError> {
        let topic = self.topic(name, package, kind, &qos.into())?;
        self.node.create_publisher(&topic, None).map_err(opening(name))
    }

    fn server(&mut self, name: &str) -> Result<Server<TriggerRequest, TriggerResponse>, DdsError> {
        let resolved = self.setup.resolve(name)?;
        let service = Name::parse(&resolved).map_err(opening(&resolved))?;
        let kind = ServiceTypeName::new("std_srvs", "Trigger");
        let qos = QosProfile::publisher_default().history(History::KeepLast { depth: 10 });
        let mapping = ServiceMapping::Enhanced;
        self.node.create_server(mapping, &service, &kind, qos.clone(), qos).map_err(opening(&resolved))
    }
}

fn participant(setup: &Setup) -> Result<DomainParticipant, DdsError> {
    let builder = DomainParticipantBuilder::new(setup.domain)
        .socket_receive_buffer_size(setup.config.receive_buffer)
        .socket_send_buffer_size(setup.config.receive_buffer);
    let only: &[IpAddr] = &setup.config.network_interfaces;
    let builder = if only.is_empty() { builder } else { builder.with_only_networks(only.iter().copied()) };
    match setup.security()? {
        Security::Off | Security::Unsecured(_) => builder.build().map_err(opening("a DDS participant")),
        Security::Keys(enclave) => secure::build(builder, enclave),
    }
}

fn parameter(value: &Value) -> ParameterValue {
    match value.clone() {
        Value::Boolean(value) => ParameterValue::Boolean(value),
        Value::Integer(value) => ParameterValue::Integer(value),
        Value::Double(value) => ParameterValue::Double(value),
        Value::Text(value) => ParameterValue::String(value),
        Value::TextList(value) => ParameterValue::StringArray(value),
    }
}

fn reliable(depth: usize, durability: Durability) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth })
        .durability(durability)
}

/// For what we send reliably. A snapshot outgrows the socket buffer of a reader on a stock kernel, and RustDDS repairs
/// what was lost in rounds of 8 KB: 10 ms apart, slower than we publish, or a fifth of the deadline, 1 ms at the least.
/// An offered deadline binds no reader that asks for none, and ROS readers ask for none.
fn reliable_output(depth: usize, durability: Durability) -> QosProfile {
    reliable(depth, durability).deadline(Some(Duration::from_millis(5)))
}

/// The node's topics and services on DDS.
pub struct Dds {
    // Fields are dropped in this order: publishers and the service before the node, the node before the participant.
    clusters: Publisher<SurfaceClusterArray>,
    delta: Publisher<SurfaceClusterArray>,
    markers: Publisher<MarkerArray>,
    labelled: Publisher<PointCloud2>,
    reset: Rc<Server<TriggerRequest, TriggerResponse>>,
    save: Rc<Server<TriggerRequest, TriggerResponse>>,
    /// What reads; none of these ends by itself.
    readers: Mutex<Readers>,
    node: Node,
    participant: DomainParticipant,
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
        record: Option<Record>,
    ) -> Result<(Self, Events, mpsc::Receiver<Event<RmwRequestId>>), DdsError> {
        let mut opener = Opener::new(setup)?;
        let (events, receiver) = mpsc::channel(EVENTS);
        let array = "SurfaceClusterArray";
        let latched = &reliable_output(1, Durability::TransientLocal);
        let dds = Self {
            clusters: opener.publisher(("~/clusters", "cfodi_msgs", array), latched)?,
            delta: opener.publisher(
                ("~/clusters_delta", "cfodi_msgs", array),
                &reliable_output(20, Durability::Volatile),
            )?,
            markers: opener.publisher(("~/markers", "visualization_msgs", "MarkerArray"), latched)?,
            labelled: opener.publisher(
                ("~/points_labelled", "sensor_msgs", "PointCloud2"),
                &QosProfile::subscription_default(),
            )?,
            reset: Rc::new(opener.server(Service::Reset.name())?),
            save: Rc::new(opener.server(Service::Save.name())?),
            inputs: read::inputs(setup)?,
            participant: opener.participant.clone(),
            readers: Mutex::new(read::listen(&mut opener, &events)?),
            node: opener.node,
            record,
        };
        for service in [Service::Reset, Service::Save] {
            let serving = read::serve(service, Rc::clone(dds.server(service)), events.clone());
            dds.readers.try_lock().map_err(opening(service.name()))?.spawn_local(serving);
        }
        Ok((dds, events, receiver))
    }

    const fn server(&self, service: Service) -> &Rc<Server<TriggerRequest, TriggerResponse>> {
        match service {
            Service::Reset => &self.reset,
            Service::Save => &self.save,
        }
    }

    /// Takes the node off the network. Drop what this returns after the [`tokio::task::LocalSet`]: readers sign off
    /// at the participant, which must still be there.
    pub async fn close(self) -> impl Sized {
        let Self { node, participant, readers, .. } = self;
        drop(node);
        // The library's own task ends when it runs next.
        tokio::task::yield_now().await;
        (readers, participant)
    }
}

impl Transport for Dds {
    type Request = RmwRequestId;

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        if let Some(record) = &self.record {
            record.outgoing(&message);
        }
        let sent = match message {
            Outgoing::Clusters(array) => self.clusters.async_publish(array).await.map_err(|e| e.to_string()),
            Outgoing::Delta(array) => self.delta.async_publish(array).await.map_err(|e| e.to_string()),
            Outgoing::Markers(markers) => {
                self.markers.async_publish(markers).await.map_err(|e| e.to_string())
            }
            Outgoing::Labelled(cloud) => self.labelled.async_publish(cloud).await.map_err(|e| e.to_string()),
        };
        sent.map_err(SendError)
    }

    async fn answer(
        &self,
        service: Service,
        request: RmwRequestId,
        response: TriggerResponse,
    ) -> Result<(), SendError> {
        let sent = self.server(service).async_send_response(request, response).await;
        sent.map_err(|error| SendError(error.to_string()))
    }

    fn inputs(&self) -> &Inputs {
        &self.inputs
    }

    fn sources(&self) -> Vec<Source> {
        let writers = self.participant.discovered_writers();
        let mut sources: Vec<_> = writers
            .iter()
            .filter_map(|writer| {
                let data = &writer.publication_topic_data;
                let topic = data.topic_name.strip_prefix("rt/")?;
                Some(Source { topic: format!("/{topic}"), type_name: ros_type(&data.type_name) })
            })
            .collect();
        sources.sort();
        sources.dedup();
        sources
    }

    async fn failed(&self) -> String {
        match self.readers.lock().await.join_next().await {
            Some(Ok(topic)) => format!("reading {topic} has ended"),
            Some(Err(failure)) => failure.to_string(),
            None => "nothing reads".to_owned(),
        }
    }
}

/// `sensor_msgs::msg::dds_::PointCloud2_` as ROS writes it.
fn ros_type(dds: &str) -> String {
    let plain = dds.replace("::dds_::", "::");
    plain.trim_end_matches('_').replace("::", "/")
}

/// Publishers of a simulated robot: its own participant, so that its clouds really cross the network stack.
pub struct Robot {
    points: Publisher<PointCloud2>,
    tf: Publisher<TfMessage>,
    tf_static: Publisher<TfMessage>,
    // Kept so that the publishers stay on the network, and dropped in this order.
    _network: (Node, DomainParticipant),
}

impl Robot {
    /// Opens a node `simulated_robot` that publishes `points`, `/tf` and `/tf_static` in the domain of `setup`.
    ///
    /// # Errors
    /// When the middleware refuses something.
    pub fn open(setup: &Setup) -> Result<Self, DdsError> {
        let setup = setup.for_node("simulated_robot");
        let mut opener = Opener::new(&setup)?;
        let tf = |name| (name, "tf2_msgs", "TFMessage");
        let points = opener
            .publisher(("points", "sensor_msgs", "PointCloud2"), &QosProfile::subscription_default())?;
        let dynamic = opener.publisher(tf("/tf"), &reliable(100, Durability::Volatile))?;
        let latched = opener.publisher(tf("/tf_static"), &reliable(1, Durability::TransientLocal))?;
        let network = (opener.node, opener.participant);
        Ok(Self { points, tf: dynamic, tf_static: latched, _network: network })
    }

    /// Sends a cloud.
    ///
    /// # Errors
    /// When the middleware refuses it.
    pub fn send_cloud(&self, cloud: PointCloud2) -> Result<(), SendError> {
        self.points.publish(cloud).map_err(|error| SendError(error.to_string()))
    }

    /// Sends transforms on `/tf`, or on `/tf_static`.
    ///
    /// # Errors
    /// When the middleware refuses them.
    pub fn send_transforms(&self, message: TfMessage, is_static: bool) -> Result<(), SendError> {
        let publisher = if is_static { &self.tf_static } else { &self.tf };
        publisher.publish(message).map_err(|error| SendError(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dds_type_name_reads_as_in_ros() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::PointCloud2_"), "sensor_msgs/msg/PointCloud2");
    }
}
