//! The node's topics and services on one participant of DDS.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

use ros2_client::qos::Durability;
use ros2_client::{Context, Node, Publisher, QosProfile, RmwRequestId, Server};
use rustdds::{DomainParticipant, Topic};
use serde::Serialize;
use tokio::sync::Mutex;
use tracing::warn;

use super::latched::{self, Latched};
use super::mismatch::Ends;
use super::namesakes;
use super::outlet::Outlet;
use super::pulse::Pulse;
use super::read::{self, Memory};
use super::threads::Threads;
use super::{Events, Opener, Readers, opening, ros_type};
use crate::args::Setup;
use crate::args::security::Security;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::reports::{DiagnosticArray, Log};
use crate::msg::ros::{MarkerArray, PointCloud2, TriggerRequest, TriggerResponse};
use crate::msg::twins::{Detection3DArray, PolygonInstanceStamped};
use crate::node::clock::TimeOfDay;
use crate::node::middleware::OpenError;
use crate::node::parameters::Parameters;
use crate::node::transport::{Outgoing, SendError, Service, Source};

/// Most deltas that are kept for a reader that does not acknowledge them: more than 20 s of them, after which ROS readers
/// that have died are forgotten.
const DELTAS: i32 = 1024;

/// Most snapshots, which replace each other.
const SNAPSHOTS: i32 = 16;

/// Most messages of markers, which can be the largest of all.
const MARKERS: i32 = 4;

/// Most reports, and most lines of the log.
const REPORTS: i32 = 256;
/// Most polygons, one a cluster, and the history of their topic: none is to push out another of the same map.
const POLYGONS: i32 = 4096;

/// Type of the node's own services, and how many calls may wait.
const TRIGGER: (&str, &str) = ("std_srvs", "Trigger");
const CALLS: usize = 10;

/// Time between two looks at the middleware's threads.
const LOOK: Duration = Duration::from_millis(250);

/// Time for telling that the node has gone: who has just found it may have to ask for that again.
const FAREWELL: Duration = Duration::from_millis(100);

/// Topics that are opened anew until the network is joined anew: what the libraries tell others of the node names those
/// before too. With a reader of all topics that never acknowledges, an hour.
const MOST_REOPENED: u32 = 1000;

pub(super) struct Network {
    // Fields are dropped in this order: publishers and the service before the node, the node before the participant.
    clusters: Outlet<SurfaceClusterArray>,
    delta: Outlet<SurfaceClusterArray>,
    markers: Outlet<MarkerArray>,
    labelled: Publisher<PointCloud2>,
    /// `None` where the keys do not permit it.
    diagnostics: Option<Outlet<DiagnosticArray>>,
    /// The same.
    log: Option<Outlet<Log>>,
    /// `None` where no parameter asks for them.
    detections: Option<Outlet<Detection3DArray>>,
    polygons: Option<Outlet<PolygonInstanceStamped>>,
    reset: Rc<Server<TriggerRequest, TriggerResponse>>,
    save: Rc<Server<TriggerRequest, TriggerResponse>>,
    /// What reads; none of these ends by itself.
    readers: Mutex<Readers>,
    /// `None` where the keys do not permit it.
    pulse: Option<Rc<Pulse>>,
    ends: Ends,
    node: Rc<RefCell<Node>>,
    /// Tells others of the node, and that it has gone.
    context: Context,
    participant: DomainParticipant,
    sources: Sources,
    /// How often a topic was opened anew.
    reopened: Cell<u32>,
    /// When it had last not been set back.
    time_of_day: Cell<TimeOfDay>,
}

impl Network {
    /// Opens the node and starts reading.
    pub(super) fn open(
        setup: &Setup,
        security: &Security,
        memory: &Memory,
        parameters: &Rc<Parameters>,
        events: &Events,
    ) -> Result<Self, OpenError> {
        let time_of_day = Cell::new(TimeOfDay::read());
        let (opener, threads) = Threads::started_by(|| Opener::new(setup, security));
        let mut opener = opener?;
        let pulse = pulse(&opener);
        let (participant, threads) = (opener.participant.clone(), Rc::new(threads));
        let sources = Sources { participant, threads, pulse: pulse.clone() };
        let transforms = opener.topic(latched::TOPIC, "tf2_msgs", "TFMessage", &read::latched_qos())?;
        let array = "SurfaceClusterArray";
        let latched = |most| (1, Durability::TransientLocal, most);
        let deltas = (20, Durability::Volatile, DELTAS);
        let markers = (Outgoing::MARKERS, "visualization_msgs", "MarkerArray");
        let network = Self {
            clusters: Outlet::open(
                &mut opener,
                (Outgoing::CLUSTERS, "cfodi_msgs", array),
                latched(SNAPSHOTS),
            )?,
            delta: Outlet::open(&mut opener, (Outgoing::DELTA, "cfodi_msgs", array), deltas)?,
            markers: Outlet::open(&mut opener, markers, latched(MARKERS))?,
            labelled: opener.publisher(
                (Outgoing::LABELLED, "sensor_msgs", "PointCloud2"),
                &QosProfile::subscription_default().into(),
            )?,
            diagnostics: permitted(Outlet::open(
                &mut opener,
                (Outgoing::DIAGNOSTICS, "diagnostic_msgs", "DiagnosticArray"),
                (10, Durability::Volatile, REPORTS),
            )),
            log: permitted(Outlet::open(
                &mut opener,
                (Outgoing::LOG, "rcl_interfaces", "Log"),
                (100, Durability::TransientLocal, REPORTS),
            )),
            detections: detections(setup, &mut opener, latched(SNAPSHOTS))?,
            polygons: polygons(setup, &mut opener)?,
            reset: Rc::new(opener.server(Service::Reset.name(), TRIGGER, CALLS)?),
            save: Rc::new(opener.server(Service::Save.name(), TRIGGER, CALLS)?),
            pulse,
            participant: opener.participant.clone(),
            readers: Mutex::new(read::listen(&mut opener, &sources, memory, parameters, events)?),
            ends: opener.ends,
            node: opener.node,
            context: opener.context,
            sources,
            reopened: Cell::new(0),
            time_of_day,
        };
        network.listen_to_calls(events)?;
        network.listen_to_namesakes(setup.fully_qualified_name(), memory)?;
        if !read::has_keys(security) {
            network.listen_to_found(transforms, memory, events)?;
        }
        Ok(network)
    }

    fn listen_to_calls(&self, events: &Events) -> Result<(), OpenError> {
        for service in [Service::Reset, Service::Save] {
            let serving = read::serve(service, Rc::clone(self.server(service)), events.clone());
            self.readers.try_lock().map_err(opening(service.name()))?.spawn_local(serving);
        }
        Ok(())
    }

    /// Notes other nodes of this node's name; where the keys do not permit it the node does without.
    fn listen_to_namesakes(&self, name: String, memory: &Memory) -> Result<(), OpenError> {
        let namesakes = Rc::clone(&memory.namesakes);
        match namesakes.open(&self.participant) {
            Ok(reader) => {
                let reading = namesakes::read(reader, namesakes, name);
                self.readers.try_lock().map_err(opening("the names of nodes"))?.spawn_local(reading);
            }
            Err(error) => warn!("it will not be noticed when another node has this name: {error}"),
        }
        Ok(())
    }

    /// Takes what is latched as soon as its publisher is found.
    fn listen_to_found(&self, topic: Topic, memory: &Memory, events: &Events) -> Result<(), OpenError> {
        let Some(news) = self.node.borrow().status_receiver() else { return Ok(()) };
        let latched = Latched {
            participant: self.participant.clone(),
            threads: Rc::clone(&self.sources.threads),
            pulse: self.pulse.clone(),
            topic,
            qos: read::latched_qos(),
            taken: Rc::clone(&memory.latched),
            events: events.clone(),
        };
        self.readers.try_lock().map_err(opening(latched::TOPIC))?.spawn_local(latched.read(news));
        Ok(())
    }

    /// Takes the node off the network; see [`super::Dds::close`].
    pub(super) async fn close(self) -> impl Sized {
        let Self { node, context, participant, readers, .. } = self;
        drop(node);
        // The library's own task ends when it runs next.
        tokio::time::sleep(FAREWELL).await;
        drop(context);
        (readers, participant)
    }

    /// Reads no more.
    pub(super) async fn deafen(&self) {
        self.readers.lock().await.shutdown().await;
    }

    pub(super) async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        match message {
            Outgoing::Clusters(array) => self.send(&self.clusters, array).await,
            Outgoing::Delta(array) => self.send(&self.delta, array).await,
            Outgoing::Markers(markers) => self.send(&self.markers, markers).await,
            Outgoing::Diagnostics(report) => self.tell(self.diagnostics.as_ref(), report).await,
            Outgoing::Log(line) => self.tell(self.log.as_ref(), line).await,
            Outgoing::Labelled(cloud) => {
                let sent = self.labelled.async_publish(cloud).await;
                sent.map_err(|error| SendError(format!("on {}: {error}", Outgoing::LABELLED)))
            }
            Outgoing::Detections(array) => self.tell(self.detections.as_ref(), array).await,
            Outgoing::Polygon(polygon) => self.tell(self.polygons.as_ref(), polygon).await,
        }
    }

    /// Sends where there is a topic: not for what nobody has asked for, or the keys do not permit.
    async fn tell<M: Serialize>(&self, outlet: Option<&Outlet<M>>, message: M) -> Result<(), SendError> {
        match outlet {
            Some(outlet) => self.send(outlet, message).await,
            None => Ok(()),
        }
    }

    async fn send<M: Serialize>(&self, outlet: &Outlet<M>, message: M) -> Result<(), SendError> {
        let Some(message) = outlet.send(message).await? else { return Ok(()) };
        // Where the middleware is held it would hold whoever asks it for a topic.
        if outlet.has_rested() && self.answers().await {
            outlet.reopen(&mut self.node.borrow_mut())?;
            self.reopened.set(self.reopened.get() + 1);
            if outlet.send(message).await?.is_none() {
                return Ok(());
            }
        }
        Err(outlet.refusal())
    }

    const fn server(&self, service: Service) -> &Rc<Server<TriggerRequest, TriggerResponse>> {
        match service {
            Service::Reset => &self.reset,
            Service::Save => &self.save,
        }
    }

    pub(super) async fn answer(
        &self,
        service: Service,
        request: RmwRequestId,
        response: TriggerResponse,
    ) -> Result<(), SendError> {
        let sent = self.server(service).async_send_response(request, response).await;
        sent.map_err(|error| SendError(error.to_string()))
    }

    pub(super) fn sources(&self) -> Vec<Source> {
        self.sources.list()
    }

    /// The topics of the node on which a peer asks for more than is offered, or offers less than is asked for.
    pub(super) fn mismatches(&self) -> Vec<(String, String)> {
        // Where one of its threads has died, what they share may not be readable any more.
        if self.sources.threads.live() { self.ends.mismatches(&self.participant) } else { Vec::new() }
    }

    /// Other nodes of this node's name.
    pub(super) fn namesakes(&self, memory: &Memory) -> usize {
        // As in `mismatches`.
        if !self.sources.threads.live() {
            return 0;
        }
        let writers = self.participant.discovered_writers();
        memory.namesakes.among(writers.iter().map(|writer| writer.publication_topic_data.key))
    }

    /// Resolves with a reason when something that reads has ended.
    pub(super) async fn reader_ended(&self) -> String {
        match self.readers.lock().await.join_next().await {
            Some(Ok(topic)) => format!("reading {topic} has ended"),
            Some(Err(failure)) => failure.to_string(),
            None => "nothing reads".to_owned(),
        }
    }

    /// Whether the middleware takes up what is written, as far as it can be known.
    pub(super) async fn answers(&self) -> bool {
        match &self.pulse {
            Some(pulse) => pulse.is_there().await,
            None => true,
        }
    }

    /// Resolves with a reason when a thread of the middleware does not come back from what it does.
    pub(super) async fn held(&self) -> String {
        match &self.pulse {
            Some(pulse) => {
                let waited = pulse.stops().await;
                format!("the middleware has not answered for {} s", waited.as_secs())
            }
            None => std::future::pending().await,
        }
    }

    /// Resolves when the network is to be joined anew, with the reason.
    pub(super) async fn worn_out(&self) -> String {
        loop {
            if !self.sources.threads.live() {
                return "a thread of the middleware has ended".to_owned();
            }
            if self.reopened.get() >= MOST_REOPENED {
                return format!("topics were opened anew {MOST_REOPENED} times");
            }
            if let Some(back) = self.set_back() {
                return format!("the system's clock was set back by {:.1} s", back.as_secs_f64());
            }
            tokio::time::sleep(LOOK).await;
        }
    }

    /// By how much the time of day was set back since this network was joined. RustDDS 0.15.1 orders what comes by it, and hands
    /// best-effort readers nothing until it is past where it was.
    fn set_back(&self) -> Option<Duration> {
        let now = TimeOfDay::read();
        let back = now.set_back_since(&self.time_of_day.get());
        if back.is_none() {
            self.time_of_day.set(now);
        }
        back
    }
}

/// Who publishes, for as long as it can be asked.
#[derive(Clone)]
pub(super) struct Sources {
    participant: DomainParticipant,
    threads: Rc<Threads>,
    pulse: Option<Rc<Pulse>>,
}

impl Sources {
    /// Resolves when the middleware takes up what is written: where it is held it would hold whoever asks it for a topic.
    pub(super) async fn answer(&self) {
        if let Some(pulse) = &self.pulse {
            while !pulse.is_there().await {
                tokio::time::sleep(LOOK).await;
            }
        }
    }

    /// Every topic that has a publisher now, by name.
    pub(super) fn list(&self) -> Vec<Source> {
        // As in `mismatches`.
        if !self.threads.live() {
            return Vec::new();
        }
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
}

/// What is of use and not needed: where it cannot be opened the node does without, and says so.
fn permitted<M: Serialize>(outlet: Result<Outlet<M>, OpenError>) -> Option<Outlet<M>> {
    outlet.inspect_err(|error| warn!("what the node says of itself is not sent: {error}")).ok()
}

fn detections(
    setup: &Setup,
    opener: &mut Opener<'_>,
    latched: (usize, Durability, i32),
) -> Result<Option<Outlet<Detection3DArray>>, OpenError> {
    let topic = (Outgoing::DETECTIONS, "vision_msgs", "Detection3DArray");
    setup.config.twins.detections.then(|| Outlet::open(opener, topic, latched)).transpose()
}

/// Not latched: only the last polygon would be.
fn polygons(
    setup: &Setup,
    opener: &mut Opener<'_>,
) -> Result<Option<Outlet<PolygonInstanceStamped>>, OpenError> {
    let topic = (Outgoing::POLYGONS, "geometry_msgs", "PolygonInstanceStamped");
    let each = (POLYGONS as usize, Durability::Volatile, POLYGONS);
    setup.config.twins.polygons.then(|| Outlet::open(opener, topic, each)).transpose()
}

fn pulse(opener: &Opener) -> Option<Rc<Pulse>> {
    let watched = Pulse::open(opener);
    let unwatched = |error: &OpenError| warn!("it will not be noticed when the middleware hangs: {error}");
    watched.inspect_err(unwatched).ok().map(Rc::new)
}
