//! What the node needs of a middleware: events in, messages out. No type of a middleware passes this line.

use std::borrow::Cow;
use std::fmt;
use std::future::Future;
use std::time::Duration;

use thiserror::Error;

use super::heard::PublisherId;
use super::places::without_places;
pub use crate::args::{DepthTopics, SensorTopics, TopicName};
use crate::bag::TransformTopics;
use crate::cloud::{Camera, CloudError, Decoded};
use crate::config::Config;
use crate::engine::Stamp;
pub use crate::msg::form::Form;
use crate::msg::outgoing::Outgoing;
use crate::msg::ros::{PointCloud2, TfMessage, TriggerResponse};
use crate::msg::topic::Named;

impl Form {
    /// What the sensor of this number sends in this form.
    pub const fn of(self, sensor: usize) -> Input {
        Input { sensor, form: self }
    }
}

/// What scans are made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Input {
    /// Number of the sensor, as in [`Transport::inputs`].
    pub sensor: usize,
    /// Its form.
    pub form: Form,
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

    /// Its name and type.
    pub(super) const fn named(self) -> Named<'static> {
        Named { name: self.name(), type_name: "std_srvs/srv/Trigger" }
    }
}

/// Something that came in.
#[derive(Debug)]
pub enum Event<Request> {
    /// A cloud or a depth image, decoded.
    Cloud(Input, Decoded),
    /// A cloud that was handed over inside the process, to be decoded by the parameters that hold when it is heard.
    Handed(Input, Box<PointCloud2>),
    /// Clouds that a publisher sent and that never arrived, by the gap in its sequence numbers.
    Lost(Input, u64),
    /// What the intrinsics of the sensor of this number are, when they have changed, and their frame.
    Camera(usize, Result<Camera, CloudError>, String),
    /// Transforms on `/tf` or `/tf_static`.
    Transforms {
        /// The message.
        message: TfMessage,
        /// Whether they hold for all time.
        is_static: bool,
        /// Who sent them, as the middleware names a publisher, where it tells.
        publisher: Option<PublisherId>,
    },
    /// Of `/tf`, overtaken by others of the same publisher.
    LateTransforms(TfMessage),
    /// The simulated time on `/clock`.
    Clock(Stamp),
    /// A call of a service.
    Call(Service, Request),
    /// The network was joined anew: on topics that are kept for late readers nothing is left.
    Joined,
    /// Parameters have changed: what they stand for now.
    Changed(Box<Config>),
    /// A message of another topic that could not be decoded.
    Garbled {
        /// The topic.
        topic: Cow<'static, str>,
        /// What was wrong.
        text: String,
    },
}

/// Time for those that are on a network to be found.
pub(super) const DISCOVERY: Duration = Duration::from_secs(5);

/// A topic that somebody publishes.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Source {
    /// Fully qualified name.
    pub topic: String,
    /// As `sensor_msgs/msg/PointCloud2`.
    pub type_name: String,
}

/// What can be known of the network, beyond who publishes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NetworkState {
    /// Bytes of the socket receive buffer, where the middleware takes datagrams.
    pub receive_buffer: Option<usize>,
    /// Where a publisher and a reader do not fit, so that nothing passes: the topic, and why.
    pub mismatches: Vec<(String, String)>,
    /// Other nodes of this node's name.
    pub namesakes: usize,
    /// Where others are found by a router: it has gone.
    pub without_router: bool,
}

/// A message could not be sent.
#[derive(Debug, Error)]
pub enum SendError {
    /// The middleware refuses it.
    #[error("on {topic}: {cause}")]
    Refused {
        /// The topic, as it is named in the program.
        topic: &'static str,
        /// The middleware's words.
        cause: String,
    },
    /// Too many before it wait for a reader.
    #[error("on {topic}: a reader has not acknowledged the {most} before, and no more are kept")]
    Unacknowledged {
        /// The topic, as it is named in the program.
        topic: &'static str,
        /// How many are kept.
        most: i32,
    },
    /// A topic that was to be opened anew.
    #[error("on {topic}, which cannot be opened anew: {cause}")]
    NotReopened {
        /// The topic, as it is named in the program.
        topic: &'static str,
        /// The middleware's words.
        cause: String,
    },
    /// The answer to a call, which who logs it names.
    #[error("{cause}")]
    Unanswered {
        /// The service.
        service: &'static str,
        /// The middleware's words.
        cause: String,
    },
}

impl SendError {
    pub(super) fn refused(topic: &'static str, cause: &(impl ToString + ?Sized)) -> Self {
        Self::Refused { topic, cause: without_places(&cause.to_string()) }
    }

    pub(super) fn unanswered(service: &'static str, cause: &(impl ToString + ?Sized)) -> Self {
        Self::Unanswered { service, cause: without_places(&cause.to_string()) }
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

    /// Namespace and name, as in `/robot/cfodi`.
    fn node_name(&self) -> &str;

    /// The topics that scans come from, by sensor.
    fn inputs(&self) -> &[SensorTopics];

    /// The topics that transforms come from.
    fn transform_topics(&self) -> &TransformTopics;

    /// Is told what scans of a sensor are made of from now on.
    fn chosen(&self, _: Input) {}

    /// What a person may look at where scans were sent and have not come.
    fn losses(&self) -> &'static str;

    /// Why nothing may come of a publisher that is there, beside that it is silent.
    fn silences(&self) -> &'static str;

    /// Every topic that another publishes now, as far as it is known, by name.
    fn sources(&self) -> Vec<Source>;

    /// Whether these are all: not for some seconds after the network was joined.
    fn knows_all_sources(&self) -> bool;

    /// What can be known of the network now.
    fn network_state(&self) -> NetworkState;

    /// Resolves, with a reason, when something that reads has ended: the node would be alive and deaf.
    fn failed(&self) -> impl Future<Output = String>;
}

#[cfg(test)]
mod tests {
    use std::error::Error;

    use super::*;
    use crate::msg::sent;

    #[test]
    fn what_could_not_be_sent_is_an_error_that_names_its_topic() {
        let error: Box<dyn Error> = SendError::refused(sent::DELTA.name, "no memory").into();
        assert_eq!(error.to_string(), "on ~/clusters_delta: no memory");
        let error = SendError::Unacknowledged { topic: sent::DELTA.name, most: 1024 };
        assert!(error.to_string().starts_with("on ~/clusters_delta: ") && error.to_string().contains("1024"));
        let error = SendError::unanswered(Service::Save.name(), "gone");
        assert!(matches!(error, SendError::Unanswered { service: "~/save", .. }));
    }
}
