//! What becomes of a transform that is taken in.

use nalgebra::Isometry3;

use crate::msg::ros::TransformStamped;

/// What an accepted transform did beside being stored.
#[derive(Clone, Debug, PartialEq)]
pub enum Inserted {
    /// Nothing.
    Stored,
    /// It moved its frame under another parent; the frame's past is gone.
    Reparented {
        /// The parent before.
        before: String,
    },
    /// It is static and puts its frame elsewhere below the same parent, by more than rounding explains.
    StaticMoved {
        /// How far (m).
        by: f64,
        /// How much it is turned (rad).
        turned: f64,
    },
    /// It made a static frame dynamic or a dynamic one static; the frame's past is gone.
    KindChanged,
    /// Its stamp lies more than [`JUMP_BACK`](crate::engine::JUMP_BACK) before its frame's newest, as when a bag loops: all other dynamic
    /// transforms are gone, the static ones stay.
    JumpedBack,
    /// It is where its frame had jumped back from: two publishers have stamps that lie so far apart (s). From now on none of
    /// that frame's transforms is taken for a jump.
    ToAndFro {
        /// Between the newest stamps of the two.
        apart: f64,
    },
}

/// What a static transform may lie off the one before and still be the same (m).
const ROUNDING: f64 = 1e-3;

/// What it may be turned (rad): one has `3.14` and `1.57` for half a turn and a quarter, about all three axes, the other all digits.
const ROUNDING_OF_TURNS: f64 = 3e-3;

impl Inserted {
    /// What a static transform does that comes after another one of the same frame and parent.
    pub(super) fn static_after(before: &Isometry3<f64>, now: &Isometry3<f64>) -> Self {
        let by = (now.translation.vector - before.translation.vector).norm();
        let turned = now.rotation.angle_to(&before.rotation);
        if by > ROUNDING || turned > ROUNDING_OF_TURNS {
            Self::StaticMoved { by, turned }
        } else {
            Self::Stored
        }
    }

    /// Whether the frame's past is gone.
    pub(super) const fn begins_anew(&self) -> bool {
        matches!(self, Self::Reparented { .. } | Self::KindChanged)
    }

    /// Names what has happened: of each kind something is to be said, whatever else was said of late.
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Stored => "tf_stored",
            Self::Reparented { .. } => "tf_reparented",
            Self::StaticMoved { .. } => "tf_static_moved",
            Self::KindChanged => "tf_kind_changed",
            Self::JumpedBack => "tf_jumped_back",
            Self::ToAndFro { .. } => "tf_to_and_fro",
        }
    }

    /// What to say of it, with the words that the transform has; `None` where nothing is to be said.
    pub fn about(&self, transform: &TransformStamped) -> Option<String> {
        let (child, parent) = (&transform.child_frame_id, &transform.header.frame_id);
        match self {
            Self::Stored => None,
            Self::Reparented { before } => Some(format!(
                "{child} was below {before} and is now below {parent}, and its past is forgotten: where this is said again, two \
                 publishers contradict each other"
            )),
            Self::StaticMoved { by, turned } => Some(format!(
                "the static transform of {child} below {parent} is another than before, by {by:.3} m and {turned:.3} rad: the newest \
                 counts, and where nobody has changed it two publishers contradict each other"
            )),
            Self::KindChanged => Some(format!(
                "{child} comes with transforms that change and with static ones: the newest counts, and its past is forgotten"
            )),
            Self::JumpedBack => Some(format!(
                "the transforms of {child} have jumped back in time: all before that change are forgotten"
            )),
            Self::ToAndFro { apart } => Some(format!(
                "the transforms of {child} jump to and fro by {apart:.1} s: they have two publishers, one of which is late; those of \
                 other frames are forgotten for it no more"
            )),
        }
    }
}
