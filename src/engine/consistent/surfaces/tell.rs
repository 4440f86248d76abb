//! What leaves the engine of the clusters that have an id: descriptions, each as it was told of last.

use std::sync::Arc;

use super::Surfaces;
use super::waiting::{Waits, state};
use crate::engine::class::SurfaceClass;
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::class::evidence::{self, Planarity, Surroundings, Uprights};
use crate::engine::consistent::class::{Evidence, classify};
use crate::engine::consistent::cluster::{Before, Standing};
use crate::engine::consistent::describe::shape_of;
use crate::engine::consistent::graph::{ComponentId, NodeId};
use crate::engine::consistent::lists::by::Place;
use crate::engine::consistent::rules::apart_by_poses;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::snapshot::{self, ChangedCluster};

/// Scans, a second of a Kinect's, in which every cluster that is told of is looked at again once; twice, four times, ... as many
/// where a scan would otherwise look at more than [`LOOKS`], on average.
const ROUND: usize = 30;
const LOOKS: usize = 16;
/// Most clusters that a scan looks at because their state is another by time alone; the next one looks at more.
const MOST_WAITING: usize = 32;

impl Surfaces {
    /// The clusters that are told of, by ascending id, each as it was told of last.
    pub(in super::super) fn descriptions(&self) -> Vec<&Arc<snapshot::Cluster>> {
        let mut told: Vec<_> =
            self.clusters.iter().flatten().filter_map(|cluster| cluster.told.as_ref()).collect();
        told.sort_unstable_by_key(|cluster| cluster.id);
        told
    }

    /// Ids that are gone by this scan, ascending.
    pub(in super::super) fn removed(&self) -> Vec<ClusterId> {
        self.removed.iter().copied().collect()
    }

    /// Notes that the sensor put points into these blocks (ascending), where clusters have patches or loose voxels.
    pub(in super::super) fn note_seen(&mut self, blocks: &[BlockIndex], now: Now) {
        let Self { segmented, nodes, graph, clusters, .. } = self;
        let mut see = |node: NodeId| {
            if let Some(cluster) = clusters[graph.component(node)].as_mut() {
                cluster.identity.last_seen = now.stamp;
            }
        };
        for &block in blocks {
            let (Some(here), Some(nodes)) = (segmented.get(block), nodes.get(block)) else {
                continue;
            };
            nodes.iter().copied().for_each(&mut see);
            // Most of a row of loose voxels belong to one patch.
            let rows = here.loose.chunk_by(|a, b| a.owner() == b.owner());
            rows.filter_map(|row| row.first()?.owner()).for_each(&mut see);
        }
    }

    /// Describes anew what has changed, those whose state is another by time alone and, so that classes and times do not grow
    /// old, those of the others whose turn it is; returns those that are told of differently than before, by ascending id.
    pub(in super::super) fn describe(
        &mut self,
        params: &Params,
        sensor_height: f64,
        now: Now,
    ) -> Vec<ChangedCluster> {
        let due = self.take_due(params, now);
        due.iter().for_each(|&component| self.describe_shape(component, params, now));
        self.classify(&due, sensor_height, params);
        let changed = self.count_revisions(&due);
        self.due = due;
        changed
    }

    /// The clusters that this scan looks at, ascending: those that it changed, and of the others those whose state is another by
    /// time alone, and those whose turn it is.
    fn take_due(&mut self, params: &Params, now: Now) -> Vec<ComponentId> {
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend(&self.changed);
        let others = |component: &ComponentId| !self.changed.contains(component);
        due.extend(self.waiting.due(params, now).filter(others).take(MOST_WAITING));
        due.extend(self.in_turn(now).filter(others));
        due.sort_unstable();
        due.dedup();
        due
    }

    /// The clusters with an id whose turn it is to be looked at though nothing has changed. It stays the same turn while others
    /// come. How many have an id makes the round, not how many slots there are: most may be free, or of pieces without one.
    fn in_turn(&self, now: Now) -> impl Iterator<Item = ComponentId> {
        let rounds = self.counted.clusters.div_ceil(ROUND * LOOKS).next_power_of_two();
        let round = ROUND * rounds;
        let first = (now.sequence % round as u64) as usize;
        let slots = self.clusters.iter().enumerate().skip(first).step_by(round);
        let told = slots.filter(|(_, cluster)| cluster.as_ref().is_some_and(|cluster| cluster.counted > 0));
        told.map(|(component, _)| ComponentId::at(component))
    }

    /// Describes a cluster anew where it has changed, and finds its state; its class follows once all others are described.
    fn describe_shape(&mut self, component: ComponentId, params: &Params, now: Now) {
        let changed = self.changed.contains(&component);
        let Some(cluster) = self.clusters[component].as_deref_mut() else { return };
        let Some(id) = cluster.identity.id else {
            cluster.told = None;
            self.landmarks.set(component, None);
            self.waiting.set(component, None);
            return;
        };
        let before = cluster.told.take();
        if let Some(told) = before.as_ref().filter(|_| !changed) {
            cluster.before = Before::Standing(Standing::of(told));
            cluster.told = before;
        } else {
            cluster.before = before.map_or(Before::New, Before::Other);
            cluster.told = shape_of(cluster, id, params, &mut self.drawing).map(Arc::new);
            self.landmarks.set(component, cluster.told.as_deref());
        }
        let state = state(cluster, params, now);
        let last_seen = cluster.identity.last_seen;
        let told = cluster.told.as_mut();
        if let Some(told) = told.filter(|told| (told.state, told.last_seen) != (state, last_seen)) {
            let told = Arc::make_mut(told);
            (told.state, told.last_seen) = (state, last_seen);
        }
        self.waiting.set(component, Waits::of(cluster));
    }

    /// Classifies clusters; the class of each is found before any of them has got its own.
    fn classify(&mut self, due: &[ComponentId], sensor_height: f64, params: &Params) {
        let class_of =
            |&component: &ComponentId| Some((component, self.class_of(component, sensor_height, params)?));
        let classes: Vec<_> = due.iter().filter_map(class_of).collect();
        for (component, (class, confidence)) in classes {
            let told = self.clusters[component].as_mut().and_then(|cluster| cluster.told.as_mut());
            if let Some(told) = told.filter(|told| (told.class, told.class_confidence) != (class, confidence))
            {
                let told = Arc::make_mut(told);
                (told.class, told.class_confidence) = (class, confidence);
            }
        }
    }

    /// The class of a cluster as it is described now, and the confidence in that; `None` of one that is not told of.
    fn class_of(
        &self,
        component: ComponentId,
        sensor_height: f64,
        params: &Params,
    ) -> Option<(SurfaceClass, f32)> {
        let cluster = self.clusters[component].as_deref()?;
        let (shape, plane) = (cluster.told.as_ref()?, cluster.plane.as_ref()?);
        let planarity = Planarity::of(cluster, plane, &self.rules);
        let uprights = self.uprights(shape);
        let floor = self.landmarks.floor_below(evidence::middle(shape), apart_by_poses(params));
        let surroundings = Surroundings {
            floor,
            floor_above: if floor.is_none() { self.landmarks.lowest_floor() } else { None },
            sensor: sensor_height,
            was_ceiling: cluster.before.class() == SurfaceClass::Ceiling,
        };
        Some(classify(&Evidence::of(shape, planarity, &uprights, surroundings, params)))
    }

    /// The upright clusters that this one stands beside.
    pub(super) fn uprights(&self, cluster: &snapshot::Cluster) -> Uprights {
        let edges = evidence::edges(cluster);
        let near = edges.map(|edges| self.landmarks.near(&edges)).unwrap_or_default();
        let told = near.iter().filter_map(|&other| self.clusters[other].as_ref()?.told.as_deref());
        Uprights::of(cluster, edges.as_ref(), told)
    }

    /// Counts the revisions of what is told of differently, or has taken in another.
    fn count_revisions(&mut self, due: &[ComponentId]) -> Vec<ChangedCluster> {
        let mut changed = Vec::new();
        for &component in due {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            let before = std::mem::take(&mut cluster.before);
            let merged_from = std::mem::take(&mut cluster.identity.merged_from);
            let is_other = |told: &&mut Arc<snapshot::Cluster>| !merged_from.is_empty() || !before.is(told);
            let Some(told) = cluster.told.as_mut().filter(is_other) else { continue };
            cluster.identity.revision += 1;
            let told = Arc::make_mut(told);
            told.revision = cluster.identity.revision;
            changed.push(ChangedCluster { cluster: told.clone(), merged_from });
        }
        changed.sort_unstable_by_key(|changed| changed.cluster.id);
        changed
    }
}
