//! What the node sends. A reader that is slow, or behind a link that is, holds nothing up: Zenoh drops for it what it cannot
//! pass on within some milliseconds, and what it keeps for late readers is handed to it on a thread aside.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::time::Duration;

use futures::future::select_all;
use zenoh::Wait as _;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh_ext::{AdvancedPublisherBuilderExt as _, CacheConfig, MissDetectionConfig};

use super::latched::Latched;
use super::names::{Attachment, Kind};
use super::opener::{Known, Opener};
use crate::msg::sent;
use crate::msg::topic::{Named, Topic};
use crate::node::clock;
use crate::node::middleware::OpenError;
use crate::node::transport::SendError;

/// Time until a reader is told the number of the newest message, by which it sees that it has missed it.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Opens all topics that parameters ask for, by their names.
pub(super) fn open(opener: &Opener) -> Result<BTreeMap<&'static str, Outlet>, OpenError> {
    let twins = opener.setup.config().twins;
    let topics = sent::TOPICS.into_iter().filter(|topic| twins.include(topic));
    topics.map(|topic| Ok((topic.name, Outlet::open(opener, topic)?))).collect()
}

/// Resolves, with a reason, when one of them sends nothing any more.
pub(super) async fn ended(outlets: &BTreeMap<&'static str, Outlet>) -> String {
    select_all(outlets.values().map(|outlet| Box::pin(outlet.ended()))).await.0
}

enum Sender {
    Live(Publisher<'static>),
    /// Keeps the newest for late readers.
    Latched(Latched<Message>),
}

/// In CDR, with its attachment.
type Message = (Vec<u8>, Vec<u8>);

/// A topic that is published.
pub(super) struct Outlet {
    name: &'static str,
    sender: Sender,
    known: Known,
    sent: Cell<i64>,
}

impl Outlet {
    pub(super) fn open(opener: &Opener, Topic { name, type_name, qos }: Topic) -> Result<Self, OpenError> {
        let resolved = opener.setup.resolve(name)?;
        let named = Named { name: &resolved, type_name };
        let publisher = opener.session.declare_publisher(named.key(opener.setup.domain));
        let publisher = publisher.congestion_control(CongestionControl::Drop);
        let sender = if qos.latched {
            let latched = publisher.cache(CacheConfig::default().max_samples(qos.depth));
            let missed = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
            let latched = latched.publisher_detection().sample_miss_detection(missed).wait();
            let latched = latched.map_err(OpenError::opening(&resolved))?;
            let put =
                move |(message, attachment): Message| latched.put(message).attachment(attachment).wait();
            Sender::Latched(Latched::start(qos.depth, put).map_err(OpenError::opening("a thread"))?)
        } else {
            Sender::Live(publisher.wait().map_err(OpenError::opening(&resolved))?)
        };
        Ok(Self { name, sender, known: opener.tell(Kind::Publisher, named, qos)?, sent: Cell::new(0) })
    }

    /// Resolves, with a reason, when the thread that sends has ended; never where the node's own does.
    async fn ended(&self) -> String {
        match &self.sender {
            Sender::Live(_) => std::future::pending().await,
            Sender::Latched(latched) => latched.ended().await,
        }
        format!("the thread that sends {} has ended", self.name)
    }

    /// Sends a message in CDR.
    pub(super) fn send(&self, message: Result<Vec<u8>, cdr_encoding::Error>) -> Result<(), SendError> {
        let message = message.map_err(|error| SendError::refused(self.name, &error))?;
        self.sent.set(self.sent.get() + 1);
        let attachment =
            Attachment { number: self.sent.get(), stamp: clock::now().nanos(), publisher: self.known.id };
        match &self.sender {
            Sender::Live(publisher) => {
                let sent = publisher.put(message).attachment(attachment.bytes()).wait();
                sent.map_err(|error| SendError::refused(self.name, &error))
            }
            Sender::Latched(latched) => {
                let before = latched.send((message, attachment.bytes()));
                before.map_or(Ok(()), |error| Err(SendError::refused(self.name, &error)))
            }
        }
    }
}
