//! Scans and parameters out of any bytes.

use cfodi::engine::{Isometry3, NoiseModel, Params, Points, Scan, Stamp};
use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::bytes::Bytes;

/// Most scans of a stream.
pub const SCANS: usize = 10;

/// Numbers at which something changes; those after the seventh lie beyond every grid.
const ENDS: [f64; 14] =
    [0.0, -0.0, 1e-320, -1e-40, 0.25, -0.25, 1.0, 1e9, -1e9, 1e30, -3e38, 1e200, f64::MAX, -f64::MAX];

/// A generator of the fuzzer's own: jitter, so that no two computations meet a tie.
struct Jitter(u64);

impl Jitter {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

pub fn paper_params(bytes: &mut Bytes<'_>) -> Params {
    Params::paper()
        .with_voxel_size(bytes.within(0.05, 0.25))
        .and_then(|p| p.with_min_points(1 + i64::from(bytes.below(12))))
        .and_then(|p| p.with_depth(1 + i64::from(bytes.below(8))))
        .and_then(|p| p.with_max_normal_angle(bytes.within(0.1, 1.2)))
        .and_then(|p| p.with_min_vicinity(1 + i64::from(bytes.below(4))))
        .and_then(|p| p.with_expansion_interval(i64::from(bytes.below(6))))
        .expect("possible parameters")
}

pub fn consistent_params(bytes: &mut Bytes<'_>) -> Params {
    let noise = bytes.one_of(&[NoiseModel::KinectV1, NoiseModel::None]);
    let clearing = bytes.yes();
    Params::default()
        .with_voxel_size(bytes.one_of(&[0.05, 0.08, 0.25, 1.0]))
        .and_then(|p| p.with_min_points(1 + i64::from(bytes.below(16))))
        .and_then(|p| p.with_max_voxels(bytes.one_of(&[0, 0, 1, 50, 300])))
        .and_then(|p| p.with_keep_radius(bytes.one_of(&[0.0, 0.0, 0.5, 3.0])))
        .and_then(|p| p.with_max_normal_angle(bytes.within(0.0, 1.57)))
        .and_then(|p| p.with_expansion_interval(i64::from(bytes.below(6))))
        .and_then(|p| p.with_pose_sigma(bytes.one_of(&[0.0, 0.0, 0.02, 0.05])))
        .expect("possible parameters")
        .with_noise_model(noise)
        .with_clearing(clearing)
}

/// What kind of points there are beside patches.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Stray {
    /// Beyond the grid, where the naive oracle needs no tie to be decided.
    Beyond,
    /// Anywhere, on borders and at the ends of numbers too.
    Anywhere,
}

/// The next scan, in the fixed frame's terms turned into the sensor's.
pub fn scan(bytes: &mut Bytes<'_>, number: usize, stray: Stray) -> Scan {
    let stamp = number as i64 * 33_333_333 + i64::from(bytes.short()) * 1_000_000;
    let mut jitter = Jitter(u64::from(bytes.byte()) << 8 | 1);
    let pose = pose(bytes, stray);
    let mut points = Vec::new();
    for _ in 0..bytes.below(4) {
        patch(bytes, &mut jitter, &pose, &mut points);
    }
    for _ in 0..bytes.below(12) {
        points.push(stray_point(bytes, stray));
    }
    let points = if bytes.yes() {
        Points::F64(points)
    } else {
        let single = |point: [f64; 3]| point.map(|c| c as f32);
        let finite = |point: &[f32; 3]| point.iter().all(|c| c.is_finite());
        Points::F32(points.into_iter().map(single).filter(finite).collect())
    };
    Scan { stamp: Stamp::from_nanos(stamp), fixed_from_sensor: pose, points }
}

fn pose(bytes: &mut Bytes<'_>, stray: Stray) -> Isometry3<f64> {
    let [x, y, z] = [(); 3].map(|()| bytes.within(-2.0, 2.0));
    let [yaw, pitch] = [(); 2].map(|()| bytes.within(-3.1, 3.1));
    let mut place = Vector3::new(x, y, z);
    if stray == Stray::Anywhere {
        match bytes.below(16) {
            1 => place[usize::from(bytes.below(3))] = bytes.one_of(&ENDS),
            2 => place.fill(f64::NAN),
            _ => {}
        }
    }
    Isometry3::from_parts(place.into(), UnitQuaternion::from_euler_angles(pitch, 0.3 * pitch, yaw))
}

fn patch(bytes: &mut Bytes<'_>, jitter: &mut Jitter, pose: &Isometry3<f64>, points: &mut Vec<[f64; 3]>) {
    let corner = Vector3::from([(); 3].map(|()| bytes.within(-1.0, 1.0)));
    let quarter = f64::from(bytes.below(4)) * std::f64::consts::FRAC_PI_2;
    let turn =
        UnitQuaternion::from_euler_angles(quarter + bytes.within(-0.6, 0.6), bytes.within(-0.6, 0.6), 0.0);
    let sides = [(); 2].map(|()| bytes.within(0.05, 1.2));
    for _ in 0..4 * usize::from(bytes.byte()) {
        let flat = Vector3::new(jitter.next() * sides[0], jitter.next() * sides[1], jitter.next() * 0.02);
        let point = pose.inverse_transform_point(&Point3::from(corner + turn * flat));
        if point.iter().all(|c| c.is_finite()) {
            points.push(point.into());
        }
    }
}

fn stray_point(bytes: &mut Bytes<'_>, stray: Stray) -> [f64; 3] {
    match stray {
        Stray::Beyond => {
            let mut point = [0.0; 3];
            point[usize::from(bytes.below(3))] = bytes.one_of(&ENDS[9..]);
            point
        }
        Stray::Anywhere if bytes.yes() => [(); 3].map(|()| bytes.one_of(&ENDS)),
        Stray::Anywhere => [(); 3].map(|()| f64::from(bytes.short()) * 0.001),
    }
}
