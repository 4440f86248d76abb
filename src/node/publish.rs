//! From the worker's outputs to messages on the wire.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::mpsc;
use tracing::{error, warn};

use super::counts::Counts;
use super::saving::Saver;
use super::throttle::Throttle;
use super::transport::{Outgoing, Transport};
use crate::engine::{Snapshot, Update};
use crate::msg::caps::Caps;
use crate::msg::clusters::{Session, SurfaceClusterArray};
use crate::msg::labelled::labelled_points;
use crate::msg::markers::Markers;
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
    saver: Option<Saver>,
) -> Ended {
    let mut ended = Ended::default();
    let mut publisher = Publisher {
        transport,
        markers: Markers::default(),
        session: 0,
        caps: Caps::default(),
        said_beyond: false,
        throttle: Throttle::default(),
        frame_id,
    };
    while let Some(output) = outputs.recv().await {
        match output {
            Output::Scan { session, update } => {
                counts.borrow_mut().taken_in += 1;
                let session = publisher.session(session);
                publisher.say_beyond(&update);
                publisher.send(Outgoing::Delta(SurfaceClusterArray::delta(&session, &update))).await;
            }
            Output::Snapshot { session, snapshot } => {
                let session = publisher.session(session);
                publisher.snapshot(&session, &snapshot).await;
                ended.map = Some(snapshot);
            }
            Output::Saved { map, .. } => {
                if let Some(saver) = &saver {
                    saver.write(map);
                }
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
    /// What has been said in this session.
    caps: Caps,
    said_beyond: bool,
    throttle: Throttle,
    frame_id: String,
}

impl<T: Transport> Publisher<T> {
    fn session(&mut self, id: u64) -> Session {
        if std::mem::replace(&mut self.session, id) != id {
            self.markers.reset();
            self.caps = Caps::default();
            self.said_beyond = false;
        }
        Session { id, frame_id: self.frame_id.clone() }
    }

    async fn snapshot(&mut self, session: &Session, snapshot: &Snapshot) {
        for line in self.caps.reached(snapshot.voxels.len()) {
            warn!("{line}");
        }
        self.send(Outgoing::Clusters(SurfaceClusterArray::snapshot(session, snapshot))).await;
        self.send(Outgoing::Labelled(labelled_points(session, snapshot))).await;
        let markers = self.markers.update(session, snapshot);
        self.send(Outgoing::Markers(markers)).await;
    }

    /// Points that lie beyond the grid are in no map: said once a session.
    fn say_beyond(&mut self, update: &Update) {
        let beyond = update.points_beyond_grid;
        if beyond > 0 && !std::mem::replace(&mut self.said_beyond, true) {
            warn!("{beyond} points of a scan lie beyond the grid's reach and are left out");
        }
    }

    async fn send(&mut self, message: Outgoing) {
        if let Err(failure) = self.transport.publish(message).await
            && self.throttle.allows("send", Instant::now())
        {
            error!("a message could not be sent: {failure}");
        }
    }
}
