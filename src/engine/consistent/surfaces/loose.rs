//! Loose voxels, whose patch is found by what lies around them: those in no patch, and those of frayed ones (cut, folded or narrow).
//!
//! They look for it anew when a block around them is published, and are moved only where it is another one.

use std::collections::BTreeMap;

use super::{PublishedBlocks, Surfaces};
use crate::engine::consistent::block::{BlockIndex, Cell};
use crate::engine::consistent::cells::Cells;
use crate::engine::consistent::graph::NodeId;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::patch::PatchId;
use crate::engine::consistent::patch::owner::{Owners, RIM_REACH};
use crate::engine::consistent::state::State;

/// A loose voxel beside blocks that are published.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    pub(super) block: BlockIndex,
    /// Its place in the block's list of loose ones.
    pub(super) number: usize,
    /// It belongs to a patch of theirs.
    pub(super) is_theirs: bool,
}

impl Surfaces {
    /// Puts a voxel that has become dense beside the patches that are there, until its block is published.
    pub(super) fn admit(&mut self, grid: &Grid, block: BlockIndex, cell: Cell) {
        let Some(voxel) = grid.block(block).voxel(cell) else { return };
        debug_assert_eq!(self.segmented[block].corner(), grid.block(block).corner());
        let admitted = self.segmented[block].admit(State::new(voxel));
        if let Some(number) = admitted {
            self.enter_loose(grid, block, std::iter::once(number));
        }
    }

    /// Loose voxels of other blocks within reach of these, by ascending block and number.
    pub(super) fn beside(&self, grid: &Grid, published: PublishedBlocks<'_>) -> Vec<Beside> {
        let mut near = BTreeMap::<BlockIndex, Cells>::new();
        for block in published.iter() {
            let around = grid.block(block).around.iter();
            for (direction, other) in around.filter(|(_, other)| !published.has(*other)) {
                let loose = &self.segmented[other].loose_cells;
                let border = loose.and(&Cells::border(direction.opposite(), RIM_REACH));
                if !border.is_empty() {
                    near.entry(other).or_default().extend(&border);
                }
            }
        }
        let mut beside = Vec::new();
        for (block, cells) in near {
            let here = &self.segmented[block];
            // Most of a row of loose voxels belong to one patch.
            let mut last = (None, false);
            beside.extend(here.loose_cells.ranks_of(&cells).map(|number| {
                let owner = here.loose[number].owner();
                if owner != last.0 {
                    last = (owner, self.is_of(owner, published));
                }
                Beside { block, number, is_theirs: last.1 }
            }));
        }
        beside
    }

    /// Whether a node is that of a patch of these blocks.
    fn is_of(&self, node: Option<NodeId>, published: PublishedBlocks<'_>) -> bool {
        let patch = node.and_then(|node| self.patches[node]);
        patch.is_some_and(|patch| published.has(patch.block))
    }

    /// Takes a loose voxel out of the cluster of its owner. That it has another one, or none, from then on is for the caller to note, or
    /// it would be taken out twice.
    pub(super) fn leave_loose(&mut self, block: BlockIndex, number: usize) {
        let here = &self.segmented[block];
        let Some(owner) = here.loose[number].owner() else { return };
        let state = here.loose_state(number);
        let component = self.graph.component(owner);
        let own = self.patches[owner].and_then(|patch| self.number_in(patch, block, state.cell()));
        let member = here.member(state, own, &self.rules);
        if let (Some(cluster), Some(member)) = (self.clusters[component].as_mut(), member) {
            cluster.remove(&member);
            self.changed.insert(component);
        }
    }

    /// Takes those of the loose voxels of one block out of their clusters that belong to patches that go.
    pub(super) fn withdraw_loose(&mut self, beside: &[Beside]) {
        let theirs = || beside.iter().filter(|it| it.is_theirs);
        theirs().for_each(|it| self.leave_loose(it.block, it.number));
        if let Some(first) = theirs().next() {
            self.set_owners(first.block, theirs().map(|it| (it.number, None)).collect());
        }
    }

    fn set_owners(&mut self, block: BlockIndex, owners: Vec<(usize, Option<NodeId>)>) {
        let loose = &mut self.segmented[block].loose;
        owners.into_iter().for_each(|(number, owner)| loose[number].set_owner(owner));
    }

    /// Puts loose voxels of a block, by their places in its list, beside the patches that they belong to.
    pub(super) fn enter_loose(
        &mut self,
        grid: &Grid,
        block: BlockIndex,
        numbers: impl Iterator<Item = usize>,
    ) {
        let owners = self.owners(grid, block, numbers).into_iter();
        let owners: Vec<_> = owners.filter_map(|(number, owner)| Some((number, owner?))).collect();
        owners.iter().for_each(|&(number, owner)| self.enter_near(block, number, owner));
        let given = owners.into_iter().map(|(number, owner)| (number, Some(self.node(owner))));
        self.set_owners(block, given.collect());
    }

    /// Puts the loose voxels of one block beside the patches that they belong to after blocks around it were published;
    /// nothing is done where one stays with its patch.
    pub(super) fn settle_loose(&mut self, grid: &Grid, beside: &[Beside], published: PublishedBlocks<'_>) {
        let Some(&Beside { block, .. }) = beside.first() else { return };
        let around = grid.block(block).around.iter();
        let new = around.filter(|(_, other)| published.has(*other));
        let anew: Vec<_> = new.map(|(direction, _)| direction).collect();
        let here = &self.segmented[block];
        let owners = Owners::new(grid.block(block), &self.segmented, &self.rules);
        let stays = |number: usize| {
            let with = here.loose[number].owner().and_then(|owner| self.patches[owner]);
            owners.stays(here.loose_state(number), with, &anew)
        };
        let moving = beside.iter().filter(|it| it.is_theirs || !stays(it.number)).map(|it| it.number);
        let mut moved = Vec::new();
        for (number, owner) in self.owners(grid, block, moving) {
            let node = owner.map(|owner| self.node(owner));
            if node == self.segmented[block].loose[number].owner() {
                continue;
            }
            self.leave_loose(block, number);
            if let Some(owner) = owner {
                self.enter_near(block, number, owner);
            }
            moved.push((number, node));
        }
        if !moved.is_empty() {
            self.set_owners(block, moved);
        }
    }

    /// Loose voxels of a block, each with the patch that it belongs to.
    fn owners(
        &self,
        grid: &Grid,
        block: BlockIndex,
        numbers: impl Iterator<Item = usize>,
    ) -> Vec<(usize, Option<PatchId>)> {
        let here = &self.segmented[block];
        let owners = Owners::new(grid.block(block), &self.segmented, &self.rules);
        let owner = |number: usize| owners.of(here.loose_state(number));
        numbers.map(|number| (number, owner(number))).collect()
    }

    /// Puts a loose voxel into the cluster of the patch that it belongs to, one near it or its own, which is frayed. That this is its
    /// owner is for the caller to note.
    fn enter_near(&mut self, block: BlockIndex, number: usize, owner: PatchId) {
        let here = &self.segmented[block];
        let state = here.loose_state(number);
        let component = self.graph.component(self.node(owner));
        let own = self.number_in(owner, block, state.cell());
        let member = here.member(state, own, &self.rules);
        if let (Some(cluster), Some(member)) = (self.clusters[component].as_mut(), member) {
            cluster.add(&member);
        }
        self.changed.insert(component);
    }
}
