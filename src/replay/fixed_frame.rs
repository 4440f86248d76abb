//! In which frame a replayed map lives.

use std::collections::BTreeMap;

use crate::msg::ros::TransformStamped;
use crate::tf::{Frames, bare};

/// The fixed frame: as given, or found out from the bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FixedFrame {
    /// It stands.
    Settled(String),
    /// Nobody has named one: the default if the bag has it, else the root of the sensor's tree.
    Open {
        /// The default.
        default: String,
    },
    /// The root of the sensor's tree as far as it has been seen. A later transform may show that it was none.
    Guessed {
        /// That root.
        name: String,
        /// The default.
        default: String,
    },
    /// The root of the sensor's tree in the whole bag, which does not have the default.
    Found {
        /// That root.
        name: String,
        /// The default.
        default: String,
    },
}

impl FixedFrame {
    /// Its name, once there is one.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Settled(name) | Self::Guessed { name, .. } | Self::Found { name, .. } => Some(name),
            Self::Open { .. } => None,
        }
    }

    /// Settles on the default where it is seen before anything was guessed.
    pub(super) fn look_for_default(&mut self, frames: &Frames) {
        if let Self::Open { default } = self
            && frames.root_of(default).is_some()
        {
            *self = Self::Settled(std::mem::take(default));
        }
    }

    /// Guesses the root of the sensor's tree.
    pub(super) fn guess(&mut self, frames: &Frames, sensor: &str) {
        if let Self::Open { default } = self {
            let name = frames.root_of(sensor).unwrap_or(sensor).to_owned();
            *self = Self::Guessed { name, default: std::mem::take(default) };
        }
    }

    /// Whether the guess was wrong: the default has turned up, or the root has got a parent.
    pub(super) fn is_wrong(&self, frames: &Frames) -> bool {
        let Self::Guessed { name, default } = self else { return false };
        frames.root_of(default).is_some() || frames.root_of(name).is_some_and(|root| root != name)
    }

    /// What stands after a wrong guess: `transforms` are all those of the bag, so that no further guess is needed.
    pub(super) fn found(self, transforms: impl Iterator<Item = TransformStamped>) -> Self {
        let Self::Guessed { name, default } = self else { return self };
        // The newest transform decides on the parent of a frame.
        let parents: BTreeMap<_, _> = transforms
            .map(|t| (bare(&t.child_frame_id).to_owned(), bare(&t.header.frame_id).to_owned()))
            .collect();
        if parents.iter().any(|(child, parent)| *child == default || *parent == default) {
            return Self::Settled(default);
        }
        // Frames that change their parents can lead in a circle: no way is longer than there are frames.
        let up = |frame: &String| parents.get(frame).cloned();
        let root = std::iter::successors(Some(name.clone()), up).take(parents.len() + 1).last();
        Self::Found { name: root.unwrap_or(name), default }
    }

    /// What is to be said of a guess at the end.
    pub(super) fn about(&self, frames: &Frames) -> Option<String> {
        let (Self::Guessed { name, default } | Self::Found { name, default }) = self else { return None };
        let why = if frames.root_of(name).is_some() {
            "the root of the sensor's frames"
        } else {
            "the sensor's own frame: no transform tells how it moved, so it is taken to stand still"
        };
        Some(format!(
            "the bag has no frame `{default}`: the map is made in `{name}`, {why} (choose with -p fixed_frame:=...)"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::ros::Header;

    fn found(pairs: &[(&str, &str)]) -> FixedFrame {
        let guess = FixedFrame::Guessed { name: "a".to_owned(), default: "odom".to_owned() };
        let transform = |(parent, child): &(&str, &str)| TransformStamped {
            header: Header { frame_id: (*parent).to_owned(), ..Header::default() },
            child_frame_id: (*child).to_owned(),
            ..TransformStamped::default()
        };
        guess.found(pairs.iter().map(transform))
    }

    #[test]
    fn the_root_of_all_transforms_is_found_and_the_default_before_it() {
        let root = |name: &str| FixedFrame::Found { name: name.to_owned(), default: "odom".to_owned() };
        assert_eq!(found(&[("/b", "/a"), ("c", "b"), ("x", "y")]), root("c"));
        assert_eq!(found(&[("b", "a"), ("odom", "x")]), FixedFrame::Settled("odom".to_owned()));
        assert_eq!(found(&[]), root("a"));
    }

    #[test]
    fn frames_in_a_circle_end_somewhere() {
        assert!(matches!(found(&[("b", "a"), ("a", "b")]), FixedFrame::Found { .. }));
    }
}
