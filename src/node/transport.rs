//! What the node needs of a middleware: events in, messages out. No type of a middleware passes this line.

use std::fmt;
use std::future::Future;

use crate::cloud::{Camera, Cloud, CloudError};
use crate::config::Config;
use crate::engine::Stamp;
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::ros::{MarkerArray, PointCloud2, TfMessage, TriggerResponse};

/// What scans are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// `sensor_msgs/PointCloud2` on `points`.
    Points,
    /// `sensor_msgs/Image` on `depth/image`.
    Depth,
    /// `sensor_msgs/CompressedImage` beside `depth/image`.
    CompressedDepth,
}

/// Fully qualified names of the topics that scans come from, remappings applied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// `points`.
    pub points: String,
    /// `depth/image`.
    pub image: String,
    /// `depth/camera_info`, which both kinds of depth image need.
    pub camera_info: String,
    /// `compressedDepth` below `depth/image`.
    pub compressed: String,
}

impl Inputs {
    /// The topic of an input.
    pub fn topic(&self, input: Input) -> &str {
        match input {
            Input::Points => &self.points,
            Input::Depth => &self.image,
            Input::CompressedDepth => &self.compressed,
        }
    }
}

/// What can be called; each is a `std_srvs/Trigger`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Begins a session with an empty map.
    Reset,
    /// Saves the map.
    Save,
}

impl Service {
    /// Its name, below the node's.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reset => "~/reset",
            Self::Save => "~/save",
        }
    }
}

/// Something that came in.
#[derive(Debug)]
pub enum Event<Request> {
    /// A cloud or a depth image, decoded.
    Cloud(Input, Result<Cloud, CloudError>),
    /// Clouds that a publisher sent and that never arrived, by the gap in its sequence numbers.
    Lost(Input, u64),
    /// What `depth/camera_info` says, when it has changed.
    Camera(Result<Camera, CloudError>),
    /// Transforms on `/tf` or `/tf_static`.
    Transforms {
        /// The message.
        message: TfMessage,
        /// Whether they hold for all time.
        is_static: bool,
    },
    /// Of `/tf`, overtaken by others of the same publisher.
    LateTransforms(TfMessage),
    /// The simulated time on `/clock`.
    Clock(Stamp),
    /// A call of a service.
    Call(Service, Request),
    /// Parameters have changed: what they stand for now.
    Changed(Box<Config>),
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

impl Outgoing {
    /// Name of the topic of [`Self::Clusters`].
    pub const CLUSTERS: &str = "~/clusters";
    /// Of [`Self::Delta`].
    pub const DELTA: &str = "~/clusters_delta";
    /// Of [`Self::Markers`].
    pub const MARKERS: &str = "~/markers";
    /// Of [`Self::Labelled`].
    pub const LABELLED: &str = "~/points_labelled";
    /// Of all.
    pub const TOPICS: [&str; 4] = [Self::CLUSTERS, Self::DELTA, Self::MARKERS, Self::LABELLED];

    /// Name of its topic.
    pub const fn topic(&self) -> &'static str {
        match self {
            Self::Clusters(_) => Self::CLUSTERS,
            Self::Delta(_) => Self::DELTA,
            Self::Markers(_) => Self::MARKERS,
            Self::Labelled(_) => Self::LABELLED,
        }
    }
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

    /// Answers a call of a service.
    fn answer(
        &self,
        service: Service,
        request: Self::Request,
        response: TriggerResponse,
    ) -> impl Future<Output = Result<(), SendError>>;

    /// The topics that scans come from.
    fn inputs(&self) -> &Inputs;

    /// Every topic that has a publisher now, by name.
    fn sources(&self) -> Vec<Source>;

    /// Resolves, with a reason, when something that reads has ended: the node would be alive and deaf.
    fn failed(&self) -> impl Future<Output = String>;
}
