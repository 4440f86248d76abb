//! Answers to calls, on a thread of their own. An answer goes by the caller's congestion control, which by default waits for a
//! place on the link, 5 s at most, and so does the word that there is no answer, which Zenoh sends where a call is dropped.
//! Neither is to hold up the node.

use std::sync::Arc;
use std::thread::Builder;
use std::time::Instant;

use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tracing::warn;

use crate::line::one_line;
use crate::node::middleware::OpenError;
use crate::node::throttle::Throttle;

/// Something that may wait for a link.
type Task = Box<dyn FnOnce() -> Result<(), String> + Send>;

/// The way to the thread, which ends with the last of them. Who adds never waits; [`Places`] bound what does.
#[derive(Clone)]
pub(super) struct Answers(UnboundedSender<Task>);

impl Answers {
    pub(super) fn start() -> Result<Self, OpenError> {
        let (tasks, waiting) = unbounded_channel();
        let thread = Builder::new().name("cfodi-answers".to_owned());
        thread.spawn(move || work(waiting)).map_err(OpenError::opening("a thread"))?;
        Ok(Self(tasks))
    }

    fn add(&self, task: impl FnOnce() -> Result<(), String> + Send + 'static) {
        drop(self.0.send(Box::new(task)));
    }

    /// Resolves when all that was added before is done.
    pub(super) async fn done(&self) {
        let (tell, done) = oneshot::channel();
        self.add(move || tell.send(()).or(Ok(())));
        drop(done.await);
    }

    /// Resolves, with a reason, when the thread has ended: nobody would be answered any more.
    pub(super) async fn ended(&self) -> String {
        self.0.closed().await;
        "the thread that answers calls has ended".to_owned()
    }
}

fn work(mut waiting: UnboundedReceiver<Task>) {
    let mut throttle = Throttle::default();
    while let Some(task) = waiting.blocking_recv() {
        if let Err(error) = task()
            && throttle.allows("answer", Instant::now())
        {
            warn!("a call could not be answered: {}", one_line(&error));
        }
    }
}

/// How many calls of one service may be under way or wait for the thread; others wait in the mailbox, where the oldest go.
pub(super) struct Places(Arc<Semaphore>);

impl Places {
    pub(super) fn new(number: usize) -> Self {
        Self(Arc::new(Semaphore::new(number)))
    }

    /// Resolves when there is one.
    pub(super) async fn free(&self) -> Place {
        Place(Arc::clone(&self.0).acquire_owned().await.ok())
    }
}

/// One of the [`Places`], until it is dropped.
pub(super) struct Place(
    #[expect(dead_code, reason = "its end frees the place")] Option<OwnedSemaphorePermit>,
);

/// A call in its place. However it ends, it does so on the thread.
pub(super) struct Held<C: Send + 'static> {
    call: Option<(C, Place)>,
    answers: Answers,
}

impl<C: Send + 'static> Held<C> {
    pub(super) fn new(call: C, place: Place, answers: &Answers) -> Self {
        Self { call: Some((call, place)), answers: answers.clone() }
    }

    /// Answers it; an error is said in the log.
    pub(super) fn answer(mut self, answer: impl FnOnce(&C) -> Result<(), String> + Send + 'static) {
        self.end(answer);
    }

    fn end(&mut self, answer: impl FnOnce(&C) -> Result<(), String> + Send + 'static) {
        if let Some((call, place)) = self.call.take() {
            self.answers.add(move || {
                let answered = answer(&call);
                drop(call);
                drop(place);
                answered
            });
        }
    }
}

impl<C: Send + 'static> Drop for Held<C> {
    fn drop(&mut self) {
        self.end(|_| Ok(()));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Sender, channel};
    use std::thread::current;

    use futures::FutureExt as _;

    use super::*;

    /// Tells by which thread it was dropped.
    struct Told(Sender<Option<String>>);

    impl Drop for Told {
        fn drop(&mut self) {
            drop(self.0.send(current().name().map(str::to_owned)));
        }
    }

    #[tokio::test]
    async fn a_caller_whose_link_is_full_holds_up_nobody_but_the_thread_of_answers() {
        let (answers, places) = (Answers::start().unwrap(), Places::new(2));
        let (open, link) = channel::<()>();
        let (answered, order) = channel();
        let first = Held::new('a', places.free().await, &answers);
        let then = answered.clone();
        first.answer(move |call| {
            assert!(link.recv().is_err(), "nobody sends");
            then.send(*call).map_err(|error| error.to_string())
        });
        let second = Held::new('b', places.free().await, &answers);
        second.answer(move |call| answered.send(*call).map_err(|error| error.to_string()));
        assert!(order.try_recv().is_err(), "the link is full");
        assert!(places.free().now_or_never().is_none(), "no more than two are under way");
        drop(open);
        answers.done().await;
        assert_eq!(order.iter().collect::<String>(), "ab");
        assert!(places.free().now_or_never().is_some());
    }

    #[tokio::test]
    async fn a_call_without_an_answer_ends_on_the_thread_too() {
        let (answers, places) = (Answers::start().unwrap(), Places::new(1));
        let (sender, dropped) = channel();
        drop(Held::new(Told(sender.clone()), places.free().await, &answers));
        Held::new(Told(sender), places.free().await, &answers).answer(|_| Err("no such key".to_owned()));
        let threads: Vec<_> = dropped.iter().collect();
        assert_eq!(threads, vec![Some("cfodi-answers".to_owned()); 2]);
    }

    #[tokio::test]
    async fn it_is_known_when_the_thread_has_died() {
        let answers = Answers::start().unwrap();
        assert!(answers.ended().now_or_never().is_none());
        answers.add(|| std::panic::resume_unwind(Box::new("died")));
        assert!(answers.ended().await.contains("has ended"));
        answers.done().await;
    }
}
