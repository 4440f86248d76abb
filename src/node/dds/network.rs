//! The node's topics and services on one participant of DDS.

mod callers;
mod open;
mod sessions;

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ros2_client::{Context, Node, Publisher, RmwRequestId, Server};
use rustdds::{DomainParticipant, RTPSEntity as _};
use serde::Serialize;
use tokio::sync::Mutex;

use self::sessions::Sessions;
use super::addresses::Addresses;
use super::answering::Answering;
use super::farewell::Farewell;
use super::mismatch::Ends;
use super::outlet::Outlet;
use super::pulse::Pulse;
use super::read::Memory;
use super::threads::Threads;
use super::{Readers, STAY};
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::outgoing::Outgoing;
use crate::msg::reports::{DiagnosticArray, Log};
use crate::msg::ros::{MarkerArray, PointCloud2, TriggerRequest, TriggerResponse};
use crate::msg::sent;
use crate::msg::twins::{Detection3DArray, PolygonInstanceStamped};
use crate::node::clock::{TimeOfDay, Watch};
use crate::node::readers;
use crate::node::topics::ros_type;
use crate::node::transport::{DISCOVERY, SendError, Service, Source};

/// Time between two looks at the middleware's threads.
const LOOK: Duration = Duration::from_millis(250);

/// Time for telling that the node has gone: who has just found it may have to ask for that again.
const FAREWELL: Duration = Duration::from_millis(100);

/// Topics that are opened anew until the network is joined anew: what the libraries tell others of the node names those
/// before too. With a reader of all topics that never acknowledges, an hour; with sessions that alternate, some minutes.
const MOST_REOPENED: u32 = 1000;

/// One of the node's own services.
pub(super) type Triggers = Answering<Server<TriggerRequest, TriggerResponse>>;

pub(super) struct Network {
    // Fields are dropped in this order: publishers and the service before the node, the node before the participant.
    clusters: Outlet<SurfaceClusterArray>,
    delta: Outlet<SurfaceClusterArray>,
    markers: Outlet<MarkerArray>,
    labelled: Publisher<PointCloud2>,
    /// `None` where the keys do not permit it.
    diagnostics: Option<Outlet<DiagnosticArray>>,
    /// `None` where the keys do not permit it.
    log: Option<Outlet<Log>>,
    /// `None` where no parameter asks for them.
    detections: Option<Outlet<Detection3DArray>>,
    polygons: Option<Outlet<PolygonInstanceStamped>>,
    reset: Rc<Triggers>,
    save: Rc<Triggers>,
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
    sessions: RefCell<Sessions>,
    /// How often the network has been joined, this time among them.
    pub(super) number: u32,
    /// How often a topic was opened anew.
    reopened: Cell<u32>,
    /// RustDDS 0.15.1 orders what comes by it: where it was set back, best-effort readers are handed nothing until it is past where it
    /// was.
    time_of_day: Watch,
    addresses: Addresses,
    has_keys: bool,
}

impl Network {
    /// Takes the node off the network; see [`super::Dds::close`].
    pub(super) async fn close(self) -> impl FnOnce() {
        let farewell = self.farewell(&self);
        let Self { node, context, participant, readers, .. } = self;
        drop(node);
        // The library's own task ends when it runs next.
        tokio::time::sleep(FAREWELL).await;
        drop(context);
        move || {
            drop((readers, participant));
            farewell.into_iter().for_each(Farewell::say);
        }
    }

    /// What remains to be said when it has been left, on the network that is joined by `now`.
    pub(super) fn farewell(&self, now: &Self) -> Option<Farewell> {
        let farewell = || Farewell::of(&self.participant, &self.sources.threads, now.addresses.joined());
        (!self.has_keys).then(farewell)
    }

    /// Reads no more.
    pub(super) async fn deafen(&self) {
        self.readers.lock().await.shutdown().await;
    }

    pub(super) async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        match message {
            Outgoing::Clusters(map) => self.send_map(map).await,
            Outgoing::Delta(array) => self.send(&self.delta, array).await,
            Outgoing::Markers(markers) => self.send(&self.markers, markers).await,
            Outgoing::Diagnostics(report) => self.tell(self.diagnostics.as_ref(), report).await,
            Outgoing::Log(line) => self.tell(self.log.as_ref(), line).await,
            Outgoing::Labelled(cloud) => {
                let published = self.labelled.async_publish(cloud).await;
                published.map_err(|error| SendError::refused(sent::LABELLED.name, &error))
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
        outlet.refused()
    }

    const fn triggers(&self, service: Service) -> &Rc<Triggers> {
        match service {
            Service::Reset => &self.reset,
            Service::Save => &self.save,
        }
    }

    pub(super) async fn answer(
        &self,
        service: Service,
        caller: RmwRequestId,
        response: TriggerResponse,
    ) -> Result<(), SendError> {
        self.triggers(service).answer_aside(caller, response).await
    }

    pub(super) fn sources(&self) -> Vec<Source> {
        self.sources.list()
    }

    /// Whether there has been time to find them.
    pub(super) fn knows_all_sources(&self) -> bool {
        self.sources.joined.elapsed() >= DISCOVERY && self.sources.threads.live()
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
        readers::ended(&self.readers).await
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
            if let Some(back) = self.time_of_day.set_back(TimeOfDay::read(), STAY) {
                return format!("the system's clock was set back by {:.1} s", back.as_secs_f64());
            }
            tokio::time::sleep(LOOK).await;
        }
    }

    /// As [`Self::worn_out`], for an address that this machine has got since.
    pub(super) async fn has_other_addresses(&self) -> String {
        self.addresses.have_changed().await
    }
}

/// Who publishes, for as long as it can be asked.
#[derive(Clone)]
pub(super) struct Sources {
    participant: DomainParticipant,
    threads: Arc<Threads>,
    pulse: Option<Rc<Pulse>>,
    /// When the network was.
    joined: Instant,
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

    /// Every topic that another publishes now, by name.
    pub(super) fn list(&self) -> Vec<Source> {
        // As in `mismatches`.
        if !self.threads.live() {
            return Vec::new();
        }
        let writers = self.participant.discovered_writers();
        let own = self.participant.guid().prefix;
        // RustDDS discovers the node itself too.
        let mut sources: Vec<_> = writers
            .iter()
            .filter(|writer| writer.publication_topic_data.key.prefix != own)
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
