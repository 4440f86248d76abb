//! What lies between two frames, and above or below one.

use nalgebra::Isometry3;

use super::{Edge, Frames, reach_beyond};
use crate::engine::Stamp;

impl Frames {
    /// Whether the newest of the dynamic transforms on the way from `sensor` to `fixed` lies more than [`JUMP_BACK`](crate::engine::JUMP_BACK) after
    /// `stamp`; `false` where there is none, whatever others do.
    pub fn way_reaches_beyond(&self, fixed: &str, sensor: &str, stamp: Stamp) -> bool {
        reach_beyond(self.way(fixed, sensor), stamp)
    }

    /// The edges up from both frames of a tree to where their ways meet.
    fn way(&self, fixed: &str, sensor: &str) -> impl Iterator<Item = &Edge> {
        let [fixed, sensor] = [fixed, sensor].map(|frame| self.up_from(frame).collect::<Vec<_>>());
        // What lies above both is on the way of neither.
        let shared = fixed.iter().rev().zip(sensor.iter().rev());
        let shared = shared.take_while(|(one, other)| std::ptr::eq(**one, **other)).count();
        let own = [fixed, sensor].map(|mut edges| {
            edges.truncate(edges.len() - shared);
            edges
        });
        own.into_iter().flatten()
    }

    /// A frame in which transforms of `/tf` move `fixed`, and `sensor` with it, and where `fixed` was in it last: the nearest that
    /// `is_map`, or else the root. `None` where nothing moves it, where something moves `sensor` in it, and where no way leads there.
    pub fn carried(
        &self,
        fixed: &str,
        sensor: &str,
        is_map: impl Fn(&str) -> bool,
    ) -> Option<(&str, Isometry3<f64>)> {
        let is_one_tree = self.root_of(fixed) == self.root_of(sensor);
        if !is_one_tree || self.way(fixed, sensor).any(|edge| edge.kept.is_some()) {
            return None;
        }
        // All that move it must be known at the time.
        let mut at: Option<Stamp> = None;
        let mut above = None;
        for edge in self.up_from(fixed) {
            at = at.into_iter().chain(edge.newest()).min();
            above = Some(edge.parent.as_str());
            if at.is_some() && is_map(&edge.parent) {
                break;
            }
        }
        let (above, at) = above.zip(at)?;
        Some((above, self.lookup(above, fixed, at).ok()?))
    }

    /// Whether something moves a frame, and `other` with it.
    pub fn is_carried_with(&self, frame: &str, other: &str) -> bool {
        let body = self.body_of(frame);
        body == self.body_of(other) && self.is_placed(body)
    }

    /// The topmost frame in which none moves a frame.
    fn body_of<'a>(&'a self, frame: &'a str) -> &'a str {
        let still = self.up_from(frame).take_while(|edge| edge.kept.is_none());
        still.last().map_or(frame, |edge| &edge.parent)
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
