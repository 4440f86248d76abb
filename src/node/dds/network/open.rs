//! The opening of a network: topics, services, and the tasks that read.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use ros2_client::QosProfile;
use ros2_client::qos::History;
use rustdds::Topic;
use serde::Serialize;
use tokio::sync::Mutex;
use tracing::warn;

use super::{Network, Sources, Triggers};
use crate::args::Setup;
use crate::args::security::Security;
use crate::msg::heard::TF_STATIC;
use crate::msg::sent;
use crate::msg::twins::{Detection3DArray, PolygonInstanceStamped};
use crate::node::clock::{TimeOfDay, Watch};
use crate::node::dds::addresses::Addresses;
use crate::node::dds::answering::Answering;
use crate::node::dds::latched::Latched;
use crate::node::dds::outlet::Outlet;
use crate::node::dds::pulse::Pulse;
use crate::node::dds::read::{self, Memory};
use crate::node::dds::threads::Threads;
use crate::node::dds::{Events, Opener, namesakes};
use crate::node::middleware::OpenError;
use crate::node::parameters::Parameters;
use crate::node::transport::Service;

/// Most deltas that are kept for a reader that does not acknowledge them: more than 20 s of them, after which ROS readers
/// that have died are forgotten.
const DELTAS: i32 = 1024;

/// Most snapshots, which replace each other.
const SNAPSHOTS: i32 = 16;

/// Most messages of markers, which can be the largest of all.
const MARKERS: i32 = 4;

/// Most reports, and most lines of the log.
const REPORTS: i32 = 256;

/// Most polygons: those of one map.
const POLYGONS: i32 = sent::POLYGONS.qos.depth as i32;

/// Calls of one of the node's own services that may wait.
const CALLS: usize = 10;

impl Network {
    /// Opens the node and starts reading.
    pub(in crate::node::dds) fn open(
        setup: &Setup,
        security: &Security,
        memory: &Memory,
        parameters: &Rc<Parameters>,
        events: &Events,
    ) -> Result<Self, OpenError> {
        let time_of_day = Watch::begin(TimeOfDay::read());
        let addresses = Addresses::at_joining(&setup.config().network_interfaces);
        let (opener, threads) = Threads::started_by(|| Opener::new(setup, security));
        let mut opener = opener?;
        let pulse = pulse(&opener);
        let (participant, threads) = (opener.participant.clone(), Arc::new(threads));
        let sources = Sources { participant, threads, pulse: pulse.clone(), joined: Instant::now() };
        let transforms = opener.topic(TF_STATIC.named(), &read::latched_qos())?;
        let network = Self {
            clusters: Outlet::open(&mut opener, sent::CLUSTERS, SNAPSHOTS)?,
            delta: Outlet::open(&mut opener, sent::DELTA, DELTAS)?,
            markers: Outlet::open(&mut opener, sent::MARKERS, MARKERS)?,
            labelled: opener.publisher(sent::LABELLED.named(), &labelled_qos())?,
            diagnostics: permitted(Outlet::open(&mut opener, sent::DIAGNOSTICS, REPORTS)),
            log: permitted(Outlet::open(&mut opener, sent::LOG, REPORTS)),
            detections: detections(setup, &mut opener)?,
            polygons: polygons(setup, &mut opener)?,
            reset: triggers(&mut opener, Service::Reset)?,
            save: triggers(&mut opener, Service::Save)?,
            pulse,
            participant: opener.participant.clone(),
            readers: Mutex::new(read::listen(&mut opener, &sources, memory, parameters, events)?),
            ends: opener.ends,
            node: opener.node,
            context: opener.context,
            sources,
            sessions: RefCell::default(),
            number: memory.next_number(),
            reopened: Cell::new(0),
            time_of_day,
            addresses,
            has_keys: read::has_keys(security),
        };
        network.listen_to_calls(events)?;
        network.listen_to_namesakes(setup.fully_qualified_name(), memory)?;
        if !network.has_keys {
            network.listen_to_found(transforms, memory, events)?;
        }
        Ok(network)
    }

    fn listen_to_calls(&self, events: &Events) -> Result<(), OpenError> {
        for service in [Service::Reset, Service::Save] {
            let serving =
                read::serve(service, Rc::clone(self.triggers(service)), self.number, events.clone());
            self.readers.try_lock().map_err(OpenError::opening(service.name()))?.spawn_local(serving);
        }
        Ok(())
    }

    /// Notes other nodes of this node's name; where the keys do not permit it the node does without.
    fn listen_to_namesakes(&self, name: String, memory: &Memory) -> Result<(), OpenError> {
        let namesakes = Rc::clone(&memory.namesakes);
        match namesakes.open(&self.participant) {
            Ok(reader) => {
                let reading = namesakes::read(reader, namesakes, name);
                self.readers
                    .try_lock()
                    .map_err(OpenError::opening("the names of nodes"))?
                    .spawn_local(reading);
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
            threads: Arc::clone(&self.sources.threads),
            pulse: self.pulse.clone(),
            topic,
            qos: read::latched_qos(),
            taken: Rc::clone(&memory.latched),
            events: events.clone(),
        };
        self.readers.try_lock().map_err(OpenError::opening(TF_STATIC.name))?.spawn_local(latched.read(news));
        Ok(())
    }
}

fn triggers(opener: &mut Opener<'_>, service: Service) -> Result<Rc<Triggers>, OpenError> {
    Ok(Rc::new(Answering::new(service.name(), opener.server(service.named(), CALLS)?)))
}

/// What is of use and not needed: where it cannot be opened the node does without, and says so.
fn permitted<M: Serialize>(outlet: Result<Outlet<M>, OpenError>) -> Option<Outlet<M>> {
    outlet.inspect_err(|error| warn!("what the node says of itself is not sent: {error}")).ok()
}

fn labelled_qos() -> rustdds::QosPolicies {
    let depth = sent::LABELLED.qos.depth;
    (&QosProfile::subscription_default().history(History::KeepLast { depth })).into()
}

fn detections(setup: &Setup, opener: &mut Opener<'_>) -> Result<Option<Outlet<Detection3DArray>>, OpenError> {
    setup.config().twins.detections.then(|| Outlet::open(opener, sent::DETECTIONS, SNAPSHOTS)).transpose()
}

fn polygons(
    setup: &Setup,
    opener: &mut Opener<'_>,
) -> Result<Option<Outlet<PolygonInstanceStamped>>, OpenError> {
    setup.config().twins.polygons.then(|| Outlet::open(opener, sent::POLYGONS, POLYGONS)).transpose()
}

fn pulse(opener: &Opener) -> Option<Rc<Pulse>> {
    let watched = Pulse::open(opener);
    let unwatched = |error: &OpenError| warn!("it will not be noticed when the middleware hangs: {error}");
    watched.inspect_err(unwatched).ok().map(Rc::new)
}
