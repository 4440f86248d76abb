//! How the patches of published blocks meet those around them, and what they are joined to.

use std::collections::{BTreeMap, BTreeSet};

use super::{PublishedBlocks, Surfaces};
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::graph::{Batch, End, Outcome};
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::patch::host::{host, joined_with};
use crate::engine::consistent::patch::segmented::contacts;
use crate::engine::consistent::patch::{Patch, PatchId};

impl Surfaces {
    /// The nodes and edges of the new patches, and the edges of slices and bridges beside them, which may be parts of
    /// another patch now.
    pub(super) fn connect(&mut self, grid: &Grid, published: PublishedBlocks<'_>, batch: &mut Batch) {
        let first = self.add_nodes(published, batch);
        let slices = self.meet_new(grid, published);
        let mut anew: Vec<_> = published.iter().flat_map(|block| self.segmented.ids(block)).collect();
        for &id in &anew {
            self.find_host(id);
        }
        let slices: Vec<_> = slices.into_iter().filter(|&id| self.find_host(id)).collect();
        self.cut(&slices, batch);
        anew.extend(slices);
        let end = |id: PatchId| match first.get(&id.block) {
            Some(first) => End::New(first + u32::from(id.number)),
            None => End::Old(self.node(id)),
        };
        for id in anew {
            let joined = joined_with(&self.segmented, id, &self.rules);
            batch.connect.extend(joined.map(|other| (end(id), end(other))));
        }
    }

    /// Adds a node for each new patch; returns the place of each block's first one among them.
    fn add_nodes(&self, published: PublishedBlocks<'_>, batch: &mut Batch) -> BTreeMap<BlockIndex, u32> {
        let mut first = BTreeMap::new();
        for block in published.iter() {
            first.insert(block, batch.add.len() as u32);
            batch.add.extend(self.segmented[block].patches.iter().map(|patch| patch.cells.len() as u32));
        }
        first
    }

    /// Finds where the new patches meet others; returns the patches of other blocks that may be slices or bridges and that meet them,
    /// or met what was there before.
    fn meet_new(&mut self, grid: &Grid, published: PublishedBlocks<'_>) -> Vec<PatchId> {
        let slices = self.slices_beside(grid, published);
        let met: Vec<_> = slices.iter().map(|&id| self.meets_any(id, published)).collect();
        published.iter().for_each(|block| self.meet(grid, block, published));
        let slices = slices.into_iter().zip(met);
        slices.filter(|&(id, met)| met || self.meets_any(id, published)).map(|(id, _)| id).collect()
    }

    /// Takes out the edges of patches that stay, but for those to nodes that go, with which they go unsaid.
    fn cut(&self, patches: &[PatchId], batch: &mut Batch) {
        let gone: BTreeSet<_> = batch.remove.iter().copied().collect();
        for &id in patches {
            let node = self.node(id);
            let stay = self.graph.neighbours(node).iter().filter(|other| !gone.contains(other));
            batch.disconnect.extend(stay.map(|&other| (node, other)));
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

    /// Finds where the patches of a block that was segmented anew, with others, meet those around it, and tells these.
    fn meet(&mut self, grid: &Grid, block: BlockIndex, published: PublishedBlocks<'_>) {
        for (direction, other) in grid.block(block).around.iter() {
            if !published.has(other) {
                // It may have met what this block was before.
                if self.segmented[other].contacts.meets(block) {
                    self.segmented[other].contacts.forget(block);
                }
            } else if other < block {
                // It has met this one already.
                continue;
            }
            let [here, there] = [block, other].map(|block| &self.segmented[block]);
            let met = contacts(here, there, direction);
            for ((a, b), contact) in met {
                let [a, b] = [PatchId { block, number: a }, PatchId { block: other, number: b }];
                self.segmented[block].contacts.insert(a.number, b, &contact);
                self.segmented[other].contacts.insert(b.number, a, &contact);
            }
        }
    }

    /// Patches of other blocks around these that may be slices or bridges.
    fn slices_beside(&self, grid: &Grid, published: PublishedBlocks<'_>) -> Vec<PatchId> {
        let around =
            published.iter().flat_map(|block| grid.block(block).around.iter().map(|(_, other)| other));
        let others: BTreeSet<_> = around.filter(|&other| !published.has(other)).collect();
        let ids = others.into_iter().flat_map(|other| self.segmented.ids(other));
        let may_have_host = |patch: &Patch| patch.may_be_slice() || patch.may_be_bridge();
        ids.filter(|&id| may_have_host(self.segmented.patch(id))).collect()
    }

    /// Whether a patch meets one of these blocks.
    fn meets_any(&self, id: PatchId, published: PublishedBlocks<'_>) -> bool {
        self.segmented.contacts_of(id).any(|(other, _)| published.has(other.block))
    }

    /// Writes down which nodes the new patches have got.
    pub(super) fn number(&mut self, published: PublishedBlocks<'_>, outcome: &Outcome) {
        let mut added = outcome.added.iter();
        for block in published.iter() {
            let count = self.segmented[block].patches.len();
            let nodes: Vec<_> = added.by_ref().take(count).map(|(node, _)| *node).collect();
            for (number, &node) in (0..).zip(&nodes) {
                *self.patches.grow_to(node) = Some(PatchId { block, number });
            }
            self.nodes[block] = nodes;
        }
    }
}
