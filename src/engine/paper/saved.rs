//! A map of the method to the letter as plain data, and back.

use std::collections::HashSet;

use nalgebra::{Point3, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::globals::SavedGlobals;
use super::grid::{Grid, Label, Surface, Voxel};
use crate::engine::key::VoxelKey;
use crate::engine::params::{MAX_POINTS, Params};
use crate::engine::saved::{RestoreError, ensure};

/// All of a [`Cfodi`](super::Cfodi) but its parameters and the scans that it has taken in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedCfodi {
    pub(super) voxels: Vec<SavedVoxel>,
    pub(super) globals: SavedGlobals,
    pub(super) sensor: Point3<f64>,
}

/// A voxel; in the order of the grid's list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedVoxel {
    key: [i32; 3],
    count: u32,
    sum: [u64; 3],
    touched: u64,
    surface: Option<(Vector3<f64>, f32)>,
    /// Slot of a global cluster, merged away or not.
    slot: Option<u32>,
}

impl SavedVoxel {
    pub(super) fn of(voxel: &Voxel) -> Self {
        Self {
            key: voxel.key.indices(),
            count: voxel.count,
            sum: voxel.sum,
            touched: voxel.touched,
            surface: voxel.surface.map(|surface| (surface.normal.into_inner(), surface.curvature)),
            slot: if let Label::Global(slot) = voxel.label { Some(slot) } else { None },
        }
    }

    fn restore(&self, slots: usize, params: &Params, sequence: u64) -> Result<Voxel, RestoreError> {
        let [ix, iy, iz] = self.key;
        let key = VoxelKey::new(ix, iy, iz).ok_or_else(|| {
            RestoreError::Contradiction(format!("voxel {:?} is beyond the grid's reach", self.key))
        })?;
        let holds = |holds, what: &str| ensure(holds, || format!("voxel {:?} {what}: {self:?}", self.key));
        holds((1..=MAX_POINTS).contains(&self.count), "has an impossible number of points")?;
        let most = u64::from(self.count) << 32;
        holds(self.sum.iter().all(|&sum| sum <= most), "has its centre outside")?;
        holds(self.touched <= sequence, "was touched by a scan to come")?;
        holds(self.slot.is_none_or(|slot| (slot as usize) < slots), "is in a cluster that is not there")?;
        holds(self.slot.is_some() == self.surface.is_some(), "has a normal and no cluster or the reverse")?;
        holds(self.surface.is_none() || self.count >= params.min_points(), "has a normal and is not dense")?;
        let surface = self.surface.map(|(normal, curvature)| {
            holds(is_unit(&normal) && (0.0..=0.34).contains(&curvature), "has an impossible normal")?;
            Ok(Surface { normal: UnitVector3::new_unchecked(normal), curvature })
        });
        Ok(Voxel {
            key,
            count: self.count,
            sum: self.sum,
            touched: self.touched,
            surface: surface.transpose()?,
            label: self.slot.map_or(Label::None, Label::Global),
        })
    }
}

/// Whether a vector is of length 1, as far as rounding lets it.
pub(super) fn is_unit(vector: &Vector3<f64>) -> bool {
    (vector.norm_squared() - 1.0).abs() < 1e-9
}

/// The grid of these voxels; their clusters have `slots` slots.
pub(super) fn grid(
    voxels: &[SavedVoxel],
    slots: usize,
    params: &Params,
    sequence: u64,
) -> Result<Grid, RestoreError> {
    let voxels: Result<Vec<_>, _> =
        voxels.iter().map(|voxel| voxel.restore(slots, params, sequence)).collect();
    let voxels = voxels?;
    let keys: HashSet<_> = voxels.iter().map(|voxel| voxel.key).collect();
    ensure(keys.len() == voxels.len(), || format!("{} voxels at {} places", voxels.len(), keys.len()))?;
    Ok(Grid::of(params.voxel_size(), params.min_points(), voxels))
}
