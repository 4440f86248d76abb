//! The node's end: what is under way is taken in, sent, saved or counted.

use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;

use futures::FutureExt as _;
use tokio::sync::mpsc::{self, UnboundedReceiver};
use tokio::task::JoinError;

use super::calls::{LastFile, given_up, last_written, tell};
use super::calls_for_map::{Call, CallsForMap};
use super::{Live, LiveError};
use crate::cloud::CloudError;
use crate::engine::Snapshot;
use crate::msg::ros::TriggerResponse;
use crate::node::counts::{Counts, ENGINE_DIED};
use crate::node::publish::Ended;
use crate::node::saving::Written;
use crate::node::transport::{Event, Service, Transport};
use crate::reason::{Reason, SHUTDOWN};
use crate::thread::panic_text;
use crate::worker::Worker;

/// Counts what was under way when the engine died, or was given up.
fn count_buried(counts: &RefCell<Counts>, reason: Reason) {
    let mut counts = counts.borrow_mut();
    let known = counts.taken_in + counts.replaced + counts.skipped.values().sum::<u64>();
    (known..counts.received).for_each(|_| counts.skip(reason));
}

/// The map that publishing has ended with.
fn last_map(ended: Result<Ended, JoinError>) -> Result<Arc<Snapshot>, LiveError> {
    match ended {
        Ok(Ended { map: Some(map), died: None }) => Ok(map),
        ended => Err(death(ended)),
    }
}

fn death(ended: Result<Ended, JoinError>) -> LiveError {
    match ended {
        Ok(ended) => LiveError::Died(ended.died.unwrap_or_else(|| "it has ended".to_owned())),
        Err(error) => mute(error),
    }
}

/// What a task that sends has ended with.
pub(super) fn mute(error: JoinError) -> LiveError {
    LiveError::Mute(match error.try_into_panic() {
        Ok(panic) => panic_text(&*panic),
        Err(error) => error.to_string(),
    })
}

impl<T: Transport> Live<T> {
    /// Takes nothing in any more.
    pub(super) fn close(self) -> (Worker, Closing<T>) {
        let Self { worker, transport, counts, session, join, calls_for_map, .. } = self;
        let (waiting, calls_for_map) = (join.waiting(), RefCell::new(calls_for_map));
        (worker, Closing { transport, counts, session, waiting, calls_for_map })
    }
}

/// A node that takes nothing in any more, and is still there for who calls.
pub(super) struct Closing<T: Transport> {
    pub(super) transport: Rc<T>,
    pub(super) counts: Rc<RefCell<Counts>>,
    session: u64,
    /// Scans that waited for their transform.
    waiting: usize,
    /// `None` where no map will come by which calls could be answered.
    pub(super) calls_for_map: RefCell<Option<CallsForMap<Call<T::Request>>>>,
}

impl<T: Transport> Closing<T> {
    /// Does the same as [`Self::finish`], and puts away what comes meanwhile: a disk may take its time, and who calls then must not wait
    /// for good.
    pub(super) async fn finish_and_answer(
        &self,
        worker: Worker,
        mut events: mpsc::Receiver<Event<T::Request>>,
        publishing: impl Future<Output = Result<Ended, JoinError>>,
        written: Option<(UnboundedReceiver<Written>, LastFile<impl Future<Output = ()>>)>,
    ) -> Result<Arc<Snapshot>, LiveError> {
        self.put_away_all(&mut events).await;
        let mut finished = pin!(self.finish(worker, publishing, written));
        let map = loop {
            tokio::select! {
                map = &mut finished => break map,
                Some(event) = events.recv() => self.put_away(event).await,
            }
        };
        events.close();
        self.put_away_all(&mut events).await;
        map
    }

    async fn put_away_all(&self, events: &mut mpsc::Receiver<Event<T::Request>>) {
        while let Ok(event) = events.try_recv() {
            self.put_away(event).await;
        }
    }

    /// Counts what came and will not be used any more; a call to save is answered by the last map, others at once.
    pub(super) async fn put_away(&self, event: Event<T::Request>) {
        match event {
            Event::Cloud(_, cloud) => {
                let mut counts = self.counts.borrow_mut();
                counts.received += 1;
                counts.skip(cloud.as_ref().map_or_else(CloudError::reason, |_| SHUTDOWN));
            }
            Event::Handed(..) => {
                let mut counts = self.counts.borrow_mut();
                counts.received += 1;
                counts.skip(SHUTDOWN);
            }
            Event::Lost(_, number) => self.counts.borrow_mut().lose(number),
            Event::Call(service, request) => {
                let refused = self.let_wait(Call { service, session: self.session, request });
                let message = "the node ends, and nothing was done";
                let response = |_: &_| TriggerResponse { success: false, message: message.to_owned() };
                tell(refused, response, &*self.transport).await;
            }
            _ => {}
        }
    }

    /// Lets a call wait for the last map; gives it back where that does not answer it.
    fn let_wait(&self, call: Call<T::Request>) -> Option<Call<T::Request>> {
        match &mut *self.calls_for_map.borrow_mut() {
            Some(calls) if call.service == Service::Save && !calls.is_full() => {
                calls.wait(call);
                None
            }
            _ => Some(call),
        }
    }

    /// Lets the worker take in what waits, and everything be sent and saved; the last thing sent is the whole map. Where the engine
    /// has died, what is on its way to the disk still gets there. Where the map is saved, all of that may be given up.
    pub(super) async fn finish(
        &self,
        worker: Worker,
        publishing: impl Future<Output = Result<Ended, JoinError>>,
        written: Option<(UnboundedReceiver<Written>, LastFile<impl Future<Output = ()>>)>,
    ) -> Result<Arc<Snapshot>, LiveError> {
        worker.end(self.calls_for_map.borrow().is_some());
        let (mut written, file) = written.unzip();
        let mut given_up = pin!(given_up(file).fuse());
        let ended = tokio::select! {
            biased;
            ended = publishing => {
                // Its outputs have ended, and so has it: nobody waits here for a place among them, which this thread empties.
                drop(worker);
                let ended = last_map(ended);
                match &ended {
                    Ok(_) => (0..self.waiting).for_each(|_| self.counts.borrow_mut().skip(SHUTDOWN)),
                    Err(_) => count_buried(&self.counts, ENGINE_DIED),
                }
                ended
            }
            error = &mut given_up => {
                // It may wait for a place, and would be waited for.
                std::mem::forget(worker);
                count_buried(&self.counts, SHUTDOWN);
                written.iter_mut().for_each(UnboundedReceiver::close);
                Err(LiveError::NotSaved(error))
            }
        };
        match written {
            Some(written) => {
                last_written(ended, written, &self.calls_for_map, &*self.transport, given_up).await
            }
            None => ended,
        }
    }
}
