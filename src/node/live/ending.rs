//! The node's end: what is under way is taken in, sent, saved or counted.

use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::sync::Arc;

use futures::FutureExt as _;
use tokio::sync::mpsc::UnboundedReceiver;
use tokio::task::JoinError;

use super::calls::{LastFile, given_up, last_written};
use super::calls_for_map::Call;
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
    match ended.map_err(JoinError::try_into_panic) {
        Ok(ended) => LiveError::Died(ended.died.unwrap_or_else(|| "it has ended".to_owned())),
        Err(Ok(panic)) => LiveError::Mute(panic_text(&*panic)),
        Err(Err(error)) => LiveError::Mute(error.to_string()),
    }
}

impl<T: Transport> Live<T> {
    /// Counts what came and will not be used any more; a call to save is answered by the last map, others at once.
    pub(super) async fn put_away(&mut self, event: Event<T::Request>) {
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
            Event::Call(service, request) => match &mut self.calls_for_map {
                Some(calls) if service == Service::Save => {
                    calls.wait(Call { service, session: self.session, request });
                }
                _ => {
                    let message = "the node ends, and nothing was done".to_owned();
                    self.answer(service, request, TriggerResponse { success: false, message }).await;
                }
            },
            _ => {}
        }
    }

    /// Lets the worker take in what waits, and everything be sent and saved; the last thing sent is the whole map. Where the engine
    /// has died, what is on its way to the disk still gets there. Where the map is saved, all of that may be given up.
    pub(super) async fn finish(
        self,
        publishing: impl Future<Output = Result<Ended, JoinError>>,
        written: Option<(UnboundedReceiver<Written>, LastFile<impl Future<Output = ()>>)>,
    ) -> Result<Arc<Snapshot>, LiveError> {
        let Self { worker, transport, calls_for_map, counts, mut join, clocks, .. } = self;
        worker.end(calls_for_map.is_some());
        let (mut written, file) = written.unzip();
        let mut given_up = pin!(given_up(file).fuse());
        let ended = tokio::select! {
            biased;
            ended = publishing => {
                // Its outputs have ended, and so has it: nobody waits here for a place among them, which this thread empties.
                drop(worker);
                let ended = last_map(ended);
                match &ended {
                    Ok(_) => {
                        let waiting = join.give_up(clocks.moment());
                        waiting.iter().for_each(|_| counts.borrow_mut().skip(SHUTDOWN));
                    }
                    Err(_) => count_buried(&counts, ENGINE_DIED),
                }
                ended
            }
            error = &mut given_up => {
                // It may wait for a place, and would be waited for.
                std::mem::forget(worker);
                count_buried(&counts, SHUTDOWN);
                written.iter_mut().for_each(UnboundedReceiver::close);
                Err(LiveError::NotSaved(error))
            }
        };
        match written {
            Some(written) => last_written(ended, written, calls_for_map, &*transport, given_up).await,
            None => ended,
        }
    }
}
