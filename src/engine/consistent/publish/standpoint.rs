//! Where the sensor stands, and since when. While it stands still it sees nothing from elsewhere, only more noise.
//!
//! Two sensors that take turns at one map never count as standing still.

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};

use crate::engine::saved::{RestoreError, ensure};

/// Turn from which on the sensor no longer stands still (rad).
const TURN: f64 = 0.01;
/// Way from which on the sensor no longer stands still, in voxels.
const WAY: f64 = 0.5;

/// A pose that the sensor has not left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Standpoint {
    pose: Isometry3<f64>,
    /// The scan that it was taken up in; 0 = none was.
    since: u64,
}

impl Standpoint {
    pub(crate) fn new() -> Self {
        Self { pose: Isometry3::identity(), since: 0 }
    }

    /// Whether it can be that of a map after the scan `sequence`.
    pub(crate) fn check(&self, sequence: u64) -> Result<(), RestoreError> {
        let Self { pose, since } = *self;
        let possible = pose.translation.vector.iter().all(|c| c.is_finite())
            && (pose.rotation.quaternion().norm() - 1.0).abs() < 1e-6
            && since <= sequence;
        ensure(possible, || format!("the sensor stands at {pose} since scan {since} of {sequence}"))
    }

    /// Where the sensor stands (m).
    pub(crate) fn origin(&self) -> Point3<f64> {
        self.pose.translation.vector.into()
    }

    pub(crate) const fn since(&self) -> u64 {
        self.since
    }

    /// Takes up a new one where the sensor has moved by half a voxel or turned by 0.01 rad from this; none from a pose that is nowhere.
    pub(crate) fn follow(&mut self, fixed_from_sensor: &Isometry3<f64>, voxel_size: f64, sequence: u64) {
        let moved = self.pose.inv_mul(fixed_from_sensor);
        let (way, turn) = (moved.translation.vector.norm(), moved.rotation.angle());
        let is_left = self.since == 0 || way > WAY * voxel_size || turn > TURN;
        if is_left && way.is_finite() && turn.is_finite() {
            (self.pose, self.since) = (*fixed_from_sensor, sequence);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn what_creeps_is_left_in_the_end_and_what_trembles_is_not() {
        let mut standpoint = Standpoint::new();
        let mut follow = |x: f64, turn: f64, sequence: u64| {
            standpoint.follow(&Isometry3::new(Vector3::x() * x, Vector3::z() * turn), 0.1, sequence);
            standpoint.since()
        };
        assert_eq!(follow(7.0, 0.0, 1), 1, "the first is new");
        assert_eq!([follow(7.03, 0.005, 2), follow(6.97, -0.005, 3), follow(7.04, 0.009, 4)], [1; 3]);
        assert_eq!(follow(7.06, 0.0, 5), 5, "6 cm from the first");
        assert_eq!(follow(7.06, 0.011, 6), 6, "turned");
    }
}
