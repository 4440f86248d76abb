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

mod follow;
mod frozen;
mod identify;
mod landmarks;
mod loose;
mod saved;
mod tell;
mod waiting;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

pub(super) use self::frozen::{Faces, FrozenSurfaces};
use self::landmarks::Landmarks;
pub(super) use self::saved::SavedSurfaces;
use self::waiting::Waiting;
use super::block::{BlockIndex, CELLS, Cell};
use super::by::By;
use super::cluster::Cluster;
use super::graph::{Batch, ComponentId, End, Graph, NodeId, Outcome};
use super::grid::Grid;
use super::host::{are_joined, host};
use super::outline::Drawing;
use super::patch::{Patch, PatchId};
use super::rules::Rules;
use super::segmented::{Segmented, SegmentedBlocks, contacts, contacts_of, patch};
use super::shared::Shared;
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
    pub(super) fn rest(&mut self, block: BlockIndex) -> Arc<Vec<State>> {
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
        self.make_room(grid);
        let beside = self.beside(grid, blocks);
        let by_block = || beside.chunk_by(|a, b| a.block == b.block);
        by_block().for_each(|beside| self.withdraw_loose(grid, beside));
        let mut batch = Batch::default();
        let old: Vec<_> = blocks.iter().map(|&block| self.withdraw(grid, block, &mut batch)).collect();
        for &block in blocks {
            self.segmented[block] = Segmented::new(grid, grid.block(block), &self.rules);
        }
        self.connect(grid, blocks, &mut batch);
        let outcome = self.graph.apply(&batch);
        self.number(blocks, &outcome);
        let votes = self.votes(blocks, &old, &outcome);
        self.identify(&votes, &outcome, now);
        for moved in &outcome.moved {
            self.transfer(grid, moved.node, moved.from, moved.to);
        }
        for &block in blocks {
            self.enter(grid, block);
        }
        by_block().for_each(|beside| self.settle_loose(grid, beside, blocks));
        for &gone in &outcome.removed {
            // What it was has been taken over by another cluster, or is gone with its voxels.
            let counted = self.clusters[gone].take().map_or(0, |cluster| cluster.counted);
            self.counted.count(counted, 0);
            self.landmarks.set(gone, None);
            self.waiting.set(gone, None);
        }
        for (block, cell) in dense {
            self.admit(grid, block, cell);
        }
        self.refit(grid);
        self.grant_ids(grid, now);
    }

    fn make_room(&mut self, grid: &Grid) {
        let blocks = grid.slots();
        self.segmented.set_len(blocks);
        self.nodes.set_len(blocks);
    }

    /// Takes all voxels of a block out of their clusters, and its nodes out of the graph; returns what it was.
    fn withdraw(&mut self, grid: &Grid, block: BlockIndex, batch: &mut Batch) -> Old {
        (0..self.segmented[block].loose.len()).for_each(|number| self.leave_loose(grid, block, number));
        let segmented = self.segmented.take(block);
        let nodes = self.nodes.take(block);
        let components: Vec<_> = nodes.iter().map(|&node| self.graph.component(node)).collect();
        let numbers = segmented.numbers();
        for (number, row) in rows(&segmented.states, &numbers) {
            if segmented.is_loose(number) {
                continue;
            }
            let component = components[usize::from(number)];
            let Some(cluster) = self.clusters[component].as_mut() else { continue };
            self.changed.insert(component);
            for state in row {
                let member = segmented.member(grid.block(block), state, Some(number), &self.rules);
                member.iter().for_each(|member| cluster.remove(member));
            }
        }
        nodes.iter().for_each(|&node| self.patches[node] = None);
        batch.remove.extend(nodes);
        Old { segmented, components }
    }

    /// The nodes and edges of the new patches, and the edges of slices and bridges beside them, which may be parts of
    /// another patch now.
    fn connect(&mut self, grid: &Grid, blocks: &[BlockIndex], batch: &mut Batch) {
        let mut first = BTreeMap::new();
        for &block in blocks {
            first.insert(block, batch.add.len() as u32);
            batch.add.extend(self.segmented[block].patches.iter().map(|patch| patch.cells.len() as u32));
        }
        let beside = self.slices_beside(grid, blocks);
        // What a slice met before counts as well as what it meets now.
        let met: Vec<_> = beside.iter().map(|&id| self.meets_any(id, blocks)).collect();
        blocks.iter().for_each(|&block| self.meet(grid, block, blocks));
        let slices = beside.into_iter().zip(met);
        let slices = slices.filter(|&(id, met)| met || self.meets_any(id, blocks));
        let slices: Vec<_> = slices.map(|(id, _)| id).collect();
        let new: Vec<_> = blocks.iter().flat_map(|&block| self.ids(block)).collect();
        for &id in &new {
            self.find_host(id);
        }
        let slices: Vec<_> = slices.into_iter().filter(|&id| self.find_host(id)).collect();
        let anew: Vec<_> = new.into_iter().chain(slices.iter().copied()).collect();
        for id in slices {
            let node = self.node(id);
            batch.disconnect.extend(self.graph.neighbours(node).iter().map(|&other| (node, other)));
        }
        // What goes with a removed node need not be said to go.
        let gone: BTreeSet<_> = batch.remove.iter().copied().collect();
        batch.disconnect.retain(|(_, other)| !gone.contains(other));
        let end = |id: PatchId| match first.get(&id.block) {
            Some(first) => End::New(first + u32::from(id.number)),
            None => End::Old(self.node(id)),
        };
        for id in anew {
            for (other, contact) in contacts_of(&self.segmented, id) {
                if are_joined(&self.segmented, id, other, &contact, &self.rules) {
                    batch.connect.push((end(id), end(other)));
                }
            }
        }
    }

    /// Finds anew what a patch is a part of; `false` where it has neither been a bridge nor a slice nor is one, so that it is
    /// joined to the patches that it was joined to.
    fn find_host(&mut self, id: PatchId) -> bool {
        let host = host(&self.segmented, id, &self.rules);
        let patch = &mut self.segmented[id.block].patches[usize::from(id.number)];
        let before = std::mem::replace(&mut patch.host, host);
        before.is_bridge() || host.is_bridge() || patch.may_be_slice()
    }

    fn ids(&self, block: BlockIndex) -> impl Iterator<Item = PatchId> {
        (0..self.segmented[block].patches.len()).map(move |number| PatchId { block, number: number as u8 })
    }

    /// Finds where the patches of a block that was segmented anew, with others (ascending), meet those around it, and tells these.
    fn meet(&mut self, grid: &Grid, block: BlockIndex, published: &[BlockIndex]) {
        for (place, other) in grid.block(block).around.iter() {
            if published.binary_search(&other).is_err() {
                // It may have met what this block was before.
                if self.segmented[other].contacts.meets(block) {
                    self.segmented[other].contacts.forget(block);
                }
            } else if other < block {
                // It has met this one already.
                continue;
            }
            let [here, there] = [block, other].map(|block| &self.segmented[block]);
            let met = contacts(here, there, place, grid.block(block).corner());
            for ((a, b), contact) in met {
                let [a, b] = [PatchId { block, number: a }, PatchId { block: other, number: b }];
                self.segmented[block].contacts.insert(a.number, b, &contact);
                self.segmented[other].contacts.insert(b.number, a, &contact);
            }
        }
    }

    /// Patches of other blocks around these that may be slices or bridges.
    fn slices_beside(&self, grid: &Grid, blocks: &[BlockIndex]) -> Vec<PatchId> {
        let around = blocks.iter().flat_map(|&block| grid.block(block).around.iter().map(|(_, other)| other));
        let others: BTreeSet<_> = around.filter(|other| blocks.binary_search(other).is_err()).collect();
        let ids = others.into_iter().flat_map(|other| self.ids(other));
        let may_have_host = |patch: &Patch| patch.may_be_slice() || patch.may_be_bridge();
        ids.filter(|&id| may_have_host(patch(&self.segmented, id))).collect()
    }

    /// Whether a patch meets one of these blocks (ascending).
    fn meets_any(&self, id: PatchId, blocks: &[BlockIndex]) -> bool {
        contacts_of(&self.segmented, id).any(|(other, _)| blocks.binary_search(&other.block).is_ok())
    }

    /// Writes down which nodes the new patches have got.
    fn number(&mut self, blocks: &[BlockIndex], outcome: &Outcome) {
        let mut added = outcome.added.iter();
        for &block in blocks {
            let count = self.segmented[block].patches.len();
            let nodes: Vec<_> = added.by_ref().take(count).map(|(node, _)| *node).collect();
            for (number, &node) in (0..).zip(&nodes) {
                *self.patches.reach(node) = Some(PatchId { block, number });
            }
            self.nodes[block] = nodes;
        }
    }

    /// Moves a patch and the loose voxels beside it to another cluster.
    fn transfer(&mut self, grid: &Grid, node: NodeId, from: ComponentId, to: ComponentId) {
        let Some(id) = self.patches[node] else { return };
        let (mut lost, mut gained) = (self.clusters[from].take(), self.clusters[to].take());
        self.for_each_voxel(grid, node, id, |block, state| {
            let there = &self.segmented[block];
            let is_own =
                block == id.block && there.patches[usize::from(id.number)].cells.contains(state.cell());
            let member = there.member(grid.block(block), state, is_own.then_some(id.number), &self.rules);
            if let (Some(member), Some(lost), Some(gained)) = (member, lost.as_mut(), gained.as_mut()) {
                lost.remove(&member);
                gained.add(&member);
            }
        });
        self.clusters[from] = lost;
        self.clusters[to] = gained;
        self.changed.extend([from, to]);
    }

    /// Visits the voxels that belong to a node's patch: those in it, and the loose ones beside it.
    fn for_each_voxel(
        &self,
        grid: &Grid,
        node: NodeId,
        id: PatchId,
        mut visit: impl FnMut(BlockIndex, &State),
    ) {
        let (here, patch) = (&self.segmented[id.block], patch(&self.segmented, id));
        let whole = patch.cells.iter().filter(|_| !patch.is_frayed());
        whole.filter_map(|cell| here.state(cell)).for_each(|state| visit(id.block, state));
        for (_, block) in grid.block(id.block).around.iter() {
            let there = &self.segmented[block];
            let beside = there.loose.iter().filter(|loose| loose.owner() == Some(node));
            beside.for_each(|loose| visit(block, &there.states[loose.place()]));
        }
    }

    /// Puts the voxels of a block that was segmented anew into their clusters.
    fn enter(&mut self, grid: &Grid, block: BlockIndex) {
        let here = &self.segmented[block];
        let numbers = here.numbers();
        for (number, row) in rows(&here.states, &numbers) {
            if here.is_loose(number) {
                continue;
            }
            let component = self.graph.component(self.nodes[block][usize::from(number)]);
            let Some(cluster) = self.clusters[component].as_mut() else { continue };
            for state in row {
                let member = here.member(grid.block(block), state, Some(number), &self.rules);
                member.iter().for_each(|member| cluster.add(member));
            }
        }
        self.enter_loose(grid, block, 0..self.segmented[block].loose.len());
    }
}

/// The states of a block in rows of one patch, or of none, with its number.
fn rows<'a>(states: &'a [State], numbers: &[u8; CELLS]) -> impl Iterator<Item = (u8, &'a [State])> {
    let number = |state: &State| numbers[state.cell().index()];
    let rows = states.chunk_by(move |a, b| number(a) == number(b));
    rows.filter_map(move |row| Some((number(row.first()?), row)))
}

/// A block before it was published anew.
struct Old {
    segmented: Segmented,
    /// The components of its patches, by number.
    components: Vec<ComponentId>,
}

#[cfg(test)]
mod tests;
