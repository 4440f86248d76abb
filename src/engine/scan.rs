//! What one sensor message contributes: its valid points, in the sensor's frame, and where the sensor stood.

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};

use super::points::Points;

/// Time of acquisition: nanoseconds since the Unix epoch, taken from a message header and never from a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Stamp(i64);

impl Stamp {
    /// From nanoseconds since the Unix epoch.
    pub const fn from_nanos(nanos: i64) -> Self {
        Self(nanos)
    }

    /// Nanoseconds since the Unix epoch.
    pub const fn nanos(self) -> i64 {
        self.0
    }

    /// Seconds from `earlier` to `self`; negative when `self` is the earlier one.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 * 1e-9
    }

    /// By how many seconds it lies before the newest stamp of the same clock, where that is more than [`JUMP_BACK`].
    pub fn jump_back_from(self, newest: Self) -> Option<f64> {
        Some(newest.seconds_since(self)).filter(|back| *back > JUMP_BACK)
    }
}

/// A stamp that lies further back than this is of a clock that jumped, and not of a late message (s).
pub const JUMP_BACK: f64 = 1.0;

/// All valid points of one sensor message and the sensor's pose in the fixed frame.
///
/// Points are kept in the sensor's frame; the grid maps each into the fixed frame in `f64` as it bins it.
#[derive(Clone, Debug)]
pub struct Scan {
    /// Acquisition time of the message.
    pub stamp: Stamp,
    /// Maps sensor coordinates into the fixed frame. With one that is not finite all points count as beyond the grid.
    pub fixed_from_sensor: Isometry3<f64>,
    /// The valid points, sensor frame (m); finite.
    pub points: Points,
}

impl Scan {
    /// Whether its pose is finite: it lies somewhere.
    pub(crate) fn is_placed(&self) -> bool {
        let Isometry3 { rotation, translation } = &self.fixed_from_sensor;
        rotation.coords.iter().chain(translation.vector.iter()).all(|along| along.is_finite())
    }

    /// Where the sensor stood: the origin of its frame, in the fixed frame (m).
    pub fn sensor_origin(&self) -> Point3<f64> {
        Point3::from(self.fixed_from_sensor.translation.vector)
    }
}
