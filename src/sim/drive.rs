//! What a driver would publish while the robot drives: an organised cloud and the robot's pose, 30 times a second.
//!
//! Each step is a function of scene, seed and index alone: the same step gives the same bytes whatever was asked for
//! before, so steps can be made again, left out or made in parallel. A labelled scan of the laboratory takes about 12 ms
//! on one core.

use nalgebra::{Isometry3, Point3};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng, SeedableRng};

use super::kinect::{DepthImage, Kinect};
use super::pose_noise::PoseNoise;
use super::raycast::View;
use super::robot::Robot;
use super::scene::Scene;
use crate::engine::{Points, Scan, Stamp};
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

/// Bytes of a point: x, y and z as `depth_image_proc` lays them out, and the label in the four bytes it leaves unused.
const POINT_STEP: u32 = 16;

/// A Kinect on a robot in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    scene: Scene,
    kinect: Kinect,
    robot: Robot,
    pose_noise: Option<PoseNoise>,
    seed: u64,
    start: Stamp,
}

/// What is published at one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time of both messages.
    pub stamp: Stamp,
    /// 640 x 480 points in [`OPTICAL_FRAME`], NaN where nothing was measured; `label` is that of the true surface, 0
    /// where nothing was measured.
    pub cloud: PointCloud2,
    /// `odom` -> `base_link`.
    pub tf: TfMessage,
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
        Self { scene, kinect: Kinect::v1(), robot, pose_noise: None, seed, start }
    }

    /// The same with another largest depth that is measured (m).
    #[must_use]
    pub fn with_max_range(self, max_range: f64) -> Self {
        Self { kinect: Kinect { max_range, ..self.kinect }, ..self }
    }

    /// The same with poses that are told wrong: by `sigma_m` (m) in each coordinate of the place and `sigma_rad` (rad)
    /// about each axis, as standard deviations; what the Kinect sees stays the same.
    #[must_use]
    pub fn with_pose_noise(self, sigma_m: f64, sigma_rad: f64) -> Self {
        let mut rng = generator(self.seed, POSE_STREAM);
        let pose_noise = Some(PoseNoise::new(sigma_m, sigma_rad, rng.next_u64()));
        Self { pose_noise, ..self }
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
        self.pose_noise.as_ref().map_or(pose, |noise| pose * noise.error(seconds, &mut rng))
    }

    /// The messages of a step.
    pub fn step(&self, index: u32) -> Step {
        let stamp = self.stamp(index);
        let image = self.image(index);
        let cloud = cloud_message(&self.kinect, &image, header(stamp, OPTICAL_FRAME));
        let base = self.told_base_pose(index);
        let transforms = vec![transform_message(stamp, FIXED_FRAME, BASE_FRAME, &base)];
        Step { stamp, cloud, tf: TfMessage { transforms } }
    }

    /// The same measurements without encoding: the valid points, each with the surface it lies on.
    pub fn labelled_scan(&self, index: u32) -> LabelledScan {
        let image = self.image(index);
        let xs: Vec<f32> = (0..image.width).map(|column| self.kinect.direction_x(column) as f32).collect();
        let mut points = Vec::with_capacity(image.depths.len());
        let mut labels = Vec::with_capacity(image.depths.len());
        let rows = image.depths.chunks_exact(image.width).zip(image.labels.chunks_exact(image.width));
        for (row, (depths, row_labels)) in rows.enumerate() {
            let y = self.kinect.direction_y(row) as f32;
            for ((&x, &z), &label) in xs.iter().zip(depths).zip(row_labels) {
                if !z.is_nan() {
                    points.push([x * z, y * z, z]);
                    labels.push(label);
                }
            }
        }
        let (stamp, fixed_from_sensor) = (self.stamp(index), self.fixed_from_optical(index));
        LabelledScan { scan: Scan { stamp, fixed_from_sensor, points: Points::F32(points) }, labels }
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

    /// `base_link` -> `camera_link` -> `camera_depth_optical_frame`, for `/tf_static`.
    pub fn static_transforms(&self) -> TfMessage {
        let (camera, optical) = (self.robot.base_from_camera(), Robot::camera_from_optical());
        TfMessage {
            transforms: vec![
                transform_message(self.start, BASE_FRAME, CAMERA_FRAME, &camera),
                transform_message(self.start, CAMERA_FRAME, OPTICAL_FRAME, &optical),
            ],
        }
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

fn header(stamp: Stamp, frame_id: &str) -> Header {
    Header { stamp: stamp.into(), frame_id: frame_id.to_owned() }
}

/// The points of an image as `depth_image_proc` publishes them.
fn cloud_message(kinect: &Kinect, image: &DepthImage, header: Header) -> PointCloud2 {
    let (width, height) = (image.width as u32, image.height as u32);
    let xs: Vec<f32> = (0..image.width).map(|column| kinect.direction_x(column) as f32).collect();
    let mut data = Vec::with_capacity(image.depths.len() * POINT_STEP as usize);
    let rows = image.depths.chunks_exact(image.width).zip(image.labels.chunks_exact(image.width));
    for (row, (depths, labels)) in rows.enumerate() {
        let y = kinect.direction_y(row) as f32;
        for ((&x, &z), label) in xs.iter().zip(depths).zip(labels) {
            let mut point = [0; POINT_STEP as usize];
            point[0..4].copy_from_slice(&(x * z).to_le_bytes());
            point[4..8].copy_from_slice(&(y * z).to_le_bytes());
            point[8..12].copy_from_slice(&z.to_le_bytes());
            point[12..16].copy_from_slice(&label.to_le_bytes());
            data.extend_from_slice(&point);
        }
    }
    let fields = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
    let fields = fields.map(|(name, offset)| PointField::single(name, offset, PointField::FLOAT32));
    let label = PointField::single("label", 12, PointField::UINT32);
    PointCloud2 {
        header,
        height,
        width,
        fields: fields.chain([label]).collect(),
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
    use nalgebra::{Translation3, UnitQuaternion};

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
        let [a, b] = [1, 2].map(|i| drive.kinect.sample(&drive.scene, &pose, 0.0, &mut drive.rng(i)).depths);
        let both: Vec<_> = a.iter().zip(&b).filter(|(a, b)| !a.is_nan() && !b.is_nan()).collect();
        let equal = both.iter().filter(|(a, b)| a == b).count();
        // Two draws often are rounded to the same disparity: a step is up to twice as large as their scatter.
        assert!(equal * 3 < both.len() * 2, "{equal} of {} depths are equal", both.len());
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
        assert!(
            (200_000..300_000).contains(&valid),
            "{valid} points in a room, the paper has 200,000 to 300,000"
        );
        let label = &cloud.fields[3];
        assert_eq!((label.name.as_str(), label.offset, label.datatype), ("label", 12, PointField::UINT32));
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
                let off = drive.scene().nearest(&(fixed_from_optical * point), 0.0).unwrap().1;
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
    fn the_table_is_seen_on_the_way() {
        let drive = drive(3);
        let to_fixed = drive.fixed_from_optical(90);
        let points = points(&drive.step(90).cloud);
        let on_table = points.iter().filter(|point| {
            drive.scene().nearest(&(to_fixed * **point), 0.0).unwrap().0.name() == "table/top"
        });
        let on_table = on_table.count();
        assert!(on_table > 500, "{on_table} points");
    }

    #[test]
    fn a_labelled_scan_holds_the_points_of_the_message_on_the_surfaces_of_its_labels() {
        for name in Scene::NAMES {
            let drive = Drive::new(Scene::named(name).unwrap(), 3, START);
            let LabelledScan { scan, labels } = drive.labelled_scan(40);
            let Points::F32(measured) = &scan.points else { panic!("single precision") };
            let told = points(&drive.step(40).cloud);
            assert_eq!((measured.len(), labels.len()), (told.len(), told.len()));
            for ((measured, told), &label) in measured.iter().zip(told).zip(&labels).step_by(13) {
                let measured: Point3<f64> = measured.map(f64::from).into();
                assert_eq!(measured, told);
                assert_ne!(label, 0);
                let surface = drive.scene().surface(label).unwrap();
                let off = surface.distance(&(scan.fixed_from_sensor * measured), drive.seconds(40)).unwrap();
                assert!(
                    off < 0.012 * measured.z * measured.z + 0.01,
                    "{name}: {off} m off {}",
                    surface.name()
                );
            }
        }
    }

    #[test]
    fn the_labels_of_a_message_are_those_of_the_scan_and_0_where_nothing_was_measured() {
        let drive = Drive::new(Scene::named("lab").unwrap(), 3, START);
        let cloud = drive.step(40).cloud;
        let mut labels = Vec::new();
        for point in cloud.data.chunks_exact(16) {
            let label = u32::from_le_bytes(point[12..].try_into().unwrap());
            let is_measured = !f32::from_le_bytes(point[8..12].try_into().unwrap()).is_nan();
            assert_eq!(label != 0, is_measured);
            labels.extend(is_measured.then_some(label));
        }
        assert_eq!(labels, drive.labelled_scan(40).labels);
    }

    #[test]
    fn noise_of_the_pose_changes_what_is_told_and_not_what_is_measured() {
        let (exact, noisy) = (drive(3), drive(3).with_pose_noise(0.03, 0.01));
        let (told, wrong) = (exact.step(700), noisy.step(700));
        assert!(told.cloud.data == wrong.cloud.data);
        assert_ne!(told.tf, wrong.tf);
        assert_eq!(noisy.true_fixed_from_optical(700), exact.fixed_from_optical(700));
        let off = exact.fixed_from_optical(700).inverse() * noisy.fixed_from_optical(700);
        assert!(off.translation.vector.norm() < 0.2 && off.rotation.angle() < 0.06, "{off}");
        assert_eq!(noisy.labelled_scan(700).scan.fixed_from_sensor, noisy.fixed_from_optical(700));
        assert!(wrong.tf == drive(3).with_pose_noise(0.03, 0.01).step(700).tf, "the same again");
    }
}
