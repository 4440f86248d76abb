//! From the worker's outputs to messages on the wire.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use tokio::sync::mpsc;
use tracing::{error, warn};

use super::counts::Counts;
use super::transport::{Outgoing, Transport};
use crate::engine::Snapshot;
use crate::msg::clusters::{Session, SurfaceClusterArray};
use crate::msg::labelled::{MAX_LABELLED, labelled_points};
use crate::msg::markers::{MAX_CUBES, Markers};
use crate::worker::Output;

/// How publishing ended.
#[derive(Debug, Default)]
pub(super) struct Ended {
    /// The newest map that was published.
    pub(super) map: Option<Arc<Snapshot>>,
    /// What the worker died of.
    pub(super) died: Option<String>,
}

/// Publishes until the worker has ended or died.
pub(super) async fn publish(
    transport: Rc<impl Transport>,
    mut outputs: mpsc::Receiver<Output>,
    counts: Rc<RefCell<Counts>>,
    frame_id: String,
) -> Ended {
    let mut ended = Ended::default();
    let mut publisher =
        Publisher { transport, markers: Markers::default(), session: 0, capped: [false; 2], frame_id };
    while let Some(output) = outputs.recv().await {
        match output {
            Output::Scan { session, update } => {
                counts.borrow_mut().taken_in += 1;
                let session = publisher.session(session);
                publisher.send(Outgoing::Delta(SurfaceClusterArray::delta(&session, &update))).await;
            }
            Output::Snapshot { session, snapshot } => {
                let session = publisher.session(session);
                publisher.snapshot(&session, &snapshot).await;
                ended.map = Some(snapshot);
            }
            Output::Died(text) => ended.died = Some(text),
        }
    }
    ended
}

struct Publisher<T> {
    transport: Rc<T>,
    markers: Markers,
    /// Of the newest output.
    session: u64,
    /// Whether it has been said in this session that markers, and labelled points, are capped.
    capped: [bool; 2],
    frame_id: String,
}

impl<T: Transport> Publisher<T> {
    fn session(&mut self, id: u64) -> Session {
        if std::mem::replace(&mut self.session, id) != id {
            self.markers.reset();
            self.capped = [false; 2];
        }
        Session { id, frame_id: self.frame_id.clone() }
    }

    async fn snapshot(&mut self, session: &Session, snapshot: &Snapshot) {
        self.say_caps(snapshot.voxels.len());
        self.send(Outgoing::Clusters(SurfaceClusterArray::snapshot(session, snapshot))).await;
        self.send(Outgoing::Labelled(labelled_points(session, snapshot))).await;
        let markers = self.markers.update(session, snapshot);
        self.send(Outgoing::Markers(markers)).await;
    }

    fn say_caps(&mut self, voxels: usize) {
        let caps = [("~/markers", MAX_CUBES), ("~/points_labelled", MAX_LABELLED)];
        for ((topic, cap), said) in caps.into_iter().zip(&mut self.capped) {
            if voxels > cap && !std::mem::replace(said, true) {
                warn!("{topic} shows the first {cap} of {voxels} dense voxels");
            }
        }
    }

    async fn send(&self, message: Outgoing) {
        if let Err(failure) = self.transport.publish(message).await {
            error!("a message could not be sent: {failure}");
        }
    }
}
