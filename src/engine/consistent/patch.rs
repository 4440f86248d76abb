//! A patch: the planar piece of a surface that lies in one block.
//!
//! Positions are in voxels from the corner of voxel (0, 0, 0).
//!
//! `segment` gathers the voxels of a block to patches, by sums that planes are fitted to (`plane_sums`), and `segmented` holds what it
//! has found. `contacts` tells where patches touch, within a block and across its border; `meet` does so for a whole map. Which of
//! these are one surface say `slice`, `fold` and `join`, and `host` for what is a part of another. `owner` finds the patch of a loose
//! voxel, which is a `candidate` for several.

mod candidate;
pub(super) mod contacts;
#[cfg(test)]
pub(super) mod examples;
mod fold;
pub(super) mod host;
mod join;
pub(super) mod meet;
pub(super) mod owner;
pub(super) mod plane_sums;
pub(super) mod segment;
pub(super) mod segmented;
mod slice;

use nalgebra::{Matrix3, UnitVector3, Vector3};

use self::fold::is_folded;
use self::plane_sums::{Fit, PlaneSums};
use super::block::{BlockIndex, EDGE};
use super::cells::Cells;
use super::noise::Noise;
use super::plane::Plane;
use super::rules::Rules;
use super::state::State;
use crate::engine::symmetric::{Symmetric3, quadratic};

/// What a voxel counts in the fit of a plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    /// Inverse variance of its mean, in voxels^-2; a tenth of it in a rough patch, whose points lie off its plane.
    pub(super) most: f64,
    /// The part of that which it counts, 0 to 1: it may hold what is not of the plane.
    pub(super) part: f64,
}

/// How a patch was grown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Its voxels' means lie on a plane.
    Flat,
    /// The points of its voxels do, of which there may be one row.
    Strip,
    /// Its points lie on its plane only roughly.
    Rough,
}

impl Kind {
    /// What a voxel adds to the fit of a plane.
    pub(super) fn share(self, state: &State, noise: &Noise) -> PlaneSums {
        if self == Self::Strip { PlaneSums::points(state, noise) } else { PlaneSums::one(state, noise) }
    }

    /// Least variance across its narrow side that a plane is known by, in voxels^2: the means of two rows of voxels have
    /// 0.25, the points of one have 0.08.
    pub(super) const fn least_breadth(self) -> f64 {
        if matches!(self, Self::Strip) { 0.05 } else { 0.2 }
    }

    /// Least number of voxels that a seed's plane is fitted to.
    pub(super) const fn least_window(self) -> usize {
        if matches!(self, Self::Strip) { 3 } else { 4 }
    }
}

/// Which patch: its block, and its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct PatchId {
    pub(super) block: BlockIndex,
    pub(super) number: u8,
}

/// What a patch is a part of, by the patches that it meets (`host`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Host {
    /// Of nothing but its cluster.
    #[default]
    None,
    /// It is a slice of this sharper, broader or whole patch.
    SliceOf(PatchId),
    /// It is a bridge between two surfaces, with a plane that may agree with both and is that of neither. Of the patches at
    /// its ends it is a part of this one.
    BridgeTo(PatchId),
}

impl Host {
    pub(super) const fn patch(self) -> Option<PatchId> {
        match self {
            Self::None => None,
            Self::SliceOf(id) | Self::BridgeTo(id) => Some(id),
        }
    }

    pub(super) const fn is_bridge(self) -> bool {
        matches!(self, Self::BridgeTo(_))
    }

    /// The same patch, in the slot that its block has got.
    pub(super) fn moved(self, moved: impl Fn(PatchId) -> PatchId) -> Self {
        match self {
            Self::None => Self::None,
            Self::SliceOf(id) => Self::SliceOf(moved(id)),
            Self::BridgeTo(id) => Self::BridgeTo(moved(id)),
        }
    }
}

/// A patch. Four of them stand in a block: but for its place, it is kept in single precision.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Its voxels.
    pub(super) cells: Cells,
    /// A point of its plane.
    point: Vector3<f64>,
    normal: Vector3<f32>,
    /// Mean of its points' places from that point, every voxel counting the same.
    mean: Vector3<f32>,
    /// Mean square of its points' places from their mean: xx, xy, xz, yy, yz, zz.
    square: [f32; 6],
    /// Covariance that noise gives its points: the same.
    blur: [f32; 6],
    /// Mean direction towards the sensor.
    towards: Vector3<f32>,
    /// Variance of its points along its normal that is noise.
    noise: f32,
    /// Variance of its voxels across its narrow side, in voxels^2.
    breadth: f32,
    /// The smallest variance of what its plane is fitted to over the sum.
    curvature: f32,
    /// Variance of the plane's tilt about its most uncertain axis (rad^2).
    tilt_variance: f32,
    /// Variance of the plane's place at its middle, along the normal.
    offset_variance: f32,
    /// Its points lie on its plane only roughly.
    is_rough: bool,
    /// It reaches no further into its block than two rows: its plane may be the cut that the block makes of another one's
    /// scatter.
    is_cut: bool,
    /// A crease runs through it.
    is_folded: bool,
    pub(super) host: Host,
}

/// Rows of voxels at a face of a block that a whole surface is not known by.
const CUT: i32 = 2;

/// Variance across its narrow side, in voxels^2, below which a patch is narrow: three rows and a half.
const NARROW: f64 = 1.0;
/// Standard deviation of noise, in voxels, from which on a patch may be a slice of another's scatter.
const NOISY: f64 = 0.25;
/// What a voxel of a rough patch counts in a plane by one of a flat patch: where a jamb meets the leaf of its door, voxels hold
/// both, and turned the leaf's plane by 3 degrees.
const ROUGH: f64 = 0.1;

impl Patch {
    /// `None` of fewer than three states; `corner` is that of their block.
    pub(super) fn new(states: &[&State], corner: &Vector3<f64>, kind: Kind, rules: &Rules) -> Option<Self> {
        let noise = &rules.noise;
        let sums = PlaneSums::sum(states.iter().map(|state| kind.share(state, noise)));
        let fit = sums.fit()?;
        let Fit { plane, variances } = fit;
        let count = states.len() as f64;
        let mean = states.iter().map(|state| state.mean()).sum::<Vector3<f64>>() / count;
        let blur = states.iter().map(|state| state.blur(noise).covariance()).sum::<Matrix3<f64>>() / count;
        let apart = |state: &&&State| {
            let from_mean = state.mean() - mean;
            state.covariance() + from_mean * from_mean.transpose()
        };
        let towards = states.iter().map(|state| state.towards()).sum::<Vector3<f64>>() / count;
        let noise_variance = quadratic(&blur, &plane.normal);
        let square = states.iter().map(|state| apart(&state)).sum::<Matrix3<f64>>() / count;
        Some(Self {
            cells: states.iter().map(|state| state.cell()).collect(),
            point: plane.point + corner,
            normal: plane.normal.cast().into_inner(),
            mean: (mean - plane.point).cast(),
            square: single(&square),
            blur: single(&blur),
            towards: towards.cast(),
            noise: noise_variance as f32,
            breadth: variances[1] as f32,
            curvature: fit.curvature() as f32,
            tilt_variance: tilt_variance(&sums, &fit) as f32,
            offset_variance: (1.0 / sums.weight()) as f32,
            is_rough: kind == Kind::Rough,
            is_cut: is_cut(states),
            is_folded: kind == Kind::Flat && is_folded(states, &fit, noise_variance, rules),
            host: Host::default(),
        })
    }

    pub(super) fn plane(&self) -> Plane {
        Plane { point: self.point, normal: self.normal() }
    }

    pub(super) fn normal(&self) -> UnitVector3<f64> {
        UnitVector3::new_unchecked(self.normal.cast())
    }

    /// Mean of its points' places, every voxel counting the same.
    pub(super) fn mean(&self) -> Vector3<f64> {
        self.point + self.mean.cast()
    }

    /// Variance of its points along its normal that is noise.
    pub(super) fn noise(&self) -> f64 {
        self.noise.into()
    }

    /// The smallest variance of what its plane is fitted to over the sum: 0 (flat) to 1/3.
    pub(super) const fn curvature(&self) -> f32 {
        self.curvature
    }

    /// Variance of the plane's tilt about its most uncertain axis (rad^2).
    pub(super) fn tilt_variance(&self) -> f64 {
        self.tilt_variance.into()
    }

    /// Variance of the plane's height above a place: that at its middle, and what its tilt makes of the way there.
    pub(super) fn height_variance(&self, place: &Vector3<f64>) -> f64 {
        f64::from(self.offset_variance) + (place - self.point).norm_squared() * self.tilt_variance()
    }

    /// How far a place lies above its plane.
    pub(super) fn height_of(&self, place: &Vector3<f64>) -> f64 {
        self.normal().dot(&(place - self.point))
    }

    /// Whether what it shows may be a slice of another one: its points scatter much or lie on no plane, or on two, or it is too
    /// narrow for its plane to be known by its own voxels.
    pub(super) fn may_be_slice(&self) -> bool {
        self.is_rough || self.is_folded || self.is_noisy() || self.is_narrow()
    }

    /// Whether it may lie between two surfaces: where its block cuts off all but two rows, its plane may be any between theirs.
    pub(super) fn may_be_bridge(&self) -> bool {
        self.is_cut && self.is_whole()
    }

    pub(super) fn is_noisy(&self) -> bool {
        self.noise() > NOISY * NOISY
    }

    pub(super) fn is_narrow(&self) -> bool {
        f64::from(self.breadth) < NARROW
    }

    pub(super) fn has_less_noise(&self, other: &Self) -> bool {
        self.noise < other.noise
    }

    /// Whether its plane is that of one surface, known by its own voxels.
    pub(super) fn is_whole(&self) -> bool {
        !self.is_rough && !self.is_folded && !self.is_narrow()
    }

    pub(super) const fn is_rough(&self) -> bool {
        self.is_rough
    }

    /// Whether a crease runs through it, as where a ramp meets the floor: its plane is that of neither.
    pub(super) const fn is_folded(&self) -> bool {
        self.is_folded
    }

    /// What one of its voxels counts in the plane of its cluster.
    pub(super) fn weight_of(&self, state: &State, noise: &Noise) -> Weight {
        let most = state.mean_weight(noise) * if self.is_rough { ROUGH } else { 1.0 };
        Weight { most, part: state.part_on(&self.normal()) }
    }

    /// Whether each of its voxels may as well be another one's: it is cut, folded or narrow.
    pub(super) fn is_frayed(&self) -> bool {
        self.is_cut || self.is_folded || self.is_narrow()
    }
}

/// The entries of a symmetric matrix in single precision.
fn single(matrix: &Matrix3<f64>) -> [f32; 6] {
    Symmetric3::of(matrix).0.map(|entry| entry as f32)
}

/// Variance of the tilt of the plane of these sums about its most uncertain axis (rad^2).
fn tilt_variance(sums: &PlaneSums, fit: &Fit) -> f64 {
    1.0 / (sums.weight() * fit.variances[1])
}

fn is_cut(states: &[&State]) -> bool {
    (0..3).any(|axis| {
        let mut rows = states.iter().map(|state| state.cell().coordinates()[axis]);
        rows.clone().all(|row| row < CUT) || rows.all(|row| row >= EDGE - CUT)
    })
}

#[cfg(test)]
mod tests {
    use super::examples::{rows, states};
    use super::*;
    use crate::engine::params::Params;

    #[test]
    fn a_voxel_of_a_patch_that_lies_on_no_plane_says_little_about_that_of_its_cluster() {
        let flat = rows(0..4, |_| 2.3);
        let rough = Patch { is_rough: true, ..flat.clone() };
        let noise = Rules::new(&Params::default()).noise;
        for state in states(1.0, &Vector3::z(), 0..4, |_| 2.3) {
            let weight = |patch: &Patch| {
                let Weight { most, part } = patch.weight_of(&state, &noise);
                most * part
            };
            let [sure, unsure] = [&flat, &rough].map(weight);
            assert!(unsure > 0.0 && unsure <= 0.2 * sure, "{unsure} of {sure}");
        }
    }
}
