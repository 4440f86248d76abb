//! Exact sums over the points of a voxel.
//!
//! Offsets from the voxel's corner are whole 1/4096 of its edge (20 um at 8 cm). A scan's points are summed without a
//! weight first ([`ScanSums`]) and folded into the voxel with one weight for all of them ([`Sums`]). Sums are integers, so
//! neither the order of points nor of voxels matters, and what is taken out leaves no trace.
//!
//! Nothing overflows: a square has 24 bits, a weight 15, a scan at most 2^24 points, which is 2^63 a scan; where the weights
//! of a voxel exceed 2^32 or its points 2^20, all its sums are halved ([`Sums::fold`]), so that a sum of squares stays below
//! 2^56 between scans and one of directions below 2^31. Halving also lets old scans fade where a voxel has been seen for
//! long. For the sums of a cluster see `exact`.

use nalgebra::{Matrix3, Vector3};

use serde::{Deserialize, Serialize};

use crate::engine::binning::{self, nearest};

/// Units of an offset in a voxel's edge.
pub(super) const UNITS: f64 = binning::UNITS as f64;
/// Most weight and most points of a voxel; beyond either its sums are halved.
const MOST_WEIGHT: u64 = u32::MAX as u64;
const MOST_POINTS: u64 = 1 << 20;

/// What one scan puts into a voxel; offsets in 1/4096 of its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ScanSums {
    pub(super) count: u32,
    pub(super) sum: [u64; 3],
    /// xx, xy, xz, yy, yz, zz.
    pub(super) squares: [u64; 6],
}

impl ScanSums {
    #[inline]
    pub(super) fn add(&mut self, [x, y, z]: [u64; 3]) {
        self.count += 1;
        for (sum, offset) in self.sum.iter_mut().zip([x, y, z]) {
            *sum += offset;
        }
        for (sum, square) in self.squares.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum += square;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        (0..3).for_each(|i| self.sum[i] += other.sum[i]);
        (0..6).for_each(|i| self.squares[i] += other.squares[i]);
    }

    /// Mean offset from the corner, in voxels.
    pub(super) fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.sum.map(|sum| sum as f64)) / (f64::from(self.count) * UNITS)
    }
}

/// Everything a voxel knows of its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "Wide")]
pub(super) struct Sums {
    /// Number of points, halved when the sums are.
    pub(super) points: u32,
    pub(super) weight: u32,
    sum: [u64; 3],
    squares: [u64; 6],
    /// Unit directions towards the sensor times 1024, one a point, summed.
    towards: [i32; 3],
}

/// Sums as they may have been saved, when they were halved later: in the file whole numbers have no width.
#[derive(Deserialize)]
struct Wide {
    points: u64,
    weight: u64,
    sum: [u64; 3],
    squares: [u64; 6],
    towards: [i64; 3],
}

impl From<Wide> for Sums {
    fn from(wide: Wide) -> Self {
        let halvings = halvings(wide.weight, MOST_WEIGHT).max(halvings(wide.points, MOST_POINTS));
        let most = i64::from(i32::MAX);
        Self {
            points: (wide.points >> halvings) as u32,
            weight: (wide.weight >> halvings) as u32,
            sum: wide.sum.map(|sum| sum >> halvings),
            squares: wide.squares.map(|square| square >> halvings),
            towards: wide.towards.map(|towards| (towards >> halvings).clamp(-most, most) as i32),
        }
    }
}

impl Sums {
    /// Whether points can have these sums.
    pub(super) fn is_possible(&self) -> bool {
        let edge = binning::UNITS as u64;
        let most = u64::from(self.weight) * edge;
        let directions = i64::from(self.points) * 1025;
        // Halved, each sum is rounded down on its own.
        self.points > 0
            && self.points <= self.weight
            && u64::from(self.points) <= MOST_POINTS
            && self.sum.iter().all(|&sum| sum <= most)
            && self.squares.iter().all(|&square| square <= most * edge)
            && self.towards.iter().all(|&towards| i64::from(towards).abs() <= directions)
    }

    /// Adds a scan's points, each of this weight and seen from this direction (of unit length); returns how often the sums
    /// were halved.
    pub(super) fn fold(&mut self, scan: &ScanSums, weight: u64, towards: &Vector3<f64>) -> u32 {
        let count = u64::from(scan.count);
        let points = u64::from(self.points) + count;
        let weights = u64::from(self.weight) + weight * count;
        let halvings = halvings(weights, MOST_WEIGHT).max(halvings(points, MOST_POINTS));
        (self.points, self.weight) = (((points >> halvings).max(1)) as u32, (weights >> halvings) as u32);
        (0..3).for_each(|i| self.sum[i] = (self.sum[i] + weight * scan.sum[i]) >> halvings);
        (0..6).for_each(|i| self.squares[i] = (self.squares[i] + weight * scan.squares[i]) >> halvings);
        for (sum, towards) in self.towards.iter_mut().zip(towards.iter()) {
            let directions = i64::from(*sum) + nearest(towards * 1024.0) * i64::from(scan.count);
            *sum = (directions >> halvings) as i32;
        }
        halvings
    }

    /// Weighted mean offset from the corner, in voxels.
    pub(super) fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.sum.map(|sum| sum as f64)) / (f64::from(self.weight) * UNITS)
    }

    /// Weighted covariance, in voxels^2.
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        let scale = 1.0 / (f64::from(self.weight) * UNITS * UNITS);
        let [xx, xy, xz, yy, yz, zz] = self.squares.map(|sum| sum as f64 * scale);
        let mean = self.mean();
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - mean * mean.transpose()
    }

    /// Mean direction towards the sensor; its length is 1 where all points were seen from one side.
    pub(super) fn towards(&self) -> Vector3<f64> {
        Vector3::from(self.towards.map(f64::from)) / (f64::from(self.points) * 1024.0)
    }
}

/// How often a number must be halved to be no more than `most`.
const fn halvings(number: u64, most: u64) -> u32 {
    let mut halvings = 0;
    while number >> halvings > most {
        halvings += 1;
    }
    halvings
}

#[cfg(test)]
mod tests {
    use super::super::noise::MAX_WEIGHT;
    use super::*;

    #[test]
    fn what_was_saved_with_wider_sums_is_halved() {
        let wide = Wide {
            points: 1 << 22,
            weight: 1 << 33,
            sum: [1 << 44; 3],
            squares: [1 << 56; 6],
            towards: [-1 << 32, 0, 1 << 20],
        };
        let sums = Sums::from(wide);
        assert_eq!((sums.points, sums.weight), (1 << 20, 1 << 31));
        assert_eq!(
            (sums.sum, sums.squares, sums.towards),
            ([1 << 42; 3], [1 << 54; 6], [-1 << 30, 0, 1 << 18])
        );
        assert!(sums.is_possible());
    }

    #[test]
    fn as_many_points_of_the_greatest_weight_as_a_scan_may_have_overflow_nothing() {
        // All in the last place of a voxel, of as many points as the parameter `max_points` lets through.
        let (count, place) = (1_u32 << 24, u64::from(UNITS as u32 - 1));
        let many = u64::from(count);
        let scan = ScanSums { count, sum: [many * place; 3], squares: [many * place * place; 6] };
        let mut sums = Sums::default();
        for _ in 0..1000 {
            sums.fold(&scan, MAX_WEIGHT, &Vector3::new(0.0, 0.0, 1.0));
            assert!((sums.mean() * UNITS - Vector3::repeat(place as f64)).amax() < 1e-3, "{:?}", sums.mean());
            assert!(sums.covariance().amax() < 1e-6 && sums.towards().norm() < 1.001);
        }
    }
}
