//! The robot of demonstrations and tests.

use std::sync::Arc;
use std::time::Duration;

use ros2_client::qos::{Durability, WhenFull};
use ros2_client::{Publisher, QosProfile};
use rustdds::TopicDescription as _;

use super::farewell::{Farewell, LastWord};
use super::opener::Kept;
use super::read::has_keys;
use super::threads::Threads;
use super::{Opener, addresses, reliable};
use crate::args::Setup;
use crate::msg::heard::of_robot;
use crate::msg::ros::{PointCloud2, TfMessage};
use crate::msg::topic::{Named, Topic};
use crate::msg::types;
use crate::node::middleware::OpenError;
use crate::node::transport::SendError;

/// Who begins to read `/tf` when some thousand messages have been sent counts as one that has acknowledged none of them,
/// for some milliseconds.
const PATIENCE: WhenFull = WhenFull::Wait(Duration::from_millis(500));

const POINTS: &str = "points";
const TF: Topic = of_robot(false);
const TF_STATIC: Topic = of_robot(true);

/// Publishers of a simulated robot: its own participant, so that its clouds really cross the network stack.
pub struct Robot {
    // Fields are dropped in this order: all that holds the participant before the last word on it.
    points: Publisher<PointCloud2>,
    /// The topic of `points` by its name in DDS.
    points_topic: String,
    tf: Publisher<TfMessage>,
    tf_static: Publisher<TfMessage>,
    kept: Kept,
    _last_word: LastWord,
}

impl Robot {
    /// Opens a node `simulated_robot` that publishes `points`, `/tf` and `/tf_static` in the domain of `setup`.
    ///
    /// # Errors
    /// When the middleware refuses something.
    pub fn open(setup: &Setup) -> Result<Self, OpenError> {
        let setup = setup.for_node("simulated_robot");
        let security = setup.security()?;
        let addresses = addresses::read(&setup.config().network_interfaces).into_iter().collect();
        let (opener, threads) = Threads::started_by(|| Opener::new(&setup, &security));
        let mut opener = opener?;
        let farewell = Farewell::of(&opener.participant, &Arc::new(threads), addresses);
        let farewell = Some(farewell).filter(|_| !has_keys(&security));
        let best_effort = &QosProfile::subscription_default().into();
        let cloud = Named { name: POINTS, type_name: types::CLOUD };
        let points_topic = opener.topic(cloud, best_effort)?.name();
        let points = opener.publisher(cloud, best_effort)?;
        let patient =
            |depth, durability| (&reliable(depth, durability).reliability_reliable(PATIENCE)).into();
        let dynamic = opener.publisher(TF.named(), &patient(TF.qos.depth, Durability::Volatile))?;
        let latched =
            opener.publisher(TF_STATIC.named(), &patient(TF_STATIC.qos.depth, Durability::TransientLocal))?;
        let (kept, last_word) = (opener.into_kept(), LastWord(farewell));
        Ok(Self { points, points_topic, tf: dynamic, tf_static: latched, kept, _last_word: last_word })
    }

    /// Sends a cloud, where somebody reads clouds.
    ///
    /// # Errors
    /// When the middleware refuses it.
    pub fn send_cloud(&self, cloud: PointCloud2) -> Result<(), SendError> {
        if !self.is_read() {
            return Ok(());
        }
        self.points.publish(cloud).map_err(|error| SendError::refused(POINTS, &error))
    }

    /// With DDS Security `RustDDS` 0.15.1 signs each datagram of a cloud whether or not somebody reads it, and looks at nothing
    /// that has arrived until all clouds are sent. Where a core has no time for both, nobody would ever be found.
    fn is_read(&self) -> bool {
        let (_, participant) = &self.kept;
        let readers = participant.discovered_readers();
        readers.iter().any(|reader| *reader.subscription_topic_data.topic_name() == self.points_topic)
    }

    /// Sends transforms on `/tf`, or on `/tf_static`.
    ///
    /// # Errors
    /// When the middleware refuses them.
    pub fn send_transforms(&self, message: TfMessage, is_static: bool) -> Result<(), SendError> {
        let (topic, publisher) = if is_static { (TF_STATIC, &self.tf_static) } else { (TF, &self.tf) };
        publisher.publish(message).map_err(|error| SendError::refused(topic.name, &error))
    }
}
