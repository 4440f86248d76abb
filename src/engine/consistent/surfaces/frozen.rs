//! What the surfaces know of every voxel, as it was after a scan.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::UnitVector3;

use super::saved::SavedCluster;
use super::{SavedSurfaces, Surfaces};
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::by::By;
use crate::engine::consistent::cells::Cells;
use crate::engine::consistent::graph::{ComponentId, NodeId, Slots};
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::layer::{Loose, numbers};
use crate::engine::consistent::saved::SavedState;
use crate::engine::consistent::state::{State, states};
use crate::engine::key::ClusterId;
use crate::engine::snapshot::Cluster;

#[derive(Clone, Debug)]
pub(in super::super) struct FrozenSurfaces {
    layers: By<BlockIndex, Layer>,
    /// The patches of all blocks, one block after another, each block's by number.
    patches: Vec<Patch>,
    /// The loose voxels of all blocks, likewise.
    loose: Vec<Loose>,
    faces: By<NodeId, Option<Face>>,
    /// The clusters that are told of, by ascending id.
    pub(in super::super) told: Vec<Cluster>,
    /// Voxels in them.
    pub(in super::super) clustered: u32,
    /// All that is saved of the clusters, with their components, and of the graph.
    clusters: Vec<(u32, SavedCluster)>,
    slots: Slots,
    ids_given: u64,
}

/// A block as it was published last.
#[derive(Clone, Debug)]
struct Layer {
    states: Arc<Vec<State>>,
    /// Where its patches end.
    patches: usize,
    /// Where its loose voxels end.
    loose: usize,
}

#[derive(Clone, Debug)]
struct Patch {
    node: NodeId,
    cells: Cells,
    is_frayed: bool,
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

impl Surfaces {
    /// As they are now.
    pub(in super::super) fn freeze(&self) -> FrozenSurfaces {
        let (mut patches, mut loose) = (Vec::new(), Vec::new());
        let mut faces = By::from(vec![None; self.patches.len()]);
        let mut layers = Vec::with_capacity(self.segmented.len());
        for (here, nodes) in self.segmented.iter().zip(self.nodes.iter()) {
            for (patch, &node) in here.patches.iter().zip(nodes) {
                patches.push(Patch { node, cells: patch.cells, is_frayed: patch.is_frayed() });
                let component = self.graph.component(node);
                faces[node] = Some(Face {
                    component,
                    cluster: self.clusters[component].as_ref().and_then(|cluster| cluster.identity.id),
                    normal: patch.normal(),
                    curvature: patch.curvature(),
                });
            }
            loose.extend_from_slice(&here.loose);
            let states = Arc::clone(&here.states);
            layers.push(Layer { states, patches: patches.len(), loose: loose.len() });
        }
        FrozenSurfaces {
            layers: By::from(layers),
            patches,
            loose,
            faces,
            told: self.told().into_iter().cloned().collect(),
            clustered: self.clustered(),
            clusters: self.save_clusters(),
            slots: self.graph.slots_taken(),
            ids_given: self.ids_given,
        }
    }
}

impl FrozenSurfaces {
    /// The published voxels of a block, ascending, each with the face that it belongs to.
    pub(in super::super) fn voxels(&self, block: BlockIndex) -> Vec<(&State, Option<Face>)> {
        let Some((layer, patches, loose)) = self.layer(block) else { return Vec::new() };
        let numbers = numbers(patches.iter().map(|patch| &patch.cells));
        let mut loose = loose.iter();
        let node = |state: &State| match patches.get(usize::from(numbers[state.cell().index()])) {
            Some(patch) if !patch.is_frayed => Some(patch.node),
            _ => loose.next().and_then(|loose| loose.owner()),
        };
        let nodes: Vec<_> = layer.states.iter().map(node).collect();
        let face = |node: NodeId| {
            debug_assert!(self.faces[node].is_some(), "{block:?} has voxels of {node:?}");
            self.faces[node]
        };
        layer.states.iter().zip(nodes.into_iter().map(|node| node.and_then(face))).collect()
    }

    pub(in super::super) fn save(&self) -> SavedSurfaces {
        let blocks = (0..self.layers.len() as u32).map(BlockIndex);
        let nodes = |block| {
            let patches = self.layer(block).map_or(&[][..], |(_, patches, _)| patches);
            patches.iter().map(|patch| patch.node.0).collect()
        };
        SavedSurfaces {
            nodes: blocks.map(nodes).collect(),
            slots: self.slots.clone(),
            clusters: self.clusters.clone(),
            ids_given: self.ids_given,
        }
    }

    /// The states of a block, as they are to be saved.
    pub(in super::super) fn save_states(&self, grid: &Grid, block: BlockIndex) -> Vec<SavedState> {
        let Some((layer, _, loose)) = self.layer(block) else { return Vec::new() };
        let admitted: BTreeSet<_> =
            loose.iter().filter(|loose| loose.is_admitted()).map(|loose| loose.place()).collect();
        let now = states(grid, grid.block(block));
        debug_assert!(now.iter().map(State::cell).eq(layer.states.iter().map(State::cell)));
        let places = (0..).zip(layer.states.iter().zip(&now));
        places.map(|(place, (state, now))| SavedState::of(state, now, admitted.contains(&place))).collect()
    }

    /// A block with its patches and its loose voxels.
    fn layer(&self, block: BlockIndex) -> Option<(&Layer, &[Patch], &[Loose])> {
        let layer = self.layers.get(block)?;
        let before = block.0.checked_sub(1).map(|before| &self.layers[BlockIndex(before)]);
        let [patches, loose] = [
            before.map_or(0, |before| before.patches)..layer.patches,
            before.map_or(0, |before| before.loose)..layer.loose,
        ] as [Range<usize>; 2];
        Some((layer, &self.patches[patches], &self.loose[loose]))
    }
}
