//! The clusters, kept while blocks are published one after another.
//!
//! After every [`Surfaces::publish`] the partition is the one that `scratch` finds on the same published states. A block
//! that is published takes its patches and its voxels out of their clusters, is segmented anew, and puts them in again;
//! joins change only at its own patches and at slices and bridges that meet it, and loose voxels look for their patch anew within
//! three voxels of it (`loose`).
//! The graph says which clusters that merged or split; whole patches then move, those of the smaller sides. So the work
//! follows the blocks that are published, their neighbours and the smaller side of what splits or merges; after each freezing it also
//! copies, once, what it changes of what the frozen map shares.
//!
//! Identity: the voxels that were in a cluster before vote for the one they are in now. A cluster's id goes where most of its
//! voxels went; of several that come together the oldest stays. What has lost more than half of its voxels at once keeps its id
//! where it is still most of a cluster, and does not bring it into another's.

mod connect;
mod follow;
mod frozen;
mod identify;
mod landmarks;
mod loose;
mod members;
mod refit;
mod saved;
mod tell;
mod waiting;

use std::collections::BTreeSet;
use std::sync::Arc;

pub(super) use self::frozen::{Faces, FrozenSurfaces};
use self::landmarks::Landmarks;
pub(super) use self::saved::SavedSurfaces;
use self::waiting::Waiting;
use super::block::{BlockIndex, Cell};
use super::cluster::Cluster;
use super::graph::{Batch, ComponentId, Graph, NodeId};
use super::grid::Grid;
use super::lists::by::By;
use super::lists::shared::Shared;
use super::outline::Drawing;
use super::patch::PatchId;
use super::patch::segmented::SegmentedBlocks;
use super::rules::Rules;
use super::state::State;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::params::Params;

#[derive(Clone, Debug)]
pub(super) struct Surfaces {
    pub(super) rules: Rules,
    segmented: SegmentedBlocks,
    /// The nodes of a block's patches, by number.
    nodes: Shared<BlockIndex, Vec<NodeId>>,
    patches: By<NodeId, Option<PatchId>>,
    graph: Graph,
    clusters: By<ComponentId, Option<Box<Cluster>>>,
    landmarks: Landmarks,
    waiting: Waiting,
    /// Memory to draw outlines in.
    drawing: Drawing,
    ids_given: u64,
    /// Components that this scan changed.
    changed: BTreeSet<ComponentId>,
    /// Components that this scan looks at, ascending; its memory stays for the next.
    due: Vec<ComponentId>,
    /// Ids that are gone by this scan.
    removed: BTreeSet<ClusterId>,
    counted: Counted,
}

/// How much is told of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counted {
    /// Clusters that have an id.
    clusters: usize,
    /// Voxels in them.
    voxels: u32,
}

impl Counted {
    /// A cluster has `now` voxels that are told of, and had `before`: none while it has no id.
    fn count(&mut self, before: u32, now: u32) {
        self.voxels = self.voxels + now - before;
        self.clusters = self.clusters + usize::from(now > 0) - usize::from(before > 0);
    }
}

impl Surfaces {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            rules: Rules::new(params),
            segmented: SegmentedBlocks::default(),
            nodes: Shared::default(),
            patches: By::default(),
            graph: Graph::default(),
            clusters: By::default(),
            landmarks: Landmarks::new(params.voxel_size()),
            waiting: Waiting::default(),
            drawing: Drawing::default(),
            ids_given: 0,
            changed: BTreeSet::new(),
            due: Vec::new(),
            removed: BTreeSet::new(),
            counted: Counted::default(),
        }
    }

    /// Voxels in clusters that are told of.
    pub(super) const fn clustered(&self) -> u32 {
        self.counted.voxels
    }

    #[cfg(test)]
    pub(super) fn cluster(&self, component: ComponentId) -> Option<&Cluster> {
        self.clusters[component].as_deref()
    }

    pub(super) const fn segmented(&self) -> &SegmentedBlocks {
        &self.segmented
    }

    fn node(&self, id: PatchId) -> NodeId {
        self.nodes[id.block][usize::from(id.number)]
    }

    /// The dense voxels of a block as they were published, with those that have become dense since.
    pub(super) fn states(&self, block: BlockIndex) -> &Arc<Vec<State>> {
        &self.segmented[block].states
    }

    /// The dense voxels of a block that is to rest, as they were published; what is kept of it takes no room to spare.
    pub(super) fn states_to_rest(&mut self, block: BlockIndex) -> Arc<Vec<State>> {
        if !self.segmented[block].contacts.is_fit() {
            self.segmented[block].contacts.fit();
        }
        Arc::clone(&self.segmented[block].states)
    }

    /// Forgets what the scan before has changed.
    pub(super) fn begin(&mut self) {
        self.changed.clear();
        self.removed.clear();
    }

    /// Takes over the states of these blocks (ascending) as they are now, and of other blocks those voxels that have become
    /// dense.
    pub(super) fn publish(
        &mut self,
        grid: &Grid,
        blocks: &[BlockIndex],
        dense: impl Iterator<Item = (BlockIndex, Cell)>,
        now: Now,
    ) {
        let published = PublishedBlocks(blocks);
        self.make_room(grid);
        let beside = self.beside(grid, published);
        let by_block = || beside.chunk_by(|a, b| a.block == b.block);
        by_block().for_each(|beside| self.withdraw_loose(beside));
        let mut batch = Batch::default();
        let old = self.replace(grid, published, &mut batch);
        self.connect(grid, published, &mut batch);
        let outcome = self.graph.apply(&batch);
        self.number(published, &outcome);
        let votes = self.votes(published, &old, &outcome);
        self.identify(&votes, &outcome, now);
        outcome.moved.iter().for_each(|moved| self.transfer(grid, moved));
        published.iter().for_each(|block| self.enter(grid, block));
        by_block().for_each(|beside| self.settle_loose(grid, beside, published));
        outcome.removed.iter().for_each(|&gone| self.bury(gone));
        dense.for_each(|(block, cell)| self.admit(grid, block, cell));
        self.refit(grid);
        self.grant_ids(now);
    }

    fn make_room(&mut self, grid: &Grid) {
        let blocks = grid.slots();
        self.segmented.set_len(blocks);
        self.nodes.set_len(blocks);
    }

    /// Forgets a component that is gone: what it was has been taken over by another cluster, or is gone with its voxels.
    fn bury(&mut self, gone: ComponentId) {
        let counted = self.clusters[gone].take().map_or(0, |cluster| cluster.counted);
        self.counted.count(counted, 0);
        self.landmarks.set(gone, None);
        self.waiting.set(gone, None);
    }
}

/// The blocks that are published together, ascending.
#[derive(Clone, Copy, Debug)]
struct PublishedBlocks<'a>(&'a [BlockIndex]);

impl PublishedBlocks<'_> {
    fn iter(&self) -> impl Iterator<Item = BlockIndex> {
        self.0.iter().copied()
    }

    fn has(&self, block: BlockIndex) -> bool {
        self.0.binary_search(&block).is_ok()
    }
}

#[cfg(test)]
mod tests;
