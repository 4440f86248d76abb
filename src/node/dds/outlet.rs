//! A topic that is published reliably, and that no reader takes from the others for long.
//!
//! One that does not acknowledge what is sent is waited for, as [`super::patience`] says. Where it stays so the topic is opened
//! anew, which all readers find at once. Those that keep up may miss the deltas in between, as when one is lost, and go on from
//! the next snapshot.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use ros2_client::{Node, Publisher, WriteError};
use rustdds::{Topic, TopicDescription as _};
use serde::Serialize;
use tokio::time::Instant;
use tracing::{debug, warn};

use super::patience::{Patience, REST};
use super::{Opener, reliable_output};
use crate::msg::topic;
use crate::node::middleware::OpenError;
use crate::node::transport::SendError;

pub(super) struct Outlet<M: Serialize> {
    name: &'static str,
    topic: Topic,
    /// Messages that are kept for a reader that does not acknowledge them.
    most: i32,
    /// Whether the next message says all that one did which is not sent.
    is_replaced: bool,
    publisher: RefCell<Rc<Publisher<M>>>,
    opened: Cell<Instant>,
    patience: Patience,
}

impl<M: Serialize> Outlet<M> {
    /// Opens it; `most` messages are kept for a reader that does not acknowledge them.
    pub(super) fn open(opener: &mut Opener<'_>, row: topic::Topic, most: i32) -> Result<Self, OpenError> {
        let (name, qos) = (row.name, reliable_output(row.qos, most));
        let topic = opener.topic(row.named(), &qos)?;
        opener.ends.publishes(topic.name(), qos);
        let publisher =
            opener.node.borrow_mut().create_publisher(&topic, None).map_err(OpenError::opening(name))?;
        Ok(Self {
            name,
            topic,
            most,
            is_replaced: row.qos.latched && row.qos.depth == 1,
            publisher: RefCell::new(Rc::new(publisher)),
            opened: Cell::new(Instant::now()),
            patience: Patience::new(),
        })
    }

    /// Gives the message back where a reader keeps it from being sent, and has had time for acknowledging.
    pub(super) async fn send(&self, message: M) -> Result<Option<M>, SendError> {
        self.patience.offer(message, async |message| self.offer(message).await).await
    }

    async fn offer(&self, message: M) -> Result<Option<M>, SendError> {
        let publisher = Rc::clone(&self.publisher.borrow());
        match publisher.async_publish(message).await {
            Ok(()) => Ok(None),
            Err(WriteError::WouldBlock { data }) => Ok(Some(data)),
            Err(error) => Err(SendError::refused(self.name, &error)),
        }
    }

    /// Whether it may be opened anew: not more often than others are waited for.
    pub(super) fn has_rested(&self) -> bool {
        self.opened.get().elapsed() >= REST
    }

    /// Opens it anew, with an empty history: what was sent before is sent to nobody any more.
    pub(super) fn open_anew(&self, node: &mut Node) -> Result<(), SendError> {
        let anew = node.create_publisher(&self.topic, None);
        let anew =
            anew.map_err(|error| SendError::NotReopened { topic: self.name, cause: error.to_string() })?;
        self.publisher.replace(Rc::new(anew));
        Ok(())
    }

    /// Opens it anew for those who keep up.
    pub(super) fn reopen(&self, node: &mut Node) -> Result<(), SendError> {
        self.opened.set(Instant::now());
        self.open_anew(node)?;
        let Self { name, most, .. } = self;
        warn!(
            "a reader of {name} has not acknowledged the last {most}: the topic was opened anew for the others"
        );
        Ok(())
    }

    pub(super) fn refusal(&self) -> SendError {
        SendError::Unacknowledged { topic: self.name, most: self.most }
    }

    /// A message was not sent: no error where the next one replaces it, and the reader may be one that has just been found.
    pub(super) fn refused(&self) -> Result<(), SendError> {
        let refusal = self.refusal();
        if self.is_replaced && self.patience.may_be_of_new_reader() {
            debug!("left out, for a reader may have just been found: {refusal}");
            return Ok(());
        }
        Err(refusal)
    }
}
