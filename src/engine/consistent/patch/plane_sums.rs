//! Sums over voxel means, from which planes are fitted.
//!
//! A voxel's mean counts by 1 / (noise / points + bias^2): noise averages away, what the sensor and the grid get wrong
//! does not, so that beyond some points all voxels count the same. Fitting means instead of points keeps the scatter along
//! the ray, which is seldom along the normal, out of the fit.

use nalgebra::{Matrix3, UnitVector3, Vector3};

use crate::engine::consistent::block::Cell;
use crate::engine::consistent::eigen::Eigen;
use crate::engine::consistent::noise::Noise;
use crate::engine::consistent::plane::Plane;
use crate::engine::consistent::state::State;
use crate::engine::plane::DEGENERATE;
use crate::engine::symmetric::{Symmetric3, quadratic};

/// What is summed, one after another: weight, weighted means, their weighted products (xx, xy, xz, yy, yz, zz), directions
/// towards the sensor, number of voxels. Lengths in voxels from the block's corner, weights in voxels^-2. One array, so that
/// several are added in one instruction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PlaneSums([f64; 16]);

const WEIGHT: usize = 0;
const SUM: usize = 1;
const OUTER: usize = 4;
const TOWARDS: usize = 10;
const VOXELS: usize = 13;

/// The plane of some voxels and how far these spread.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub(crate) plane: Plane,
    /// Variances of the means, ascending, in voxels^2.
    pub(crate) variances: [f64; 3],
}

impl Fit {
    /// Whether the voxels span a plane (reading R4).
    pub(crate) fn spans_plane(&self) -> bool {
        let [l0, l1, l2] = self.variances;
        l1.min(l1 - l0) > DEGENERATE * l2
    }

    /// The smallest variance over the sum: 0 (flat) to 1/3.
    pub(crate) fn curvature(&self) -> f64 {
        self.variances[0] / self.variances.iter().sum::<f64>().max(f64::MIN_POSITIVE)
    }
}

impl PlaneSums {
    pub(crate) fn of<'a>(states: impl IntoIterator<Item = &'a State>, noise: &Noise) -> Self {
        Self::sum(states.into_iter().map(|state| Self::one(state, noise)))
    }

    pub(crate) fn sum(all: impl IntoIterator<Item = Self>) -> Self {
        let mut sum = Self::default();
        all.into_iter().for_each(|sums| sum.join(&sums));
        sum
    }

    /// The states of a block (ascending) around a cell, itself included.
    pub(crate) fn around(states: &[State], cell: Cell, noise: &Noise) -> Self {
        let at = cell.coordinates();
        let is_near = |state: &&State| (0..3).all(|i| (state.cell().coordinates()[i] - at[i]).abs() <= 1);
        Self::of(states.iter().filter(is_near), noise)
    }

    /// The sums of one voxel, by the mean of its points.
    pub(crate) fn one(state: &State, noise: &Noise) -> Self {
        let (weight, [x, y, z]) = (state.mean_weight(noise), state.mean().into());
        let [wx, wy, wz] = [x, y, z].map(|at: f64| weight * at);
        let [tx, ty, tz] = state.towards().into();
        Self([weight, wx, wy, wz, wx * x, wx * y, wx * z, wy * y, wy * z, wz * z, tx, ty, tz, 1.0, 0.0, 0.0])
    }

    /// The sums of one voxel, by where its points lie.
    pub(crate) fn points(state: &State, noise: &Noise) -> Self {
        let mut sums = Self::one(state, noise);
        let within = Symmetric3::of(&state.covariance()).0.map(|entry| entry * state.mean_weight(noise));
        sums.0[OUTER..TOWARDS].iter_mut().zip(within).for_each(|(sum, entry)| *sum += entry);
        sums
    }

    /// Takes in the voxels of another one.
    #[inline]
    pub(crate) fn join(&mut self, other: &Self) {
        add(&mut self.0, &other.0);
    }

    pub(crate) const fn voxels(&self) -> f64 {
        self.0[VOXELS]
    }

    /// Inverse variance of the plane at its middle, in voxels^-2.
    pub(crate) const fn weight(&self) -> f64 {
        self.0[WEIGHT]
    }

    /// Whether it was seen from the side that the plane's normal points to.
    pub(crate) fn is_seen_from(&self, plane: &Plane) -> bool {
        vector(&self.0, TOWARDS).dot(&plane.normal) > 0.0
    }

    /// The direction towards the sensor within a plane; `None` where the plane faces it.
    pub(crate) fn sight_in(&self, plane: &Plane) -> Option<Vector3<f64>> {
        let (towards, normal) = (vector(&self.0, TOWARDS), &plane.normal);
        (towards - normal.into_inner() * normal.dot(&towards)).try_normalize(1e-9)
    }

    /// Variance of its voxels' means along a direction, in voxels^2.
    pub(crate) fn variance_along(&self, direction: &Vector3<f64>) -> f64 {
        quadratic(&self.covariance(), direction)
    }

    fn covariance(&self) -> Matrix3<f64> {
        let point = self.middle();
        symmetric(&self.0, OUTER).matrix() / self.weight() - point * point.transpose()
    }

    fn middle(&self) -> Vector3<f64> {
        vector(&self.0, SUM) / self.weight()
    }

    /// `None` for fewer than three voxels.
    pub(crate) fn fit(&self) -> Option<Fit> {
        if self.voxels() < 3.0 {
            return None;
        }
        let Eigen { variances, normal } = Eigen::of(&self.covariance());
        let normal = if normal.dot(&vector(&self.0, TOWARDS)) < 0.0 { -normal } else { normal };
        let variances = variances.map(|variance| variance.max(0.0));
        Some(Fit {
            plane: Plane { point: self.middle(), normal: UnitVector3::new_normalize(normal) },
            variances,
        })
    }
}

/// What says how far the points of voxels are off a plane, summed: means, second moments about the block's corner, with each
/// voxel's covariance as [`State::thickness`] counts it, and noise (both xx, xy, xz, yy, yz, zz), number of voxels. Lengths in
/// voxels from the block's corner; each voxel counts once.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ResidualSums([f64; 16]);

const MEAN: usize = 0;
const SQUARE: usize = 3;
const NOISE: usize = 9;
const COUNT: usize = 15;

impl ResidualSums {
    /// The sums of one voxel's points.
    pub(crate) fn one(state: &State, noise: &Noise) -> Self {
        let mut sums = [0.0; 16];
        let mean = state.mean();
        sums[MEAN..SQUARE].copy_from_slice(mean.as_slice());
        let square = state.thickness(noise) + mean * mean.transpose();
        sums[SQUARE..NOISE].copy_from_slice(&Symmetric3::of(&square).0);
        sums[NOISE..COUNT].copy_from_slice(&Symmetric3::of(&state.blur(noise).covariance()).0);
        sums[COUNT] = 1.0;
        Self(sums)
    }

    /// Takes in the voxels of another one.
    #[inline]
    pub(crate) fn join(&mut self, other: &Self) {
        add(&mut self.0, &other.0);
    }

    /// Mean square distance of the points to a plane by what is allowed of them on the mean; 1 is just allowed.
    pub(crate) fn misfit(&self, plane: &Plane, noise_factor: f64, flatness: f64) -> f64 {
        let [distance, allowed] = self.distance_and_allowed(plane, noise_factor, flatness, self.0[COUNT]);
        distance / allowed
    }

    /// [`Self::misfit`] of one voxel's points.
    pub(crate) fn misfit_of_one(&self, plane: &Plane, noise_factor: f64, flatness: f64) -> f64 {
        let [distance, allowed] = self.distance_and_allowed(plane, noise_factor, flatness, 1.0);
        distance / allowed
    }

    /// Whether that is allowed.
    pub(crate) fn is_one_allowed(&self, plane: &Plane, noise_factor: f64, flatness: f64) -> bool {
        let [distance, allowed] = self.distance_and_allowed(plane, noise_factor, flatness, 1.0);
        distance <= allowed
    }

    /// Mean square distance of the points to a plane.
    pub(crate) fn square_distance(&self, plane: &Plane) -> f64 {
        self.square_distance_of(plane, self.0[COUNT])
    }

    /// Both for the points of `count` voxels; where the compiler knows that this is 1, nothing is divided.
    #[inline(always)]
    fn distance_and_allowed(&self, plane: &Plane, noise_factor: f64, flatness: f64, count: f64) -> [f64; 2] {
        let noise = self.along(&plane.normal, NOISE) / count;
        let allowed = noise_factor * noise_factor * noise + flatness * flatness;
        [self.square_distance_of(plane, count), allowed]
    }

    #[inline(always)]
    fn square_distance_of(&self, plane: &Plane, count: f64) -> f64 {
        let height = plane.normal.dot(&plane.point);
        let sum = plane.normal.dot(&vector(&self.0, MEAN));
        self.along(&plane.normal, SQUARE) / count - height * (2.0 * sum / count - height)
    }

    /// Whether there is no plane whatever that [`Self::misfit`] would let pass. Most places that have none are told so without
    /// a fit.
    pub(crate) fn fits_none(&self, noise_factor: f64, flatness: f64) -> bool {
        let count = self.0[COUNT];
        let mean = vector(&self.0, MEAN) / count;
        let Symmetric3(products) = Symmetric3::of(&(mean * mean.transpose()));
        let noise = symmetric(&self.0, NOISE).trace() / count;
        let spread =
            Symmetric3(std::array::from_fn(|place| self.0[SQUARE + place] / count - products[place]));
        // The sum of the noise's variances is no less than that along any normal; the last factor is for rounding.
        spread.eigenvalue_lower_bound()
            > (noise_factor * noise_factor * noise + flatness * flatness) * (1.0 + 1e-9)
    }

    /// Variance that noise gives the points along a direction, on the mean.
    pub(crate) fn noise_along(&self, direction: &Vector3<f64>) -> f64 {
        self.along(direction, NOISE) / self.0[COUNT]
    }

    /// What is summed of a moment along a direction.
    fn along(&self, direction: &Vector3<f64>, first: usize) -> f64 {
        symmetric(&self.0, first).quadratic_form(direction)
    }
}

#[inline]
fn add(sums: &mut [f64; 16], others: &[f64; 16]) {
    sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
}

fn vector(sums: &[f64; 16], first: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&sums[first..first + 3])
}

fn symmetric(sums: &[f64; 16], first: usize) -> Symmetric3 {
    Symmetric3(std::array::from_fn(|place| sums[first + place]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::candidate::Candidate;
    use super::*;
    use crate::engine::consistent::block::Voxel;
    use crate::engine::consistent::noise::NoiseModel;
    use crate::engine::consistent::sums::ScanSums;

    /// A voxel with these points, in 1/4096 of its edge, each seen from this direction at this weight.
    fn state(cell: u16, points: &[[u64; 3]], towards: [f64; 3], weight: u64) -> State {
        let mut scan = ScanSums::default();
        points.iter().for_each(|&point| scan.add(point));
        let mut voxel = Voxel::new(Cell(cell));
        voxel.count = scan.count;
        voxel.moments.fold(&scan, weight, &Vector3::from(towards).normalize());
        State::new(&voxel)
    }

    /// Of any octant.
    fn direction() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(prop_oneof![-1.0..-0.1, 0.1..1.0])
    }

    fn noise() -> Noise {
        Noise::new(NoiseModel::default(), 0.08)
    }

    proptest! {
        #[test]
        fn a_misfit_by_sums_is_that_of_the_voxel(
            cell in 0_u16..512, points in prop::collection::vec(prop::array::uniform3(0_u64..4096), 1..40),
            towards in direction(), weight in 1_u64..10_000, normal in direction(), point in prop::array::uniform3(-1.0..9.0),
        ) {
            let state = state(cell, &points, towards, weight);
            let normal = UnitVector3::new_normalize(Vector3::from(normal));
            let plane = Plane { point: Vector3::from(point), normal };
            let residuals = ResidualSums::one(&state, &noise());
            let by_sums = residuals.misfit(&plane, 2.0, 0.2);
            prop_assert_eq!(residuals.misfit_of_one(&plane, 2.0, 0.2), by_sums);
            prop_assert_eq!(residuals.is_one_allowed(&plane, 2.0, 0.2), by_sums <= 1.0);
            // What is stored of the points may have them closer together than a plane is thick; a voxel's misfit has not.
            let thickness = Symmetric3::of(&state.thickness(&noise())).quadratic_form(&normal).min(0.0);
            let one = by_sums - thickness / (4.0 * residuals.noise_along(&normal) + 0.04);
            let other = Candidate::new(&state, &noise()).misfit(&plane, 2.0, 0.2, f64::INFINITY);
            prop_assert_eq!(PlaneSums::one(&state, &noise()).is_seen_from(&plane), other.is_some());
            prop_assert!(other.is_none_or(|other| (one - other).abs() <= 1e-9 * (1.0 + other)), "{one} {other:?}");
        }

        #[test]
        fn where_it_is_told_at_once_that_no_plane_fits_the_best_one_does_not(
            voxels in prop::collection::btree_map(
                0_u16..512, prop::collection::vec(prop::array::uniform3(0_u64..4096), 1..40), 1..9,
            ),
            towards in direction(), weight in 1_u64..10_000, flatness in 0.1_f64..2.0,
        ) {
            let states: Vec<_> =
                voxels.iter().map(|(&cell, points)| state(cell, points, towards, weight)).collect();
            let mut residuals = ResidualSums::default();
            states.iter().for_each(|state| residuals.join(&ResidualSums::one(state, &noise())));
            // Every voxel as thick as it counts there, and all of them counting the same: the plane that lies nearest.
            let squares = symmetric(&residuals.0, SQUARE).matrix() / residuals.0[COUNT];
            let middle = vector(&residuals.0, MEAN) / residuals.0[COUNT];
            let normal = Eigen::of(&(squares - middle * middle.transpose())).normal;
            let plane = Plane { point: middle, normal: UnitVector3::new_normalize(normal) };
            prop_assert!(!residuals.fits_none(2.0, flatness) || residuals.misfit(&plane, 2.0, flatness) > 1.0);
        }
    }
}
