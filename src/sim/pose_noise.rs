//! How far the pose that a robot tells is from where it is: an error that wanders slowly, and a small jitter.
//!
//! Each of the six coordinates (place along and turn about x, y and z of `base_link`) has an error of zero mean and the
//! stated standard deviation, of which a tenth of the variance is jitter from step to step and the rest wanders: three
//! sine waves of periods between 17 and 61 s whose phases the seed decides. A function of seed, time and step alone.

use std::f64::consts::TAU;
use std::fmt;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// Periods of the waves (s), without a common multiple that a drive would reach.
const PERIODS: [f64; 3] = [17.3, 31.7, 60.9];

/// Share of the variance that is jitter.
const JITTER: f64 = 0.1;

/// By how much the poses told of `base_link` are wrong, as standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseNoise {
    /// Of each coordinate of the place (m), 0 or more.
    pub metres: f64,
    /// Of the turn about each axis (rad), 0 or more.
    pub radians: f64,
}

impl fmt::Display for PoseNoise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} m and {} rad", self.metres, self.radians)
    }
}

/// How far wrong poses put points from where they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSpread {
    noise: PoseNoise,
    /// What the poses turn about: `base_link`, in the optical frame.
    base: Point3<f64>,
}

impl PoseSpread {
    pub(super) const fn new(noise: PoseNoise, base: Point3<f64>) -> Self {
        Self { noise, base }
    }

    /// Variance of where a point of the optical frame is told to be (m^2), in the directions in which it is largest: across the line
    /// from `base_link`. Along that line a turn moves nothing.
    pub fn variance(&self, point: &Point3<f64>) -> f64 {
        let PoseNoise { metres, radians } = self.noise;
        metres * metres + radians * radians * (point - self.base).norm_squared()
    }
}

/// The errors of a drive's poses.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PoseErrors {
    pub(super) noise: PoseNoise,
    /// Of each coordinate's waves (rad).
    phases: [[f64; 3]; 6],
}

impl PoseErrors {
    pub(super) fn new(noise: PoseNoise, seed: u64) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let phases = [(); 6].map(|()| PERIODS.map(|_| rng.random_range(0.0..TAU)));
        Self { noise, phases }
    }

    /// True `base_link` from the one that is told; `rng` is the step's own.
    pub(super) fn error(&self, seconds: f64, rng: &mut Xoshiro256PlusPlus) -> Isometry3<f64> {
        // Three waves of amplitude 1 have a variance of 3/2.
        let amplitude = ((1.0 - JITTER) / 1.5).sqrt();
        let [x, y, z, roll, pitch, yaw] = self.phases.map(|phases| {
            let waves =
                phases.iter().zip(PERIODS).map(|(phase, period)| (TAU * seconds / period + phase).sin());
            let jitter: f64 = StandardNormal.sample(rng);
            amplitude * waves.sum::<f64>() + JITTER.sqrt() * jitter
        });
        let place = self.noise.metres * Vector3::new(x, y, z);
        let turn = self.noise.radians * Vector3::new(roll, pitch, yaw);
        Isometry3::from_parts(Translation3::from(place), UnitQuaternion::from_scaled_axis(turn))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_has_zero_mean_and_the_stated_deviation_and_wanders_slowly() {
        let poses = PoseErrors::new(PoseNoise { metres: 0.02, radians: 0.01 }, 3);
        let errors: Vec<_> = (0..60_000_u32)
            .map(|i| poses.error(f64::from(i) * 0.1, &mut Xoshiro256PlusPlus::seed_from_u64(u64::from(i))))
            .collect();
        let count = errors.len() as f64;
        for axis in 0..3 {
            let places: Vec<f64> = errors.iter().map(|error| error.translation.vector[axis]).collect();
            let turns: Vec<f64> = errors.iter().map(|error| error.rotation.scaled_axis()[axis]).collect();
            for (values, sigma) in [(places, 0.02), (turns, 0.01)] {
                let mean = values.iter().sum::<f64>() / count;
                let deviation = (values.iter().map(|v| v * v).sum::<f64>() / count).sqrt();
                assert!(mean.abs() < 0.03 * sigma, "{mean}");
                assert!((deviation / sigma - 1.0).abs() < 0.03, "{deviation}");
                let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum::<f64>() / count;
                assert!(steps.sqrt() < 0.5 * sigma, "{}", steps.sqrt());
            }
        }
    }
}
