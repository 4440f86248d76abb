//! What a driver would publish while the robot drives: an organised cloud and the robot's pose, 30 times a second.
//!
//! Each step is a function of scene, seed and index alone: the same step gives the same bytes whatever was asked for
//! before, so steps can be made again, left out or made in parallel.

use nalgebra::Isometry3;
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};

use super::kinect::{DepthImage, Kinect};
use super::robot::Robot;
use super::scene::Scene;
use crate::engine::Stamp;
use crate::msg::ros::{
    Header, PointCloud2, PointField, Quaternion, TfMessage, Transform, TransformStamped, Vector3,
};

/// Scans a second of a Kinect.
pub const SCANS_PER_SECOND: u32 = 30;

/// The frame that stays.
pub const FIXED_FRAME: &str = "odom";
/// The robot's own frame.
pub const BASE_FRAME: &str = "base_link";
/// The camera's housing, x forward.
pub const CAMERA_FRAME: &str = "camera_link";
/// The frame of the points, z forward.
pub const OPTICAL_FRAME: &str = "camera_depth_optical_frame";

/// Bytes of a point: x, y, z and four unused, as `depth_image_proc` lays them out.
const POINT_STEP: u32 = 16;

/// A Kinect on a robot in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    scene: Scene,
    kinect: Kinect,
    robot: Robot,
    seed: u64,
    start: Stamp,
}

/// What is published at one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time of both messages.
    pub stamp: Stamp,
    /// 640 x 480 points in [`OPTICAL_FRAME`], NaN where nothing was measured.
    pub cloud: PointCloud2,
    /// `odom` -> `base_link`.
    pub tf: TfMessage,
}

impl Drive {
    /// A drive along the scene's route that begins at `start`; `seed` decides the noise.
    pub fn new(scene: Scene, seed: u64, start: Stamp) -> Self {
        let robot = Robot::new(scene.route());
        Self { scene, kinect: Kinect::v1(), robot, seed, start }
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

    /// `odom` from `camera_depth_optical_frame` at a step.
    pub fn fixed_from_optical(&self, index: u32) -> Isometry3<f64> {
        self.robot.optical_pose(self.seconds(index))
    }

    /// The messages of a step.
    pub fn step(&self, index: u32) -> Step {
        let stamp = self.stamp(index);
        let image = self.kinect.sample(&self.scene, &self.fixed_from_optical(index), &mut self.rng(index));
        let cloud = cloud_message(&self.kinect, &image, header(stamp, OPTICAL_FRAME));
        let base = self.robot.base_pose(self.seconds(index));
        let transforms = vec![transform_message(stamp, FIXED_FRAME, BASE_FRAME, &base)];
        Step { stamp, cloud, tf: TfMessage { transforms } }
    }

    /// `base_link` -> `camera_link` -> `camera_depth_optical_frame`, for `/tf_static`.
    pub fn static_transforms(&self) -> TfMessage {
        let (camera, optical) = (Robot::base_from_camera(), Robot::camera_from_optical());
        TfMessage {
            transforms: vec![
                transform_message(self.start, BASE_FRAME, CAMERA_FRAME, &camera),
                transform_message(self.start, CAMERA_FRAME, OPTICAL_FRAME, &optical),
            ],
        }
    }

    /// Seconds driven at a step: those of its stamp, so that pose and stamp agree to the nanosecond.
    fn seconds(&self, index: u32) -> f64 {
        self.stamp(index).seconds_since(self.start)
    }

    /// A generator of the step's own.
    fn rng(&self, index: u32) -> Xoshiro256PlusPlus {
        // The seed goes through the generator once, so that steps of neighbouring seeds share no stream.
        let mixed = Xoshiro256PlusPlus::seed_from_u64(self.seed).next_u64();
        Xoshiro256PlusPlus::seed_from_u64(mixed ^ u64::from(index))
    }
}

fn header(stamp: Stamp, frame_id: &str) -> Header {
    Header { stamp: stamp.into(), frame_id: frame_id.to_owned() }
}

/// The points of an image as `depth_image_proc` publishes them.
fn cloud_message(kinect: &Kinect, image: &DepthImage, header: Header) -> PointCloud2 {
    let (width, height) = (image.width as u32, image.height as u32);
    let xs: Vec<f32> = (0..image.width).map(|column| kinect.direction_x(column) as f32).collect();
    let mut data = Vec::with_capacity(image.depths.len() * POINT_STEP as usize);
    for (row, depths) in image.depths.chunks_exact(image.width).enumerate() {
        let y = kinect.direction_y(row) as f32;
        for (&x, &z) in xs.iter().zip(depths) {
            let mut point = [0; POINT_STEP as usize];
            point[0..4].copy_from_slice(&(x * z).to_le_bytes());
            point[4..8].copy_from_slice(&(y * z).to_le_bytes());
            point[8..12].copy_from_slice(&z.to_le_bytes());
            data.extend_from_slice(&point);
        }
    }
    let fields = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
    PointCloud2 {
        header,
        height,
        width,
        fields: fields.map(|(name, offset)| PointField::single(name, offset, PointField::FLOAT32)).collect(),
        is_bigendian: false,
        point_step: POINT_STEP,
        row_step: width * POINT_STEP,
        data,
        all_finite: false,
    }
}

fn transform_message(
    stamp: Stamp,
    parent: &str,
    child: &str,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped {
    let (place, turn) = (parent_from_child.translation, parent_from_child.rotation);
    TransformStamped {
        header: header(stamp, parent),
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 { x: place.x, y: place.y, z: place.z },
            rotation: Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w },
        },
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Translation3, UnitQuaternion};

    use super::*;

    const START: Stamp = Stamp::from_nanos(1_700_000_000_000_000_000);

    fn drive(seed: u64) -> Drive {
        Drive::new(Scene::room(), seed, START)
    }

    fn isometry(message: &TransformStamped) -> Isometry3<f64> {
        let Transform { translation, rotation } = message.transform;
        let turn = nalgebra::Quaternion::new(rotation.w, rotation.x, rotation.y, rotation.z);
        assert!((turn.norm() - 1.0).abs() < 1e-12);
        let place = Translation3::new(translation.x, translation.y, translation.z);
        Isometry3::from_parts(place, UnitQuaternion::from_quaternion(turn))
    }

    /// The finite points of a cloud, read as a subscriber would.
    fn points(cloud: &PointCloud2) -> Vec<Point3<f64>> {
        let coordinate = |point: &[u8], field: &PointField| {
            let bytes = point[field.offset as usize..][..4].try_into().unwrap();
            f64::from(f32::from_le_bytes(bytes))
        };
        let points = cloud.data.chunks_exact(cloud.point_step as usize);
        let points = points.map(|point| [0, 1, 2].map(|i| coordinate(point, &cloud.fields[i])).into());
        points.filter(|point: &Point3<f64>| point.iter().all(|c| c.is_finite())).collect()
    }

    #[test]
    fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
        let (first, second) = (drive(5), drive(5));
        first.step(0);
        let (a, b) = (first.step(17), second.step(17));
        assert!(a.cloud.data == b.cloud.data);
        assert_eq!(a.tf, b.tf);
        assert!(a.cloud.data != drive(6).step(17).cloud.data);
        assert!(a.cloud.data != first.step(18).cloud.data);
    }

    #[test]
    fn the_noise_of_neighbouring_steps_is_independent() {
        let drive = drive(5);
        let pose = drive.fixed_from_optical(0);
        let [a, b] = [1, 2].map(|i| drive.kinect.sample(&drive.scene, &pose, &mut drive.rng(i)).depths);
        let equal = a.iter().zip(&b).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
        assert!(equal < a.len() / 2, "{equal} of {} depths are equal", a.len());
    }

    #[test]
    fn the_cloud_is_laid_out_as_depth_image_proc_does_it() {
        let Step { stamp, cloud, .. } = drive(1).step(4);
        assert_eq!(stamp.nanos(), START.nanos() + 133_333_333);
        assert_eq!(cloud.header.stamp.stamp(), Some(stamp));
        assert_eq!(cloud.header.frame_id, "camera_depth_optical_frame");
        assert_eq!((cloud.width, cloud.height, cloud.point_step, cloud.row_step), (640, 480, 16, 10_240));
        assert_eq!(cloud.data.len(), 640 * 480 * 16);
        assert!(!cloud.all_finite && !cloud.is_bigendian);
        let valid = points(&cloud).len();
        assert!(valid > 250_000, "{valid} points in a room");
    }

    #[test]
    fn thirty_steps_are_one_second() {
        assert_eq!(drive(1).stamp(30).nanos() - START.nanos(), 1_000_000_000);
        assert_eq!(drive(1).stamp(0), START);
    }

    #[test]
    fn points_mapped_through_the_transforms_lie_on_the_surfaces_of_the_scene() {
        let drive = drive(3);
        let statics = drive.static_transforms().transforms;
        let base_from_optical = isometry(&statics[0]) * isometry(&statics[1]);
        for index in [0, 300, 900, 1500] {
            let step = drive.step(index);
            let fixed_from_optical = isometry(&step.tf.transforms[0]) * base_from_optical;
            for point in points(&step.cloud).iter().step_by(7) {
                let off = drive.scene().nearest(&(fixed_from_optical * point)).unwrap().1;
                // Noise is along z; a ray may be 1.3 times as long, and 6 sigma is never reached here.
                let sigma = 0.0012 + 0.0019 * (point.z - 0.4).powi(2) + 0.0031 * point.z.powi(2);
                assert!(off < 6.0 * 1.3 * sigma, "step {index}: {point} is {off} m off");
            }
        }
    }

    #[test]
    fn the_frames_form_one_chain_from_odom_to_the_points() {
        let drive = drive(3);
        let mut chain = drive.step(0).tf.transforms;
        chain.extend(drive.static_transforms().transforms);
        let links: Vec<_> =
            chain.iter().map(|t| (t.header.frame_id.as_str(), t.child_frame_id.as_str())).collect();
        let expected = [
            ("odom", "base_link"),
            ("base_link", "camera_link"),
            ("camera_link", "camera_depth_optical_frame"),
        ];
        assert_eq!(links, expected);
        let optical = chain[2].transform.rotation;
        let optical = nalgebra::Vector4::new(optical.x, optical.y, optical.z, optical.w);
        assert!((optical - nalgebra::Vector4::new(-0.5, 0.5, -0.5, 0.5)).norm() < 1e-12);
        let camera = chain[1].transform;
        assert!(camera.rotation.y > 0.0 && (camera.translation.z - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_table_is_seen_at_once() {
        let drive = drive(3);
        let to_fixed = drive.fixed_from_optical(0);
        let points = points(&drive.step(0).cloud);
        let on_table = points
            .iter()
            .filter(|point| drive.scene().nearest(&(to_fixed * **point)).unwrap().0.name() == "table/top");
        assert!(on_table.count() > 2000);
    }
}
