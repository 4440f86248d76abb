//! [`Transport`] over ROS 2's DDS. The only module that imports `ros2_client` and `rustdds`.
//!
//! Everything runs on the thread of one [`tokio::task::LocalSet`]. Clouds are decoded while the middleware's buffer is
//! borrowed, so no cloud is copied; each subscription is a task that hands events to one bounded channel and waits
//! when it is full: what the middleware then drops shows as a gap in the publisher's sequence numbers.

mod addresses;
mod answering;
mod farewell;
mod latched;
mod mismatch;
mod namesakes;
mod network;
mod opener;
mod opening;
mod outlet;
mod parameters;
mod patience;
mod pulse;
mod read;
mod robot;
mod secure;
mod snapshot_reader;
mod system;
mod threads;

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use ros2_client::RmwRequestId;
use tokio::sync::mpsc;
use tokio::task::spawn_local;
use tracing::warn;

use self::network::Network;
use self::opener::{Opener, check_interface, reliable, reliable_output, those_there};
use self::opening::in_time;
use self::read::Memory;
pub use self::robot::Robot;
pub use self::snapshot_reader::SnapshotReader;
pub use self::system::receive_buffer;
use super::middleware::{Adding, EVENTS, Middleware, OpenError, Opened};
use super::parameters::Parameters;
use super::readers::Readers;
use super::transport::{Event, Input, NetworkState, SendError, SensorTopics, Service, Source, Transport};
use crate::args::Setup;
use crate::args::security::Security;
use crate::bag::TransformTopics;
use crate::config::Value;
use crate::memory::prefault;
use crate::msg::outgoing::Outgoing;
use crate::msg::ros::{TriggerRequest, TriggerResponse};

/// Receive buffers to have memory for before anything is received. RustDDS 0.15.1 empties a socket before it works on what was
/// in it: where that takes fresh memory more slowly than a publisher on the same machine sends, it never ends, and
/// the node is deaf.
const BURSTS: usize = 2;

/// More than that of them (bytes) is asked for to be safe, and no memory.
const LARGEST_BURST: usize = 64 << 20;

/// Time that a network stays joined at least, for scans rest while it is joined anew: containers may bring addresses all the time, and
/// a clock that is being disciplined may be set back again and again. What has ended is not waited for.
const STAY: Duration = Duration::from_secs(5);

/// Time until the network is joined again where no address was there, and how many times it is tried until that is said again.
const AGAIN: Duration = Duration::from_secs(5);
const SAID_EVERY: u64 = 12;
/// How often the network is tried to be joined anew where the middleware fails, as it does when it is stopped meanwhile.
const FAILURES: u32 = 3;
const SOON: Duration = Duration::from_millis(500);

/// Adds events to those of the network.
type Events = Adding<Dds>;

impl ros2_client::Message for TriggerRequest {}
impl ros2_client::Message for TriggerResponse {}

/// Who has called one of the node's own services.
#[derive(Clone, Copy, Debug)]
pub struct Caller {
    id: RmwRequestId,
    /// The number of the network that it was heard on.
    network: u32,
}

/// The node on DDS, for as long as it runs: where a thread of the middleware ends, topics were opened anew too often, the
/// system's clock was set back, or this machine has another address, the network is joined anew under the same name, and nothing that is known is forgotten.
pub struct Dds {
    setup: Setup,
    security: Security,
    events: Events,
    memory: Memory,
    parameters: Rc<Parameters>,
    network: RefCell<Rc<Network>>,
    inputs: Vec<SensorTopics>,
    transforms: TransformTopics,
    /// Fully qualified.
    name: String,
    /// Of its sockets (bytes).
    receive_buffer: usize,
}

impl Dds {
    fn network(&self) -> Rc<Network> {
        Rc::clone(&self.network.borrow())
    }

    /// Joins anew, as soon as one of the interfaces that are asked for is there: after a sleep a wireless one comes back late.
    async fn join_anew(&self, reason: &str) -> Result<(), OpenError> {
        let (mut attempts, mut failures) = (0_u64, 0);
        loop {
            match self.try_to_join_anew(reason).await {
                Err(error @ OpenError::Interface { .. }) => {
                    if attempts.is_multiple_of(SAID_EVERY) {
                        let seconds = AGAIN.as_secs();
                        warn!(
                            "{reason}: the network cannot be joined anew: {error}; it is tried every {seconds} s"
                        );
                    }
                    attempts += 1;
                    tokio::time::sleep(AGAIN).await;
                }
                Err(error @ OpenError::Open { .. }) if failures + 1 < FAILURES => {
                    failures += 1;
                    warn!("{reason}: the network cannot be joined anew: {error}; it is tried again");
                    tokio::time::sleep(SOON).await;
                }
                ended => return ended,
            }
        }
    }

    /// The network before is left without a farewell of its own, for which its threads may be gone; it is said once they are. Late
    /// readers are given nothing of what was sent there, so that the node is told.
    async fn try_to_join_anew(&self, reason: &str) -> Result<(), OpenError> {
        let Self { setup, security, memory, parameters, events, .. } = self;
        let anew = in_time(|| Network::open(setup, security, memory, parameters, events))?;
        warn!("{reason}: the network is joined anew, the map stays");
        let before = self.network.replace(Rc::new(anew));
        if let Some(farewell) = before.farewell(&self.network()) {
            spawn_local(farewell.say_once_gone());
        }
        before.deafen().await;
        // Where the node ends, nobody hears it or needs to.
        drop(events.send(Event::Joined).await);
        Ok(())
    }
}

impl Middleware for Dds {
    const NAME: &str = "DDS";

    fn check(setup: &Setup) -> Result<Security, OpenError> {
        let addresses = &setup.config().network_interfaces;
        // At the start each must be there; where the network is joined anew, be it by a process in this one's place, one is enough.
        if setup.begins_anew {
            those_there(addresses)?;
        } else {
            addresses.iter().copied().try_for_each(check_interface)?;
        }
        Ok(setup.security()?)
    }

    fn say_system(setup: &Setup) {
        system::say_system(setup);
    }

    async fn open(setup: &Setup, security: Security) -> Result<Opened<Self>, OpenError> {
        prefault(BURSTS * setup.config().receive_buffer.min(LARGEST_BURST));
        let (events, receiver) = mpsc::channel(EVENTS);
        let memory = Memory::default();
        let parameters = Rc::new(Parameters::of(setup));
        let network = in_time(|| Network::open(setup, &security, &memory, &parameters, &events))?;
        let dds = Self {
            setup: setup.clone(),
            security,
            events: events.clone(),
            memory,
            parameters,
            network: RefCell::new(Rc::new(network)),
            inputs: setup.sensor_topics()?,
            transforms: setup.transform_topics()?,
            name: setup.fully_qualified_name(),
            receive_buffer: receive_buffer(setup),
        };
        Ok((dds, events, receiver))
    }

    async fn close(self) -> impl FnOnce() {
        let leave = match Rc::into_inner(self.network.into_inner()) {
            Some(network) => Some(network.close().await),
            None => None,
        };
        move || leave.into_iter().for_each(|leave| leave())
    }

    fn changed(&self, setup: &Setup) -> Vec<(String, Value)> {
        self.parameters.other_than(&setup.parameters)
    }

    async fn answers(&self) -> bool {
        self.network().answers().await
    }
}

impl Transport for Dds {
    type Request = Caller;

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        self.network().publish(message).await
    }

    async fn answer(
        &self,
        service: Service,
        Caller { id, network }: Caller,
        response: TriggerResponse,
    ) -> Result<(), SendError> {
        let now = self.network();
        if network == now.number {
            return now.answer(service, id, response).await;
        }
        now.answer_once_found(service, id, response);
        Ok(())
    }

    fn inputs(&self) -> &[SensorTopics] {
        &self.inputs
    }

    fn transform_topics(&self) -> &TransformTopics {
        &self.transforms
    }

    fn chosen(&self, input: Input) {
        self.memory.choose(input);
    }

    fn losses(&self) -> &'static str {
        "see receive_buffer"
    }

    fn silences(&self) -> &'static str {
        "or its messages are too large for the socket receive buffer, or it sends by shared memory only"
    }

    fn sources(&self) -> Vec<Source> {
        self.network().sources()
    }

    fn knows_all_sources(&self) -> bool {
        self.network().knows_all_sources()
    }

    fn node_name(&self) -> &str {
        &self.name
    }

    fn network_state(&self) -> NetworkState {
        let network = self.network();
        NetworkState {
            receive_buffer: Some(self.receive_buffer),
            mismatches: network.mismatches(),
            without_router: false,
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
                reason = network.has_other_addresses() => reason,
            };
            drop(network);
            if let Err(error) = self.join_anew(&reason).await {
                return error.to_string();
            }
        }
    }
}
