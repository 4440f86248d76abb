//! The sparse grid: voxels in blocks of 8 x 8 x 8.
//!
//! A block is found by one hash look-up a scan; neighbouring blocks know each other, so that walks over the neighbourhood
//! need none. What a voxel knows does not depend on the order of the points within a scan (see `sums`), nor do the places of
//! blocks: those that a scan brings are numbered in the order of their keys.
//!
//! A block that has lost all its voxels goes with its place in the list, which the last one takes ([`Grid::release`]): memory
//! follows what is there, whatever was there once.

mod bin;
mod index;
pub(super) mod moves;

use std::sync::Arc;

use nalgebra::Point3;

pub(super) use self::bin::Binned;
use self::index::Index;
use self::moves::Moves;
use super::block::{Around, Block, BlockIndex, BlockKey, Cell, Direction, Voxel};
use super::lists::by::Place;
use super::lists::shared::Shared;
use super::noise::NoiseModel;
use super::state::State;
use crate::engine::params::Params;
use crate::engine::saved::{RestoreError, ensure};

/// The blocks with their voxels, but not where they are found. A copy shares with the grid what neither changes ([`Shared`]).
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    voxel_size: f64,
    min_points: u32,
    list: Shared<BlockIndex, Block>,
    dense: u32,
}

impl Blocks {
    pub(super) const fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// Number of dense voxels.
    pub(super) const fn dense(&self) -> u32 {
        self.dense
    }

    pub(super) const fn is_dense(&self, voxel: &Voxel) -> bool {
        voxel.count >= self.min_points
    }

    /// What part of the pages is shared with another copy.
    #[cfg(test)]
    pub(super) fn shared_with(&self, other: &Self) -> f64 {
        self.list.shared_with(&other.list)
    }

    /// The places of each page that is not shared with another copy.
    #[cfg(test)]
    pub(super) fn copied_since(&self, other: &Self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.list.copied_since(&other.list)
    }

    /// All blocks, by their places.
    pub(super) fn blocks(&self) -> impl Iterator<Item = (BlockIndex, &Block)> {
        self.list.each()
    }

    pub(super) fn block(&self, block: BlockIndex) -> &Block {
        &self.list[block]
    }

    /// The dense voxels of a block as they are now, by ascending cell.
    pub(super) fn states(&self, block: &Block) -> Vec<State> {
        let voxels = block.voxels();
        let dense = voxels.iter().filter(|voxel| self.is_dense(voxel));
        let mut states = Vec::with_capacity(block.dense as usize);
        states.extend(dense.map(State::new));
        states
    }

    /// Mean of a voxel's points (m), fixed frame.
    pub(super) fn centre(&self, block: &Block, voxel: &Voxel) -> Point3<f64> {
        Point3::from((block.low() + voxel.cell.corner() + voxel.moments.mean()) * self.voxel_size)
    }
}

/// [`Blocks`] that are found by their keys and take in scans.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    blocks: Blocks,
    noise: NoiseModel,
    index: Index,
    /// Points of one scan that prove a voxel to be occupied.
    proof: u32,
    voxels: usize,
}

/// Fewer points of one scan than this may be strays.
const MOST_STRAYS: u32 = 3;

/// Points of one scan that prove a voxel to be occupied: a quarter of those that make it dense, two at least and
/// [`MOST_STRAYS`] at most. A single one may be a stray, but where it makes a voxel dense.
fn proof(min_points: u32) -> u32 {
    (min_points / 4).clamp(2, MOST_STRAYS).min(min_points)
}

impl Grid {
    pub(super) fn new(params: &Params) -> Self {
        let blocks = Blocks {
            voxel_size: params.voxel_size(),
            min_points: params.min_points(),
            list: Shared::default(),
            dense: 0,
        };
        Self {
            blocks,
            noise: params.noise_model(),
            index: Index::new(),
            proof: proof(params.min_points()),
            voxels: 0,
        }
    }

    /// The blocks as they are now: whatever changes in the grid, these stay.
    pub(super) fn freeze(&self) -> Blocks {
        self.blocks.clone()
    }

    /// See [`Blocks::voxel_size`].
    pub(super) const fn voxel_size(&self) -> f64 {
        self.blocks.voxel_size()
    }

    /// See [`Blocks::dense`].
    pub(super) const fn dense(&self) -> u32 {
        self.blocks.dense()
    }

    /// See [`Blocks::is_dense`].
    pub(super) const fn is_dense(&self, voxel: &Voxel) -> bool {
        self.blocks.is_dense(voxel)
    }

    /// See [`Blocks::blocks`].
    pub(super) fn blocks(&self) -> impl Iterator<Item = (BlockIndex, &Block)> {
        self.blocks.blocks()
    }

    /// See [`Blocks::block`].
    pub(super) fn block(&self, block: BlockIndex) -> &Block {
        self.blocks.block(block)
    }

    /// See [`Blocks::states`].
    pub(super) fn states(&self, block: &Block) -> Vec<State> {
        self.blocks.states(block)
    }

    /// See [`Blocks::centre`].
    #[cfg(test)]
    pub(super) fn centre(&self, block: &Block, voxel: &Voxel) -> Point3<f64> {
        self.blocks.centre(block, voxel)
    }

    /// Takes in a block with its voxels, at the next place of the list.
    pub(super) fn restore(&mut self, block: Block) -> Result<BlockIndex, RestoreError> {
        let slot = BlockIndex::at(self.blocks.list.len());
        let key = block.key;
        ensure(self.index.insert(key, slot).is_none(), || format!("two blocks at {key:?}"))?;
        self.blocks.dense += block.dense;
        self.voxels += block.len();
        self.blocks.list.push(block);
        self.link(key, slot);
        Ok(slot)
    }

    /// Number of voxels that hold a point.
    pub(super) const fn len(&self) -> usize {
        self.voxels
    }

    pub(super) const fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// Number of blocks, which have the places below it.
    pub(super) fn slots(&self) -> usize {
        self.blocks.list.len()
    }

    pub(super) fn note_published(&mut self, block: BlockIndex, sequence: u64) {
        self.blocks.list[block].note_published(sequence, self.blocks.min_points);
    }

    /// Notes that a block holds points in dense voxels that are not published.
    pub(super) fn note_touched(&mut self, block: BlockIndex) {
        self.blocks.list[block].news.note_touched();
    }

    /// Notes that it is time for a block to rest; whether there is something in it that is to be published first.
    pub(super) fn note_left(&mut self, block: BlockIndex) -> bool {
        self.blocks.list[block].news.note_left()
    }

    /// Puts a block to rest whose dense voxels were published as they are now: as these states.
    pub(super) fn rest(&mut self, block: BlockIndex, states: Arc<Vec<State>>) {
        self.blocks.list[block].rest(states);
    }

    /// Ends the rest of a block; whether it was at rest.
    pub(super) fn wake(&mut self, block: BlockIndex) -> bool {
        // Asked first: most are awake, and what is to be changed is copied where a frozen map shares it.
        self.block(block).is_at_rest() && self.blocks.list[block].wake()
    }

    /// The places of all blocks, in no order.
    pub(super) fn keys(&self) -> impl Iterator<Item = BlockKey> {
        self.index.keys()
    }

    pub(super) fn find(&self, key: BlockKey) -> Option<BlockIndex> {
        self.index.get(key)
    }

    /// Takes a voxel out with all its points.
    pub(super) fn remove(&mut self, block: BlockIndex, cell: Cell) -> Option<Voxel> {
        let removed = self.blocks.list[block].remove(cell)?;
        self.voxels -= 1;
        if self.is_dense(&removed) {
            let block = &mut self.blocks.list[block];
            block.dense -= 1;
            block.news.note_lost();
            self.blocks.dense -= 1;
        }
        Some(removed)
    }

    /// Takes all voxels of a block out.
    pub(super) fn empty(&mut self, block: BlockIndex) {
        let block = &mut self.blocks.list[block];
        self.voxels -= block.len();
        block.empty();
        self.blocks.dense -= block.dense;
        if block.dense > 0 {
            block.news.note_lost();
        }
        block.dense = 0;
    }

    /// Takes those of these blocks out that have no voxel, and gives their places to the last of the list. What they were must
    /// have been published; whatever refers to places must follow.
    pub(super) fn release(&mut self, thinned: &[BlockIndex]) -> Moves {
        let mut gone: Vec<_> =
            thinned.iter().copied().filter(|&block| self.block(block).is_empty()).collect();
        gone.sort_unstable();
        gone.dedup();
        gone.iter().for_each(|&block| self.unlink(block));
        let moves = Moves::new(self.blocks.list.len(), gone);
        moves.apply(&mut self.blocks.list);
        let moved: Vec<_> = moves.moved().iter().map(|&(_, to)| (self.block(to).key, to)).collect();
        for &(key, to) in &moved {
            self.index.insert(key, to);
        }
        moved.into_iter().for_each(|(key, to)| self.link(key, to));
        moves
    }

    /// A block and its neighbours forget each other.
    fn unlink(&mut self, index: BlockIndex) {
        let block = &mut self.blocks.list[index];
        self.index.remove(block.key);
        let around = std::mem::take(&mut block.around);
        for (direction, other) in around.iter() {
            self.blocks.list[other].around.set(direction.opposite(), None);
        }
    }

    /// Notes that a voxel was seen through; whether it is to be cleared.
    pub(super) fn note_seen_through(&mut self, block: BlockIndex, cell: Cell) -> bool {
        let voxel = self.blocks.list[block].voxel_mut(cell);
        voxel.is_some_and(|voxel| voxel.clearance.note_seen_through())
    }

    pub(super) fn block_at(&mut self, key: BlockKey) -> BlockIndex {
        let next = BlockIndex::at(self.blocks.list.len());
        self.index.get(key).unwrap_or_else(|| {
            self.index.insert(key, next);
            self.blocks.list.push(Block::new(key));
            self.link(key, next);
            next
        })
    }

    /// A block and its neighbours get to know each other.
    fn link(&mut self, key: BlockKey, index: BlockIndex) {
        let mut around = Around::default();
        for direction in Direction::all() {
            let [dx, dy, dz] = direction.offset();
            let neighbour = self.index.get([key[0] + dx, key[1] + dy, key[2] + dz]);
            around.set(direction, neighbour);
            if let Some(other) = neighbour.filter(|other| *other != index) {
                self.blocks.list[other].around.set(direction.opposite(), Some(index));
            }
        }
        self.blocks.list[index].around = around;
    }
}
