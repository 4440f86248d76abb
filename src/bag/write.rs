//! A result bag: MCAP with the profile `ros2`, whole definitions of its messages, and everything indexed.
//!
//! The same messages give the same bytes: one thread compresses, and nothing comes from a clock.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::time::Duration;

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{WriteOptions, Writer};
use serde::Serialize;

use super::clock::{Clock, unmoved};
use super::copies::{Copies, OFFERED};
use super::decode::is_transforms;
use super::qos;
use super::read::Message;
use super::schemas::definition;
use crate::engine::Stamp;
use crate::msg::cdr;
use crate::msg::heard::of_robot;
use crate::msg::outgoing::Outgoing;
use crate::msg::ros::{Header, TfMessage};
use crate::msg::sent;
use crate::msg::topic::{Named, Qos};
use crate::msg::twins::Twins;

/// The topics that a result bag holds, by their names in the program, with those that remappings give them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputTopics(BTreeMap<&'static str, String>);

impl OutputTopics {
    /// All that the node sends but its log, with these twins; `resolve` gives a topic its name.
    ///
    /// # Errors
    /// The first of `resolve`.
    pub fn new<E>(twins: Twins, resolve: impl Fn(&'static str) -> Result<String, E>) -> Result<Self, E> {
        let names = sent::TOPICS.into_iter().filter(|topic| *topic != sent::LOG && twins.include(topic));
        names.map(|topic| Ok((topic.name, resolve(topic.name)?))).collect::<Result<_, _>>().map(Self)
    }

    /// The twins that are wanted.
    pub fn twins(&self) -> Twins {
        let [detections, polygons] =
            [sent::DETECTIONS, sent::POLYGONS].map(|topic| self.0.contains_key(topic.name));
        Twins { detections, polygons }
    }
}

/// A channel of the result, and how many messages it has.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    id: u16,
    messages: u32,
}

/// Writes a result bag.
pub struct ResultBag<W: Write> {
    writer: Writer<NoSeek<W>>,
    /// By the topics' names in the program.
    channels: BTreeMap<&'static str, Channel>,
    topics: OutputTopics,
    /// Of transforms that are no input, by topic.
    transforms: BTreeMap<&'static str, Channel>,
    copies: Copies,
    with_input: bool,
    clock: Clock,
    scratch: Vec<u8>,
}

impl<W: Write> ResultBag<W> {
    /// Begins a bag; `with_input` adds the input's messages, of which there are otherwise only the transforms.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn new(out: W, topics: &OutputTopics, with_input: bool) -> io::Result<Self> {
        let mut writer = writer(out, RESULTS)?;
        let mut channels = BTreeMap::new();
        for topic in sent::TOPICS {
            if let Some(name) = topics.0.get(topic.name) {
                let named = Named { name, ..topic.named() };
                channels.insert(topic.name, channel(&mut writer, named, topic.qos)?);
            }
        }
        Ok(Self {
            channels,
            topics: topics.clone(),
            writer,
            transforms: BTreeMap::new(),
            copies: Copies::default(),
            with_input,
            clock: Clock::default(),
            scratch: Vec::new(),
        })
    }

    /// The stamps have jumped back by this many seconds, and a session begins with the next [`Self::scan`]: it and the input that
    /// belongs to it are logged after all before, for a player would otherwise mix the two.
    pub fn begin_session(&mut self, seconds: f64) {
        self.clock.begin_session(seconds);
    }

    /// The input's messages are logged by the clock of the stamps, which lies so many nanoseconds after the one by which they were
    /// recorded; from the first [`Self::scan`] on as far as that shows, for the two may go at different speeds.
    pub fn follow_stamps(&mut self, offset: i64) {
        self.clock.follow_stamps(offset);
    }

    /// A scan of this sensor, of this stamp, was recorded at this time; its results come next.
    ///
    /// # Errors
    /// Those of the output.
    pub fn scan(&mut self, sensor: usize, stamp: Stamp, recorded: Duration) -> io::Result<()> {
        let due = self.clock.scan(sensor, stamp, recorded);
        due.iter().try_for_each(|message| self.copy(message))
    }

    /// Adds a message of the node at the time of its header, where the bag has its topic; markers without any have no time.
    ///
    /// # Errors
    /// Those of the output.
    pub fn put(&mut self, message: &Outgoing) -> io::Result<()> {
        let Some(channel) = self.channels.get_mut(message.topic().name) else { return Ok(()) };
        let Some(header) = message.header() else { return Ok(()) };
        self.scratch.clear();
        message.write(&mut self.scratch).map_err(io::Error::other)?;
        write(&mut self.writer, channel, self.clock.result(stamp(header)), &self.scratch)
    }

    /// Adds transforms of `/tf`, or of `/tf_static`, at the time of the first of them.
    ///
    /// # Errors
    /// Those of the output.
    pub fn transforms(&mut self, message: &TfMessage, is_static: bool) -> io::Result<()> {
        let Some(first) = message.transforms.first() else { return Ok(()) };
        let topic = of_robot(is_static);
        let Self { writer, scratch, transforms, clock, .. } = self;
        if !transforms.contains_key(topic.name) {
            transforms.insert(topic.name, channel(writer, topic.named(), topic.qos)?);
        }
        let Some(channel) = transforms.get_mut(topic.name) else { return Ok(()) };
        put(writer, scratch, channel, clock.result(stamp(&first.header)), message)
    }

    /// Whether a message of the input would be copied, had the result no topic of that name.
    pub fn replaces(&self, message: &Message) -> bool {
        self.is_wanted(message) && self.is_own(message)
    }

    /// Whether a message of the input belongs into the result.
    fn is_wanted(&self, message: &Message) -> bool {
        self.with_input || is_transforms(message.type_name())
    }

    fn is_own(&self, message: &Message) -> bool {
        self.topics.0.values().any(|own| own == message.topic())
    }

    /// Copies a message of the input, where it is wanted.
    ///
    /// # Errors
    /// Those of the output.
    pub fn input(&mut self, message: &Message) -> io::Result<()> {
        let due = self.clock.message(message.log_time);
        due.iter().try_for_each(|message| self.copy(message))?;
        if self.is_own(message) || !self.is_wanted(message) {
            return Ok(());
        }
        self.clock.hold(message).map_or(Ok(()), |message| self.copy(message))
    }

    fn copy(&mut self, message: &Message) -> io::Result<()> {
        let channel_id = self.copies.of(&message.channel, &mut self.writer)?;
        let log_time = self.clock.logged(message.log_time);
        // Moved together, so that what lies between the two stays.
        let moved = log_time.wrapping_sub(message.log_time).cast_signed();
        let publish_time = message.publish_time.saturating_add_signed(moved);
        let header = MessageHeader { channel_id, sequence: message.sequence, log_time, publish_time };
        self.writer.write_to_known_channel(&header, &message.data).map_err(io::Error::other)
    }

    /// Writes the indexes and gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        self.clock.release().iter().try_for_each(|message| self.copy(message))?;
        self.writer.finish().map_err(io::Error::other)?;
        Ok(self.writer.into_inner().into_inner())
    }
}

/// What writes recordings, as their header names it.
pub(super) const RECORDER: &str = concat!("cfodi ", env!("CARGO_PKG_VERSION"));
/// What writes results: one that lies beside a recording is known by it.
const RESULTS: &str = concat!("cfodi ", env!("CARGO_PKG_VERSION"), " result");

/// Whether a header names what writes results, of whatever version.
pub(super) fn is_result(library: &[u8]) -> bool {
    library.starts_with(b"cfodi ") && library.ends_with(b" result")
}

/// A bag without messages, which one thread compresses.
pub(super) fn writer<W: Write>(out: W, library: &str) -> io::Result<Writer<NoSeek<W>>> {
    let options =
        WriteOptions::new().profile("ros2").library(library).compression_threads(0).disable_seeking(true);
    options.create(NoSeek::new(out)).map_err(io::Error::other)
}

pub(super) fn channel<W: Write>(
    writer: &mut Writer<NoSeek<W>>,
    Named { name, type_name }: Named<'_>,
    qos: Qos,
) -> io::Result<Channel> {
    let schema = schema(writer, type_name)?;
    let metadata = BTreeMap::from([(OFFERED.to_owned(), qos::offered(qos))]);
    let id = writer.add_channel(schema, name, "cdr", &metadata).map_err(io::Error::other)?;
    Ok(Channel { id, messages: 0 })
}

pub(super) fn schema<W: Write>(writer: &mut Writer<NoSeek<W>>, type_name: &str) -> io::Result<u16> {
    let text =
        definition(type_name).ok_or_else(|| io::Error::other(format!("no definition of {type_name}")))?;
    writer.add_schema(type_name, "ros2msg", text.as_bytes()).map_err(io::Error::other)
}

/// Adds a message at this time.
pub(super) fn put<W: Write>(
    writer: &mut Writer<NoSeek<W>>,
    scratch: &mut Vec<u8>,
    channel: &mut Channel,
    log_time: u64,
    message: &impl Serialize,
) -> io::Result<()> {
    scratch.clear();
    cdr::write(scratch, message).map_err(io::Error::other)?;
    write(writer, channel, log_time, scratch)
}

/// That of a header; zero where it has none that can be.
fn stamp(header: &Header) -> Stamp {
    header.stamp.stamp().unwrap_or_default()
}

/// When a message with this header is logged where nothing moves it.
pub(super) fn logged(header: &Header) -> u64 {
    unmoved(stamp(header))
}

fn write<W: Write>(
    writer: &mut Writer<NoSeek<W>>,
    channel: &mut Channel,
    log_time: u64,
    data: &[u8],
) -> io::Result<()> {
    let header = MessageHeader {
        channel_id: channel.id,
        sequence: channel.messages,
        log_time,
        publish_time: log_time,
    };
    channel.messages = channel.messages.wrapping_add(1);
    writer.write_to_known_channel(&header, data).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    #[test]
    fn each_topic_is_offered_as_the_node_offers_it() {
        let twins = Twins { detections: true, polygons: true };
        let topics = OutputTopics::new(twins, |name| Ok::<_, Infallible>(name.to_owned())).unwrap();
        let bag = ResultBag::new(Vec::new(), &topics, false).unwrap().finish().unwrap();
        let summary = mcap::Summary::read(&bag).unwrap().unwrap();
        assert_eq!(summary.channels.len(), 7);
        for topic in sent::TOPICS.into_iter().filter(|topic| topic.name != sent::LOG.name) {
            let channel = summary.channels.values().find(|channel| channel.topic == topic.name).unwrap();
            assert_eq!(channel.schema.as_ref().unwrap().name, topic.type_name);
            assert_eq!(channel.metadata["offered_qos_profiles"], qos::offered(topic.qos));
        }
        let many = qos::offered(sent::POLYGONS.qos);
        assert!(many.contains("depth: 4096, reliability: reliable, durability: volatile"), "{many}");
    }
}
