//! A Kinect that measures the building: 640 x 480 depths that scatter as the engine's noise model says, up to 6 m.
//!
//! They are neither rounded nor missing where a surface is met at a grazing angle. The same image has the same noise.

use std::sync::Arc;

use cfodi::engine::{Depths, Isometry3, Points, Rays, Scan, Stamp};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::building::View;

const SIZE: [usize; 2] = [640, 480];
/// Pixels a radian.
const FOCAL: f32 = 525.0;
const NEAREST: f32 = 0.4;
const FARTHEST: f32 = 6.0;
/// Numbers that noise is taken from, one after the other; of a length that an image's is no multiple of.
const SCATTER: usize = 65_521;

pub(crate) struct Camera {
    rays: Arc<Rays>,
    /// With mean 0 and variance 1.
    scatter: Vec<f32>,
    images: usize,
}

impl Camera {
    pub(crate) fn new() -> Self {
        let rays = |size: usize| (0..size).map(|i| (i as f32 - 0.5 * (size as f32 - 1.0)) / FOCAL).collect();
        let [x, y] = SIZE.map(rays);
        let mut state = 1;
        let scatter = (0..SCATTER).map(|_| scatter(&mut state)).collect();
        Self { rays: Arc::new(Rays { x, y }), scatter, images: 0 }
    }

    /// What it measures there, 1/30 s after the image before.
    pub(crate) fn scan(&mut self, view: &View) -> Scan {
        self.images += 1;
        let axes = axes(view);
        let mut noise = self.scatter.iter().cycle().skip(self.images * 7919 % SCATTER);
        let mut depths = Vec::with_capacity(SIZE[0] * SIZE[1]);
        for y in &self.rays.y {
            let row = axes[2] + axes[1] * *y;
            for x in &self.rays.x {
                let depth = view.cast((row + axes[0] * *x).into(), FARTHEST);
                let beyond = depth - 0.4;
                let measured =
                    depth + (0.0012 + 0.0019 * beyond * beyond) * noise.next().copied().unwrap_or(0.0);
                depths.push(if measured >= NEAREST { measured } else { f32::INFINITY });
            }
        }
        Scan {
            stamp: Stamp::from_nanos(self.images as i64 * 33_333_333),
            fixed_from_sensor: pose(view, &axes),
            points: Points::Depths(Depths::new(Arc::clone(&self.rays), depths).unwrap()),
        }
    }
}

/// Its axes: to the right, down and forwards.
fn axes(view: &View) -> [Vector3<f32>; 3] {
    let ((sin, cos), (down, level)) = (view.yaw.sin_cos(), view.pitch.sin_cos());
    let forwards = Vector3::new(level * cos, level * sin, -down);
    let right = Vector3::new(sin, -cos, 0.0);
    [right, forwards.cross(&right), forwards]
}

fn pose(view: &View, axes: &[Vector3<f32>; 3]) -> Isometry3<f64> {
    let turn = Rotation3::from_matrix(&Matrix3::from_columns(&axes.map(Vector3::cast)));
    let place = Vector3::from(view.place()).cast();
    Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_rotation_matrix(&turn))
}

/// The sum of twelve even numbers, nearly normal.
fn scatter(state: &mut u64) -> f32 {
    let even = |state: &mut u64| {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f32 / (1 << 24) as f32
    };
    (0..12).map(|_| even(state)).sum::<f32>() - 6.0
}
