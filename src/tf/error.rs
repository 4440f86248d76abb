//! Why a transform was refused, and why a lookup gave none.

use std::fmt;

use crate::engine::Stamp;
use crate::reason::Reason;

/// Why a transform was not taken into the tree.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrameError {
    /// A name is empty, or was nothing but slashes.
    #[error("transform from child `{child}` to parent `{parent}`: a frame name is empty")]
    EmptyName {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
    },
    /// A name longer than any driver's.
    #[error("a frame name has {bytes} bytes, at most {max} are taken")]
    LongName {
        /// Its length.
        bytes: usize,
        /// [`MAX_NAME_BYTES`](super::MAX_NAME_BYTES).
        max: usize,
    },
    /// Parent and child are the same.
    #[error("frame {frame} cannot be its own parent")]
    SelfTransform {
        /// The frame.
        frame: String,
    },
    /// The frame would become its own ancestor.
    #[error("frame {child} cannot be put under {parent}, which lies below it")]
    Cycle {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
    },
    /// A number is NaN or infinite.
    #[error(
        "transform {child} to {parent} is not finite: translation {translation:?}, rotation {rotation:?}"
    )]
    NonFinite {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
        /// x, y, z (m).
        translation: [f64; 3],
        /// x, y, z, w.
        rotation: [f64; 4],
    },
    /// The rotation is no unit quaternion, and not nearly one either.
    #[error("transform {child} to {parent} has a quaternion of norm {norm}, must be 1 within 0.01")]
    BadNorm {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
        /// The quaternion's norm.
        norm: f64,
    },
    /// The header's nanoseconds do not fit a second.
    #[error("transform {child} to {parent} has nanosec {nanosec}, must be below 1000000000")]
    BadStamp {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
        /// `header.stamp.nanosec`.
        nanosec: u32,
    },
    /// The tree is full.
    #[error("no room for frame {child}: {max} frames are kept")]
    TooManyFrames {
        /// The frame that came last.
        child: String,
        /// [`MAX_FRAMES`](super::MAX_FRAMES).
        max: usize,
    },
    /// Too many samples, of one frame or of all, within the time that is kept.
    #[error("no room for a transform of {child}: {max} are kept at once")]
    TooManySamples {
        /// The frame that came last.
        child: String,
        /// [`MAX_FRAME_SAMPLES`](super::MAX_FRAME_SAMPLES) or [`MAX_SAMPLES`](super::MAX_SAMPLES).
        max: usize,
    },
    /// Too many frames above it.
    #[error("frame {child} has more than {max} frames above it")]
    TooDeep {
        /// The frame.
        child: String,
        /// [`MAX_DEPTH`](super::MAX_DEPTH).
        max: usize,
    },
    /// The registry has a reason that is not among the others.
    #[error("transform {child} to {parent} refused: {reason}")]
    Refused {
        /// Parent frame.
        parent: String,
        /// Child frame.
        child: String,
        /// In the registry's words.
        reason: String,
    },
}

impl FrameError {
    /// What refused transforms are counted by, with what that means.
    pub fn reason(&self) -> Reason {
        let (key, sentence) = match self {
            Self::EmptyName { .. } => ("empty_name", "A transform names no frame."),
            Self::LongName { .. } => ("long_name", "A transform’s frame has too long a name."),
            Self::SelfTransform { .. } => ("self_transform", "A transform leads from a frame to itself."),
            Self::Cycle { .. } => ("cycle", "A transform would make a frame its own ancestor."),
            Self::NonFinite { .. } => ("non_finite", "A transform holds a number that is not finite."),
            Self::BadNorm { .. } => ("bad_norm", "The rotation of a transform is no unit quaternion."),
            Self::BadStamp { .. } => {
                ("bad_stamp", "The nanoseconds of the header’s stamp do not fit a second.")
            }
            Self::TooManyFrames { .. } => ("too_many_frames", "The transforms name too many frames."),
            Self::TooManySamples { .. } => (
                "too_many_samples",
                "More transforms came within the time that is kept than there is room for.",
            ),
            Self::TooDeep { .. } => ("too_deep", "A transform’s frame has too many frames above it."),
            Self::Refused { .. } => ("refused", "A transform was refused by the buffer of transforms."),
        };
        Reason::new(key, sentence)
    }
}

/// A range of time, both ends inclusive; in text as seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Oldest stamp.
    pub from: Stamp,
    /// Newest stamp.
    pub until: Stamp,
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", Seconds(self.from), Seconds(self.until))
    }
}

/// A stamp as seconds with all of its microseconds, which an `f64` since 1970 just holds.
struct Seconds(Stamp);

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.6} s", self.0.nanos() as f64 * 1e-9)
    }
}

/// The time from the second stamp to the first, which is no earlier. Stamps of one instant that two programs have rounded differ by
/// nanoseconds.
struct Apart(Stamp, Stamp);

impl fmt::Display for Apart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(later, earlier) = self;
        match i128::from(later.nanos()) - i128::from(earlier.nanos()) {
            nanos @ ..1000 => write!(f, "{nanos} ns"),
            _ => write!(f, "{:.6} s", later.seconds_since(*earlier)),
        }
    }
}

/// Why there is no transform from the sensor's frame into the fixed one; the text goes into a warning as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LookupError {
    /// Fixed frame.
    pub fixed: String,
    /// Sensor's frame.
    pub sensor: String,
    /// Time asked for.
    pub at: Stamp,
    /// What there is not.
    pub lack: Lack,
}

/// What a lookup lacks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Lack {
    /// No transform has named one of the frames so far.
    UnknownFrame {
        /// The one that is not known.
        frame: String,
    },
    /// Both frames are known, in trees apart.
    NotConnected {
        /// Root of the tree that the fixed frame is in.
        fixed_root: String,
        /// Root of the tree that the sensor's frame is in.
        sensor_root: String,
    },
    /// The time asked for is already forgotten, or was never covered; waiting does not help.
    TooEarly {
        /// The frame between the two whose samples do not reach.
        frame: String,
        /// The range of its samples.
        covered: Span,
    },
    /// The transform for the time asked for has not come yet; it may.
    TooLate {
        /// The frame between the two whose samples do not reach.
        frame: String,
        /// The range of its samples.
        covered: Span,
    },
    /// The stamps of the sensor have jumped back, and the transforms have not: those at this time are of before the jump.
    NotJumpedBack {
        /// Stamp of the sensor's newest scan.
        newest: Stamp,
    },
    /// One of the frames has too much above it.
    TooDeep {
        /// [`MAX_DEPTH`](super::MAX_DEPTH).
        max: usize,
    },
    /// The chain is there, but its numbers cannot be composed.
    Numeric {
        /// What overflowed.
        reason: String,
    },
}

impl std::error::Error for LookupError {}

impl fmt::Display for LookupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fixed, sensor, at, lack } = self;
        write!(f, "no transform from {sensor} into {fixed} at {}: ", Seconds(*at))?;
        match lack {
            Lack::UnknownFrame { frame } => write!(f, "no frame {frame} has been seen"),
            Lack::NotConnected { fixed_root, sensor_root } => write!(
                f,
                "{sensor} hangs below {sensor_root}, {fixed} below {fixed_root}, and nothing connects the two"
            ),
            Lack::TooEarly { frame, covered } => {
                write!(f, "{} before the range covered by {frame}, {covered}", Apart(covered.from, *at))
            }
            Lack::TooLate { frame, covered } => {
                write!(f, "{} after the range covered by {frame}, {covered}", Apart(*at, covered.until))
            }
            Lack::NotJumpedBack { newest } => write!(
                f,
                "its stamp lies {:.3} s before that of the newest scan, and the transforms have not jumped back",
                newest.seconds_since(*at)
            ),
            Lack::TooDeep { max } => write!(f, "one of the two has more than {max} frames above it"),
            Lack::Numeric { reason } => f.write_str(reason),
        }
    }
}

impl LookupError {
    /// Whether no way leads from the one frame to the other, as opposed to one that does not reach that time.
    pub const fn is_unconnected(&self) -> bool {
        matches!(self.lack, Lack::UnknownFrame { .. } | Lack::NotConnected { .. })
    }

    /// Whether a way leads from the one frame to the other, but not at that time, or not since the stamps jumped back.
    pub const fn is_of_time(&self) -> bool {
        matches!(self.lack, Lack::TooEarly { .. } | Lack::TooLate { .. } | Lack::NotJumpedBack { .. })
    }

    /// Keeps the start of the range that an earlier lookup for the same cloud has found. The oldest samples are forgotten meanwhile: a
    /// cloud that was taken a moment too early would seem to be too early by all the time for which it has waited.
    pub(crate) fn keep_start(&mut self, earlier: &Self) {
        let lacks = (&mut self.lack, &earlier.lack);
        if let (Lack::TooEarly { frame, covered }, Lack::TooEarly { frame: same, covered: found }) = lacks
            && frame == same
        {
            covered.from = covered.from.min(found.from);
        }
    }

    /// What skipped scans are counted by, with what that means.
    pub fn reason(&self) -> Reason {
        let (key, sentence) = match self.lack {
            Lack::UnknownFrame { .. } => {
                ("tf_unknown_frame", "No transform names the sensor’s frame or the fixed frame.")
            }
            Lack::NotConnected { .. } => {
                ("tf_not_connected", "No chain of transforms joins the sensor to the fixed frame.")
            }
            Lack::TooEarly { .. } => ("tf_too_early", "The cloud is older than the oldest transform."),
            Lack::TooLate { .. } => ("tf_too_late", "The cloud is newer than the newest transform."),
            Lack::NotJumpedBack { .. } => {
                ("tf_not_jumped_back", "The stamps jumped back, and the transforms did not.")
            }
            Lack::TooDeep { .. } => {
                ("tf_too_deep", "The sensor’s frame or the fixed frame has too many frames above it.")
            }
            Lack::Numeric { .. } => {
                ("tf_numeric", "The transforms to the fixed frame cannot be put together.")
            }
        };
        Reason::new(key, sentence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_covered_is_so_still_for_a_cloud_that_waits() {
        let stamp = Stamp::from_nanos;
        let early = |frame: &str, from| {
            let covered = Span { from: stamp(from), until: stamp(from + 10) };
            let lack = Lack::TooEarly { frame: frame.to_owned(), covered };
            LookupError { fixed: "odom".to_owned(), sensor: "camera".to_owned(), at: stamp(1), lack }
        };
        let covered = |before: &LookupError, from| {
            let mut now = early("base", from);
            now.keep_start(before);
            let Lack::TooEarly { covered, .. } = now.lack else { panic!("{now}") };
            (covered.from.nanos(), covered.until.nanos())
        };
        assert_eq!(covered(&early("base", 3), 40), (3, 50));
        assert_eq!(covered(&early("base", 40), 3), (3, 13), "one that came late");
        assert_eq!(covered(&early("head", 3), 40), (40, 50), "of another frame");
    }

    #[test]
    fn a_lookup_lacks_a_way_or_its_time_or_neither() {
        let (frame, at) = (|| "f".to_owned(), Stamp::default());
        let covered = Span { from: at, until: at };
        let of = |lack| {
            let error = LookupError { fixed: frame(), sensor: frame(), at, lack };
            (error.reason().key, error.is_unconnected(), error.is_of_time())
        };
        assert_eq!(of(Lack::UnknownFrame { frame: frame() }), ("tf_unknown_frame", true, false));
        let apart = Lack::NotConnected { fixed_root: frame(), sensor_root: frame() };
        assert_eq!(of(apart), ("tf_not_connected", true, false));
        assert_eq!(of(Lack::TooEarly { frame: frame(), covered }), ("tf_too_early", false, true));
        assert_eq!(of(Lack::TooLate { frame: frame(), covered }), ("tf_too_late", false, true));
        assert_eq!(of(Lack::NotJumpedBack { newest: at }), ("tf_not_jumped_back", false, true));
        assert_eq!(of(Lack::TooDeep { max: 1 }), ("tf_too_deep", false, false));
        assert_eq!(of(Lack::Numeric { reason: String::new() }), ("tf_numeric", false, false));
    }
}
