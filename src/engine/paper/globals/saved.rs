//! The global clusters as plain data, and back.

use nalgebra::{UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Global, Globals, Moments};
use crate::engine::key::{ClusterId, VoxelKey};
use crate::engine::paper::extremes::Extremes;
use crate::engine::paper::grid::{Grid, Label};
use crate::engine::paper::saved::is_unit;
use crate::engine::saved::{MOST_REVISIONS, RestoreError, ensure};
use crate::engine::scan::Stamp;

/// All of [`Globals`] that does not follow from the voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedGlobals {
    slots: Vec<Option<SavedGlobal>>,
    parents: Vec<u32>,
    growths: Vec<(u64, u32)>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SavedGlobal {
    revision: u32,
    first_seen: Stamp,
    last_seen: Stamp,
    normal: Vector3<f64>,
    grown: u64,
    changed: u64,
}

impl SavedGlobals {
    pub(crate) const fn slots(&self) -> usize {
        self.slots.len()
    }

    /// What chains of slots and of growths rely on.
    fn check(&self, sequence: u64) -> Result<(), RestoreError> {
        let slots = self.slots.len();
        ensure(self.parents.len() == slots && u32::try_from(slots).is_ok(), || {
            format!("{slots} clusters with {} places", self.parents.len())
        })?;
        for ((slot, &parent), global) in (0..).zip(&self.parents).zip(&self.slots) {
            ensure(parent <= slot && (parent == slot) == global.is_some(), || {
                format!("cluster {slot} has been merged into {parent}: {global:?}")
            })?;
        }
        for global in self.slots.iter().flatten() {
            let possible = is_unit(&global.normal)
                && global.grown.max(global.changed) <= sequence
                && global.revision <= MOST_REVISIONS;
            ensure(possible, || format!("an impossible cluster after {sequence} scans: {global:?}"))?;
        }
        ensure(self.growths.is_sorted_by_key(|(scan, _)| *scan), || "growths are out of order".to_owned())?;
        let possible = |&(scan, slot): &(u64, u32)| scan <= sequence && (slot as usize) < slots;
        ensure(self.growths.iter().all(possible), || "a growth of no cluster or scan".to_owned())
    }
}

impl Globals {
    pub(crate) fn save(&self) -> SavedGlobals {
        let saved = |global: &Global| SavedGlobal {
            revision: global.revision,
            first_seen: global.first_seen,
            last_seen: global.last_seen,
            normal: global.normal.into_inner(),
            grown: global.grown,
            changed: global.changed,
        };
        SavedGlobals {
            slots: self.slots.iter().map(|slot| slot.as_deref().map(saved)).collect(),
            parents: self.parents.clone(),
            growths: self.growths.iter().copied().collect(),
        }
    }

    /// The clusters of the voxels of `grid`, whose labels are below the number of slots.
    pub(crate) fn restore(map: &SavedGlobals, grid: &Grid, sequence: u64) -> Result<Self, RestoreError> {
        map.check(sequence)?;
        // Until the first voxel comes.
        let origin = VoxelKey::new(0, 0, 0).unwrap_or_else(|| unreachable!("the origin is within reach"));
        let globals = (1..).zip(&map.slots).map(|(number, saved)| {
            let (id, saved) = (ClusterId::new(number)?, saved.as_ref()?);
            Some(Box::new(Global {
                id,
                revision: saved.revision,
                first_seen: saved.first_seen,
                last_seen: saved.last_seen,
                normal: UnitVector3::new_unchecked(saved.normal),
                moments: Moments::default(),
                point_count: 0,
                extremes: Extremes::of(origin),
                grown: saved.grown,
                changed: saved.changed,
                merged_from: Vec::new(),
                refine: false,
            }))
        });
        let mut globals = Self {
            slots: globals.collect(),
            parents: map.parents.clone(),
            growths: map.growths.iter().copied().collect(),
            ..Self::default()
        };
        globals.enter(grid);
        let empty = globals.living().find(|global| global.moments.count() == 0);
        ensure(empty.is_none(), || {
            format!("cluster {} has no voxel", empty.map_or(0, |global| global.id.get()))
        })?;
        Ok(globals)
    }

    /// Counts the voxels in their clusters.
    fn enter(&mut self, grid: &Grid) {
        for voxel in grid.voxels() {
            let Label::Global(slot) = voxel.label else { continue };
            let root = self.root(slot);
            let Some(global) = self.slots[root as usize].as_deref_mut() else { continue };
            if global.moments.count() == 0 {
                global.extremes = Extremes::of(voxel.key);
            }
            global.extremes.add(voxel.key);
            global.moments.add(voxel.centre());
            global.point_count += u64::from(voxel.count);
            self.clustered += 1;
        }
    }
}
