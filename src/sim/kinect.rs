//! The first Kinect: a pinhole depth camera whose measurements scatter and come in steps.
//!
//! Along the optical axis a measured depth scatters by sigma = 0.0012 + 0.0019 (z - 0.4)^2 m (Nguyen, Izadi and Lovell,
//! "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking", 2012) and is then rounded to a whole raw
//! disparity, z = 1 / (3.3309495161 - 0.0030711016 raw): a step of 3 mm at 1 m, 12 mm at 2 m, 49 mm at 4 m.
//!
//! Nguyen's sigma was measured on a real Kinect, whose depths were already rounded so. It holds a part of the rounding
//! (a step has a standard deviation of 0.29 of its size), and the simulated depths scatter by up to a sixth more than
//! the real ones did. The scatter of neighbouring pixels is independent here; in a real Kinect it is not quite.

use nalgebra::Isometry3;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::raycast::inverse_depths;
use super::scene::Scene;

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
}

impl Kinect {
    /// The Kinect of 2010, with the intrinsics its drivers take by default.
    pub const fn v1() -> Self {
        let (width, height) = (640, 480);
        Self { width, height, fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, min_range: 0.4, max_range: 8.0 }
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

    /// What the Kinect measures at a pose in the scene.
    pub fn sample(
        &self,
        scene: &Scene,
        fixed_from_optical: &Isometry3<f64>,
        rng: &mut impl Rng,
    ) -> DepthImage {
        let inverse_depths = inverse_depths(scene, self, fixed_from_optical);
        let depths =
            inverse_depths.into_iter().map(|w| if w > 0.0 { self.measure(1.0 / w, rng) } else { f32::NAN });
        DepthImage { width: self.width, height: self.height, depths: depths.collect() }
    }

    /// One measurement of a true depth; NaN where the measured depth is out of range.
    fn measure(&self, depth: f64, rng: &mut impl Rng) -> f32 {
        let scatter: f64 = StandardNormal.sample(rng);
        let measured = to_whole_disparity(depth + axial_sigma(depth) * scatter);
        if (self.min_range..=self.max_range).contains(&measured) { measured as f32 } else { f32::NAN }
    }
}

/// Standard deviation of a depth (m), Nguyen et al. 2012.
fn axial_sigma(depth: f64) -> f64 {
    0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4)
}

/// The depth (m) of the nearest whole raw disparity.
fn to_whole_disparity(depth: f64) -> f64 {
    const OFFSET: f64 = 3.330_949_516_1;
    const SLOPE: f64 = 0.003_071_101_6;
    // Rounds: a raw disparity is positive from 0.3 m on, and a cast drops the fraction.
    let raw = ((OFFSET - 1.0 / depth) / SLOPE + 0.5) as u32;
    1.0 / (OFFSET - SLOPE * f64::from(raw))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{UnitQuaternion, Vector3};
    use rand::SeedableRng;
    use rand::rngs::Xoshiro256PlusPlus;

    use super::*;

    /// Optical frame at (x, y, 1.0), looking along +x of the room.
    fn looking_east(x: f64, y: f64) -> Isometry3<f64> {
        let axes = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
        Isometry3::from_parts(Vector3::new(x, y, 1.0).into(), axes)
    }

    fn wall_at(depth: f64) -> DepthImage {
        // From y = 2.4 only the east wall, at x = 6.5, is in the middle of the image.
        let pose = looking_east(6.5 - depth, 2.4);
        Kinect::v1().sample(&Scene::room(), &pose, &mut Xoshiro256PlusPlus::seed_from_u64(1))
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
    fn depths_scatter_by_nguyen_s_sigma_and_a_share_of_the_disparity_step() {
        for depth in [1.0, 2.0, 4.0, 6.0] {
            let (_, deviation) = mean_and_deviation(&middle(&wall_at(depth)));
            let rounding = 0.003_071 * depth * depth / 12_f64.sqrt();
            let expected = axial_sigma(depth).hypot(rounding);
            assert!(
                (deviation / expected - 1.0).abs() < 0.03,
                "{deviation} m is not {expected} m at {depth} m"
            );
        }
        assert!((axial_sigma(2.4) - 0.0088).abs() < 1e-12);
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
    fn rounding_gives_the_nearer_of_two_disparities() {
        for z in (40..800).map(|centimetres| f64::from(centimetres) * 0.01) {
            let off = (1.0 / to_whole_disparity(z) - 1.0 / z).abs();
            assert!(off <= 0.5 * 0.003_071_101_6 + 1e-12, "{z} m");
        }
    }

    #[test]
    fn nothing_is_measured_out_of_range() {
        let near = wall_at(0.3);
        assert!(middle(&near).iter().all(|z| z.is_nan()));
        let far = Kinect { max_range: 3.0, ..Kinect::v1() };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let image = far.sample(&Scene::room(), &looking_east(2.0, 2.4), &mut rng);
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
