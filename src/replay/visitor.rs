//! Who is handed the scans of a bag, and says whether to go on.

use std::time::Duration;

use super::summary::Tally;
use crate::bag::Message;
use crate::engine::Scan;
use crate::msg::ros::TransformStamped;

/// Where a scan comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Its sensor, as its place among those of the [`Decoder`](crate::bag::Decoder).
    pub sensor: usize,
    /// When it was recorded (since the epoch).
    pub recorded: Duration,
}

/// What becomes of the scans.
pub trait Visitor {
    /// Why it cannot go on.
    type Error;

    /// A scan, in the frame `fixed_frame`; `tally` is what has become of the bag until then.
    ///
    /// # Errors
    /// Ends the feeding.
    fn scan(
        &mut self,
        scan: &Scan,
        origin: Origin,
        fixed_frame: &str,
        tally: &Tally,
    ) -> Result<(), Self::Error>;

    /// Stamps have jumped back by this many seconds: the next scan begins a new session. Says whether it is wanted.
    ///
    /// # Errors
    /// Ends the feeding.
    fn jumped_back(&mut self, seconds: f64) -> Result<Go, Self::Error>;

    /// Nothing in the bag says how the camera is mounted, so that the map is made in its body frame (x ahead, y left, z up); the static
    /// transform leads from that, the parent, to the optical frame.
    fn level(&mut self, _: &TransformStamped) {}

    /// A message of the bag, where [`Feed::with_messages`](super::Feed::with_messages) asks for them.
    ///
    /// # Errors
    /// Ends the feeding.
    fn message(&mut self, message: &Message) -> Result<(), Self::Error>;

    /// Something that a person should know.
    fn say(&mut self, line: &str);
}

/// Whether to go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Go {
    /// What follows is wanted.
    On,
    /// What follows is only counted.
    Home,
}
