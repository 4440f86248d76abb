//! A patch: the planar piece of a surface that lies in one block, and when it is a slice of another.
//!
//! Positions are in voxels from the corner of voxel (0, 0, 0).

use nalgebra::{Matrix3, UnitVector3, Vector3};

use super::block::{BlockIndex, EDGE};
use super::cells::Cells;
use super::noise::Noise;
use super::region::{Fit, Region};
use super::rules::{RIM_NOISE_FACTOR, Rules};
use super::state::{Plane, State};
use crate::engine::symmetric::{along, quadratic, upper};

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
    pub(super) fn share(self, state: &State, noise: &Noise) -> Region {
        if self == Self::Strip { Region::points(state, noise) } else { Region::one(state, noise) }
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
/// Part of a noisy patch's noise, as standard deviations, that the one which it is a slice of has at most.
const SHARPER: f64 = 0.75;
/// Angle between the normals of a noisy or folded patch and the one that it is a slice of, at most (rad).
const SLICE_ANGLE: f64 = 0.6;
/// Angle between the normals of a patch and another that it lies on without meeting it, at most (rad).
const BESIDE_ANGLE: f64 = 0.4;
/// Misfit of a slice, at most: scatters of a pillar seen from 6 m have 1.1 on the nearer ones' planes, and from 1.25 on a
/// wall takes in a door that stands ajar.
const SLICE: f64 = 1.1;
/// Misfit of a folded slice, at most: half of it lies off the plane of the one that it is taken to be a slice of.
const FOLDED_SLICE: f64 = 2.0;
/// What a voxel of a rough patch counts in a plane by one of a flat patch: where a jamb meets the leaf of its door, voxels hold
/// both, and turned the leaf's plane by 3 degrees.
const ROUGH: f64 = 0.1;
/// Angle from which on two planes that meet within a patch are no single one (rad).
const FOLD_ANGLE: f64 = 0.12;
/// Voxels to either side of a crease, at least.
const FLANK: f64 = 6.0;
/// Part of a patch's variance across its narrow side that lies along its normal, where a crease of [`FOLD_ANGLE`] runs
/// through its middle: 0.0009. Where there is less, as in most patches, none does.
const CREASED: f64 = 0.0009;
/// Standard deviation of noise along the normal, in voxels, up to which a crease is looked for: the foot of a ramp 6 m away is
/// noisy, and ties the ramp to the floor.
const CREASE_NOISE: f64 = 0.45;
/// Standard deviations by which flanks that are badly known may differ more. A broad patch that is taken to be folded and is not
/// loses little: one that is folded and not taken to be ties two surfaces together.
const FOLD_SIGMAS: f64 = 1.5;
/// Standard deviations by which badly known flanks of a narrow patch may differ more: it may be the only bridge between two parts
/// of a surface.
const NARROW_FOLD_SIGMAS: f64 = 3.0;
/// A patch is much broader than another where its variance across its narrow side is this many times the other's.
const BROADER: f64 = 2.0;

impl Patch {
    /// `None` where the states span no plane; `corner` is that of their block.
    pub(super) fn new(states: &[&State], corner: &Vector3<f64>, kind: Kind, rules: &Rules) -> Option<Self> {
        let noise = &rules.noise;
        let region = Region::sum(states.iter().map(|state| kind.share(state, noise)));
        let fit = region.fit()?;
        let Fit { plane, variances } = fit;
        let count = states.len() as f64;
        let mean = states.iter().map(|state| state.mean()).sum::<Vector3<f64>>() / count;
        let blur = states.iter().map(|state| state.blur(noise).covariance()).sum::<Matrix3<f64>>() / count;
        let apart = |state: &&&State| {
            let from_mean = state.mean() - mean;
            state.spread() + from_mean * from_mean.transpose()
        };
        let towards = states.iter().map(|state| state.towards()).sum::<Vector3<f64>>() / count;
        let noise_variance = quadratic(&blur, &plane.normal);
        let shows_creases = noise_variance <= CREASE_NOISE * CREASE_NOISE;
        let square = states.iter().map(|state| apart(&state)).sum::<Matrix3<f64>>() / count;
        Some(Self {
            cells: states.iter().map(|state| state.cell()).collect(),
            point: plane.point + corner,
            normal: plane.normal.cast().into_inner(),
            mean: (mean - plane.point).cast(),
            square: single(upper(&square)),
            blur: single(upper(&blur)),
            towards: towards.cast(),
            noise: noise_variance as f32,
            breadth: variances[1] as f32,
            curvature: fit.curvature() as f32,
            tilt_variance: tilt_variance(&region, &fit) as f32,
            offset_variance: (1.0 / region.weight()) as f32,
            is_rough: kind == Kind::Rough,
            is_cut: is_cut(states),
            is_folded: kind == Kind::Flat && shows_creases && is_folded(states, &fit, rules),
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
        self.is_cut && !self.is_rough && !self.is_folded && !self.is_narrow()
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

    pub(super) const fn is_rough(&self) -> bool {
        self.is_rough
    }

    /// Whether a crease runs through it, as where a ramp meets the floor: its plane is that of neither.
    pub(super) const fn is_folded(&self) -> bool {
        self.is_folded
    }

    /// What one of its voxels counts in the plane of its cluster.
    pub(super) fn weight_of(&self, state: &State, noise: &Noise) -> f64 {
        state.weight_on(&self.normal(), noise) * if self.is_rough { ROUGH } else { 1.0 }
    }

    /// Whether each of its voxels may as well be another one's: it is cut, folded or narrow.
    pub(super) fn is_frayed(&self) -> bool {
        self.is_cut || self.is_folded || self.is_narrow()
    }

    /// How well its points lie on the plane of a patch whose slice it may be, up to 1: of a flat one where it is rough, of a
    /// whole one where it is folded, of one with less noise where it is noisy, of a much broader one where it is narrow, for its
    /// own normal may be any then. `None` where it is no such slice.
    pub(super) fn slice_of(&self, other: &Self, rules: &Rules) -> Option<f64> {
        let turn = self.normal().dot(&other.normal());
        let is_sharper = other.noise() <= SHARPER * SHARPER * self.noise();
        let may_be = if self.is_rough {
            turn > 0.0
        } else if self.is_folded {
            !other.is_folded && !other.is_narrow() && turn >= SLICE_ANGLE.cos()
        } else {
            self.is_noisy() && is_sharper && turn >= SLICE_ANGLE.cos()
                || self.is_narrow()
                    && f64::from(other.breadth) >= BROADER * f64::from(self.breadth)
                    && self.towards.dot(&other.normal) > 0.0
        };
        let may_be = may_be && !other.is_rough;
        let most = if self.is_folded { FOLDED_SLICE } else { SLICE };
        may_be.then(|| self.misfit(other, rules)).filter(|misfit| *misfit <= most)
    }

    /// Whether its points lie on the plane of another that it need not meet, as far as a slice's do.
    pub(super) fn lies_on(&self, other: &Self, rules: &Rules) -> bool {
        self.normal().dot(&other.normal()) >= BESIDE_ANGLE.cos() && self.misfit(other, rules) <= 1.0
    }

    /// How far its points are off the plane of another, by what is allowed of a slice.
    pub(super) fn misfit(&self, other: &Self, rules: &Rules) -> f64 {
        let (normal, off) = (other.normal(), other.height_of(&self.mean()));
        let square = off * off + along(self.square.map(f64::from), &normal);
        let noise = along(self.blur.map(f64::from), &normal);
        let flatness = rules.rim_flatness * rules.rim_flatness;
        square / (RIM_NOISE_FACTOR * RIM_NOISE_FACTOR * noise + flatness)
    }
}

fn single(entries: [f64; 6]) -> [f32; 6] {
    entries.map(|entry| entry as f32)
}

/// Whether a crease runs through a patch with this fit: the voxels to either side of its middle have planes of different
/// directions. Tried are the two axes of the grid that lie nearest to its plane, and their diagonals.
fn is_folded(states: &[&State], fit: &Fit, rules: &Rules) -> bool {
    if fit.variances[0] < CREASED * fit.variances[1] {
        return false;
    }
    let steepest = fit.plane.normal.iamax();
    let [a, b] = [1, 2].map(|next| Vector3::ith((steepest + next) % 3, 1.0));
    [a, b, a + b, a - b].iter().any(|across| is_folded_along(across, states, fit, rules))
}

fn is_folded_along(across: &Vector3<f64>, states: &[&State], fit: &Fit, rules: &Rules) -> bool {
    let Fit { plane, variances } = fit;
    let mut flanks = [Region::default(); 2];
    for state in states {
        let is_beyond = across.dot(&(state.mean() - plane.point)) > 0.0;
        flanks[usize::from(is_beyond)].join(&Region::one(state, &rules.noise));
    }
    if flanks.iter().any(|flank| flank.voxels() < FLANK) {
        return false;
    }
    let [Some(one), Some(other)] = flanks.map(|flank| flank.fit()) else { return false };
    let tilt_variance = tilt_variance(&flanks[0], &one) + tilt_variance(&flanks[1], &other);
    // Each flank faces the sensor by itself: one that is seen along its plane may have its normal on the other side.
    let angle = one.plane.normal.dot(&other.plane.normal).abs().min(1.0).acos();
    let (least, sigmas) = if variances[1] < NARROW {
        (rules.join_angle, NARROW_FOLD_SIGMAS)
    } else {
        (FOLD_ANGLE, FOLD_SIGMAS)
    };
    angle > least.max(sigmas * tilt_variance.sqrt())
}

/// Variance of the tilt of a region's plane about its most uncertain axis (rad^2).
fn tilt_variance(region: &Region, fit: &Fit) -> f64 {
    1.0 / (region.weight() * fit.variances[1])
}

fn is_cut(states: &[&State]) -> bool {
    (0..3).any(|axis| {
        let mut rows = states.iter().map(|state| state.cell().coordinates()[axis]);
        rows.clone().all(|row| row < CUT) || rows.all(|row| row >= EDGE - CUT)
    })
}

/// Patches of known surfaces, for tests.
#[cfg(test)]
pub(super) mod examples {
    use super::super::block::{Cell, Voxel};
    use super::super::sums::ScanSums;
    use super::*;
    use crate::engine::params::Params;

    /// Rows of eight voxels along x, each with points on the surface z = `height`(y) that is seen from above.
    pub(in super::super) fn rows(rows: std::ops::Range<i32>, height: impl Fn(f64) -> f64) -> Patch {
        rows_from(1.0, rows, height)
    }

    /// The same with the noise of a sensor at this distance (m).
    pub(in super::super) fn rows_from(
        distance: f64,
        rows: std::ops::Range<i32>,
        height: impl Fn(f64) -> f64,
    ) -> Patch {
        let (states, rules) = (states(distance, &Vector3::z(), rows, height), Rules::new(&Params::default()));
        let states: Vec<_> = states.iter().collect();
        Patch::new(&states, &Vector3::zeros(), Kind::Flat, &rules).unwrap()
    }

    /// The voxels of such rows, seen from this direction.
    pub(in super::super) fn states(
        distance: f64,
        towards: &Vector3<f64>,
        rows: std::ops::Range<i32>,
        height: impl Fn(f64) -> f64,
    ) -> Vec<State> {
        let noise = Params::default().noise_model();
        let mut states = Vec::new();
        for (x, y) in rows.flat_map(|y| (0..8).map(move |x| (x, y))) {
            let middle = f64::from(y) + 0.5;
            let z = height(middle).floor();
            let mut scan = ScanSums::default();
            for (a, b) in (0..64_u64).flat_map(|a| (0..64_u64).map(move |b| (a, b))) {
                let up = height(f64::from(y) + (b as f64 + 0.5) / 64.0) - z;
                scan.add([a * 64 + 32, b * 64 + 32, (up.clamp(0.0, 0.999) * 4096.0) as u64]);
            }
            let mut voxel = Voxel::new(Cell::at([x, y, z as i32]));
            voxel.count = scan.count;
            voxel.moments.fold(&scan, noise.weight(distance), towards);
            states.push(State::new(&voxel));
        }
        states
    }
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
            let [sure, unsure] = [&flat, &rough].map(|patch| patch.weight_of(&state, &noise));
            assert!(unsure > 0.0 && unsure <= 0.2 * sure, "{unsure} of {sure}");
        }
    }

    #[test]
    fn a_narrow_patch_on_a_broad_one_s_plane_is_a_slice_of_it_whatever_its_normal() {
        let rules = Rules::new(&Params::default());
        let floor = rows(0..5, |_| 2.3);
        let strip = rows(5..7, |y| 2.3 + 0.3 * (y - 6.0));
        let angle = floor.normal().angle(&strip.normal());
        assert!(angle > rules.join_angle, "{angle}");
        assert!(strip.may_be_slice() && strip.is_frayed());
        assert!(strip.slice_of(&floor, &rules).is_some());
        // Neither the other way round, nor of one that is no broader, nor where it rises from the floor.
        assert!(!floor.may_be_slice() && floor.slice_of(&strip, &rules).is_none());
        assert_eq!(strip.slice_of(&rows(3..5, |_| 2.3), &rules), None);
        assert_eq!(rows(5..7, |y| 2.3 + (y - 5.0)).slice_of(&floor, &rules), None);
    }

    #[test]
    fn a_patch_with_a_crease_is_a_slice_of_one_of_the_two_surfaces_and_what_is_bent_less_is_none() {
        let rules = Rules::new(&Params::default());
        let ramp = 18.0_f64.to_radians().tan();
        let [floor, foot] = [rows(0..8, |_| 2.3), rows(0..8, |y| 2.3 + ramp * (y - 4.0).max(0.0))];
        // By its direction it would be joined with either.
        assert!(floor.normal().angle(&foot.normal()) < rules.join_angle);
        assert!(foot.is_folded() && foot.is_frayed() && foot.may_be_slice());
        assert!(foot.slice_of(&floor, &rules).is_some());
        // Neither is a flat patch or a slope, nor what is bent over its whole length by as little.
        let slope = rows(0..8, |y| 2.3 + ramp * (y - 4.0));
        let bent = rows(0..8, |y| 2.3 + 0.01 * (y - 4.0) * (y - 4.0));
        assert!([&floor, &slope, &bent].iter().all(|patch| !patch.is_folded()));
        assert_eq!(
            foot.slice_of(&foot.clone(), &rules),
            None,
            "two folded ones would tie the surfaces together"
        );
    }

    #[test]
    fn what_is_bent_a_little_is_not_folded_because_one_flank_was_seen_from_behind() {
        let rules = Rules::new(&Params::default());
        // The sensor is above one flank's plane and below the other's.
        let grazing = Vector3::new(0.0, 1.0, 0.03).normalize();
        let is_folded = |bend: f64| {
            let states = states(1.0, &grazing, 0..8, |y| 2.3 + (bend / 2.0) * (y - 4.0).abs());
            let mut all = Region::default();
            states.iter().for_each(|state| all.join(&Region::one(state, &rules.noise)));
            let states: Vec<_> = states.iter().collect();
            is_folded_along(&Vector3::y(), &states, &all.fit().unwrap(), &rules)
        };
        assert_eq!([0.1, 0.2].map(is_folded), [false, true]);
    }
}
