//! What follows from the voxels of the clusters that a scan has changed: their planes and footprints, and who has an id.

use super::Surfaces;
use crate::engine::consistent::block::Cell;
use crate::engine::consistent::cluster::content;
use crate::engine::consistent::graph::ComponentId;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::outline::footprint::{Axis, Footprint};
use crate::engine::consistent::patch::PatchId;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;

/// Voxels from which on a cluster is told of, and below which it no longer is.
const TOLD: u32 = 10;
const NO_LONGER_TOLD: u32 = 7;

impl Surfaces {
    /// Finds the planes of what has changed, and projects a cluster along another axis where its normal now leans well towards
    /// that, which costs its voxels, once in a while.
    pub(super) fn refit(&mut self, grid: &Grid) {
        for component in self.changed.clone() {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            // Without a plane before, its axis is one that it has by chance.
            let before = cluster.plane.is_some().then(|| cluster.footprint.axis());
            cluster.refit();
            cluster.footprint.tidy();
            let Some(normal) = cluster.plane.as_ref().map(|plane| plane.normal) else { continue };
            let axis = before.map_or_else(|| Axis::dominant(&normal), |axis| axis.kept(&normal));
            if axis != cluster.footprint.axis() {
                let footprint = self.footprint(grid, component, axis);
                if let Some(cluster) = self.clusters[component].as_mut() {
                    cluster.footprint = footprint;
                }
            }
        }
    }

    /// The footprint of a component from its voxels.
    pub(super) fn footprint(&self, grid: &Grid, component: ComponentId, axis: Axis) -> Footprint {
        let mut footprint = Footprint::new(axis);
        for &node in self.graph.nodes(component) {
            let Some(id) = self.patches[node] else { continue };
            self.for_each_voxel(grid, node, id, |block, state| {
                let here = &self.segmented[block];
                let is_thin = here.is_thin(state, &self.rules);
                if let Some(key) = here.voxel_key(state.cell()).filter(|_| !is_thin) {
                    footprint.add(axis.column(key), &content(state, axis));
                }
            });
        }
        footprint
    }

    /// Gives ids to clusters that have become large enough and have a plane, and takes them from those that no longer are or
    /// have.
    pub(super) fn grant_ids(&mut self, now: Now) {
        let mut new = Vec::new();
        for &component in &self.changed {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            // Where all voxels of a patch have gone to broader ones, what lies beside it has no plane.
            let (voxels, has_shape) = (cluster.voxels, cluster.has_shape());
            let identity = &mut cluster.identity;
            identity.count(voxels, now.sequence);
            if identity.id.is_none() && voxels >= TOLD && has_shape {
                new.push(component);
            } else if voxels < NO_LONGER_TOLD || !has_shape {
                self.removed.extend(identity.id.take());
            }
        }
        // The order of components depends on what was there before, which must not decide.
        new.sort_by_cached_key(|&component| self.first_voxel(component));
        for component in new {
            self.ids_given += 1;
            if let Some(cluster) = self.clusters[component].as_deref_mut() {
                (cluster.identity.id, cluster.identity.revision) = (ClusterId::new(self.ids_given), 0);
            }
        }
        for &component in &self.changed {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            let counted = if cluster.identity.id.is_some() { cluster.voxels } else { 0 };
            self.counted.count(std::mem::replace(&mut cluster.counted, counted), counted);
        }
    }

    /// The first voxel of a component's patches, by the corner of its block and its cell.
    fn first_voxel(&self, component: ComponentId) -> Option<([i32; 3], Cell)> {
        let ids = self.graph.nodes(component).iter().filter_map(|&node| self.patches[node]);
        let first = |id: PatchId| self.segmented.patch(id).cells.iter().next();
        ids.filter_map(|id| Some((self.segmented[id.block].corner(), first(id)?))).min()
    }
}
