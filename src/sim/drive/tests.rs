//! What is sent against what there is, and one step against another.

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::msg::ros::{PointCloud2, PointField, Transform, TransformStamped};

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
fn scans_come_as_often_as_was_asked_for_or_not_at_all() {
    let rates = [1, 2, 3, 5, 6, 10, 15, 30];
    assert_eq!(rates.map(steps_apart), [30, 15, 10, 6, 5, 3, 2, 1].map(Some));
    assert_eq!([0, 4, 20, 29, 31, 60, 100, u32::MAX].map(steps_apart), [None; 8]);
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
    let expected =
        [("odom", "base_link"), ("base_link", "camera_link"), ("camera_link", "camera_depth_optical_frame")];
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
    let on_table = points
        .iter()
        .filter(|point| drive.scene().nearest(&(to_fixed * **point), 0.0).unwrap().0.name() == "table/top");
    let on_table = on_table.count();
    assert!(on_table > 500, "{on_table} points");
}

/// As points they are those that another drive measures up to there; what lies beyond is told as the end of a ray.
#[test]
fn labelled_depths_are_the_points_up_to_a_range_and_where_farther_rays_end() {
    let drive = Drive::new(Scene::named("lab").unwrap(), 3, Stamp::from_nanos(0));
    let near = drive.clone().with_max_range(1.5);
    for index in [0, 700] {
        let LabelledScan { scan, labels } = drive.labelled_depths(index, 1.5);
        let expected = near.labelled_scan(index);
        let Points::Depths(depths) = &scan.points else { panic!("{index}") };
        assert_eq!(Points::F32(depths.list()), expected.scan.points);
        assert_eq!((labels.len(), labels), (depths.len(), expected.labels));
        let all = drive.labelled_scan(index).scan.points.len();
        let ends = depths.ends();
        assert!(ends.len() == all - depths.len() && !ends.is_empty(), "{index}: {} of {all}", ends.len());
        assert!(ends.iter().all(|[_, _, z]| *z > 1.5), "{index}");
    }
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
            assert!(off < 0.012 * measured.z * measured.z + 0.01, "{name}: {off} m off {}", surface.name());
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

const NOISE: PoseNoise = PoseNoise { metres: 0.03, radians: 0.01 };

#[test]
fn noise_of_the_pose_changes_what_is_told_and_not_what_is_measured() {
    let (exact, noisy) = (drive(3), drive(3).with_pose_noise(NOISE));
    let (told, wrong) = (exact.step(700), noisy.step(700));
    assert!(told.cloud.data == wrong.cloud.data);
    assert_ne!(told.tf, wrong.tf);
    assert_eq!(noisy.true_fixed_from_optical(700), exact.fixed_from_optical(700));
    let off = exact.fixed_from_optical(700).inverse() * noisy.fixed_from_optical(700);
    assert!(off.translation.vector.norm() < 0.2 && off.rotation.angle() < 0.06, "{off}");
    assert_eq!(noisy.labelled_scan(700).scan.fixed_from_sensor, noisy.fixed_from_optical(700));
    let depths = noisy.labelled_depths(700, 6.0).scan;
    assert_eq!(depths.fixed_from_sensor, noisy.fixed_from_optical(700));
    assert_eq!(depths.points, exact.labelled_depths(700, 6.0).scan.points);
    assert!(wrong.tf == drive(3).with_pose_noise(NOISE).step(700).tf, "the same again");
}

#[test]
fn wrong_poses_put_a_point_off_by_the_spread_across_the_line_from_the_base_and_by_less_along_it() {
    assert_eq!(drive(3).pose_spread(), None);
    let spread = drive(3).with_pose_noise(NOISE).pose_spread().unwrap();
    let base_from_optical = Robot::new(&Scene::room()).base_from_camera() * Robot::camera_from_optical();
    let point = Point3::new(0.7, -0.3, 4.0);
    let line = base_from_optical * point;
    let across = line.coords.cross(&Vector3::z()).normalize();
    // The waves of one seed have the same periods in all coordinates, so the mean squares are taken over seeds.
    let (seeds, mut means) = (4000_u32, [0.0; 2]);
    for seed in 0..seeds {
        let noisy = drive(u64::from(seed)).with_pose_noise(NOISE);
        let base_pose = noisy.true_fixed_from_optical(70) * base_from_optical.inverse();
        let off = base_pose.inverse() * (noisy.fixed_from_optical(70) * point) - line;
        for (mean, direction) in means.iter_mut().zip([across, line.coords.normalize()]) {
            *mean += off.dot(&direction).powi(2) / f64::from(seeds);
        }
    }
    let ratios = [means[0] / spread.variance(&point), means[1] / NOISE.metres.powi(2)];
    assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.08), "{ratios:?}");
}
