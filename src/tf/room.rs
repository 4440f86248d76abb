//! The bounds of what is kept, and what goes or is spared where they are reached.

use super::sample::Sample;
use super::{Edge, FrameError, Frames, MAX_AGE, MAX_FRAME_SAMPLES, MAX_FRAMES, MAX_SAMPLES};
use crate::engine::Stamp;

impl Frames {
    /// Whether a sample can be spared for want of room.
    pub(super) fn can_spare(&self, sample: &Sample<'_>) -> bool {
        let edge = self.edges.get(sample.child).filter(|edge| edge.parent == sample.parent);
        let kept = edge.and_then(|edge| edge.kept);
        kept.zip(sample.stamp).is_some_and(|(kept, stamp)| kept.can_spare(stamp))
    }

    /// Refuses a sample where too much is kept, once what is out of date is forgotten.
    pub(super) fn make_room(&mut self, sample: &Sample<'_>) -> Result<(), FrameError> {
        let kept = self.edges.get(sample.child).map(|edge| edge.kept);
        let is_full = |frames: &Self| {
            let no_frame = kept.is_none() && frames.edges.len() >= MAX_FRAMES;
            (no_frame, sample.stamp.is_some() && frames.samples >= MAX_SAMPLES)
        };
        if is_full(self) != (false, false) {
            self.forget_stale(sample.stamp);
        }
        let child = || sample.child.to_owned();
        match is_full(self) {
            (true, _) => return Err(FrameError::TooManyFrames { child: child(), max: MAX_FRAMES }),
            (_, true) => return Err(FrameError::TooManySamples { child: child(), max: MAX_SAMPLES }),
            _ => {}
        }
        let grown = kept.flatten().zip(sample.stamp).map_or(0, |(kept, stamp)| kept.with(stamp).bound());
        if grown > MAX_FRAME_SAMPLES {
            return Err(FrameError::TooManySamples { child: child(), max: MAX_FRAME_SAMPLES });
        }
        Ok(())
    }

    /// Forgets the dynamic frames of another time than `stamp` (or the newest there is): nothing is looked up there.
    fn forget_stale(&mut self, stamp: Option<Stamp>) {
        let newest = || self.edges.values().filter_map(Edge::newest).max();
        let Some(now) = stamp.or_else(newest) else { return };
        let is_far = |other: Stamp, seconds: f64| other.seconds_since(now).abs() > seconds;
        // Looking through all takes time, and a sender of ever new names would have it done for each.
        if self.looked.is_some_and(|looked| !is_far(looked, 1.0)) {
            return;
        }
        self.looked = Some(now);
        self.retain(|edge| !edge.newest().is_some_and(|newest| is_far(newest, MAX_AGE.as_secs_f64())));
    }
}
