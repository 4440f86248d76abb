//! What the surfaces know of every voxel, as it was after a scan.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::UnitVector3;

use super::saved::SavedCluster;
use super::{SavedSurfaces, Surfaces};
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::graph::{ComponentId, FrozenGraph, NodeId};
use crate::engine::consistent::grid::Blocks;
use crate::engine::consistent::lists::by::By;
use crate::engine::consistent::lists::shared::Shared;
use crate::engine::consistent::patch::segmented::SegmentedBlocks;
use crate::engine::consistent::saved::SavedState;
use crate::engine::consistent::state::State;
use crate::engine::key::ClusterId;
use crate::engine::snapshot::Cluster;

#[derive(Clone, Debug)]
pub(in super::super) struct FrozenSurfaces {
    segmented: SegmentedBlocks,
    nodes: Shared<BlockIndex, Vec<NodeId>>,
    graph: FrozenGraph,
    /// All that is saved of the clusters, with their components.
    clusters: Vec<(u32, SavedCluster)>,
    /// The clusters that are told of, by ascending id.
    told: Vec<Arc<Cluster>>,
    /// Voxels in them.
    pub(in super::super) clustered: u32,
    ids_given: u64,
}

/// What a patch is for the voxels that belong to it.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Face {
    pub(in super::super) component: ComponentId,
    /// `None` where its cluster is not told of.
    pub(in super::super) cluster: Option<ClusterId>,
    pub(in super::super) normal: UnitVector3<f64>,
    pub(in super::super) curvature: f32,
}

/// Those of all patches that are there.
pub(in super::super) type Faces = By<NodeId, Option<Face>>;

impl Surfaces {
    /// As they are now.
    pub(in super::super) fn freeze(&self) -> FrozenSurfaces {
        FrozenSurfaces {
            segmented: self.segmented.clone(),
            nodes: self.nodes.clone(),
            graph: self.graph.freeze(),
            clusters: self.save_clusters(),
            told: self.descriptions().into_iter().cloned().collect(),
            clustered: self.clustered(),
            ids_given: self.ids_given,
        }
    }
}

impl FrozenSurfaces {
    /// The clusters that are told of, by ascending id.
    pub(in super::super) fn descriptions(&self) -> Vec<Cluster> {
        self.told.iter().map(|cluster| Cluster::clone(cluster)).collect()
    }

    /// What each patch is for its voxels, by its node.
    pub(in super::super) fn faces(&self) -> Faces {
        let mut ids = By::<ComponentId, Option<ClusterId>>::new();
        for (component, cluster) in &self.clusters {
            *ids.grow_to(ComponentId(*component)) = cluster.id();
        }
        let mut components = By::<NodeId, Option<ComponentId>>::new();
        self.graph.nodes().for_each(|(node, component)| *components.grow_to(node) = Some(component));
        let mut faces = Faces::new();
        for (here, nodes) in self.segmented.iter().zip(self.nodes.iter()) {
            for (patch, &node) in here.patches.iter().zip(nodes) {
                let Some(component) = components[node] else { unreachable!("{node:?} is in no component") };
                let cluster = ids.get(component).copied().flatten();
                let (normal, curvature) = (patch.normal(), patch.curvature());
                *faces.grow_to(node) = Some(Face { component, cluster, normal, curvature });
            }
        }
        faces
    }

    /// What part of each of its lists is shared with another map's.
    #[cfg(test)]
    pub(in super::super) fn shared_with(&self, other: &Self) -> [f64; 3] {
        [
            self.segmented.shared_with(&other.segmented),
            self.nodes.shared_with(&other.nodes),
            self.graph.shared_with(&other.graph),
        ]
    }

    /// The places of each page of its lists by block that is not shared with another map's.
    #[cfg(test)]
    pub(in super::super) fn copied_since(
        &self,
        other: &Self,
    ) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.segmented.copied_since(&other.segmented).chain(self.nodes.copied_since(&other.nodes))
    }

    /// The published voxels of a block, ascending, each with the one of `faces` that it belongs to.
    pub(in super::super) fn voxels(&self, block: BlockIndex, faces: &Faces) -> Vec<(&State, Option<Face>)> {
        let (Some(here), Some(nodes)) = (self.segmented.get(block), self.nodes.get(block)) else {
            return Vec::new();
        };
        let numbers = here.numbers();
        let mut loose = here.loose.iter();
        let node = |state: &State| {
            let number = numbers[state.cell().index()];
            if here.is_loose(number) {
                loose.next().and_then(|loose| loose.owner())
            } else {
                Some(nodes[usize::from(number)])
            }
        };
        let nodes: Vec<_> = here.states.iter().map(node).collect();
        let face = |node: NodeId| {
            debug_assert!(faces[node].is_some(), "{block:?} has voxels of {node:?}");
            faces[node]
        };
        here.states.iter().zip(nodes.into_iter().map(|node| node.and_then(face))).collect()
    }

    pub(in super::super) fn save(&self) -> SavedSurfaces {
        SavedSurfaces {
            nodes: self.nodes.iter().map(|nodes| nodes.iter().copied()).collect(),
            slots: self.graph.slots_taken(),
            clusters: self.clusters.clone(),
            ids_given: self.ids_given,
        }
    }

    /// The states of a block of `blocks`, as they are to be saved.
    pub(in super::super) fn save_states(&self, blocks: &Blocks, block: BlockIndex) -> Vec<SavedState> {
        let Some(here) = self.segmented.get(block) else { return Vec::new() };
        let admitted: BTreeSet<_> =
            here.loose.iter().filter(|loose| loose.is_admitted()).map(|loose| loose.place()).collect();
        let now = blocks.states(blocks.block(block));
        debug_assert!(now.iter().map(State::cell).eq(here.states.iter().map(State::cell)));
        let places = (0..).zip(here.states.iter().zip(&now));
        places.map(|(place, (state, now))| SavedState::of(state, now, admitted.contains(&place))).collect()
    }
}
