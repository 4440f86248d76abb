//! Calls of services, and the map on its way into its file.

use std::cell::RefCell;
use std::future::Future;
use std::path::PathBuf;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::mpsc::UnboundedReceiver;
use tracing::{debug, warn};

use super::calls_for_map::{Call, CallsForMap, MOST_CALLS};
use super::{Live, LiveError};
use crate::count::count_of;
use crate::engine::Snapshot;
use crate::msg::ros::TriggerResponse;
use crate::node::saving::{InFile, Written};
use crate::node::transport::{Service, Transport};
use crate::store::StoreError;

impl<T: Transport> Live<T> {
    pub(super) async fn save_for(&mut self, request: T::Request) {
        let message = match &self.calls_for_map {
            Some(calls) if calls.is_full() => {
                format!("{MOST_CALLS} calls wait for a map to be written")
            }
            Some(_) => {
                return self.save(Some(Call { service: Service::Save, session: self.session, request }));
            }
            None => "the parameter snapshot_path names no file".to_owned(),
        };
        self.answer(Service::Save, request, TriggerResponse { success: false, message }).await;
    }

    /// Asks for the map where it is another than in the file: a robot that stands at its dock wears out no disk.
    pub(super) fn save_what_changed(&mut self) {
        if !self.diagnosis.is_saved(Instant::now()) {
            self.save(None);
        }
    }

    /// Asks for the map, to save it; `call` is answered when it is written.
    pub(super) fn save(&mut self, call: Option<Call<T::Request>>) {
        if self.calls_for_map.as_mut().is_some_and(|calls| calls.begin(call)) {
            self.diagnosis.saving.ask(Instant::now());
            self.worker.request_save();
        }
    }

    /// A map has been written, or was not.
    pub(super) async fn written(&mut self, result: &Written) {
        match result {
            Ok(_) => log(result),
            // Maps may be saved ten times a second.
            Err(error) => self.warn("not_saved", format_args!("the map was not saved: {error}")),
        }
        let Some(calls) = &mut self.calls_for_map else { return };
        let (calls, goes_on) = calls.end();
        self.diagnosis.saving.note(result, goes_on, Instant::now());
        if goes_on {
            self.worker.request_save();
        }
        for call in calls {
            let response = call.response(result);
            self.answer(call.service, call.request, response).await;
        }
    }

    pub(super) async fn answer(&mut self, service: Service, request: T::Request, response: TriggerResponse) {
        if let Err(failure) = self.transport.answer(service, request, response).await {
            let name = service.name();
            self.warn(name, format_args!("{name} could not be answered: {failure}"));
        }
    }
}

/// Says in the log how a map was written, whether or not anybody has called for it.
fn log(written: &Written) {
    match written {
        Ok(InFile { version, bytes }) => {
            debug!("map of {} saved, {bytes} bytes", count_of(version.sequence, "scan"));
        }
        Err(error) => warn!("the map was not saved: {error}"),
    }
}

/// The next map that has been written; never where none is.
pub(super) async fn next(written: &mut Option<UnboundedReceiver<Written>>) -> Option<Written> {
    match written {
        Some(written) => written.recv().await,
        None => std::future::pending().await,
    }
}

/// How long the map of the node's end is waited for until it is said, and nobody need wait longer.
const PATIENCE: Duration = Duration::from_secs(2);

/// The file of the map, and who gives it up; that is asked only once it was said that the map is waited for, for whoever starts
/// the node and the terminal may both pass on one signal.
pub(super) struct LastFile<GivenUp> {
    pub(super) path: PathBuf,
    pub(super) given_up: GivenUp,
}

/// Waits until the last map is written or given up, and answers every waiting call with how that went; a call whose own map was still
/// on its way, with how that one went. If there is no last map (the node has `ended` with an error, or the saver died), the calls are
/// told that error.
pub(super) async fn last_written<T: Transport>(
    ended: Result<Arc<Snapshot>, LiveError>,
    mut written: UnboundedReceiver<Written>,
    calls: &RefCell<Option<CallsForMap<Call<T::Request>>>>,
    transport: &T,
    mut given_up: Pin<&mut impl Future<Output = StoreError>>,
) -> Result<Arc<Snapshot>, LiveError> {
    let mut last = None;
    loop {
        let result = tokio::select! {
            biased;
            result = written.recv() => result,
            error = &mut given_up => {
                last = Some(Err(error));
                break;
            }
        };
        let Some(result) = result else { break };
        log(&result);
        // Where it was not written, the next one may be.
        if result.is_ok() {
            let answered = calls.borrow_mut().as_mut().map(|calls| calls.end().0);
            tell(answered.into_iter().flatten(), |call| call.response(&result), transport).await;
        }
        last = Some(result);
    }
    // No map comes any more by which calls could be answered.
    let calls = calls.take().into_iter().flat_map(CallsForMap::into_calls);
    match ended.and_then(|map| Ok((map, last.ok_or(LiveError::SaverDied)?))) {
        Ok((map, last)) => {
            tell(calls, |call| call.response(&last), transport).await;
            last.map(|_| map).map_err(LiveError::NotSaved)
        }
        Err(error) => {
            tell(calls, |call| call.failure(&error), transport).await;
            Err(error)
        }
    }
}

/// Resolves when the map is given up; says before that it can be. Never where there is no file.
pub(super) async fn given_up(file: Option<LastFile<impl Future<Output = ()>>>) -> StoreError {
    let Some(LastFile { path, given_up }) = file else { return std::future::pending().await };
    tokio::time::sleep(PATIENCE).await;
    warn!("the map is being written to {}: one more signal ends the node without it", path.display());
    given_up.await;
    StoreError::GivenUp { path }
}

/// Answers calls at the node's end.
pub(super) async fn tell<T: Transport>(
    calls: impl IntoIterator<Item = Call<T::Request>>,
    response: impl Fn(&Call<T::Request>) -> TriggerResponse,
    transport: &T,
) {
    for call in calls {
        let response = response(&call);
        if let Err(failure) = transport.answer(call.service, call.request, response).await {
            warn!("{} could not be answered: {failure}", call.service.name());
        }
    }
}
