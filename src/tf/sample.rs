//! From a `geometry_msgs/TransformStamped` to a transform whose every part was checked.

use transforms::errors::TransformError;
use transforms::geometry::{Quaternion, Transform, Vector3};
use transforms::time::{self, Timestamp};

use super::FrameError;
use crate::engine::Stamp;
use crate::msg::ros::{MAX_FRAME_ID_BYTES, TransformStamped};

/// Largest deviation of a quaternion's norm from 1 that is normalised; beyond it the rotation is not known. tf2's.
pub const NORM_TOLERANCE: f64 = 1e-2;

/// Longest name of a frame.
pub const MAX_NAME_BYTES: usize = MAX_FRAME_ID_BYTES;

/// A transform that is well formed by itself; whether the tree has a place for it is another question.
pub(super) struct Sample<'a> {
    pub(super) parent: &'a str,
    pub(super) child: &'a str,
    /// `None` for a static transform.
    pub(super) stamp: Option<Stamp>,
    translation: Vector3,
    rotation: Quaternion,
}

impl<'a> Sample<'a> {
    pub(super) fn check(message: &'a TransformStamped, is_static: bool) -> Result<Self, FrameError> {
        let (parent, child) = names(message)?;
        let (t, r) = (message.transform.translation, message.transform.rotation);
        let (translation, rotation) = ([t.x, t.y, t.z], [r.x, r.y, r.z, r.w]);
        if !translation.iter().chain(&rotation).all(|value| value.is_finite()) {
            let (parent, child) = (parent.to_owned(), child.to_owned());
            return Err(FrameError::NonFinite { parent, child, translation, rotation });
        }
        let norm = rotation.iter().map(|value| value * value).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > NORM_TOLERANCE {
            return Err(FrameError::BadNorm { parent: parent.into(), child: child.into(), norm });
        }
        let time = message.header.stamp;
        let nanosec = time.nanosec;
        let bad_stamp = || FrameError::BadStamp { parent: parent.into(), child: child.into(), nanosec };
        Ok(Self {
            parent,
            child,
            stamp: if is_static { None } else { Some(time.stamp().ok_or_else(bad_stamp)?) },
            translation: Vector3::new(t.x, t.y, t.z),
            rotation: Quaternion::from_wxyz(r.w / norm, r.x / norm, r.y / norm, r.z / norm),
        })
    }

    /// In the registry's terms.
    pub(super) fn transform(&self) -> Result<Transform<Timestamp>, TransformError> {
        let stamp = self.stamp.map_or(time::Stamp::Static, |stamp| time::Stamp::At(instant(stamp)));
        Transform::new(self.parent, self.child, self.translation, self.rotation, stamp)
    }
}

/// The names of parent and child: there, not endless, and different.
fn names(message: &TransformStamped) -> Result<(&str, &str), FrameError> {
    let (parent, child) = (message.header.frame_id.as_str(), message.child_frame_id.as_str());
    if let Some(name) = [parent, child].into_iter().find(|name| name.len() > MAX_NAME_BYTES) {
        return Err(FrameError::LongName { bytes: name.len(), max: MAX_NAME_BYTES });
    }
    if parent.is_empty() || child.is_empty() {
        return Err(FrameError::EmptyName { parent: parent.into(), child: child.into() });
    }
    if parent == child {
        return Err(FrameError::SelfTransform { frame: parent.into() });
    }
    Ok((parent, child))
}

/// The registry counts time in `u64`; the shift keeps the order and the distances of stamps before 1970.
pub(super) fn instant(stamp: Stamp) -> Timestamp {
    Timestamp::from_nanos(stamp.nanos().wrapping_sub(i64::MIN) as u64)
}

/// The inverse of [`instant`].
pub(super) fn stamp_of(instant: Timestamp) -> Stamp {
    Stamp::from_nanos((instant.as_nanos() as i64).wrapping_add(i64::MIN))
}
