//! How a simulated thing moves: its pose as a function of time alone, so that any moment can be asked for.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::path::Path;

/// A way to move; maps the thing from where it rests into the fixed frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Motion {
    /// Goes round a closed way; the thing rests at the origin, looking along +x.
    Walk {
        /// The way over the floor.
        path: Path,
        /// Along the way (m/s).
        speed: f64,
    },
    /// Opens and closes about an upright axis, from rest to `angle` and back.
    Swing {
        /// A point of the axis (m).
        hinge: [f64; 2],
        /// Where it turns back (rad), counter-clockwise seen from above.
        angle: f64,
        /// From rest to rest (s).
        period: f64,
    },
    /// Stands still until it is taken away.
    TakenAway {
        /// When it is there no more (s).
        at: f64,
    },
}

impl Motion {
    /// Fixed frame from rest, `seconds` after the start; `None` when the thing is not there.
    pub fn pose(&self, seconds: f64) -> Option<Isometry3<f64>> {
        match self {
            Self::Walk { path, speed } => {
                let pose = path.pose_at(speed * seconds);
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.rotation.angle());
                let place = Translation3::new(pose.translation.x, pose.translation.y, 0.0);
                Some(Isometry3::from_parts(place, turn))
            }
            Self::Swing { hinge: [x, y], angle, period } => {
                let opened = 0.5 * angle * (1.0 - (TAU * seconds / period).cos());
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), opened);
                let hinge = Translation3::new(*x, *y, 0.0);
                Some(hinge * turn * hinge.inverse())
            }
            Self::TakenAway { at } => (seconds < *at).then(Isometry3::identity),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;

    #[test]
    fn a_door_rests_opens_and_closes_again_about_its_hinge() {
        let door = Motion::Swing { hinge: [2.0, 1.0], angle: 1.2, period: 10.0 };
        let handle = Point3::new(2.9, 1.0, 1.0);
        for (seconds, angle) in [(0.0, 0.0_f64), (5.0, 1.2), (2.5, 0.6), (10.0, 0.0)] {
            let expected = Point3::new(2.0 + 0.9 * angle.cos(), 1.0 + 0.9 * angle.sin(), 1.0);
            assert!((door.pose(seconds).unwrap() * handle - expected).norm() < 1e-12, "{seconds} s");
        }
    }

    #[test]
    fn a_thing_taken_away_is_there_before_and_not_after() {
        let thing = Motion::TakenAway { at: 3.0 };
        assert_eq!(thing.pose(2.99), Some(Isometry3::identity()));
        assert_eq!(thing.pose(3.0), None);
    }
}
