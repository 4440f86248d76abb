//! A topic that is published reliably, and that no reader takes from the others for long.
//!
//! RustDDS 0.15.1 takes no message while some reader has not acknowledged the last so many. One that it has just found
//! counts as if it had acknowledged none of all that were ever sent, until its first `ACKNACK` some milliseconds later: it
//! is waited for. One that is stopped, behind a wall, or slower than what is sent, stays so: the topic is opened anew, which
//! all readers find at once. Those that keep up may miss the deltas in between, as when one is lost, and go on from the next
//! snapshot.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::Duration;

use ros2_client::{Node, Publisher, WriteError};
use rustdds::{Topic, TopicDescription as _};
use serde::Serialize;
use tokio::time::{Instant, sleep};
use tracing::warn;

use super::{Opener, opening, reliable_output};
use crate::msg::sent;
use crate::node::middleware::OpenError;
use crate::node::transport::SendError;

/// What readers are waited for, in any [`REST`]: whatever they do, the engine's outputs find room meanwhile.
const PATIENCE: Duration = Duration::from_millis(500);

/// Time until a message is offered again; then twice as long, up to the most: it is encoded anew each time.
const AGAIN: Duration = Duration::from_millis(2);
const SELDOM: Duration = Duration::from_millis(64);

/// A topic is not opened anew for the others more often.
const REST: Duration = Duration::from_secs(5);

pub(super) struct Outlet<M: Serialize> {
    name: &'static str,
    topic: Topic,
    /// Messages that are kept for a reader that does not acknowledge them.
    most: i32,
    publisher: RefCell<Rc<Publisher<M>>>,
    opened: Cell<Instant>,
    patience: RefCell<Patience>,
}

/// How long is waited, in all.
struct Patience {
    since: Instant,
    spent: Duration,
}

impl Patience {
    fn new() -> Self {
        Self { since: Instant::now(), spent: Duration::ZERO }
    }

    fn left(&mut self) -> Duration {
        if self.since.elapsed() >= REST {
            *self = Self::new();
        }
        PATIENCE.saturating_sub(self.spent)
    }
}

impl<M: Serialize> Outlet<M> {
    /// Opens it; `most` messages are kept for a reader that does not acknowledge them.
    pub(super) fn open(opener: &mut Opener<'_>, row: sent::Topic, most: i32) -> Result<Self, OpenError> {
        let (name, qos) = (row.name, reliable_output(row.qos, most));
        let topic = opener.topic(row.named(), &qos)?;
        opener.ends.publishes(topic.name(), qos);
        let publisher = opener.node.borrow_mut().create_publisher(&topic, None).map_err(opening(name))?;
        Ok(Self {
            name,
            topic,
            most,
            publisher: RefCell::new(Rc::new(publisher)),
            opened: Cell::new(Instant::now()),
            patience: RefCell::new(Patience::new()),
        })
    }

    /// Gives the message back where a reader keeps it from being sent, and has had time for acknowledging.
    pub(super) async fn send(&self, mut message: M) -> Result<Option<M>, SendError> {
        let mut pause = AGAIN;
        while let Some(refused) = self.offer(message).await? {
            pause = pause.min(self.patience.borrow_mut().left());
            if pause.is_zero() {
                return Ok(Some(refused));
            }
            sleep(pause).await;
            self.patience.borrow_mut().spent += pause;
            message = refused;
            pause = (2 * pause).min(SELDOM);
        }
        Ok(None)
    }

    async fn offer(&self, message: M) -> Result<Option<M>, SendError> {
        let publisher = Rc::clone(&self.publisher.borrow());
        match publisher.async_publish(message).await {
            Ok(()) => Ok(None),
            Err(WriteError::WouldBlock { data }) => Ok(Some(data)),
            Err(error) => Err(SendError::refused(self.name, &error)),
        }
    }

    /// Whether it may be opened anew.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_are_waited_for_so_long_in_any_rest_and_no_longer() {
        let mut patience = Patience::new();
        assert_eq!(patience.left(), PATIENCE);
        patience.spent = PATIENCE / 2;
        assert_eq!(patience.left(), PATIENCE / 2);
        patience.spent = 2 * PATIENCE;
        assert_eq!(patience.left(), Duration::ZERO);
        patience.since -= REST;
        assert_eq!(patience.left(), PATIENCE);
    }
}
