//! What a bag tells beyond what has been fed of it: where its map lives, and the transforms that lie ahead.

use std::time::Duration;

use crate::bag::TransformTopics;
use crate::join::Join;
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::replay::ahead::Ahead;
use crate::replay::early::Early;
use crate::replay::finder::Finder;
use crate::replay::fixed_frame::FixedFrame;
use crate::replay::said::Remark;

/// A bag, and what was found in it so far.
pub(super) struct Outlook<'a> {
    ahead: Ahead<'a>,
    finder: Finder,
    early: Early,
}

impl<'a> Outlook<'a> {
    pub(super) fn new(ahead: Ahead<'a>, fixed_frame: FixedFrame, patience: Duration) -> Self {
        Self { ahead, finder: Finder::new(fixed_frame), early: Early::new(patience) }
    }

    /// The topics that transforms are read from.
    pub(super) const fn transform_topics(&self) -> &TransformTopics {
        self.ahead.transform_topics()
    }

    /// Where the map lives, once it is known.
    pub(super) fn fixed_frame(&self) -> Option<&str> {
        self.finder.name()
    }

    /// Whether the frame that was guessed is not the root.
    pub(super) const fn is_wrong(&self) -> bool {
        self.finder.is_wrong()
    }

    /// Whether a stamp of zero is a time like any other.
    pub(super) fn begins_at_zero(&mut self) -> bool {
        self.ahead.begins_at_zero()
    }

    /// Notes transforms, whatever becomes of them.
    pub(super) fn note(&mut self, message: &TfMessage, is_static: bool) {
        self.finder.note(message, is_static);
    }

    /// Notes that the turn of a transform has come; says whether it was taken before.
    pub(super) fn turn(&mut self, transform: &TransformStamped, is_static: bool) -> bool {
        self.early.turn(transform, is_static)
    }

    /// As [`Finder::guess`].
    pub(super) fn guess(&mut self, join: &Join) -> Option<TransformStamped> {
        self.finder.guess(&self.ahead, join)
    }

    /// As [`Finder::look_ahead`].
    pub(super) fn look_ahead(&mut self, join: &mut Join) -> bool {
        self.finder.look_ahead(&self.ahead, join)
    }

    /// As [`Early::next`].
    pub(super) fn next_early(&mut self, join: &Join) -> Option<TransformStamped> {
        self.early.next(&self.ahead, join)
    }

    /// The frame by the whole bag; `None` where a signal came before all of it was read.
    pub(super) fn right(&self, join: &Join) -> Option<FixedFrame> {
        self.finder.right(&self.ahead, join)
    }

    /// Whether some transforms so far, however late, lead from a sensor's frame to the fixed one.
    pub(super) fn reaches(&self, sensor: &str) -> bool {
        self.finder.reaches(sensor)
    }

    /// Where the map lives, and what is to be said at the end.
    pub(super) fn end(self, join: &Join) -> (String, Vec<Remark>) {
        let remarks = self.early.about().chain(self.finder.about(join)).collect();
        (self.finder.into_name(), remarks)
    }
}
