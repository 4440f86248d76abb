//! Which channel a message belongs to, and which schema a channel.

use std::sync::Arc;

use mcap::McapError;
use mcap::read::ChannelAccumulator;
use mcap::records::MessageHeader;

use super::read::Message;
use super::records::{Record, reason};

/// What a file has said of its channels so far.
#[derive(Default)]
pub(super) struct Channels {
    known: ChannelAccumulator<'static>,
    is_data_over: bool,
    /// What the records behind the data say otherwise than those before.
    contradiction: Option<String>,
}

impl Channels {
    /// Takes a record up; gives the message, where it is one. A channel or a schema that changes its meaning is an error. Behind
    /// the data, where the summary repeats them, it is one only if a message follows.
    pub(super) fn take(&mut self, record: Record) -> Result<Option<Message>, String> {
        let known = match record {
            Record::Schema { header, data } => self.known.add_schema(header, data),
            Record::Channel(channel) => self.known.add_channel(channel),
            Record::Message { header, data } => return self.message(header, data.into_owned()).map(Some),
            Record::DataEnd(_) => {
                self.is_data_over = true;
                Ok(())
            }
            _ => Ok(()),
        };
        match known.map_err(|error| reason(&error)) {
            Err(reason) if self.is_data_over => self.contradiction = Some(reason),
            other => other?,
        }
        Ok(None)
    }

    fn message(&mut self, header: MessageHeader, data: Vec<u8>) -> Result<Message, String> {
        if let Some(reason) = self.contradiction.take() {
            return Err(reason);
        }
        let unknown = || reason(&McapError::UnknownChannel(header.sequence, header.channel_id));
        let channel = self.known.get(header.channel_id).ok_or_else(unknown)?;
        Ok(Message { channel, log_time: header.log_time, data })
    }

    /// The channels of these numbers, as far as they are known.
    pub(super) fn of(&self, ids: impl IntoIterator<Item = u16>) -> Vec<Arc<mcap::Channel<'static>>> {
        ids.into_iter().filter_map(|id| self.known.get(id)).collect()
    }
}
