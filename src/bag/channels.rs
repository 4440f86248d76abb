//! Which channel a message belongs to, and which schema a channel.

use std::collections::BTreeSet;
use std::sync::Arc;

use mcap::McapError;
use mcap::read::ChannelAccumulator;
use mcap::records::MessageHeader;

use super::read::Message;
use super::records::{Record, reason};

/// Bytes of schemas and channels that are kept: a thousand of each have 10 MB.
const MAX_KEPT: usize = 32 << 20;

/// What a pair of a channel's metadata takes beside its text (bytes).
const PAIR: usize = 128;

/// What a file has said of its channels so far.
#[derive(Default)]
pub(super) struct Channels {
    known: ChannelAccumulator<'static>,
    schema_ids: BTreeSet<u16>,
    channel_ids: BTreeSet<u16>,
    /// Bytes of both.
    kept: usize,
    /// A chunk is damaged, and may have named channels.
    lacks_some: bool,
    /// Messages whose channel, or its schema, was in what is damaged.
    passed_over: u64,
    is_data_over: bool,
    /// What the records behind the data say otherwise than those before.
    contradiction: Option<String>,
}

impl Channels {
    /// Takes a record up; gives the message, where it is one. A channel or a schema that changes its meaning is an error. Behind
    /// the record that ends the data, where the summary repeats them, it is an error only if a message still follows: within a
    /// chunk that record ends nothing, and the library does not tell where it stood.
    pub(super) fn take(&mut self, record: Record) -> Result<Option<Message>, String> {
        self.keep(&record)?;
        let known = match record {
            Record::Schema { header, data } => self.known.add_schema(header, data),
            Record::Channel(channel) => self.known.add_channel(channel),
            Record::Message { header, data } => return self.message(header, data.into_owned()),
            Record::DataEnd(_) => {
                self.is_data_over = true;
                Ok(())
            }
            _ => Ok(()),
        };
        let known = match known {
            // Its schema was in what is damaged: its messages are passed over.
            Err(McapError::UnknownSchema(..)) if self.lacks_some => Ok(()),
            other => other.map_err(|error| reason(&error)),
        };
        match known {
            Err(reason) if self.is_data_over => self.contradiction = Some(reason),
            other => other?,
        }
        Ok(None)
    }

    /// A chunk is damaged. What it may have named is looked for in the file's summary; messages of a channel that is not found there
    /// are passed over and counted, for they belong to what is damaged.
    pub(super) fn lack(&mut self, summary: impl Iterator<Item = Record>) {
        self.lacks_some = true;
        // What contradicts the data is not believed.
        summary.for_each(|record| drop(self.take(record)));
    }

    /// Accounts for what is kept of a schema or a channel that is new. A file of 50 kB can hold gigabytes of them.
    fn keep(&mut self, record: &Record) -> Result<(), String> {
        let size = match record {
            Record::Schema { header, data } if self.schema_ids.insert(header.id) => {
                header.name.len() + header.encoding.len() + data.len()
            }
            Record::Channel(channel) if self.channel_ids.insert(channel.id) => {
                let pairs = channel.metadata.iter().map(|(key, value)| PAIR + key.len() + value.len());
                channel.topic.len() + channel.message_encoding.len() + pairs.sum::<usize>()
            }
            _ => return Ok(()),
        };
        self.kept += size;
        if self.kept > MAX_KEPT {
            let (schemas, channels) = (self.schema_ids.len(), self.channel_ids.len());
            return Err(format!(
                "{schemas} schemas and {channels} channels of {} bytes: at most {MAX_KEPT} are kept",
                self.kept
            ));
        }
        Ok(())
    }

    fn message(&mut self, header: MessageHeader, data: Vec<u8>) -> Result<Option<Message>, String> {
        if let Some(reason) = self.contradiction.take() {
            return Err(reason);
        }
        let Some(channel) = self.known.get(header.channel_id) else {
            if !self.lacks_some {
                return Err(reason(&McapError::UnknownChannel(header.sequence, header.channel_id)));
            }
            self.passed_over += 1;
            return Ok(None);
        };
        let MessageHeader { sequence, log_time, publish_time, .. } = header;
        Ok(Some(Message { channel, log_time, publish_time, sequence, data, damage: None }))
    }

    /// How many messages were passed over: a damaged chunk alone has named their channel or its schema.
    pub(super) const fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// All channels that the file has named, by ascending number.
    pub(super) fn all(&self) -> impl Iterator<Item = Arc<mcap::Channel<'static>>> {
        self.channel_ids.iter().filter_map(|id| self.known.get(*id))
    }
}
