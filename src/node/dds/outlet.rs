//! A topic that is published reliably, and that no reader keeps from the others.
//!
//! RustDDS 0.15.1 takes no message while some reader has not acknowledged the last so many. One that it has just found
//! counts as if it had acknowledged none of all that were ever sent, until its first `ACKNACK` some milliseconds later: it
//! is waited for. One that is stopped, or behind a wall, stays so for as long as it is believed to be there: the topic is
//! opened anew, which all readers find at once. Those that keep up may miss the deltas in between, as when one is lost,
//! and go on from the next snapshot.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

use ros2_client::{Node, Publisher, WriteError};
use rustdds::{QosPolicies, Topic};
use serde::Serialize;
use tokio::time::{Instant, sleep};
use tracing::warn;

use super::{DdsError, Opener, opening};
use crate::node::transport::SendError;

/// What a reader that has just been found is given for its first acknowledgement.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time between two tries.
const AGAIN: Duration = Duration::from_millis(5);

/// A topic is not opened anew more often.
const REST: Duration = Duration::from_secs(5);

pub(super) struct Outlet<M: Serialize> {
    name: &'static str,
    topic: Topic,
    publisher: RefCell<Rc<Publisher<M>>>,
    opened: Cell<Instant>,
    /// The message before was not taken: the readers have had their time.
    full: Cell<bool>,
}

impl<M: Serialize> Outlet<M> {
    pub(super) fn open(
        opener: &mut Opener<'_>,
        (name, package, kind): (&'static str, &str, &str),
        qos: &QosPolicies,
    ) -> Result<Self, DdsError> {
        let topic = opener.topic(name, package, kind, qos)?;
        let publisher = opener.node.create_publisher(&topic, None).map_err(opening(name))?;
        Ok(Self {
            name,
            topic,
            publisher: RefCell::new(Rc::new(publisher)),
            opened: Cell::new(Instant::now()),
            full: Cell::new(false),
        })
    }

    /// Gives the message back where a reader keeps it from being sent, and has had time for acknowledging.
    pub(super) async fn send(&self, mut message: M) -> Result<Option<M>, SendError> {
        let end = Instant::now() + PATIENCE;
        while let Some(refused) = self.offer(message).await? {
            if self.full.get() || Instant::now() >= end {
                self.full.set(true);
                return Ok(Some(refused));
            }
            message = refused;
            sleep(AGAIN).await;
        }
        self.full.set(false);
        Ok(None)
    }

    async fn offer(&self, message: M) -> Result<Option<M>, SendError> {
        let publisher = Rc::clone(&self.publisher.borrow());
        match publisher.async_publish(message).await {
            Ok(()) => Ok(None),
            Err(WriteError::WouldBlock { data }) => Ok(Some(data)),
            Err(error) => Err(SendError(format!("on {}: {error}", self.name))),
        }
    }

    /// Whether it may be opened anew.
    pub(super) fn has_rested(&self) -> bool {
        self.opened.get().elapsed() >= REST
    }

    pub(super) fn reopen(&self, node: &mut Node) -> Result<(), SendError> {
        warn!("a reader of {} acknowledges nothing: the topic is opened anew for the others", self.name);
        let failed = |error| SendError(format!("on {}, opened anew: {error}", self.name));
        let anew = node.create_publisher(&self.topic, None).map_err(failed)?;
        self.publisher.replace(Rc::new(anew));
        self.opened.set(Instant::now());
        Ok(())
    }

    pub(super) fn refusal(&self) -> SendError {
        SendError(format!(
            "on {}: a reader has not acknowledged those before, and no more are kept",
            self.name
        ))
    }
}
