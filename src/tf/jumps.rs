//! Which transforms jump back in time, and which frames only seem to.
//!
//! A bag that loops and a simulator that is reset play again from the beginning. Two publishers of one frame, one of which is
//! late, send older stamps by turns: what comes next, or a few messages later, is where the frame was before. Where the later one falls
//! silent, the frame has jumped back after all, once the other has gone on alone for as long as transforms are kept.

use std::collections::BTreeMap;

use super::{MAX_AGE, MAX_FRAMES};
use crate::engine::{JUMP_BACK, Stamp};

/// Whether the stamp of a transform has jumped back from the newest of its frame; neither has one where a transform is static.
fn has_jumped(newest: Option<Stamp>, stamp: Option<Stamp>) -> bool {
    newest.zip(stamp).is_some_and(|(newest, stamp)| stamp.jump_back_from(newest).is_some())
}

#[derive(Debug, Default)]
pub(super) struct Jumps {
    count: u64,
    /// The frame whose transform was the last that jumped back, and from where.
    last: Option<(String, Stamp)>,
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
        let Some((_, before)) = self.last.as_ref().filter(|(last, _)| last == child) else { return false };
        let leaps = |(newest, stamp): (Stamp, Stamp)| {
            stamp.jump_back_from(*before).is_none() && newest.jump_back_from(stamp).is_some()
        };
        newest.zip(stamp).is_some_and(leaps)
    }

    /// Notes a transform that jumps back from the newest of its frame.
    pub(super) fn note_back(&mut self, child: &str, newest: Option<Stamp>) {
        self.count += 1;
        self.to_and_fro.remove(child);
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
        if let Some(since) = self.to_and_fro.get_mut(child) {
            let is_behind = has_jumped(newest, stamp);
            // From its beginning anew, where it plays in a loop.
            let earlier = |stamp: Stamp| since.map_or(stamp, |since| since.min(stamp));
            *since = stamp.filter(|_| is_behind).map(earlier);
        }
        let (stamp, newest) = (stamp?, newest?);
        // The late one may send several before the other's next.
        let is_there = |before: &Stamp| stamp.jump_back_from(*before).is_none();
        self.last.take_if(|(last, before)| last == child && is_there(before))?;
        let apart = stamp.seconds_since(newest);
        if apart <= JUMP_BACK || self.to_and_fro.len() >= MAX_FRAMES {
            return None;
        }
        self.to_and_fro.insert(child.to_owned(), None);
        Some(apart)
    }
}
