//! Which transforms jump back in time, and which frames only seem to.
//!
//! A bag that loops and a simulator that is reset play again from the beginning. Two publishers of one frame, one of which is
//! late, send an older stamp with every other message: what comes next is where the frame was before.

use std::collections::BTreeSet;

use super::MAX_FRAMES;
use crate::engine::Stamp;
use crate::msg::ros::JUMP_BACK;

#[derive(Debug, Default)]
pub(super) struct Jumps {
    count: u64,
    /// The frame whose transform was the last that jumped back, and from where.
    last: Option<(String, Stamp)>,
    /// Frames with two publishers whose stamps lie apart: of them no transform jumps back.
    to_and_fro: BTreeSet<String>,
}

impl Jumps {
    /// How often transforms have jumped back.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// Whether a transform with this stamp jumps back from the newest of its frame.
    pub(super) fn is_back(&self, child: &str, newest: Option<Stamp>, stamp: Option<Stamp>) -> bool {
        let is_back =
            newest.zip(stamp).is_some_and(|(newest, stamp)| newest.seconds_since(stamp) > JUMP_BACK);
        is_back && !self.to_and_fro.contains(child)
    }

    /// Notes a transform that jumps back from the newest of its frame.
    pub(super) fn note_back(&mut self, child: &str, newest: Option<Stamp>) {
        self.count += 1;
        self.last = newest.map(|newest| (child.to_owned(), newest));
    }

    /// Notes any other transform. Gives how far the stamps of its frame's two publishers lie apart (s), where the one before
    /// jumped back and this one leaps to where that came from; what plays again from its beginning gets there step by step.
    pub(super) fn note_on(
        &mut self,
        child: &str,
        newest: Option<Stamp>,
        stamp: Option<Stamp>,
    ) -> Option<f64> {
        let (_, before) = self.last.take_if(|(last, _)| last == child)?;
        let (stamp, newest) = (stamp?, newest?);
        let apart = stamp.seconds_since(newest);
        let is_there = before.seconds_since(stamp) <= JUMP_BACK;
        if !is_there || apart <= JUMP_BACK || self.to_and_fro.len() >= MAX_FRAMES {
            return None;
        }
        self.to_and_fro.insert(child.to_owned());
        Some(apart)
    }
}
