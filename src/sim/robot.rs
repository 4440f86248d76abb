//! The robot that carries the Kinect: a steady drive along a path, and where the camera sits.
//!
//! Frames as REP 105 and REP 103 name them: `odom` is fixed, `base_link` has x forward, y left, z up, and the optical
//! frame x right, y down, z forward.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::path::Path;
use super::scene::Scene;

/// Speed along the path (m/s).
pub const SPEED: f64 = 0.3;
/// Height of the camera above the floor (m).
pub const CAMERA_HEIGHT: f64 = 1.0;
/// How far the camera looks down where the scene does not say otherwise (rad), 15 degrees.
pub const CAMERA_PITCH: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// The infrared camera, left of the middle of a Kinect as seen from the front, y of `camera_link` (m) (`openni_launch`).
const INFRARED_CAMERA_Y: f64 = -0.02;

/// A robot on its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    path: Path,
    camera_pitch: f64,
}

impl Robot {
    /// A robot that follows the scene's route from its first corner.
    pub fn new(scene: &Scene) -> Self {
        Self { path: Path::new(scene.route()), camera_pitch: scene.camera_pitch() }
    }

    /// The way it takes.
    pub const fn path(&self) -> &Path {
        &self.path
    }

    /// `odom` from `base_link`, `seconds` after the start.
    pub fn base_pose(&self, seconds: f64) -> Isometry3<f64> {
        let pose = self.path.pose_at(SPEED * seconds);
        let place = Translation3::new(pose.translation.x, pose.translation.y, 0.0);
        Isometry3::from_parts(
            place,
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.rotation.angle()),
        )
    }

    /// `base_link` from `camera_link`.
    pub fn base_from_camera(&self) -> Isometry3<f64> {
        let pitch = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.camera_pitch);
        Isometry3::from_parts(Translation3::new(0.0, 0.0, CAMERA_HEIGHT), pitch)
    }

    /// `camera_link` from `camera_depth_optical_frame`.
    pub fn camera_from_optical() -> Isometry3<f64> {
        let axes = UnitQuaternion::new_unchecked(Quaternion::new(0.5, -0.5, 0.5, -0.5));
        Isometry3::from_parts(Translation3::new(0.0, INFRARED_CAMERA_Y, 0.0), axes)
    }

    /// `odom` from `camera_depth_optical_frame`, `seconds` after the start.
    pub fn optical_pose(&self, seconds: f64) -> Isometry3<f64> {
        self.base_pose(seconds) * self.base_from_camera() * Self::camera_from_optical()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::sim::Scene;

    #[test]
    fn it_drives_at_its_speed_without_a_jump_of_place_or_heading() {
        let robot = Robot::new(&Scene::room());
        let (step, sharpest) = (1.0 / 30.0, SPEED / 0.6);
        let mut driven = 0.0;
        for i in 0..2400 {
            let (before, after) =
                (robot.base_pose(f64::from(i) * step), robot.base_pose(f64::from(i + 1) * step));
            let moved = (after.translation.vector - before.translation.vector).norm();
            assert!((moved / step - SPEED).abs() < 1e-4, "step {i}: {moved} m");
            assert!(before.rotation.angle_to(&after.rotation) <= sharpest * step + 1e-9, "step {i}");
            driven += moved;
        }
        assert!(driven > robot.path().length(), "the test sees the whole loop");
    }

    #[test]
    fn it_starts_at_the_origin_and_looks_where_it_drives() {
        let robot = Robot::new(&Scene::room());
        assert!(
            (robot.base_pose(0.0).to_homogeneous() - Isometry3::identity().to_homogeneous()).norm() < 1e-12
        );
        for seconds in [0.0, 18.5, 30.0, 50.0] {
            let moved = robot.base_pose(seconds + 0.01).translation.vector
                - robot.base_pose(seconds).translation.vector;
            let ahead = robot.base_pose(seconds) * Vector3::x();
            assert!(ahead.dot(&moved) > 0.999 * moved.norm(), "{seconds} s");
        }
    }

    #[test]
    fn the_optical_axis_points_forward_and_fifteen_degrees_down() {
        let robot = Robot::new(&Scene::room());
        let optical = robot.optical_pose(0.0);
        let (sin, cos) = CAMERA_PITCH.sin_cos();
        assert!((optical * Vector3::z() - Vector3::new(cos, 0.0, -sin)).norm() < 1e-12);
        assert!((optical * Vector3::x() - Vector3::new(0.0, -1.0, 0.0)).norm() < 1e-12);
        assert!((optical.translation.z - 1.0).abs() < 1e-12);
    }

    #[test]
    fn it_keeps_clear_of_everything_at_the_height_of_its_body() {
        for name in Scene::NAMES {
            let scene = Scene::named(name).unwrap();
            let robot = Robot::new(&scene);
            for i in 0..800 {
                let seconds = f64::from(i) * 0.1;
                for height in [0.2, 0.5, 1.0] {
                    let place = robot.base_pose(seconds) * nalgebra::Point3::new(0.0, 0.0, height);
                    let (nearest, distance) = scene.nearest(&place, seconds).unwrap();
                    let clear = distance > 0.3 || (nearest.name() == "floor" && height == 0.2);
                    assert!(clear, "{name}, {seconds} s: {distance} m from {}", nearest.name());
                }
            }
        }
    }
}
