//! Latched transforms of publishers that have just been found.
//!
//! A reliable reader of RustDDS takes nothing of a publisher before its heartbeat. Fast DDS sends one when it has found the
//! reader, which mostly has not found it by then, and the next 3 s later. A reader that is opened when the publisher is known
//! hears the first, unless the two threads of RustDDS tell each other of the reader later than Fast DDS answers (one time in
//! ten): then the next one does. It gets what all the others have latched too, which was taken before and is not taken again.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use futures::{Stream, StreamExt, pin_mut};
use ros2_client::{Gid, MessageInfo, NodeEvent};
use rustdds::no_key::SimpleDataReaderCdr;
use rustdds::policy::Durability;
use rustdds::{DomainParticipant, QosPolicies, Topic, TopicDescription as _};
use tokio::task::JoinSet;
use tokio::time::sleep;
use tracing::warn;

use super::Events;
use super::pulse::Pulse;
use super::threads::Threads;
use crate::msg::heard::TF_STATIC;
use crate::msg::ros::TfMessage;
use crate::node::heard::{Order, PublisherId, Taken};
use crate::node::middleware::OpenError;
use crate::node::transport::Event;

/// Where transforms come that hold for all time.
const TOPIC: &str = TF_STATIC.name;

/// Time between two openings: publishers that come together are heard by one reader.
const REST: Duration = Duration::from_millis(200);

/// Readers that are opened for one publisher. It may have nothing to tell.
const TRIES: u32 = 3;

/// Most openings on one network: whoever makes up publishers without end is not answered without end.
const MOST: u32 = 1000;

/// What latched transforms are taken of, by whichever reader has them first.
pub(super) fn event<Request>(
    taken: &RefCell<Taken>,
    message: TfMessage,
    info: &MessageInfo,
) -> Option<Event<Request>> {
    let publisher = info.publisher_gid().to_bytes16();
    let order = taken.borrow_mut().note(publisher, info.sequence_number());
    (order != Order::Known).then_some(Event::Transforms {
        message,
        is_static: true,
        publisher: Some(publisher),
    })
}

/// The publishers that are there, and how many readers may still be opened for each.
#[derive(Debug, Default)]
struct Waited(BTreeMap<PublisherId, u32>);

impl Waited {
    /// Notes who is there now; says whether one of them is still to be heard.
    fn note(&mut self, there: BTreeSet<PublisherId>, is_heard: impl Fn(PublisherId) -> bool) -> bool {
        self.0.retain(|publisher, _| there.contains(publisher));
        for publisher in there {
            let left = self.0.entry(publisher).or_insert(TRIES);
            if is_heard(publisher) {
                *left = 0;
            }
        }
        self.0.values().any(|&left| left > 0)
    }

    /// Notes that a reader was opened for all.
    fn spend(&mut self) {
        self.0.values_mut().for_each(|left| *left = left.saturating_sub(1));
    }
}

/// Opens a reader whenever a publisher is found.
pub(super) struct Latched {
    pub(super) participant: DomainParticipant,
    pub(super) threads: Arc<Threads>,
    pub(super) pulse: Option<Rc<Pulse>>,
    pub(super) topic: Topic,
    pub(super) qos: QosPolicies,
    /// Shared with the reader that is always open.
    pub(super) taken: Rc<RefCell<Taken>>,
    pub(super) events: Events,
}

impl Latched {
    /// Reads for as long as there is news of the network.
    pub(super) async fn read(self, news: impl Stream<Item = NodeEvent>) -> Cow<'static, str> {
        pin_mut!(news);
        let (mut waited, mut reading) = (Waited::default(), JoinSet::new());
        for _ in 0..MOST {
            while !waited.note(self.publishers(), |publisher| self.taken.borrow().knows(publisher)) {
                if news.next().await.is_none() {
                    return TOPIC.into();
                }
            }
            // Where the middleware is held it would hold whoever asks it for a reader.
            if self.answers().await {
                waited.spend();
                match self.open() {
                    Ok(reader) => {
                        reading.shutdown().await;
                        reading.spawn_local(take(reader, Rc::clone(&self.taken), self.events.clone()));
                    }
                    Err(error) => warn!("what was latched before may take 3 s to come: {error}"),
                }
            }
            sleep(REST).await;
        }
        warn!("{TOPIC} was read anew {MOST} times: what is latched may take 3 s to come from now on");
        std::future::pending().await
    }

    async fn answers(&self) -> bool {
        match &self.pulse {
            Some(pulse) => pulse.is_there().await,
            None => true,
        }
    }

    /// Those that latch.
    fn publishers(&self) -> BTreeSet<PublisherId> {
        // What its threads share may not be readable where one has died.
        if !self.threads.live() {
            return BTreeSet::new();
        }
        let writers = self.participant.discovered_writers();
        let of_topic = writers.iter().map(|writer| &writer.publication_topic_data).filter(|writer| {
            writer.topic_name == self.topic.name() && writer.durability == Some(Durability::TransientLocal)
        });
        of_topic.map(|writer| Gid::from(writer.key).to_bytes16()).collect()
    }

    fn open(&self) -> Result<SimpleDataReaderCdr<TfMessage>, OpenError> {
        // Not as one of the node's: what the libraries tell others of the node would name those before too.
        let subscriber = self.participant.create_subscriber(&self.qos).map_err(OpenError::opening(TOPIC))?;
        subscriber
            .create_simple_datareader_no_key(&self.topic, Some(self.qos.clone()))
            .map_err(OpenError::opening(TOPIC))
    }
}

async fn take(reader: SimpleDataReaderCdr<TfMessage>, taken: Rc<RefCell<Taken>>, events: Events) {
    let messages = reader.as_async_stream();
    pin_mut!(messages);
    while let Some(message) = messages.next().await {
        // As in `read`: a place first. What cannot be decoded is said by the reader that is always open.
        let Ok(place) = events.reserve().await else { return };
        let Ok(message) = message else { continue };
        let info = MessageInfo::from(&message);
        if let Some(event) = event(&taken, message.into_value(), &info) {
            place.send(event);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::heard::tests::publisher;

    #[test]
    fn who_is_heard_is_not_waited_for_nor_is_who_has_nothing_to_tell_for_ever() {
        let there =
            |numbers: &[u32]| numbers.iter().map(|&number| publisher(number)).collect::<BTreeSet<_>>();
        let mut waited = Waited::default();
        assert!(!waited.note(there(&[]), |_| false));
        assert!(waited.note(there(&[1, 2]), |heard| heard == publisher(1)));
        waited.spend();
        assert!(!waited.note(there(&[1, 2]), |_| true));
        for _ in 0..TRIES {
            assert!(waited.note(there(&[1, 2, 3]), |heard| heard != publisher(3)));
            waited.spend();
        }
        assert!(!waited.note(there(&[1, 2, 3]), |heard| heard != publisher(3)));
        assert!(!waited.note(there(&[2]), |_| false) && waited.0.len() == 1, "who has gone is forgotten");
        assert!(waited.note(there(&[2, 3]), |_| false), "and waited for when it comes again");
    }

    #[test]
    fn what_two_readers_have_of_a_publisher_is_taken_once() {
        let taken = RefCell::new(Taken::default());
        let tell = |number, sequence| {
            let info = MessageInfo::new(None, None, sequence, publisher(number).into(), None);
            event::<()>(&taken, TfMessage::default(), &info).is_some()
        };
        assert!(tell(1, 1) && tell(1, 2) && tell(2, 1), "by the reader that is always open");
        assert!(!tell(1, 1) && !tell(1, 2) && !tell(2, 1), "by the one that was opened later");
        assert!(tell(3, 1) && tell(1, 3));
    }
}
