//! What a driver would publish while the robot drives: an organised cloud and the robot's pose, 30 times a second.
//!
//! Each step is a function of scene, seed and index alone: the same step gives the same bytes whatever was asked for
//! before, so steps can be made again, left out or made in parallel. A labelled scan of the laboratory takes about 12 ms
//! on one core.

mod messages;

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};

pub use self::messages::{BASE_FRAME, CAMERA_FRAME, FIXED_FRAME, OPTICAL_FRAME, Step};
use super::kinect::{DepthImage, Kinect};
use super::pose_noise::{PoseErrors, PoseNoise, PoseSpread};
use super::raycast::View;
use super::robot::Robot;
use super::scene::Scene;
use crate::engine::{Depths, Points, Scan, Stamp};

/// Scans a second of a Kinect.
pub const SCANS_PER_SECOND: u32 = 30;

/// By how many steps of a drive scans lie apart of which `in_a_second` come each second; `None` where steps do not give that: it
/// must divide [`SCANS_PER_SECOND`].
pub const fn steps_apart(in_a_second: u32) -> Option<u32> {
    match SCANS_PER_SECOND.checked_rem(in_a_second) {
        Some(0) => Some(SCANS_PER_SECOND / in_a_second),
        _ => None,
    }
}

/// A Kinect on a robot in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    scene: Scene,
    kinect: Kinect,
    robot: Robot,
    pose_errors: Option<PoseErrors>,
    seed: u64,
    start: Stamp,
}

/// A scan as the engine takes it, with its truth.
#[derive(Clone, Debug)]
pub struct LabelledScan {
    /// The valid points, in the optical frame.
    pub scan: Scan,
    /// Label of the surface that each point was measured on, in the order of the points.
    pub labels: Vec<u32>,
}

impl Drive {
    /// A drive along the scene's route that begins at `start`; `seed` decides the noise.
    pub fn new(scene: Scene, seed: u64, start: Stamp) -> Self {
        let robot = Robot::new(&scene);
        Self { scene, kinect: Kinect::v1(), robot, pose_errors: None, seed, start }
    }

    /// Sets the largest depth that is measured (m).
    #[must_use]
    pub fn with_max_range(self, max_range: f64) -> Self {
        Self { kinect: Kinect { max_range, ..self.kinect }, ..self }
    }

    /// Has poses told wrong by so much; what the Kinect sees stays the same.
    #[must_use]
    pub fn with_pose_noise(self, noise: PoseNoise) -> Self {
        let mut rng = generator(self.seed, POSE_STREAM);
        let pose_errors = Some(PoseErrors::new(noise, rng.next_u64()));
        Self { pose_errors, ..self }
    }

    /// How far the poses told put points from where they are; `None` where these are exact.
    pub fn pose_spread(&self) -> Option<PoseSpread> {
        let base_from_optical = self.robot.base_from_camera() * Robot::camera_from_optical();
        let base = base_from_optical.inverse() * Point3::origin();
        self.pose_errors.as_ref().map(|errors| PoseSpread::new(errors.noise, base))
    }

    /// The camera.
    pub const fn kinect(&self) -> &Kinect {
        &self.kinect
    }

    /// What there is to be seen.
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Time of a step: `start` + `index` / 30 s, the fraction of a nanosecond dropped.
    pub fn stamp(&self, index: u32) -> Stamp {
        let since_start = i64::from(index) * 1_000_000_000 / i64::from(SCANS_PER_SECOND);
        Stamp::from_nanos(self.start.nanos().saturating_add(since_start))
    }

    /// `odom` from `camera_depth_optical_frame` at a step, as the transforms tell it.
    pub fn fixed_from_optical(&self, index: u32) -> Isometry3<f64> {
        self.told_base_pose(index) * self.robot.base_from_camera() * Robot::camera_from_optical()
    }

    /// Where the Kinect really is at a step.
    pub fn true_fixed_from_optical(&self, index: u32) -> Isometry3<f64> {
        self.robot.optical_pose(self.seconds(index))
    }

    /// `odom` from `base_link` at a step, as the transforms tell it.
    fn told_base_pose(&self, index: u32) -> Isometry3<f64> {
        let seconds = self.seconds(index);
        let pose = self.robot.base_pose(seconds);
        // Another stream than that of the Kinect's noise.
        let mut rng = generator(self.seed, POSE_STREAM ^ u64::from(index));
        self.pose_errors.as_ref().map_or(pose, |errors| pose * errors.error(seconds, &mut rng))
    }

    /// The measurements of a step without encoding: the valid points, each with the surface it lies on.
    pub fn labelled_scan(&self, index: u32) -> LabelledScan {
        let image = self.image(index);
        let pixels = image.depths.len();
        let mut measured = (Vec::with_capacity(pixels), Vec::with_capacity(pixels));
        measured.extend(self.kinect.points(&image).filter(|([_, _, z], _)| !z.is_nan()));
        let (points, labels) = measured;
        let (stamp, fixed_from_sensor) = (self.stamp(index), self.fixed_from_optical(index));
        LabelledScan { scan: Scan { stamp, fixed_from_sensor, points: Points::F32(points) }, labels }
    }

    /// The same as the depths of the camera's pixels, which are what its driver sends. Depths beyond `max_range` (m) are no points:
    /// they tell that up to there is nothing.
    pub fn labelled_depths(&self, index: u32, max_range: f64) -> LabelledScan {
        let DepthImage { depths, mut labels, .. } = self.image(index);
        let is_far = |depth: f32| f64::from(depth) > max_range;
        let mut measured = depths.iter();
        labels.retain(|_| measured.next().is_some_and(|&depth| !depth.is_nan() && !is_far(depth)));
        let depths = Depths::by_pixel(Arc::new(self.kinect.rays()), |pixel| match depths[pixel] {
            none if none.is_nan() => f32::INFINITY,
            far if is_far(far) => -far,
            near => near,
        });
        let (stamp, fixed_from_sensor) = (self.stamp(index), self.fixed_from_optical(index));
        LabelledScan { scan: Scan { stamp, fixed_from_sensor, points: Points::Depths(depths) }, labels }
    }

    /// What rays without noise meet at a step, within the Kinect's range: label and point in the fixed frame.
    ///
    /// One ray for every `stride`-th pixel of every `stride`-th row; `stride` is 1 or more.
    pub fn true_hits(&self, index: u32, stride: usize) -> impl Iterator<Item = (u32, Point3<f64>)> + use<> {
        let camera = self.kinect.every_nth_pixel(stride);
        let pose = self.true_fixed_from_optical(index);
        let View { inverse_depths, labels, .. } = View::new(&self.scene, &camera, &pose, self.seconds(index));
        let pixels = inverse_depths.into_iter().zip(labels).enumerate();
        pixels.filter_map(move |(pixel, (w, label))| {
            let (row, column) = (pixel / camera.width, pixel % camera.width);
            let depth = 1.0 / w;
            let seen = w > 0.0 && (camera.min_range..=camera.max_range).contains(&depth);
            let ray = Point3::new(camera.direction_x(column), camera.direction_y(row), 1.0);
            seen.then(|| (label, pose * (ray * depth)))
        })
    }

    /// What the Kinect measures at a step.
    fn image(&self, index: u32) -> DepthImage {
        let pose = self.true_fixed_from_optical(index);
        self.kinect.sample(&self.scene, &pose, self.seconds(index), &mut self.rng(index))
    }

    /// Seconds driven at a step: those of its stamp, so that pose and stamp agree to the nanosecond.
    pub fn seconds(&self, index: u32) -> f64 {
        self.stamp(index).seconds_since(self.start)
    }

    /// A generator of the step's own.
    fn rng(&self, index: u32) -> Xoshiro256PlusPlus {
        generator(self.seed, u64::from(index))
    }
}

/// Apart from all indices of steps.
const POSE_STREAM: u64 = 1 << 32;

/// One of the generators that belong to a seed.
fn generator(seed: u64, stream: u64) -> Xoshiro256PlusPlus {
    // The seed goes through the generator once, so that steps of neighbouring seeds share no stream.
    let mixed = Xoshiro256PlusPlus::seed_from_u64(seed).next_u64();
    Xoshiro256PlusPlus::seed_from_u64(mixed ^ stream)
}

#[cfg(test)]
mod tests;
