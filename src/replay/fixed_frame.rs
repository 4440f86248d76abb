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
    /// The root of the sensor's tree as far as it has been seen. A later transform may show that it was none.
    Guessed {
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
            Self::Settled(name) | Self::Guessed { name, .. } => Some(name),
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

    /// What the frame must be where the guess was wrong: the default has turned up, or the root has got a parent.
    pub(super) fn better(&self, frames: &Frames) -> Option<Self> {
        let Self::Guessed { name, default } = self else { return None };
        if frames.root_of(default).is_some() {
            return Some(Self::Settled(default.clone()));
        }
        let root = frames.root_of(name).filter(|root| root != name)?;
        Some(Self::Guessed { name: root.to_owned(), default: default.clone() })
    }

    /// What is to be said of a guess at the end.
    pub(super) fn about(&self, frames: &Frames) -> Option<String> {
        let Self::Guessed { name, default } = self else { return None };
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
