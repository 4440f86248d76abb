//! What the definition sees of a voxel: the moments of its points as they were published.
//!
//! Lengths are in voxels, positions relative to the corner of the block.

use nalgebra::{Matrix3, UnitVector3, Vector3};

use serde::{Deserialize, Serialize};

use super::block::{Block, Cell, Voxel};
use super::eigen::Spread;
use super::grid::Grid;
use super::published::{PARTS, in_parts};
use super::sums::{MOST_COVARIANCE, MOST_TOWARDS};
use super::symmetric::{area_across, least_at_least, symmetric, upper};
use crate::engine::binning::nearest;

/// What a voxel's mean is off by however many points it has, in voxels: the sensor's distortion, the cut at the border.
const BIAS: f64 = 0.03;

/// Points of a voxel whose errors are one error: neighbouring pixels err alike, and where points scatter over several
/// voxels, each holds a slice of them that counts by how many they are.
const ALIKE: f64 = 100.0;

fn mean_weight(depth_variance: f64, points: f64) -> f64 {
    1.0 / (depth_variance * ALIKE / points + BIAS * BIAS)
}

/// One over the product of the variances along two sides of a square of 1 that points cover evenly.
const FULL: f64 = 144.0;

/// Least variance of a voxel's points across the narrow side of their plane, in voxels^2, and most along its normal by that.
const OWN_BREADTH: f64 = 0.03;
const OWN_FLATNESS: f64 = 0.1;
/// The same of a voxel in a strip.
const SHEET_BREADTH: f64 = 0.02;
const SHEET_FLATNESS: f64 = 0.15;
/// Variance of noise up to which a voxel is sharp, in voxels^2: seen from 2 m at 5 cm.
const SHARP: f64 = 0.02;
/// How many times its spread counts then.
const SHEET: f64 = 2.0;
/// Units of what is kept of a covariance, in voxels^2, and of a direction.
const SPREAD_UNITS: f64 = 65536.0;
const DIRECTION_UNITS: f64 = 16384.0;

/// A dense voxel, published: the definition knows it to a 65536th of a voxel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct State {
    pub(super) cell: Cell,
    /// Number of points.
    pub(super) count: u32,
    /// Weighted mean of its points from its corner, in [`PARTS`] of its edge.
    mean: [u16; 3],
    /// Weighted covariance of its points: xx, xy, xz, yy, yz, zz.
    spread: [i16; 6],
    /// Mean direction towards the sensor, of length 1 at most.
    towards: [i16; 3],
    /// What its mean counts in a fit.
    mean_weight: f32,
    /// Mean variance of its points' depths.
    depth_variance: f32,
    /// Mean variance across their depth axis.
    lateral_variance: f32,
}

impl State {
    pub(super) fn new(grid: &Grid, voxel: &Voxel) -> Self {
        let moments = &voxel.moments;
        let metres_squared = grid.voxel_size() * grid.voxel_size();
        let depth_variance = grid.noise().depth_variance(moments.points.into(), moments.weight.into());
        let lateral_variance = grid.noise().lateral_variance(depth_variance);
        Self::of(&Plain {
            cell: voxel.cell,
            count: voxel.count,
            mean: moments.mean() + voxel.cell.corner(),
            spread: moments.covariance(),
            mean_weight: mean_weight(depth_variance / metres_squared, moments.points.into()),
            depth_variance: depth_variance / metres_squared,
            lateral_variance: lateral_variance / metres_squared,
            towards: moments.towards(),
        })
    }

    /// Rounded to what is kept.
    pub(super) fn of(plain: &Plain) -> Self {
        let whole = |value: f64| nearest(value) as i16;
        Self {
            cell: plain.cell,
            count: plain.count,
            mean: (plain.mean - plain.cell.corner()).map(in_parts).into(),
            spread: upper(&plain.spread).map(|spread| whole(spread * SPREAD_UNITS)),
            towards: plain.towards.map(|part| whole(part * DIRECTION_UNITS)).into(),
            mean_weight: plain.mean_weight as f32,
            depth_variance: plain.depth_variance as f32,
            lateral_variance: plain.lateral_variance as f32,
        }
    }

    pub(super) fn plain(&self) -> Plain {
        Plain {
            cell: self.cell,
            count: self.count,
            mean: self.mean(),
            spread: self.spread(),
            mean_weight: self.mean_weight(),
            depth_variance: self.depth_variance.into(),
            lateral_variance: self.lateral_variance.into(),
            towards: self.towards(),
        }
    }

    /// Weighted mean of its points.
    pub(super) fn mean(&self) -> Vector3<f64> {
        self.cell.corner() + self.offset()
    }

    /// The same from the voxel's corner.
    pub(super) fn offset(&self) -> Vector3<f64> {
        Vector3::from(self.mean.map(|part| f64::from(part) / PARTS))
    }

    /// Weighted covariance of its points.
    pub(super) fn spread(&self) -> Matrix3<f64> {
        symmetric(self.spread_entries())
    }

    fn spread_entries(&self) -> [f64; 6] {
        self.spread.map(|spread| f64::from(spread) / SPREAD_UNITS)
    }

    /// What its mean counts in a fit.
    pub(super) fn mean_weight(&self) -> f64 {
        self.mean_weight.into()
    }

    /// The same in a fit of a surface with this normal, the less the less of the voxel's cross section its points cover: at
    /// the rim of a surface they may be of the edge of a board.
    pub(super) fn weight_on(&self, normal: &Vector3<f64>) -> f64 {
        let covered = (FULL * area_across(self.spread_entries(), normal)).clamp(0.0, 1.0);
        self.mean_weight() * covered * covered
    }

    /// Mean direction towards the sensor, of length 1 at most.
    pub(super) fn towards(&self) -> Vector3<f64> {
        Vector3::from(self.towards.map(|part| f64::from(part) / DIRECTION_UNITS))
    }

    /// Covariance that noise alone gives its points.
    pub(super) fn noise(&self) -> Matrix3<f64> {
        let towards = self.towards();
        towards * towards.transpose() * self.deep(&towards) + Matrix3::from_diagonal_element(self.lateral())
    }

    /// What the variance of depths is more than that across them, for the direction to the sensor squared.
    pub(super) fn deep(&self, towards: &Vector3<f64>) -> f64 {
        (f64::from(self.depth_variance) - self.lateral()) / towards.norm_squared().max(1e-18)
    }

    /// Mean variance across the depth axis.
    pub(super) fn lateral(&self) -> f64 {
        self.lateral_variance.into()
    }

    /// The plane of its own points, where they lie on one.
    pub(super) fn own_plane(&self) -> Option<Plane> {
        let Spread { variances, normal } = self.flat_spread(OWN_FLATNESS)?;
        let is_flat = variances[1] >= OWN_BREADTH && variances[0] <= OWN_FLATNESS * variances[1];
        let normal = if normal.dot(&self.towards()) < 0.0 { -normal } else { normal };
        is_flat.then(|| Plane { point: self.mean(), normal: UnitVector3::new_normalize(normal) })
    }

    /// Whether its points lie on a plane, be it of half a row.
    pub(super) fn is_sheet(&self) -> bool {
        self.flat_spread(SHEET_FLATNESS).is_some_and(|Spread { variances, .. }| {
            variances[1] >= SHEET_BREADTH && variances[0] <= SHEET_FLATNESS * variances[1]
        })
    }

    /// How its points spread; `None` where it is seen at once that their least variance is more than that part of the next,
    /// which is half of all at most.
    fn flat_spread(&self, flatness: f64) -> Option<Spread> {
        let entries = self.spread_entries();
        let half = 0.5 * (entries[0] + entries[3] + entries[5]);
        (least_at_least(entries) <= flatness * half).then(|| Spread::of(&symmetric(entries)))
    }

    fn is_sharp(&self) -> bool {
        f64::from(self.depth_variance) <= SHARP
    }

    /// How its points spread about a plane, which counts more where they are sharp: a voxel in which a surface shows as a
    /// sheet lies on no plane across that sheet, even where its mean does.
    pub(super) fn thickness(&self) -> Matrix3<f64> {
        self.spread() * if self.is_sharp() { SHEET } else { 1.0 }
    }
}

/// A state in numbers, as it is saved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Plain {
    pub(super) cell: Cell,
    count: u32,
    mean: Vector3<f64>,
    spread: Matrix3<f64>,
    mean_weight: f64,
    depth_variance: f64,
    lateral_variance: f64,
    towards: Vector3<f64>,
}

impl Plain {
    /// Whether it can be that of a voxel's points: numbers within the bounds that they have there.
    pub(super) fn is_possible(&self) -> bool {
        let offsets = self.mean - self.cell.corner();
        let within = |value: f64, low: f64, high: f64| (low..=high).contains(&value);
        self.count > 0
            && offsets.iter().all(|&offset| within(offset, 0.0, 1.0))
            && self.spread.iter().all(|&entry| within(entry, -MOST_COVARIANCE, MOST_COVARIANCE))
            && self.spread == self.spread.transpose()
            && self.mean_weight >= f32::MIN_POSITIVE.into()
            && self.mean_weight <= (1.0 / (BIAS * BIAS)).next_up()
            && within(self.depth_variance, 0.0, 1e9)
            && within(self.lateral_variance, 0.0, 1e9)
            && self.towards.iter().all(|&part| within(part, -MOST_TOWARDS, MOST_TOWARDS))
    }
}

/// A plane in space, with the side it is seen from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) point: Vector3<f64>,
    /// Towards the side it was seen from.
    pub(super) normal: UnitVector3<f64>,
}

/// The dense voxels of a block as they are now, by ascending cell.
pub(super) fn states(grid: &Grid, block: &Block) -> Vec<State> {
    let voxels = block.voxels();
    let dense = voxels.iter().filter(|voxel| grid.is_dense(voxel));
    let mut states = Vec::with_capacity(block.dense as usize);
    states.extend(dense.map(|voxel| State::new(grid, voxel)));
    states
}
