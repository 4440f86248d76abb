//! Latched transforms, soon after their publisher has come.
//!
//! A publisher announces what it has kept when it finds a reader, and then every 3 s by Fast DDS's defaults. RustDDS 0.15.1
//! does not listen to one that it has not found itself by then, and asks for nothing of its own accord: half of the time
//! `/tf_static` comes seconds late, and no scan is of use until then. But a reader that is opened when the publisher is known
//! is ready for that first announcement.

use std::cell::RefCell;
use std::collections::BTreeSet;

use ros2_client::{CreateError, Node};
use rustdds::{DomainParticipant, GUID, Topic};
use tokio::task::AbortHandle;

use super::Events;
use super::read::read_statics;

/// Publishers that are remembered.
const PUBLISHERS: usize = 1000;

pub(super) struct Statics {
    topic: Topic,
    /// Its name in DDS.
    name: String,
    events: Events,
    known: RefCell<BTreeSet<GUID>>,
    /// The reader that was opened last; the one of the begin goes on.
    newest: RefCell<Option<Reader>>,
}

/// Ends with its place.
struct Reader(AbortHandle);

impl Drop for Reader {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Statics {
    pub(super) fn new(topic: Topic, name: String, events: Events) -> Self {
        Self { topic, name, events, known: RefCell::default(), newest: RefCell::default() }
    }

    /// Opens a reader for publishers that have come since; whether there were any.
    pub(super) fn hear_new(
        &self,
        participant: &DomainParticipant,
        node: &mut Node,
    ) -> Result<bool, CreateError> {
        let writers = participant.discovered_writers();
        let of_topic =
            writers.iter().filter(|writer| *writer.publication_topic_data.topic_name() == self.name);
        let now: BTreeSet<_> =
            of_topic.map(|writer| writer.writer_proxy.remote_writer_guid).take(PUBLISHERS).collect();
        let has_new = !now.is_subset(&self.known.borrow());
        *self.known.borrow_mut() = now;
        if has_new {
            let subscription = node.create_subscription(&self.topic, None)?;
            let reading = tokio::task::spawn_local(read_statics(subscription, self.events.clone()));
            self.newest.replace(Some(Reader(reading.abort_handle())));
        }
        Ok(has_new)
    }
}
