//! Sums over voxel means, from which planes are fitted.
//!
//! A voxel's mean counts by 1 / (noise / points + bias^2): noise averages away, what the sensor and the grid get wrong
//! does not, so that beyond some points all voxels count the same. Fitting means instead of points keeps the scatter along
//! the ray, which is seldom along the normal, out of the fit.

use nalgebra::{Matrix3, UnitVector3, Vector3};

use super::block::Cell;
use super::eigen::Spread;
use super::state::{Plane, State};

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Region {
    pub(super) voxels: u32,
    weight: f64,
    sum: Vector3<f64>,
    outer: Matrix3<f64>,
    /// Sum of the voxels' directions towards the sensor.
    towards: Vector3<f64>,
}

/// The plane of a region and how far its voxels spread.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) plane: Plane,
    /// Variances of the means, ascending, in voxels^2.
    pub(super) variances: [f64; 3],
}

impl Region {
    pub(super) fn of<'a>(states: impl IntoIterator<Item = &'a State>) -> Self {
        let mut region = Self::default();
        states.into_iter().for_each(|state| region.add(state));
        region
    }

    /// The states of a block (ascending) around a cell, itself included.
    pub(super) fn around(states: &[State], cell: Cell) -> Self {
        let at = cell.coordinates();
        let is_near = |state: &&State| (0..3).all(|i| (state.cell.coordinates()[i] - at[i]).abs() <= 1);
        Self::of(states.iter().filter(is_near))
    }

    pub(super) fn add(&mut self, state: &State) {
        let weight = state.mean_weight;
        self.voxels += 1;
        self.weight += weight;
        self.sum += weight * state.mean;
        self.outer += weight * state.mean * state.mean.transpose();
        self.towards += state.towards;
    }

    /// Inverse variance of the plane at its middle, in voxels^-2.
    pub(super) const fn weight(&self) -> f64 {
        self.weight
    }

    /// `None` for fewer than three voxels.
    pub(super) fn fit(&self) -> Option<Fit> {
        if self.voxels < 3 {
            return None;
        }
        let point = self.sum / self.weight;
        let Spread { variances, normal } =
            Spread::of(&(self.outer / self.weight - point * point.transpose()));
        let normal = if normal.dot(&self.towards) < 0.0 { -normal } else { normal };
        let variances = variances.map(|variance| variance.max(0.0));
        Some(Fit { plane: Plane { point, normal: UnitVector3::new_normalize(normal) }, variances })
    }
}
