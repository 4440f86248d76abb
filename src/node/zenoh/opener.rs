//! The node's ends on a session: what it listens to, what it sends, what it serves, each with its token.

use std::cell::Cell;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;
use zenoh::bytes::ZBytes;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::query::{Query, Queryable};
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait as _};
use zenoh_ext::{AdvancedSubscriber, AdvancedSubscriberBuilderExt as _, HistoryConfig};

use super::Events;
use super::answers::{Answers, Held, Places};
use super::discards::Discards;
use super::mailbox::{Mailbox, Room};
use super::names::{Attachment, Kind, NodeToken, publisher_id};
use crate::args::Setup;
use crate::msg::cdr;
use crate::msg::topic::{Named, Qos};
use crate::node::clock;
use crate::node::heard::{Origin, PublisherId};
use crate::node::middleware::OpenError;
use crate::node::places::without_places;
use crate::node::transport::{Event, SendError};

/// What a service is declared with, as in ROS.
const SERVICES: Qos = Qos::reliable(10);

/// Calls of a service that may be under way: more than wait for a map to be written.
const UNDER_WAY: usize = 128;

/// Time for a publisher to send what it keeps for late readers.
const HISTORY: Duration = Duration::from_secs(10);

/// A node on a session; others see it while it is kept, and each of its ends while that is.
pub(super) struct Opener {
    pub(super) setup: Setup,
    pub(super) session: Session,
    node: NodeToken,
    _token: LivelinessToken,
    ends: Cell<u64>,
    answers: Answers,
    discards: Discards<Query>,
}

impl Opener {
    pub(super) fn new(setup: &Setup, session: &Session, answers: Answers) -> Result<Self, OpenError> {
        let Setup { domain, namespace, name, .. } = setup;
        let (namespace, name) = (namespace.clone(), name.clone());
        let node = NodeToken { domain: *domain, id: session.zid().to_string(), namespace, name };
        let (setup, session) = (setup.clone(), session.clone());
        let (token, ends, discards) = (declare(&session, node.key())?, Cell::new(0), Discards::start()?);
        Ok(Self { setup, session, node, _token: token, ends, answers, discards })
    }

    /// The node as others know it.
    pub(super) const fn node(&self) -> &NodeToken {
        &self.node
    }

    /// Tells others of an end.
    pub(super) fn tell(&self, kind: Kind, named: Named<'_>, qos: Qos) -> Result<Known, OpenError> {
        self.ends.set(self.ends.get() + 1);
        let key = self.node.key_of(self.ends.get(), kind, named, qos);
        Ok(Known { id: publisher_id(&key), _token: declare(&self.session, key)? })
    }

    /// Listens to a topic, by its resolved name, of which remappings would make another; what is kept of a latched one for late
    /// readers is asked for.
    pub(super) fn subscribe(&self, named: Named<'_>, qos: Qos, room: Room) -> Result<Inbox, OpenError> {
        let resolved = named.name;
        let mailbox = Arc::new(Mailbox::new(room));
        let there = Arc::clone(&mailbox);
        let put = move |sample: Sample| {
            if sample.kind() == SampleKind::Put {
                let bytes = length([Some(sample.payload()), sample.attachment()]);
                drop(there.put(sample, bytes));
            }
        };
        let key = named.key_of_any(self.setup.domain);
        let subscriber = self.session.declare_subscriber(key).callback(put);
        let reader = if qos.latched {
            let history = HistoryConfig::default().detect_late_publishers().max_samples(qos.depth);
            let subscriber = subscriber.history(history).query_timeout(HISTORY).subscriber_detection();
            Reader::Latched(subscriber.wait().map_err(OpenError::opening(resolved))?)
        } else {
            Reader::Live(subscriber.wait().map_err(OpenError::opening(resolved))?)
        };
        let known = self.tell(Kind::Subscription, named, qos)?;
        Ok(Inbox { name: resolved.to_owned(), mailbox, _reader: reader, _known: known })
    }

    /// Serves calls.
    pub(super) fn serve(
        &self,
        Named { name, type_name }: Named<'static>,
        room: Room,
    ) -> Result<Calls, OpenError> {
        let resolved = self.setup.resolve_service(name)?;
        let named = Named { name: &resolved, type_name };
        let mailbox = Arc::new(Mailbox::new(room));
        let there = Arc::clone(&mailbox);
        let discards = self.discards.clone();
        let put = move |query: Query| {
            let bytes = bytes_of(&query);
            discards.add(there.put(query, bytes).into_iter().map(emptied));
        };
        let key = named.key_of_any(self.setup.domain);
        let queryable = self.session.declare_queryable(key).complete(true).callback(put).wait();
        let queryable = queryable.map_err(OpenError::opening(&resolved))?;
        let known = self.tell(Kind::Service, named, SERVICES)?;
        let key = named.key(self.setup.domain);
        let (places, answers) = (Places::new(UNDER_WAY), self.answers.clone());
        Ok(Calls { name, key, mailbox, places, answers, _queryable: queryable, _known: known })
    }
}

fn declare(session: &Session, key: String) -> Result<LivelinessToken, OpenError> {
    session.liveliness().declare_token(key).wait().map_err(OpenError::opening("a token"))
}

/// An end that others know of while this is kept.
pub(super) struct Known {
    /// What names it in its messages.
    pub(super) id: PublisherId,
    _token: LivelinessToken,
}

fn length<const N: usize>(parts: [Option<&ZBytes>; N]) -> usize {
    parts.into_iter().flatten().map(ZBytes::len).sum()
}

/// What a call has in bytes, as far as a caller may make it long.
fn bytes_of(query: &Query) -> usize {
    length([query.payload(), query.attachment()]) + query.parameters().as_str().len()
}

/// A call of which nothing but the end is needed, without what it has brought.
fn emptied(mut query: Query) -> Query {
    query.payload_mut().map(std::mem::take);
    query.attachment_mut().map(std::mem::take);
    query
}

/// Kept while it is listened.
enum Reader {
    Live(#[expect(dead_code, reason = "its end is that of the listening")] Subscriber<()>),
    Latched(#[expect(dead_code, reason = "the same")] AdvancedSubscriber<()>),
}

/// The messages of a topic.
pub(super) struct Inbox {
    /// Fully qualified.
    pub(super) name: String,
    mailbox: Arc<Mailbox<Sample>>,
    _reader: Reader,
    _known: Known,
}

/// A message as it came.
pub(super) struct Received {
    sample: Sample,
    /// Messages before it that found no room.
    pub(super) dropped: u64,
}

impl Inbox {
    pub(super) async fn take(&self) -> Received {
        let (sample, dropped) = self.mailbox.take().await;
        Received { sample, dropped }
    }
}

impl Received {
    /// The message; copied where Zenoh has it in pieces.
    pub(super) fn bytes(&self) -> std::borrow::Cow<'_, [u8]> {
        self.sample.payload().to_bytes()
    }

    /// Who sent it, and its number, where it tells.
    pub(super) fn origin(&self) -> Option<Origin> {
        let Attachment { publisher, number, .. } = Attachment::read(&self.sample.attachment()?.to_bytes())?;
        Some(Origin { publisher, number })
    }
}

/// The calls of a service.
pub(super) struct Calls {
    pub(super) name: &'static str,
    /// That an answer goes by.
    key: String,
    mailbox: Arc<Mailbox<Query>>,
    places: Places,
    answers: Answers,
    _queryable: Queryable<()>,
    _known: Known,
}

impl Calls {
    /// The next one. The node is told of what is none, and how many were lost; nothing where the node has ended.
    pub(super) async fn take<Q: DeserializeOwned>(&self, events: &Events) -> Option<(Call, Q)> {
        loop {
            let place = self.places.free().await;
            let (mut query, dropped) = self.mailbox.take().await;
            let read = self.read(&mut query);
            let query = Held::new(query, place, &self.answers);
            if let Some(lost) = lost(self.name, dropped) {
                events.send(lost).await.ok()?;
            }
            match read {
                Ok((key, attachment, request)) => {
                    return Some((Call { query, service: self.name, key, attachment }, request));
                }
                Err(text) => events.send(Event::Garbled { topic: self.name.into(), text }).await.ok()?,
            }
        }
    }

    /// The key that its answer goes by, who calls, and what is asked, which is not kept.
    fn read<Q: DeserializeOwned>(&self, query: &mut Query) -> Result<(String, Attachment, Q), String> {
        let attachment = query.attachment().and_then(|attachment| Attachment::read(&attachment.to_bytes()));
        let attachment = attachment.ok_or("a call without who calls and its number")?;
        let payload = query.payload_mut().ok_or("a call without a request")?;
        let request = cdr::read(&std::mem::take(payload).to_bytes())?;
        let asked = query.key_expr();
        // An answer goes by one key.
        let key = if asked.is_wild() { self.key.clone() } else { asked.as_str().to_owned() };
        Ok((key, attachment, request))
    }
}

/// What the node is told where so many messages found no room.
pub(super) fn lost<R>(topic: &'static str, dropped: u64) -> Option<Event<R>> {
    let text = || format!("messages that came faster than they were read, and are lost: {dropped}");
    (dropped > 0).then(|| Event::Garbled { topic: topic.into(), text: text() })
}

/// A call to answer.
pub struct Call {
    query: Held<Query>,
    service: &'static str,
    key: String,
    attachment: Attachment,
}

impl fmt::Debug for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Call").field("key", &self.key).finish_non_exhaustive()
    }
}

impl Call {
    /// Has it answered, by the thread of answers.
    pub(super) fn answer(self, response: &impl Serialize) -> Result<(), SendError> {
        let Self { query, service, key, attachment } = self;
        let mut bytes = Vec::new();
        cdr::write(&mut bytes, response).map_err(|error| SendError::unanswered(service, &error))?;
        query.answer(move |query| {
            // Its number and who called go back as they came.
            let attachment = Attachment { stamp: clock::now().nanos(), ..attachment };
            let reply = query.reply(key, bytes).attachment(attachment.bytes());
            reply.wait().map_err(|error| without_places(&error.to_string()))
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use zenoh::Config;

    use super::*;

    /// A session that neither looks for others nor lets any in.
    fn alone() -> Session {
        let mut config = Config::default();
        let settings =
            [("mode", "\"peer\""), ("scouting/multicast/enabled", "false"), ("listen/endpoints", "[]")];
        settings.into_iter().for_each(|(key, value)| config.insert_json5(key, value).unwrap());
        zenoh::open(config).wait().unwrap()
    }

    #[test]
    fn a_call_counts_with_all_that_it_has_brought_and_waits_for_its_end_without() {
        let (session, (sender, calls)) = (alone(), std::sync::mpsc::channel());
        let put = move |query: Query| sender.send(query).unwrap();
        let _queryable = session.declare_queryable("call").callback(put).wait().unwrap();
        let _replies =
            session.get("call?a=1").payload(vec![1; 10_000]).attachment(vec![2; 500]).wait().unwrap();
        let call = calls.recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!(bytes_of(&call), 10_503);
        assert_eq!(bytes_of(&emptied(call)), 3);
    }

    #[test]
    fn messages_that_found_no_room_are_told_with_their_number() {
        assert!(lost::<()>("~/reset", 0).is_none());
        let told = lost::<()>("~/reset", 7);
        assert!(
            matches!(told, Some(Event::Garbled { topic, text }) if topic == "~/reset" && text.ends_with("lost: 7"))
        );
    }
}
