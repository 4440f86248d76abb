//! What lies between two frames, and above or below one.

use super::{Edge, Frames, reach_beyond};
use crate::engine::Stamp;

impl Frames {
    /// Whether the newest of the dynamic transforms on the way from `sensor` to `fixed` lies more than [`JUMP_BACK`](crate::engine::JUMP_BACK) after
    /// `stamp`; `false` where there is none, whatever others do.
    pub fn way_reaches_beyond(&self, fixed: &str, sensor: &str, stamp: Stamp) -> bool {
        let [fixed, sensor] = [fixed, sensor].map(|frame| self.up_from(frame).collect::<Vec<_>>());
        // What lies above both is on the way of neither.
        let shared = fixed.iter().rev().zip(sensor.iter().rev());
        let shared = shared.take_while(|(one, other)| std::ptr::eq(**one, **other)).count();
        let own = [fixed, sensor].map(|mut edges| {
            edges.truncate(edges.len() - shared);
            edges
        });
        reach_beyond(own.into_iter().flatten(), stamp)
    }

    /// The edges from a frame to its root.
    pub(super) fn up_from(&self, frame: &str) -> impl Iterator<Item = &Edge> {
        std::iter::successors(self.edges.get(frame), |edge| self.edges.get(&edge.parent))
    }

    /// Whether a frame is another one, or one of those above it.
    pub fn is_above(&self, frame: &str, below: &str) -> bool {
        frame == below || self.up_from(below).any(|edge| edge.parent == frame)
    }

    /// Whether the link from a frame to its parent is on the way from `sensor` to `fixed`.
    pub fn is_on_way(&self, frame: &str, fixed: &str, sensor: &str) -> bool {
        self.is_above(frame, fixed) != self.is_above(frame, sensor)
    }

    /// Whether anything moves below a frame: transforms of `/tf` lead there from it.
    pub fn moves_below(&self, frame: &str) -> bool {
        // Asked of each cloud of a camera that stands still, which is mostly above nothing.
        if !self.parents.contains_key(frame) {
            return false;
        }
        let is_below = |edge: &Edge| {
            edge.parent == frame || self.up_from(&edge.parent).any(|above| above.parent == frame)
        };
        self.edges.values().any(|edge| edge.kept.is_some() && is_below(edge))
    }
}
