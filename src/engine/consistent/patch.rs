//! A patch: the planar piece of a surface that lies in one block, and when two of them are one surface.
//!
//! Positions are in voxels from the corner of voxel (0, 0, 0).

use nalgebra::{Matrix3, Vector3};

use super::block::EDGE;
use super::cells::Cells;
use super::region::{Fit, Region};
use super::rules::Rules;
use super::state::{Plane, State};

#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Its voxels.
    pub(super) cells: Cells,
    pub(super) plane: Plane,
    /// Mean and mean square of its points' places, every voxel counting the same.
    mean: Vector3<f64>,
    square: Matrix3<f64>,
    /// Variance of its points along its normal that is noise.
    noise: f64,
    /// It is of the second growth: its points lie on its plane only roughly.
    is_rough: bool,
    /// It reaches no further into its block than two rows: its plane may be the cut that the block makes of another one's
    /// scatter.
    is_cut: bool,
    /// Variance of the plane's tilt about its most uncertain axis (rad^2).
    tilt_variance: f64,
    /// Variance of the plane's place at its middle, along the normal.
    offset_variance: f64,
}

/// Where two patches come within two voxels of each other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Contact {
    /// Number of pairs of voxels.
    pub(super) pairs: u32,
    /// Sum of the cells' middles over the pairs' voxels, two a pair.
    pub(super) sum: Vector3<f64>,
}

/// Rows of voxels at a face of a block that a whole surface is not known by.
const CUT: i32 = 2;

/// Pairs of voxels that make a contact.
const MIN_PAIRS: u32 = 3;
/// Standard deviations by which planes that are badly known may differ more.
const JOIN_SIGMAS: f64 = 3.0;
/// What a badly known plane excuses at most (rad): 20 degrees.
const MAX_JOIN_ANGLE: f64 = 0.35;

impl Patch {
    /// `None` where the states span no plane; `corner` is that of their block.
    pub(super) fn new(states: &[&State], corner: &Vector3<f64>, is_rough: bool) -> Option<Self> {
        let region = Region::of(states.iter().copied());
        let Fit { plane, variances } = region.fit()?;
        let count = states.len() as f64;
        let mean = states.iter().map(|state| state.mean()).sum::<Vector3<f64>>() / count;
        let apart = |state: &&&State| {
            let from_mean = state.mean() - mean;
            state.spread() + from_mean * from_mean.transpose()
        };
        Some(Self {
            mean: mean + corner,
            square: states.iter().map(|state| apart(&state)).sum::<Matrix3<f64>>() / count,
            noise: states.iter().map(|state| state.noise_along(&plane.normal)).sum::<f64>() / count,
            cells: states.iter().map(|state| state.cell).collect(),
            plane: Plane { point: plane.point + corner, ..plane },
            is_rough,
            is_cut: is_cut(states),
            tilt_variance: 1.0 / (region.weight() * variances[1]),
            offset_variance: 1.0 / region.weight(),
        })
    }

    /// Whether what it shows may be a slice of another's noise: its points scatter much, or lie on no plane.
    pub(super) fn may_be_slice(&self, rules: &Rules) -> bool {
        self.is_rough || self.noise > rules.noisy * rules.noisy
    }

    pub(super) fn has_less_noise(&self, other: &Self) -> bool {
        self.noise < other.noise
    }

    pub(super) const fn is_rough(&self) -> bool {
        self.is_rough
    }

    pub(super) const fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// How well its points lie on the plane of a patch with much less noise whose scatter it may be, or of a flat one whose
    /// rim a rough one may be, up to 1; `None` where it is no such slice.
    pub(super) fn slice_of(&self, other: &Self, rules: &Rules) -> Option<f64> {
        let (a, b) = (&self.plane, &other.plane);
        let sharper = if self.is_rough {
            !other.is_rough
        } else {
            other.noise <= rules.sharper * rules.sharper * self.noise
                && a.normal.dot(&b.normal) >= rules.slice_angle.cos()
        };
        if !self.may_be_slice(rules) || !sharper || a.normal.dot(&b.normal) <= 0.0 {
            return None;
        }
        Some(self.misfit(other, rules)).filter(|misfit| *misfit <= 1.0)
    }

    /// How far its points are off the plane of another, by what is allowed of a slice.
    pub(super) fn misfit(&self, other: &Self, rules: &Rules) -> f64 {
        let normal = &other.plane.normal;
        let off = normal.dot(&(self.mean - other.plane.point));
        let square = off * off + normal.dot(&(self.square * normal.into_inner()));
        let flatness = rules.rim_flatness * rules.rim_flatness;
        square / (rules.rim_noise_factor * rules.rim_noise_factor * self.noise + flatness)
    }

    /// Whether two patches that meet so are one surface; a rough one is none with a flat one. Free of order.
    pub(super) fn joins(&self, other: &Self, contact: &Contact, rules: &Rules) -> bool {
        if contact.pairs < MIN_PAIRS || self.is_rough != other.is_rough {
            return false;
        }
        let (most_angle, most_offset) = if self.is_rough {
            (rules.rough_angle, rules.rough_offset)
        } else {
            (rules.join_angle, rules.join_offset)
        };
        let (a, b) = (&self.plane, &other.plane);
        let angle = a.normal.dot(&b.normal).clamp(-1.0, 1.0).acos();
        let tilt_sigma = (self.tilt_variance + other.tilt_variance).sqrt();
        if angle > (JOIN_SIGMAS * tilt_sigma).clamp(most_angle, MAX_JOIN_ANGLE.max(most_angle)) {
            return false;
        }
        let meeting = contact.sum / (2.0 * f64::from(contact.pairs));
        // The meeting lies within a voxel of both planes; the heights of the planes above it are compared.
        let heights = [a, b].map(|plane| plane.normal.dot(&(meeting - plane.point)));
        let lever = |patch: &Self| (meeting - patch.plane.point).norm_squared() * patch.tilt_variance;
        let variance = self.offset_variance + other.offset_variance + lever(self) + lever(other);
        // Where a block ends within the scatter, each of the two sees one side of it.
        let cut = rules.cut * (self.noise.sqrt() + other.noise.sqrt());
        let allowed = (JOIN_SIGMAS * variance.sqrt()).clamp(most_offset, 2.0 * most_offset) + cut;
        (heights[0] - heights[1]).abs() <= allowed
    }
}

fn is_cut(states: &[&State]) -> bool {
    (0..3).any(|axis| {
        let mut rows = states.iter().map(|state| state.cell.coordinates()[axis]);
        rows.clone().all(|row| row < CUT) || rows.all(|row| row >= EDGE - CUT)
    })
}
