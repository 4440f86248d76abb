//! What a replay reads of its bag before its turn comes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::clocks;
use crate::bag::{Bag, Decoder, Recorded, TransformTopics};
use crate::msg::ros::TransformStamped;

/// A bag to look ahead in, up to a signal; what cannot be read is said when its turn comes.
pub(super) struct Ahead<'a> {
    bag: &'a Bag,
    decoder: Decoder,
    stop: Arc<AtomicBool>,
    /// Once it is known.
    begins_at_zero: Option<bool>,
}

impl<'a> Ahead<'a> {
    /// Finds the cameras of the sensors first.
    pub(super) fn new(bag: &'a Bag, mut decoder: Decoder, stop: Arc<AtomicBool>) -> Self {
        decoder.look_for_cameras(bag.readable_until(Arc::clone(&stop)));
        Self { bag, decoder, stop, begins_at_zero: None }
    }

    /// Reads the sensors.
    pub(super) fn decoder(&self) -> Decoder {
        self.decoder.clone()
    }

    /// The topics that transforms are read from.
    pub(super) const fn transform_topics(&self) -> &TransformTopics {
        self.decoder.transform_topics()
    }

    /// Whether the bag has transforms, as far as it says what it has.
    pub(super) fn has_transforms(&self) -> bool {
        let topics = self.bag.survey(&self.stop).topics;
        topics.iter().any(|topic| topic.messages != Some(0) && self.transform_topics().has(&topic.name))
    }

    /// Whether a sensor's frame is optical; see [`Decoder::is_optical`].
    pub(super) fn is_optical(&self, sensor: usize, frame: &str) -> bool {
        self.decoder.is_optical(sensor, frame)
    }

    /// The transforms of the whole bag, in order, with whether they are static.
    pub(super) fn transforms(&self) -> impl Iterator<Item = (TransformStamped, bool)> + use<> {
        let mut decoder = self.decoder.of_transforms();
        let messages = self.bag.readable_until(Arc::clone(&self.stop));
        let recorded = messages.flat_map(move |message| decoder.decode(&message));
        recorded.flat_map(|recorded| match recorded {
            Recorded::Transforms { message, is_static } => {
                message.transforms.into_iter().map(|transform| (transform, is_static)).collect()
            }
            _ => Vec::new(),
        })
    }

    /// Whether a signal has come, so that what was read last may not be all.
    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Whether a stamp of zero is a time like any other.
    pub(super) fn begins_at_zero(&mut self) -> bool {
        let Self { bag, decoder, stop, begins_at_zero } = self;
        *begins_at_zero.get_or_insert_with(|| clocks::begins_at_zero(bag, decoder.clone(), stop))
    }
}
