//! The clusters as plain data, and back: every patch, contact, join and sum is found anew.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::Surfaces;
use super::waiting::Waits;
use crate::engine::consistent::block::{Block, CELLS};
use crate::engine::consistent::cluster::{Cluster, Identity, Standing};
use crate::engine::consistent::describe::shape_of;
use crate::engine::consistent::graph::{ComponentId, Graph, NodeId, NodeLists, Slots};
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::lists::by::By;
use crate::engine::consistent::outline::footprint::{Axis, Footprint};
use crate::engine::consistent::patch::PatchId;
use crate::engine::consistent::patch::host::joined_with;
use crate::engine::consistent::patch::meet::meet_all;
use crate::engine::consistent::patch::segmented::Segmented;
use crate::engine::consistent::rules::Rules;
use crate::engine::consistent::saved::SavedState;
use crate::engine::key::ClusterId;
use crate::engine::params::Params;
use crate::engine::saved::{MOST_REVISIONS, RestoreError, ensure, ensure_counted, in_slots};

/// Least part of a plane's unit normal along the axis that its outline is drawn along; along one that is kept it has 0.51 or more
/// ([`Axis::kept`]).
const LEAST_ALONG: f64 = 0.5;

/// All of [`Surfaces`] that does not follow from the states of the voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in super::super) struct SavedSurfaces {
    /// By block: the nodes of its patches, by number.
    pub(super) nodes: NodeLists,
    pub(super) slots: Slots,
    /// With their components.
    pub(super) clusters: Vec<(u32, SavedCluster)>,
    pub(super) ids_given: u64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct SavedCluster {
    identity: Identity,
    /// The axis along which its footprint is projected: 0 to 2.
    axis: u8,
    told: Option<Standing>,
}

impl SavedCluster {
    fn of(cluster: &Cluster) -> Self {
        let told = cluster.told.as_deref().map(Standing::of);
        Self { identity: cluster.identity.clone(), axis: cluster.footprint.axis().index() as u8, told }
    }

    pub(super) const fn id(&self) -> Option<ClusterId> {
        self.identity.id
    }
}

impl Surfaces {
    /// The clusters, with their components.
    pub(super) fn save_clusters(&self) -> Vec<(u32, SavedCluster)> {
        let clusters = (0..).zip(self.clusters.iter());
        clusters
            .filter_map(|(component, cluster)| Some((component, SavedCluster::of(cluster.as_deref()?))))
            .collect()
    }

    /// The next block, as it was published last.
    pub(in super::super) fn restore_block(
        &mut self,
        states: &[SavedState],
        grid: &Grid,
        block: &Block,
    ) -> Result<(), RestoreError> {
        let segmented = segmented(states, grid, block, &self.rules)?;
        self.segmented.push(segmented);
        Ok(())
    }

    /// The clusters of the blocks of `grid`, all of which were restored.
    pub(in super::super) fn restore(
        &mut self,
        map: &SavedSurfaces,
        grid: &Grid,
        params: &Params,
        sequence: u64,
    ) -> Result<(), RestoreError> {
        ensure_counted("the number of ids given", map.ids_given)?;
        self.ids_given = map.ids_given;
        let ids = meet_all(grid, &mut self.segmented, &self.rules);
        self.restore_nodes(map)?;
        self.restore_graph(map, &ids)?;
        let clusters = in_slots("cluster", &map.clusters, map.slots.components())?.into_iter().collect();
        self.restore_clusters(&clusters, map.ids_given, sequence)?;
        for (block, here) in grid.blocks() {
            if here.is_at_rest() {
                self.segmented[block].contacts.fit();
            }
            self.enter(grid, block);
        }
        self.restore_told(&clusters, params)
    }

    fn restore_nodes(&mut self, map: &SavedSurfaces) -> Result<(), RestoreError> {
        let (lists, blocks) = (map.nodes.len(), self.segmented.len());
        ensure(lists == blocks, || format!("nodes of {lists} blocks, and there are {blocks}"))?;
        let patches = || self.segmented.iter().map(|segmented| segmented.patches.len());
        let nodes = || map.nodes.iter().map(<[NodeId]>::len);
        ensure(nodes().eq(patches()), || {
            let [patches, nodes] = [patches().sum::<usize>(), nodes().sum()];
            format!("{patches} patches, {nodes} nodes, or in other blocks")
        })?;
        self.nodes = map.nodes.iter().map(<[NodeId]>::to_vec).collect();
        Ok(())
    }

    fn restore_graph(&mut self, map: &SavedSurfaces, ids: &[PatchId]) -> Result<(), RestoreError> {
        let weight = |&id: &PatchId| (self.node(id), self.segmented.patch(id).cells.len() as u32);
        let weights: BTreeMap<_, _> = ids.iter().map(weight).collect();
        ensure(weights.len() == ids.len(), || format!("{} patches at {} nodes", ids.len(), weights.len()))?;
        let mut edges = Vec::new();
        for &id in ids {
            let joined = joined_with(&self.segmented, id, &self.rules);
            edges.extend(joined.map(|other| (self.node(id), self.node(other))));
        }
        self.graph = Graph::restore(&map.slots, &weights, &edges)?;
        self.patches.set_len(self.graph.node_slots());
        ids.iter().for_each(|&id| {
            let node = self.node(id);
            self.patches[node] = Some(id);
        });
        Ok(())
    }

    fn restore_clusters(
        &mut self,
        clusters: &By<ComponentId, Option<&SavedCluster>>,
        ids_given: u64,
        sequence: u64,
    ) -> Result<(), RestoreError> {
        let mut ids = BTreeSet::new();
        for (component, saved) in clusters.each() {
            ensure(saved.is_some() != self.graph.nodes(component).is_empty(), || {
                format!("{component:?} has {} patches: {saved:?}", self.graph.nodes(component).len())
            })?;
            let Some(saved) = saved else {
                self.clusters.push(None);
                continue;
            };
            let identity = &saved.identity;
            let is_new = identity.id.is_none_or(|id| id.get() <= ids_given && ids.insert(id));
            let possible = is_new
                && identity.grown <= sequence
                && identity.revision <= MOST_REVISIONS
                && identity.merged_from.is_empty();
            let axis = Axis::of(saved.axis).filter(|_| possible);
            let axis = axis.ok_or_else(|| {
                RestoreError::Contradiction(format!(
                    "an impossible cluster after {sequence} scans: {saved:?}"
                ))
            })?;
            let mut cluster = Cluster::new(identity.clone());
            cluster.footprint = Footprint::new(axis);
            self.clusters.push(Some(Box::new(cluster)));
        }
        Ok(())
    }

    fn restore_told(
        &mut self,
        clusters: &By<ComponentId, Option<&SavedCluster>>,
        params: &Params,
    ) -> Result<(), RestoreError> {
        for (component, saved) in clusters.each() {
            let (Some(cluster), Some(saved)) = (self.clusters[component].as_deref_mut(), saved) else {
                continue;
            };
            cluster.refit();
            // An outline is drawn along the axis: a plane that holds it has none.
            let axis = usize::from(saved.axis);
            let leans = cluster.plane.as_ref().is_none_or(|plane| plane.normal[axis].abs() >= LEAST_ALONG);
            ensure(leans, || format!("{component:?} is drawn along axis {axis}, which lies in its plane"))?;
            let drawing = &mut self.drawing;
            let told = cluster.identity.id.and_then(|id| shape_of(cluster, id, params, drawing));
            ensure(told.is_some() == saved.told.is_some(), || {
                format!("{component:?} can be told of: {}, and was: {:?}", told.is_some(), saved.told)
            })?;
            cluster.told = told.map(Arc::new);
            if let (Some(told), Some(saved)) = (&mut cluster.told, &saved.told) {
                ensure(saved.is_possible(), || format!("confidence of {saved:?}"))?;
                saved.restore(Arc::make_mut(told));
            }
            cluster.counted = if cluster.identity.id.is_some() { cluster.voxels } else { 0 };
            self.counted.count(0, cluster.counted);
            self.landmarks.set(component, cluster.told.as_deref());
            self.waiting.set(component, Waits::of(cluster));
        }
        // What was entered is no news.
        self.changed.clear();
        Ok(())
    }
}

/// A block as it was published last, with what has become dense since.
fn segmented(
    states: &[SavedState],
    grid: &Grid,
    here: &Block,
    rules: &Rules,
) -> Result<Segmented, RestoreError> {
    let (mut published, mut admitted) = (Vec::new(), Vec::new());
    for saved in states {
        let state = saved.restore(grid, here)?;
        if saved.admitted { admitted.push(state) } else { published.push(state) }
    }
    ensure(published.is_sorted_by(|a, b| a.cell() < b.cell()), || {
        format!("states of block {:?} are out of order, of {CELLS} cells", here.key)
    })?;
    let mut segmented = Segmented::of(published, here.corner(), rules);
    for state in admitted {
        let cell = state.cell();
        ensure(segmented.admit(state).is_some(), || {
            format!("{cell:?} of block {:?} is there twice", here.key)
        })?;
    }
    Ok(segmented)
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests {
    use crate::engine::class::SurfaceClass;
    use crate::engine::consistent::pipeline::Consistent;
    use crate::engine::consistent::saved::SavedConsistent;
    use crate::engine::params::Params;
    use crate::engine::scan::Stamp;
    use crate::sim::{Drive, Scene};

    #[test]
    fn an_axis_that_lies_in_the_plane_of_its_cluster_is_refused() {
        let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(0));
        let mut map = Consistent::new(Params::default());
        (0..6).for_each(|index| drop(map.insert(&drive.labelled_scan(5 * index).scan)));
        let saved = map.freeze().save();
        let restored = |saved: &SavedConsistent| {
            Consistent::restore(Params::default(), *map.freeze().taken(), saved.clone())
        };
        assert!(restored(&saved).is_ok_and(|map| map.freeze().save() == saved));
        let mut floors = 0;
        for (place, (_, cluster)) in saved.surfaces.clusters.iter().enumerate() {
            if cluster.told.as_ref().is_some_and(|told| told.class == SurfaceClass::Floor) {
                let mut other = saved.clone();
                other.surfaces.clusters[place].1.axis = 0;
                // A map itself is too long a text.
                let error = restored(&other).err().map(|error| error.to_string()).unwrap_or_default();
                assert!(error.contains("axis 0, which lies in its plane"), "{error}");
                floors += 1;
            }
        }
        assert!(floors > 0);
    }
}
