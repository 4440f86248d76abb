//! What follows from the voxels of the clusters that a scan has changed: their planes and footprints.

use super::Surfaces;
use crate::engine::consistent::cluster::content;
use crate::engine::consistent::graph::ComponentId;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::outline::footprint::{Axis, Footprint};

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
}
