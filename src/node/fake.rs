//! A middleware made of channels, for tests.

use std::cell::{Cell, RefCell};

use tokio::sync::{Semaphore, oneshot};

use super::transport::{
    DepthTopics, NetworkState, SendError, SensorTopics, Service, Source, TopicName, Transport,
};
use crate::bag::TransformTopics;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::outgoing::Outgoing;
use crate::msg::reports::DiagnosticArray;
use crate::msg::ros::TriggerResponse;

/// Keeps what is published; fails when told to.
pub(super) struct Fake {
    pub(super) inputs: Vec<SensorTopics>,
    pub(super) transforms: TransformTopics,
    pub(super) sources: Vec<Source>,
    pub(super) knows_all: Cell<bool>,
    pub(super) network: NetworkState,
    /// What was sent of the map, each with its number.
    pub(super) sent: RefCell<Vec<(&'static str, u64)>>,
    /// Lets whole maps through, one each, where they are to wait for that.
    pub(super) through: Option<Semaphore>,
    pub(super) deltas: RefCell<Vec<SurfaceClusterArray>>,
    pub(super) reports: RefCell<Vec<DiagnosticArray>>,
    pub(super) replies: RefCell<Vec<TriggerResponse>>,
    pub(super) failure: RefCell<Option<oneshot::Receiver<String>>>,
    /// The topic on which it panics.
    pub(super) deadly: Option<&'static str>,
}

impl Default for Fake {
    fn default() -> Self {
        let name = |name: &str| TopicName { plain: name.to_owned(), resolved: format!("/{name}") };
        let inputs = vec![SensorTopics {
            name: "points".to_owned(),
            points: Some(name("points")),
            depth: Some(DepthTopics {
                image: name("depth/image"),
                camera_info: name("depth/camera_info"),
                compressed: "/depth/image/compressedDepth".to_owned(),
            }),
        }];
        Self {
            inputs,
            transforms: TransformTopics::default(),
            sources: Vec::new(),
            knows_all: Cell::new(true),
            network: NetworkState::default(),
            sent: RefCell::default(),
            through: None,
            deltas: RefCell::default(),
            reports: RefCell::default(),
            replies: RefCell::default(),
            failure: RefCell::default(),
            deadly: None,
        }
    }
}

impl Fake {
    /// How many whole maps were sent.
    pub(super) fn maps(&self) -> usize {
        self.sent.borrow().iter().filter(|(what, _)| *what == "map").count()
    }
}

impl Transport for Fake {
    type Request = ();

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        assert!(self.deadly != Some(message.topic().name), "a panic for the test");
        let sent = match message {
            Outgoing::Clusters(map) => {
                if let Some(through) = &self.through {
                    through.acquire().await.unwrap().forget();
                }
                ("map", map.sequence)
            }
            Outgoing::Delta(delta) => {
                let sequence = delta.sequence;
                self.deltas.borrow_mut().push(delta);
                ("delta", sequence)
            }
            Outgoing::Polygon(polygon) => ("polygon", polygon.polygon.id.cast_unsigned()),
            Outgoing::Diagnostics(report) => {
                self.reports.borrow_mut().push(report);
                return Ok(());
            }
            _ => return Ok(()),
        };
        self.sent.borrow_mut().push(sent);
        Ok(())
    }

    async fn answer(&self, _: Service, (): (), response: TriggerResponse) -> Result<(), SendError> {
        self.replies.borrow_mut().push(response);
        Ok(())
    }

    fn inputs(&self) -> &[SensorTopics] {
        &self.inputs
    }

    fn transform_topics(&self) -> &TransformTopics {
        &self.transforms
    }

    fn losses(&self) -> &'static str {
        "see receive_buffer"
    }

    fn silences(&self) -> &'static str {
        "or it sends by shared memory only"
    }

    fn sources(&self) -> Vec<Source> {
        self.sources.clone()
    }

    fn knows_all_sources(&self) -> bool {
        self.knows_all.get()
    }

    fn node_name(&self) -> &'static str {
        "/robot/cfodi"
    }

    fn network_state(&self) -> NetworkState {
        self.network.clone()
    }

    async fn failed(&self) -> String {
        let failure = self.failure.borrow_mut().take();
        match failure {
            Some(failure) => failure.await.unwrap(),
            None => std::future::pending().await,
        }
    }
}
