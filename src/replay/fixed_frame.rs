//! In which frame a replayed map lives.

use crate::tf::Frames;

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
}

impl FixedFrame {
    /// Its name, once it stands.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Settled(name) => Some(name),
            Self::Open { .. } => None,
        }
    }

    /// Settles on the default as soon as the bag has it.
    pub(super) fn look_for_default(&mut self, frames: &Frames) {
        if let Self::Open { default } = self
            && frames.root_of(default).is_some()
        {
            *self = Self::Settled(std::mem::take(default));
        }
    }

    /// Settles on the root of the sensor's tree; returns what is to be said of it.
    pub(super) fn settle(&mut self, frames: &Frames, sensor: &str) -> Option<String> {
        let Self::Open { default } = self else { return None };
        let (root, why) = match frames.root_of(sensor) {
            Some(root) => (root, "the root of the sensor's frames"),
            None => (
                sensor,
                "the sensor's own frame: no transform tells how it moved, so it is taken to stand still",
            ),
        };
        let line = format!(
            "the bag has no frame `{default}`: the map is made in `{root}`, {why} (choose with -p fixed_frame:=...)"
        );
        *self = Self::Settled(root.to_owned());
        Some(line)
    }
}
