//! Exact sums of a cluster: free of order and of history, so that what splits off leaves no trace.
//!
//! Means are whole 2^-20 voxels from the corner of voxel (0, 0, 0), weights whole numbers below 2^17. With indices below
//! 2^20 and 2^27 voxels a sum of squares stays below 2^124. The moments about the mean are the small difference of such
//! sums, taken in integers modulo 2^128, where it is exact.

use nalgebra::{Matrix3, Vector3};

use crate::engine::binning::nearest;
use crate::engine::consistent::patch::Weight;
use crate::engine::consistent::state::State;
use crate::engine::symmetric::{PAIRS, Symmetric3};

/// Units of a mean in a voxel.
const UNITS: f64 = 1_048_576.0;
/// Units of a voxel's weight in a fit.
const WEIGHT_UNITS: f64 = 64.0;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ClusterSums {
    weight: i128,
    /// Weights by the part that each is of the inverse variance: the variance of the weighted sum of the means.
    variance: i128,
    sum: [i128; 3],
    /// xx, xy, xz, yy, yz, zz.
    squares: [i128; 6],
    /// Weighted covariances of the points within their voxels.
    within: [i128; 6],
    /// Directions towards the sensor.
    towards: [i128; 3],
    /// Weighted normals of the voxels' patches.
    normal: [i128; 3],
    /// Weighted variances of their points along those that are noise.
    noise: i128,
}

impl ClusterSums {
    /// The sums of one voxel that counts so much, of a patch with this normal and this noise along it; `corner` is that of its
    /// block.
    pub(crate) fn of(
        state: &State,
        corner: [i32; 3],
        weight: Weight,
        normal: &Vector3<f64>,
        noise: f64,
    ) -> Self {
        // Of two numbers of 64 bits the product of 128 is a single instruction.
        let by = |a: i64, b: i64| i128::from(a) * i128::from(b);
        let Weight { most, part } = weight;
        let weight = nearest(most * part * WEIGHT_UNITS).max(1);
        let whole = |value: f64| nearest(value * UNITS);
        // What counts by so little that it is rounded up counts by that.
        let part = whole(weight as f64 / (most * WEIGHT_UNITS)).max(1);
        let (mean, towards) = (state.mean(), state.towards());
        let mean: [i64; 3] = std::array::from_fn(|axis| whole(mean[axis]) + (i64::from(corner[axis]) << 20));
        let weighted = mean.map(|mean| weight * mean);
        Self {
            weight: weight.into(),
            variance: by(weight, part),
            sum: weighted.map(i128::from),
            squares: PAIRS.map(|(i, j)| by(weighted[i], mean[j])),
            within: Symmetric3::of(&state.covariance()).0.map(|entry| by(weight, whole(entry))),
            towards: [0, 1, 2].map(|axis| whole(towards[axis]).into()),
            normal: [0, 1, 2].map(|axis| by(weight, whole(normal[axis]))),
            noise: by(weight, whole(noise)),
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.combine(other, i128::wrapping_add);
    }

    pub(crate) fn remove(&mut self, other: &Self) {
        self.combine(other, i128::wrapping_sub);
    }

    fn combine(&mut self, other: &Self, by: impl Fn(i128, i128) -> i128) {
        self.weight = by(self.weight, other.weight);
        self.variance = by(self.variance, other.variance);
        (0..3).for_each(|i| self.sum[i] = by(self.sum[i], other.sum[i]));
        (0..6).for_each(|i| self.squares[i] = by(self.squares[i], other.squares[i]));
        (0..6).for_each(|i| self.within[i] = by(self.within[i], other.within[i]));
        (0..3).for_each(|i| self.towards[i] = by(self.towards[i], other.towards[i]));
        (0..3).for_each(|i| self.normal[i] = by(self.normal[i], other.normal[i]));
        self.noise = by(self.noise, other.noise);
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.weight == 0
    }

    /// Inverse variance of the plane's place at the mean, in voxels^-2. Where all voxels count the same part it is the sum of what
    /// each would count at most, however small that part.
    pub(crate) fn information(&self) -> f64 {
        let weight = self.weight as f64 / WEIGHT_UNITS;
        weight * weight / (self.variance as f64 / (WEIGHT_UNITS * UNITS))
    }

    /// Weighted mean, in voxels.
    pub(crate) fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.sum.map(|sum| sum as f64 / (self.weight as f64 * UNITS)))
    }

    /// Weighted covariance of the voxels' means, in voxels^2.
    pub(crate) fn covariance(&self) -> Matrix3<f64> {
        let about = self.sum.map(|sum| sum / self.weight);
        let rest = self.sum.map(|sum| (sum % self.weight) as f64 / self.weight as f64);
        let entries = std::array::from_fn(|k| {
            let (i, j) = PAIRS[k];
            let centred = self.squares[k]
                .wrapping_sub(about[i].wrapping_mul(self.sum[j]))
                .wrapping_sub(about[j].wrapping_mul(self.sum[i]))
                .wrapping_add(self.weight.wrapping_mul(about[i]).wrapping_mul(about[j]));
            (centred as f64 / self.weight as f64 - rest[i] * rest[j]) / (UNITS * UNITS)
        });
        Symmetric3(entries).matrix()
    }

    /// Mean covariance of the points within their voxels, in voxels^2.
    pub(crate) fn covariance_within(&self) -> Matrix3<f64> {
        Symmetric3(self.within.map(|sum| sum as f64 / (self.weight as f64 * UNITS))).matrix()
    }

    /// Sum of the directions towards the sensor.
    pub(crate) fn towards(&self) -> Vector3<f64> {
        Vector3::from(self.towards.map(|sum| sum as f64 / UNITS))
    }

    /// Weighted mean of the normals of the voxels' patches; its length is 1 where they are one.
    pub(crate) fn normal(&self) -> Vector3<f64> {
        Vector3::from(self.normal.map(|sum| sum as f64 / (self.weight as f64 * UNITS)))
    }

    /// The half space that the normal of its plane lies in.
    ///
    /// Each patch faces the side that it was seen from, so the mean of their normals has the say wherever the plane is turned off it
    /// by less than 60 degrees: seen at a grazing angle, the directions towards the sensor lie in the plane, and hardly tell its sides
    /// apart. They decide where the plane lies across the patches, or these cancel out.
    pub(crate) fn side(&self) -> Vector3<f64> {
        let [normal, towards] =
            [self.normal(), self.towards()].map(|sum| sum.try_normalize(0.0).unwrap_or_default());
        2.0 * normal + towards
    }

    /// Weighted mean of the variances of the patches' points along their normals that are noise, in voxels^2.
    pub(crate) fn noise(&self) -> f64 {
        self.noise as f64 / (self.weight as f64 * UNITS)
    }
}
