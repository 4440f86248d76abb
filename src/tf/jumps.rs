//! Which transforms jump back in time, and which frames only seem to.
//!
//! A bag that loops and a simulator that is reset play again from the beginning. Two publishers of one frame, one of which is
//! late, send older stamps by turns: what comes next, or a few messages later, is where the frame was before, in one leap over most of
//! the jump. What plays again gets there step by step, however seldom the frame comes. Where the later publisher falls silent, the frame
//! has jumped back after all, once the other has gone on alone for as long as transforms are kept.

use std::collections::BTreeMap;

use super::{MAX_AGE, MAX_FRAMES};
use crate::engine::{JUMP_BACK, Stamp};

/// Whether the stamp of a transform has jumped back from the newest of its frame; neither has one where a transform is static.
fn has_jumped(newest: Option<Stamp>, stamp: Option<Stamp>) -> bool {
    newest.zip(stamp).is_some_and(|(newest, stamp)| stamp.jump_back_from(newest).is_some())
}

/// A frame whose transform has jumped back.
#[derive(Debug)]
struct Jump {
    child: String,
    from: Stamp,
    to: Stamp,
}

impl Jump {
    /// Whether this stamp is where the frame has jumped back from.
    fn is_undone(&self, stamp: Stamp) -> bool {
        stamp.jump_back_from(self.from).is_none()
    }

    /// By how much (s) this stamp leaps from its frame's newest to where that has jumped back from: by more than a jump needs and by
    /// more than half of that one. A frame that comes seldom gets there by steps that may each be as long as a jump.
    fn leap(&self, newest: Stamp, stamp: Stamp) -> Option<f64> {
        let leap = stamp.seconds_since(newest);
        let is_most = 2.0 * leap > self.from.seconds_since(self.to);
        (self.is_undone(stamp) && leap > JUMP_BACK && is_most).then_some(leap)
    }
}

#[derive(Debug, Default)]
pub(super) struct Jumps {
    count: u64,
    /// The last jump.
    last: Option<Jump>,
    /// Frames with two publishers whose stamps lie apart: of them no transform jumps back. The value is the stamp since
    /// which only the one with the earlier stamps has sent; `None` where the other one sent last.
    to_and_fro: BTreeMap<String, Option<Stamp>>,
}

impl Jumps {
    /// How often transforms have jumped back.
    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// Whether a transform with this stamp jumps back from the newest of its frame.
    pub(super) fn is_back(&self, child: &str, newest: Option<Stamp>, stamp: Option<Stamp>) -> bool {
        let is_back = has_jumped(newest, stamp);
        let is_alone = |since: &Option<Stamp>| {
            let silent = since.zip(stamp).map(|(since, stamp)| stamp.seconds_since(since));
            silent.is_some_and(|silent| silent > MAX_AGE.as_secs_f64())
        };
        is_back && self.to_and_fro.get(child).is_none_or(is_alone)
    }

    /// Whether a transform leaps to where its frame's last one jumped back from.
    pub(super) fn is_leap(&self, child: &str, newest: Option<Stamp>, stamp: Option<Stamp>) -> bool {
        let last = self.last.as_ref().filter(|last| last.child == child);
        last.zip(newest).zip(stamp).is_some_and(|((last, newest), stamp)| last.leap(newest, stamp).is_some())
    }

    /// Notes a transform that jumps back from the newest of its frame.
    pub(super) fn note_back(&mut self, child: &str, newest: Option<Stamp>, stamp: Option<Stamp>) {
        self.count += 1;
        self.to_and_fro.remove(child);
        self.last = newest.zip(stamp).map(|(from, to)| Jump { child: child.to_owned(), from, to });
    }

    /// Notes any other transform. Gives how far the stamps of its frame's two publishers lie apart (s), where the one before
    /// jumped back and this one leaps to where that came from.
    pub(super) fn note_on(
        &mut self,
        child: &str,
        newest: Option<Stamp>,
        stamp: Option<Stamp>,
    ) -> Option<f64> {
        if let Some(since) = self.to_and_fro.get_mut(child) {
            let is_behind = has_jumped(newest, stamp);
            // From its beginning anew, where it plays in a loop.
            let earlier = |stamp: Stamp| since.map_or(stamp, |since| since.min(stamp));
            *since = stamp.filter(|_| is_behind).map(earlier);
        }
        let (stamp, newest) = (stamp?, newest?);
        // The late one may send several before the other's next.
        let jump = self.last.take_if(|last| last.child == child && last.is_undone(stamp))?;
        let apart = jump.leap(newest, stamp).filter(|_| self.to_and_fro.len() < MAX_FRAMES)?;
        self.to_and_fro.insert(jump.child, None);
        Some(apart)
    }
}
