//! The first Kinect: a pinhole depth camera whose measurements scatter and come in steps.
//!
//! `noise.rs` says by how much, and where nothing is measured: out of range, in the shadow of the projector, and
//! ever more often at grazing angles.

use nalgebra::{Isometry3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use super::noise::{
    BASELINE, SAFE_COSINE, clear_shadows, dropout_probability, scatter_sigma, to_whole_disparity,
};
use super::raycast::View;
use super::scene::Scene;
use crate::engine::Rays;

/// Intrinsics and range of a depth camera without distortion.
#[derive(Clone, Debug, PartialEq)]
pub struct Kinect {
    /// Columns (px).
    pub width: usize,
    /// Rows (px).
    pub height: usize,
    /// Focal length along a row (px).
    pub fx: f64,
    /// Focal length along a column (px).
    pub fy: f64,
    /// Column of the optical axis (px); pixel centres are at whole numbers.
    pub cx: f64,
    /// Row of the optical axis (px).
    pub cy: f64,
    /// Smallest depth that is measured (m).
    pub min_range: f64,
    /// Largest depth that is measured (m).
    pub max_range: f64,
}

/// Depths of one image, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depth along the optical axis (m); NaN where nothing was measured.
    pub depths: Vec<f32>,
    /// Label of the surface that was measured; 0 where nothing was.
    pub labels: Vec<u32>,
}

impl Kinect {
    /// The Kinect of 2010, with the intrinsics its drivers take by default.
    pub const fn v1() -> Self {
        let (width, height) = (640, 480);
        Self { width, height, fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, min_range: 0.4, max_range: 8.0 }
    }

    /// The camera whose pixels are every `stride`-th one of this camera, from the first on.
    pub(super) fn every_nth_pixel(&self, stride: usize) -> Self {
        let (width, height) = (self.width.div_ceil(stride), self.height.div_ceil(stride));
        let [fx, fy, cx, cy] = [self.fx, self.fy, self.cx, self.cy].map(|length| length / stride as f64);
        Self { width, height, fx, fy, cx, cy, ..self.clone() }
    }

    /// Number of pixels.
    pub const fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// x of a pixel's ray where z = 1.
    pub fn direction_x(&self, column: usize) -> f64 {
        (column as f64 - self.cx) / self.fx
    }

    /// y of a pixel's ray where z = 1.
    pub fn direction_y(&self, row: usize) -> f64 {
        (row as f64 - self.cy) / self.fy
    }

    /// What the Kinect measures at a pose in the scene, `seconds` after the start.
    pub fn sample(
        &self,
        scene: &Scene,
        fixed_from_optical: &Isometry3<f64>,
        seconds: f64,
        rng: &mut impl Rng,
    ) -> DepthImage {
        let mut view = View::new(scene, self, fixed_from_optical, seconds);
        view.inverse_depths
            .chunks_exact_mut(self.width)
            .for_each(|row| clear_shadows(row, self.fx * BASELINE));
        let mut depths = Vec::with_capacity(self.pixels());
        for row in 0..self.height {
            let y = self.direction_y(row);
            for column in 0..self.width {
                let ray = Vector3::new(self.direction_x(column), y, 1.0);
                depths.push(self.pixel(&view, row * self.width + column, &ray, rng));
            }
        }
        let mut labels = view.labels;
        let unmeasured = labels.iter_mut().zip(&depths).filter(|(_, depth)| depth.is_nan());
        unmeasured.for_each(|(label, _)| *label = 0);
        DepthImage { width: self.width, height: self.height, depths, labels }
    }

    /// The pixels of an image of this camera, row by row: the point (m, optical frame), NaN where nothing was measured, and
    /// the label of its surface.
    pub fn points(&self, image: &DepthImage) -> impl Iterator<Item = ([f32; 3], u32)> {
        let rows = image.depths.chunks_exact(image.width).zip(image.labels.chunks_exact(image.width));
        rows.enumerate().flat_map(move |(row, (depths, labels))| {
            let y = self.direction_y(row) as f32;
            let pixels = depths.iter().zip(labels).enumerate();
            pixels.map(move |(column, (&z, &label))| {
                let x = self.direction_x(column) as f32;
                ([x * z, y * z, z], label)
            })
        })
    }

    /// Where its pixels look.
    pub fn rays(&self) -> Rays {
        Rays {
            x: (0..self.width).map(|column| self.direction_x(column) as f32).collect(),
            y: (0..self.height).map(|row| self.direction_y(row) as f32).collect(),
        }
    }

    /// What is measured in a pixel.
    fn pixel(&self, view: &View, pixel: usize, ray: &Vector3<f64>, rng: &mut impl Rng) -> f32 {
        let w = view.inverse_depths[pixel];
        if w <= 0.0 {
            return f32::NAN;
        }
        let grazing = view.cosine_below(SAFE_COSINE, pixel, ray);
        if grazing.is_some_and(|cosine| rng.random::<f64>() < dropout_probability(cosine)) {
            return f32::NAN;
        }
        self.measure(1.0 / w, rng)
    }

    /// One measurement of a true depth; NaN where the measured depth is out of range.
    fn measure(&self, depth: f64, rng: &mut impl Rng) -> f32 {
        let scatter: f64 = StandardNormal.sample(rng);
        let measured = to_whole_disparity(depth + scatter_sigma(depth) * scatter);
        if (self.min_range..=self.max_range).contains(&measured) { measured as f32 } else { f32::NAN }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::UnitQuaternion;
    use rand::SeedableRng;
    use rand::rngs::Xoshiro256PlusPlus;

    use super::*;
    use crate::sim::noise::axial_sigma;

    /// Optical frame at (x, y, 1.0), looking along +x of the room.
    fn looking_east(x: f64, y: f64) -> Isometry3<f64> {
        let axes = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
        Isometry3::from_parts(Vector3::new(x, y, 1.0).into(), axes)
    }

    fn wall_at(depth: f64) -> DepthImage {
        // From y = 2.4 only the east wall, at x = 6.5, is in the middle of the image.
        let pose = looking_east(6.5 - depth, 2.4);
        Kinect::v1().sample(&Scene::room(), &pose, 0.0, &mut Xoshiro256PlusPlus::seed_from_u64(1))
    }

    /// Depths of the middle of the image.
    fn middle(image: &DepthImage) -> Vec<f64> {
        let rows = image.depths.chunks_exact(image.width).skip(190).take(100);
        rows.flat_map(|row| &row[300..400]).map(|&z| f64::from(z)).collect()
    }

    fn mean_and_deviation(depths: &[f64]) -> (f64, f64) {
        let mean = depths.iter().sum::<f64>() / depths.len() as f64;
        let variance = depths.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / depths.len() as f64;
        (mean, variance.sqrt())
    }

    #[test]
    fn the_middle_of_the_image_measures_the_depth_of_the_wall() {
        for depth in [1.0, 2.0, 4.0] {
            let (mean, _) = mean_and_deviation(&middle(&wall_at(depth)));
            assert!((mean - depth).abs() < 0.001 * depth * depth, "{mean} m for {depth} m");
        }
    }

    #[test]
    fn scatter_and_rounding_together_are_nguyen_s_sigma() {
        for depth in [1.0, 2.0, 4.0, 6.0] {
            let (_, deviation) = mean_and_deviation(&middle(&wall_at(depth)));
            let expected = axial_sigma(depth);
            assert!(
                (deviation / expected - 1.0).abs() < 0.03,
                "{deviation} m is not {expected} m at {depth} m"
            );
        }
    }

    #[test]
    fn depths_lie_on_whole_raw_disparities() {
        let mut depths = middle(&wall_at(4.0));
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        assert!(depths.len() > 3);
        for pair in depths.windows(2) {
            let steps = (1.0 / pair[0] - 1.0 / pair[1]) / 0.003_071_101_6;
            assert!((steps - steps.round()).abs() < 1e-3, "{pair:?}");
        }
        let nearest = depths.windows(2).find(|pair| pair[0] <= 4.0 && pair[1] > 4.0).unwrap();
        assert!((nearest[1] - nearest[0] - 0.049).abs() < 0.001, "{nearest:?}");
    }

    #[test]
    fn left_of_a_near_thing_is_the_projector_s_shadow() {
        // The cupboard's west side is at x = 6.05, from y = -1.9 to -0.7, which is its left end here.
        let pose = looking_east(4.55, -0.7);
        let image =
            Kinect::v1().sample(&Scene::room(), &pose, 0.0, &mut Xoshiro256PlusPlus::seed_from_u64(1));
        let width = 525.0 * BASELINE * (1.0 / 1.5 - 1.0 / 1.95);
        let row = &image.depths[240 * 640..][..640];
        let dark: Vec<_> = (200..440).filter(|&column| row[column].is_nan()).collect();
        assert!((dark.len() as f64 - width).abs() <= 1.0, "{dark:?} for {width}");
        assert!(dark.iter().all(|column| (320 - 8..320).contains(column)), "{dark:?}");
        assert!(dark.iter().all(|column| image.labels[240 * 640 + column] == 0));
    }

    #[test]
    fn nothing_is_measured_out_of_range() {
        let near = wall_at(0.3);
        assert!(middle(&near).iter().all(|z| z.is_nan()));
        let far = Kinect { max_range: 3.0, ..Kinect::v1() };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let image = far.sample(&Scene::room(), &looking_east(2.0, 2.4), 0.0, &mut rng);
        assert!(middle(&image).iter().all(|z| z.is_nan()));
        assert!(image.depths.iter().all(|z| z.is_nan() || (0.4..=3.0).contains(z)));
    }

    #[test]
    fn scatter_that_reaches_through_the_camera_is_out_of_range() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        for _ in 0..1000 {
            assert!(Kinect::v1().measure(1e-4, &mut rng).is_nan());
        }
    }
}
