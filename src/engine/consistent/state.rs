//! What the definition sees of a voxel: the moments of its points as they were published.
//!
//! Lengths are in voxels, positions relative to the corner of the block.

use nalgebra::{Matrix3, UnitVector3, Vector3};

use serde::{Deserialize, Serialize};

use super::block::{CELLS, Cell, Voxel};
use super::eigen::Eigen;
use super::noise::Noise;
use super::plane::Plane;
use super::sums::Moments;
use crate::engine::binning::nearest;
use crate::engine::symmetric::Symmetric3;

/// What a voxel's mean is off by however many points it has, in voxels: the sensor's distortion, the cut at the border.
const BIAS: f64 = 0.03;

/// Points of a voxel whose errors are one error: neighbouring pixels err alike, and where points scatter over several
/// voxels, each holds a slice of them that counts by how many they are.
const ALIKE: f64 = 100.0;

/// One over the product of the variances along two sides of a square of 1 that points cover evenly.
const FULL: f64 = 144.0;

/// Least variance of a voxel's points across the narrow side of their plane, in voxels^2, and most along its normal by that.
const OWN_BREADTH: f64 = 0.03;
const OWN_FLATNESS: f64 = 0.1;
/// Least variance of the points of a strip's voxel across the narrow side of their plane, in voxels^2, and most along its normal by
/// that.
const SHEET_BREADTH: f64 = 0.02;
const SHEET_FLATNESS: f64 = 0.15;
/// Variance of noise up to which a voxel is sharp, in voxels^2: seen from 2 m at 5 cm.
const SHARP: f64 = 0.02;
/// How many times its covariance counts then.
const SHEET: f64 = 2.0;
/// Units of what is kept of a covariance, in voxels^2, and of a direction.
const COVARIANCE_UNITS: f64 = 65536.0;
const DIRECTION_UNITS: f64 = 16384.0;

/// Parts of a voxel's edge in which the places of means are kept.
pub(super) const PARTS: f64 = 65536.0;

/// An offset from the voxel's corner in these parts, to the nearest: rounded down, each rest of a voxel would lower what is seen
/// to rise and fall about it.
pub(super) fn in_parts(offset: f64) -> u16 {
    nearest(offset * PARTS).clamp(0, u16::MAX.into()) as u16
}

/// A dense voxel, published: the definition knows it to a 65536th of a voxel. A map is saved with states as they are here.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Its cell in the lowest [`CELL_BITS`], above them the number of points that its moments count.
    cell_and_points: u32,
    /// Number of points.
    pub(super) count: u32,
    /// Weight of the points that its moments count.
    weight: u32,
    /// Weighted mean of its points from its corner, in [`PARTS`] of its edge.
    mean: [u16; 3],
    /// Weighted covariance of its points: xx, xy, xz, yy, yz, zz.
    covariance: [i16; 6],
    /// Mean direction towards the sensor, of length 1 at most.
    towards: [i16; 3],
}

const CELL_BITS: u32 = CELLS.ilog2();

impl State {
    /// The moments of a voxel, rounded to what is kept.
    pub(super) fn new(voxel: &Voxel) -> Self {
        let whole = |value: f64| nearest(value) as i16;
        let moments = &voxel.moments;
        Self {
            cell_and_points: moments.points << CELL_BITS | u32::from(voxel.cell.0),
            count: voxel.count,
            weight: moments.weight,
            mean: moments.mean().map(in_parts).into(),
            covariance: Symmetric3::of(&moments.covariance()).0.map(|entry| whole(entry * COVARIANCE_UNITS)),
            towards: moments.towards().map(|part| whole(part * DIRECTION_UNITS)).into(),
        }
    }

    /// Whether it can be that of a voxel's points.
    pub(super) fn is_possible(&self) -> bool {
        self.count > 0 && Moments::of(self).is_possible()
    }

    pub(super) const fn cell(&self) -> Cell {
        Cell((self.cell_and_points & (CELLS as u32 - 1)) as u16)
    }

    /// Number of points that its moments count.
    pub(super) const fn points(&self) -> u32 {
        self.cell_and_points >> CELL_BITS
    }

    /// Weight of the points that its moments count.
    pub(super) const fn weight(&self) -> u32 {
        self.weight
    }

    /// Weighted mean of its points from the lower corner of its block, in voxels.
    pub(super) fn mean(&self) -> Vector3<f64> {
        self.cell().corner() + self.offset()
    }

    /// Weighted mean of its points from its own lower corner, 0 to 1 along each axis.
    pub(super) fn offset(&self) -> Vector3<f64> {
        Vector3::from(self.mean.map(|part| f64::from(part) / PARTS))
    }

    /// Weighted covariance of its points.
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        self.entries().matrix()
    }

    /// The entries of [`Self::covariance`].
    fn entries(&self) -> Symmetric3 {
        Symmetric3(self.covariance.map(|entry| f64::from(entry) / COVARIANCE_UNITS))
    }

    /// Inverse variance with which its mean counts in a fit, in voxels^-2.
    pub(super) fn mean_weight(&self, noise: &Noise) -> f64 {
        let variance = self.depth_variance(noise) * ALIKE / f64::from(self.points());
        1.0 / (variance + BIAS * BIAS)
    }

    /// The share, 0 to 1, of [`Self::mean_weight`] with which the mean enters a fit: the fourth power of the part of the voxel's
    /// cross section (perpendicular to `normal`) that its points cover. Rim voxels may belong to a board's edge.
    pub(super) fn part_on(&self, normal: &Vector3<f64>) -> f64 {
        let square_of_covered = (FULL * self.entries().adjugate_form(normal)).clamp(0.0, 1.0);
        square_of_covered * square_of_covered
    }

    /// Whether its points cover less than half of what a plane through the voxel has of it, whatever way that is turned: those of a
    /// surface that ends in it, or beside it.
    pub(super) fn is_sliver(&self, noise: &Noise) -> bool {
        let Eigen { variances, .. } = Eigen::of(&(self.covariance() - self.blur(noise).covariance()));
        // Points are cut at the voxel's faces, and what noise would scatter them by is not.
        let [a, b, c] = variances.map(|variance| variance.max(0.0));
        // The square of the part that is covered, where there is no spread along the normal; more, where there is.
        FULL * (a * b + a * c + b * c) < 0.25
    }

    /// Mean direction towards the sensor, of length 1 at most.
    pub(super) fn towards(&self) -> Vector3<f64> {
        Vector3::from(self.towards.map(|part| f64::from(part) / DIRECTION_UNITS))
    }

    /// Mean variance of its points' depths.
    fn depth_variance(&self, noise: &Noise) -> f64 {
        noise.depth_variance(self.points(), self.weight)
    }

    /// What noise alone scatters its points by.
    pub(super) fn blur(&self, noise: &Noise) -> Blur {
        let (towards, depth) = (self.towards(), self.depth_variance(noise));
        let lateral = noise.lateral_variance(depth);
        Blur { towards, deep: (depth - lateral) / towards.norm_squared().max(1e-18), lateral }
    }

    /// The plane of its own points, where they lie on one.
    pub(super) fn own_plane(&self) -> Option<Plane> {
        let Eigen { variances, normal } = self.flat_eigen(OWN_FLATNESS)?;
        let is_flat = variances[1] >= OWN_BREADTH && variances[0] <= OWN_FLATNESS * variances[1];
        let normal = if normal.dot(&self.towards()) < 0.0 { -normal } else { normal };
        is_flat.then(|| Plane { point: self.mean(), normal: UnitVector3::new_normalize(normal) })
    }

    /// Whether its points lie on a plane, be it of half a row.
    pub(super) fn is_sheet(&self) -> bool {
        self.flat_eigen(SHEET_FLATNESS).is_some_and(|Eigen { variances, .. }| {
            variances[1] >= SHEET_BREADTH && variances[0] <= SHEET_FLATNESS * variances[1]
        })
    }

    /// The eigenvalues of the covariance and its normal, unless a cheap bound already shows that the smallest exceeds `flatness`
    /// times the next.
    fn flat_eigen(&self, flatness: f64) -> Option<Eigen> {
        let entries = self.entries();
        // The next is at most half of the trace, which is the sum of all three.
        let half = 0.5 * entries.trace();
        (entries.eigenvalue_lower_bound() <= flatness * half).then(|| Eigen::of(&entries.matrix()))
    }

    /// Covariance of its points as it counts about a plane: more where they are sharp, for a voxel in which a surface shows as a
    /// sheet lies on no plane across that sheet, even where its mean does. Whether one shows is not asked: that would take 3 % of the
    /// time of a scan.
    pub(super) fn thickness(&self, noise: &Noise) -> Matrix3<f64> {
        let is_sharp = self.depth_variance(noise) <= SHARP;
        self.covariance() * if is_sharp { SHEET } else { 1.0 }
    }
}

/// What noise scatters the points of a voxel by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Blur {
    /// Mean direction towards the sensor, of length 1 at most.
    pub(super) towards: Vector3<f64>,
    /// Variance along `towards` by its length squared, less that across it.
    pub(super) deep: f64,
    /// Mean variance across the depth axis.
    pub(super) lateral: f64,
}

impl Blur {
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        self.towards * self.towards.transpose() * self.deep + Matrix3::from_diagonal_element(self.lateral)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::noise::MAX_WEIGHT;
    use super::super::sums::ScanSums;
    use super::*;

    /// What is seen a little above and a little below in turns, by visits that weigh little, and rests after each of them.
    #[test]
    fn a_mean_is_not_moved_by_rests() {
        let points = |height: u64| {
            let mut scan = ScanSums::default();
            (0..20).for_each(|_| scan.add([2048, 2048, height]));
            scan
        };
        let mut voxel = Voxel::new(Cell(0));
        for _ in 0..600 {
            voxel.moments.fold(&points(2048), MAX_WEIGHT, &Vector3::z());
        }
        for visit in 0..10_000 {
            voxel.moments.fold(&points(if visit % 2 == 0 { 2560 } else { 1536 }), 7, &Vector3::z());
            voxel.moments = Moments::of(&State::new(&voxel));
        }
        let height = voxel.moments.mean().z;
        assert!((height - 0.5).abs() < 1e-3, "{height} of a voxel");
    }

    proptest! {
        #[test]
        fn the_state_of_a_voxel_has_its_cell_and_points_and_is_possible(
            cell in 0_u16..512, points in prop::collection::vec(prop::array::uniform3(0_u64..4096), 1..40),
            towards in prop::array::uniform3(prop_oneof![-1.0..-0.1, 0.1..1.0]), scans in prop::collection::vec(1..=MAX_WEIGHT, 1..60),
        ) {
            let mut scan = ScanSums::default();
            points.iter().for_each(|&point| scan.add(point));
            let mut voxel = Voxel::new(Cell(cell));
            for weight in scans {
                voxel.count += scan.count;
                voxel.moments.fold(&scan, weight, &Vector3::from(towards).normalize());
            }
            let state = State::new(&voxel);
            prop_assert_eq!((state.cell(), state.points()), (voxel.cell, voxel.moments.points));
            prop_assert!(state.is_possible(), "{state:?}");
        }
    }
}
