//! The global clusters as plain data, and back.

use std::collections::BTreeSet;

use nalgebra::{UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Global, Globals, Moments, is_complete};
use crate::engine::key::{ClusterId, VoxelKey};
use crate::engine::now::Now;
use crate::engine::paper::extremes::Extremes;
use crate::engine::paper::grid::{Grid, Label};
use crate::engine::paper::saved::is_unit;
use crate::engine::params::Params;
use crate::engine::saved::{MOST_REVISIONS, RestoreError, ensure, in_slots};
use crate::engine::scan::Stamp;

/// All of [`Globals`] that does not follow from the voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SavedGlobals {
    /// The clusters that live, with their slots.
    living: Vec<(u32, SavedGlobal)>,
    /// By slot: that of the living cluster that it has been merged into, or its own.
    roots: Vec<u32>,
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
        self.roots.len()
    }

    /// What a search for a cluster relies on.
    fn check(&self, sequence: u64) -> Result<(), RestoreError> {
        let slots = self.slots();
        ensure(u32::try_from(slots).is_ok(), || format!("{slots} clusters"))?;
        let globals = self.by_slot()?;
        for (slot, (&root, global)) in (0..).zip(self.roots.iter().zip(&globals)) {
            let lives = |slot: u32| globals.get(slot as usize).is_some_and(Option::is_some);
            ensure(root <= slot && lives(root) && (root == slot) == global.is_some(), || {
                format!("cluster {slot} has been merged into {root}: {global:?}")
            })?;
        }
        for (_, global) in &self.living {
            let possible = is_unit(&global.normal)
                && global.grown.max(global.changed) <= sequence
                && global.revision <= MOST_REVISIONS;
            ensure(possible, || format!("an impossible cluster after {sequence} scans: {global:?}"))?;
        }
        Ok(())
    }

    /// The clusters that may become complete, by the scan in which they grew last.
    fn growths(&self, params: &Params, now: Now) -> BTreeSet<(u64, u32)> {
        let growths = self.living.iter().map(|(slot, global)| (global.grown, *slot));
        growths.filter(|(grown, _)| !is_complete(*grown, params, now)).collect()
    }

    fn by_slot(&self) -> Result<Vec<Option<&SavedGlobal>>, RestoreError> {
        in_slots("cluster", &self.living, self.slots())
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
            living: (0..)
                .zip(&self.slots)
                .filter_map(|(slot, global)| Some((slot, saved(global.as_deref()?))))
                .collect(),
            roots: self.roots(),
        }
    }

    /// The clusters of the voxels of `grid`, whose labels are below the number of slots.
    pub(crate) fn restore(
        map: &SavedGlobals,
        grid: &Grid,
        params: &Params,
        now: Now,
    ) -> Result<Self, RestoreError> {
        map.check(now.sequence)?;
        // Until the first voxel comes.
        let origin = VoxelKey::new(0, 0, 0).unwrap_or_else(|| unreachable!("the origin is within reach"));
        let globals = (1..).zip(map.by_slot()?).map(|(number, saved)| {
            let (id, saved) = (ClusterId::new(number)?, saved?);
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
            parents: map.roots.clone(),
            growths: map.growths(params, now),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_that_were_merged_into_one_that_does_not_live_are_refused() {
        let stamp = Stamp::from_nanos(0);
        let global = SavedGlobal {
            revision: 0,
            first_seen: stamp,
            last_seen: stamp,
            normal: Vector3::z(),
            grown: 1,
            changed: 1,
        };
        let check = |roots: &[u32]| {
            SavedGlobals { living: vec![(0, global.clone())], roots: roots.to_vec() }.check(1)
        };
        assert_eq!(check(&[0, 0, 0]), Ok(()));
        for roots in [[0, 0, 1], [0, 2, 0], [0, 1, 0], [1, 0, 0], [0, 0, 9]] {
            assert!(check(&roots).is_err(), "{roots:?}");
        }
    }
}
