//! What the node needs of a middleware: events in, messages out. No type of a middleware passes this line.

use std::fmt;
use std::future::Future;

use crate::cloud::{Cloud, CloudError};
use crate::engine::Stamp;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::ros::{MarkerArray, PointCloud2, TfMessage, TriggerResponse};

/// Something that came in.
#[derive(Debug)]
pub enum Event<Request> {
    /// A cloud on `points`, decoded.
    Cloud(Result<Cloud, CloudError>),
    /// Clouds that a publisher sent and that never arrived, by the gap in its sequence numbers.
    Lost(u64),
    /// Transforms on `/tf` or `/tf_static`.
    Transforms {
        /// The message.
        message: TfMessage,
        /// Whether they hold for all time.
        is_static: bool,
    },
    /// The simulated time on `/clock`.
    Clock(Stamp),
    /// A call of `~/reset`.
    Reset(Request),
    /// A message of another topic that could not be decoded.
    Garbled {
        /// The topic.
        topic: &'static str,
        /// What was wrong.
        text: String,
    },
}

/// Something to go out.
#[derive(Debug)]
pub enum Outgoing {
    /// On `~/clusters`.
    Clusters(SurfaceClusterArray),
    /// On `~/clusters_delta`.
    Delta(SurfaceClusterArray),
    /// On `~/markers`.
    Markers(MarkerArray),
    /// On `~/points_labelled`.
    Labelled(PointCloud2),
}

/// A topic that somebody publishes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Source {
    /// Fully qualified name.
    pub topic: String,
    /// As `sensor_msgs/msg/PointCloud2`.
    pub type_name: String,
}

/// A message could not be sent.
#[derive(Debug)]
pub struct SendError(pub String);

impl fmt::Display for SendError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A middleware with the node's topics and services opened on it.
pub trait Transport: 'static {
    /// Identifies a call to answer.
    type Request: fmt::Debug + 'static;

    /// Sends a message.
    fn publish(&self, message: Outgoing) -> impl Future<Output = Result<(), SendError>>;

    /// Answers a call of `~/reset`.
    fn answer_reset(
        &self,
        request: Self::Request,
        response: TriggerResponse,
    ) -> impl Future<Output = Result<(), SendError>>;

    /// The fully qualified name of the topic that clouds are read from, remappings applied.
    fn points_topic(&self) -> &str;

    /// Every topic that has a publisher now, by name.
    fn sources(&self) -> Vec<Source>;

    /// Resolves, with a reason, when something that reads has ended: the node would be alive and deaf.
    fn failed(&self) -> impl Future<Output = String>;
}
