//! The answers to the calls of one service, which clients that have just been found do not keep from being sent; see
//! [`super::patience`]. Each `ros2 service call` is such a client.

use std::cell::RefCell;
use std::rc::Rc;

use ros2_client::{Message, RmwRequestId, Server, WriteError};
use tokio::sync::Mutex;
use tokio::task::spawn_local;
use tracing::warn;

use super::patience::Patience;
use crate::node::throttle::Throttle;
use crate::node::transport::SendError;

/// Sends answers.
pub(super) trait Answers<A> {
    async fn send(&self, caller: RmwRequestId, response: A) -> Result<(), WriteError<()>>;
}

impl<Q: Message + 'static, A: Message + 'static> Answers<A> for Server<Q, A> {
    async fn send(&self, caller: RmwRequestId, response: A) -> Result<(), WriteError<()>> {
        self.async_send_response(caller, response).await
    }
}

pub(super) struct Answering<S> {
    pub(super) name: &'static str,
    pub(super) server: S,
    patience: Patience,
    /// Held by who waits: answers go out in the order in which they were given.
    turn: Mutex<()>,
    throttle: RefCell<Throttle>,
}

impl<S> Answering<S> {
    pub(super) fn new(name: &'static str, server: S) -> Self {
        let (turn, throttle) = (Mutex::default(), RefCell::default());
        Self { name, server, patience: Patience::new(), turn, throttle }
    }

    /// Sends an answer, once clients have had time for acknowledging those before.
    pub(super) async fn answer<A: Clone>(&self, caller: RmwRequestId, response: A) -> Result<(), SendError>
    where
        S: Answers<A>,
    {
        let _turn = self.turn.lock().await;
        let offer = async |response| self.offer(caller, response).await;
        match self.patience.offer(response, offer).await? {
            None => Ok(()),
            Some(_) => {
                Err(SendError::unanswered(self.name, "a client has not acknowledged the answers before"))
            }
        }
    }

    /// As [`Self::answer`], but for who must not wait: where that is needed a task of its own does it.
    pub(super) async fn answer_aside<A: Clone + 'static>(
        self: &Rc<Self>,
        caller: RmwRequestId,
        response: A,
    ) -> Result<(), SendError>
    where
        S: Answers<A> + 'static,
    {
        let refused = match self.turn.try_lock() {
            Ok(_turn) => self.offer(caller, response).await?,
            Err(_) => Some(response),
        };
        if let Some(response) = refused {
            let answering = Rc::clone(self);
            spawn_local(async move { answering.answer_or_say(caller, response).await });
        }
        Ok(())
    }

    /// As [`Self::answer`], where nobody else would say that it could not be sent.
    pub(super) async fn answer_or_say<A: Clone>(&self, caller: RmwRequestId, response: A)
    where
        S: Answers<A>,
    {
        if let Err(error) = self.answer(caller, response).await {
            self.say_unanswered(&error);
        }
    }

    pub(super) fn say_unanswered(&self, why: &dyn std::fmt::Display) {
        if self.throttle.borrow_mut().allows(self.name, std::time::Instant::now()) {
            warn!("{} could not be answered: {why}", self.name);
        }
    }

    /// Gives the answer back where there is no room for it.
    async fn offer<A: Clone>(&self, caller: RmwRequestId, response: A) -> Result<Option<A>, SendError>
    where
        S: Answers<A>,
    {
        match self.server.send(caller, response.clone()).await {
            Ok(()) => Ok(None),
            Err(WriteError::WouldBlock { .. }) => Ok(Some(response)),
            Err(error) => Err(SendError::unanswered(self.name, &error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use tokio::task::LocalSet;

    use super::*;

    /// A server that has no room for so many offers, and what it has sent.
    #[derive(Default)]
    struct Full(Cell<u32>, RefCell<Vec<char>>);

    impl Answers<char> for Full {
        async fn send(&self, _: RmwRequestId, response: char) -> Result<(), WriteError<()>> {
            if let Some(left) = self.0.get().checked_sub(1) {
                self.0.set(left);
                return Err(WriteError::WouldBlock { data: () });
            }
            self.1.borrow_mut().push(response);
            Ok(())
        }
    }

    fn full(times: u32) -> Rc<Answering<Full>> {
        Rc::new(Answering::new("~/save", Full(Cell::new(times), RefCell::default())))
    }

    #[tokio::test]
    async fn a_client_that_was_just_found_is_waited_for_and_one_that_stays_silent_not_for_long() {
        let caller = RmwRequestId::default();
        let answering = full(3);
        answering.answer(caller, 'a').await.unwrap();
        assert_eq!(answering.server.1.take(), ['a']);
        let answering = full(u32::MAX);
        assert!(answering.answer(caller, 'b').await.unwrap_err().to_string().contains("acknowledged"));
        let offered = u32::MAX - answering.server.0.get();
        assert!(answering.answer(caller, 'c').await.is_err());
        assert_eq!(u32::MAX - answering.server.0.get(), offered + 1, "the patience is spent");
    }

    #[tokio::test]
    async fn who_answers_aside_does_not_wait_and_the_order_stays() {
        let (caller, answering) = (RmwRequestId::default(), full(3));
        let run = async {
            for response in ['a', 'b', 'c'] {
                answering.answer_aside(caller, response).await.unwrap();
                tokio::task::yield_now().await;
            }
            assert!(answering.server.1.borrow().is_empty(), "nobody has waited");
            answering.answer(caller, 'd').await.unwrap();
        };
        LocalSet::new().run_until(run).await;
        assert_eq!(answering.server.1.take(), ['a', 'b', 'c', 'd']);
    }
}
