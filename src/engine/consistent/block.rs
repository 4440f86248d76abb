//! A block of 8 x 8 x 8 voxels: what each voxel has counted.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::cells::Cells;
use super::clearing::Clearance;
use super::lists::by::Place;
use super::lists::room;
use super::publish::baseline::Baseline;
use super::publish::news::News;
use super::publish::rest::Rest;
use super::state::State;
use super::sums::Moments;
use crate::engine::key::VoxelKey;
use crate::engine::params::MAX_POINTS;

/// Voxels along the edge of a block.
pub(super) const EDGE: i32 = 8;
/// Voxels of a block.
pub(super) const CELLS: usize = 512;

/// Place of a block in the grid's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct BlockIndex(pub(super) u32);

impl Place for BlockIndex {
    fn at(place: usize) -> Self {
        Self(place as u32)
    }

    fn place(self) -> usize {
        self.0 as usize
    }
}

/// Place of a voxel in its block: (x * 8 + y) * 8 + z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Cell(pub(super) u16);

impl Cell {
    /// The cell at these coordinates, each 0 to 7.
    pub(super) const fn at([x, y, z]: [i32; 3]) -> Self {
        Self(((x * EDGE + y) * EDGE + z) as u16)
    }

    /// Coordinates within the block, each 0 to 7.
    pub(super) const fn coordinates(self) -> [i32; 3] {
        let cell = self.0 as i32;
        [cell / (EDGE * EDGE), cell / EDGE % EDGE, cell % EDGE]
    }

    /// Its lower corner from that of the block, in voxels.
    pub(super) fn corner(self) -> Vector3<f64> {
        Vector3::from(self.coordinates()).map(f64::from)
    }

    pub(super) const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Integer place of a block: voxel indices divided by 8, rounded down.
pub(super) type BlockKey = [i32; 3];

/// The block of a voxel and its cell there.
pub(super) fn block_and_cell(key: VoxelKey) -> (BlockKey, Cell) {
    let indices = key.indices();
    (indices.map(|i| i.div_euclid(EDGE)), Cell::at(indices.map(|i| i.rem_euclid(EDGE))))
}

/// The voxel of a cell in the block with this lower corner (voxel indices); `None` beyond the grid.
pub(super) fn voxel_key(corner: [i32; 3], cell: Cell) -> Option<VoxelKey> {
    let at = cell.coordinates();
    let [x, y, z] = [0, 1, 2].map(|axis| corner[axis] + at[axis]);
    VoxelKey::new(x, y, z)
}

/// What a voxel has counted, in the order in which it is saved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Voxel {
    pub(super) cell: Cell,
    /// Points counted since it was last cleared.
    pub(super) count: u32,
    pub(super) moments: Moments,
    pub(super) baseline: Baseline,
    /// Scan that put a point here last, modulo 2^32.
    pub(super) hit: u32,
    /// How often it was seen through.
    pub(super) clearance: Clearance,
}

impl Voxel {
    /// A voxel without points.
    pub(super) fn new(cell: Cell) -> Self {
        Self {
            cell,
            count: 0,
            moments: Moments::default(),
            baseline: Baseline::default(),
            hit: 0,
            clearance: Clearance::default(),
        }
    }

    /// Whether one that holds a point may be so, wherever it lies.
    pub(super) fn is_possible(&self) -> bool {
        (1..=MAX_POINTS).contains(&self.count) && self.moments.is_possible() && self.baseline.is_possible()
    }
}

/// The direction from a block to one of the 26 around it, or to itself: (dx + 1) * 9 + (dy + 1) * 3 + dz + 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Direction(u8);

impl Direction {
    const COUNT: u8 = 27;

    /// From a block to itself.
    pub(super) const OWN: Self = Self::of([0; 3]);

    /// All directions, that to the block itself among them.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT).map(Self)
    }

    /// The direction of an offset in blocks: -1, 0 or 1 along each axis.
    #[inline]
    pub(super) const fn of([dx, dy, dz]: [i32; 3]) -> Self {
        Self(((dx + 1) * 9 + (dy + 1) * 3 + dz + 1) as u8)
    }

    /// Its offset in blocks.
    #[inline]
    pub(super) const fn offset(self) -> [i32; 3] {
        let place = self.0 as i32;
        [place / 9 - 1, place / 3 % 3 - 1, place % 3 - 1]
    }

    pub(super) const fn opposite(self) -> Self {
        Self(Self::COUNT - 1 - self.0)
    }

    /// Coordinates of a cell as the block in this direction counts them.
    #[inline]
    pub(super) fn seen_from(self, at: [i32; 3]) -> [i32; 3] {
        let offset = self.offset();
        [0, 1, 2].map(|axis| at[axis] - EDGE * offset[axis])
    }

    const fn index(self) -> usize {
        self.0 as usize
    }
}

/// The 26 blocks around a block and itself, by [`Direction`]; [`NOWHERE`] where there is none. Of options it would be twice as
/// large.
#[derive(Clone, Debug)]
pub(super) struct Around([u32; Direction::COUNT as usize]);

const NOWHERE: u32 = u32::MAX;

impl Default for Around {
    fn default() -> Self {
        Self([NOWHERE; Direction::COUNT as usize])
    }
}

impl Around {
    pub(super) fn get(&self, direction: Direction) -> Option<BlockIndex> {
        let block = self.0[direction.index()];
        (block != NOWHERE).then_some(BlockIndex(block))
    }

    pub(super) fn set(&mut self, direction: Direction, block: Option<BlockIndex>) {
        self.0[direction.index()] = block.map_or(NOWHERE, |block| block.0);
    }

    /// The blocks that are there, with their directions.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Direction, BlockIndex)> {
        let blocks = Direction::all().zip(&self.0).filter(|(_, block)| **block != NOWHERE);
        blocks.map(|(direction, block)| (direction, BlockIndex(*block)))
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    pub(super) key: BlockKey,
    pub(super) around: Around,
    /// The cells that have a voxel.
    cells: Cells,
    /// By ascending cell; none while it rests.
    voxels: Vec<Voxel>,
    /// The voxels of a block at rest, shared with what was frozen of the map meanwhile.
    rest: Option<Arc<Rest>>,
    /// Number of dense voxels.
    pub(super) dense: u32,
    /// Since its states were published.
    pub(super) news: News,
}

impl Block {
    /// A block at this place, without a voxel.
    pub(super) fn new(key: BlockKey) -> Self {
        Self { key, ..Self::default() }
    }

    /// Notes that its states are published as they are now.
    pub(super) fn note_published(&mut self, sequence: u64, min_points: u32) {
        let dense = |voxel: &&mut Voxel| voxel.count >= min_points;
        self.voxels.iter_mut().filter(dense).for_each(|voxel| voxel.baseline = Baseline::of(&voxel.moments));
        self.news.note_published(sequence);
    }

    /// Whether it is to be put to rest now.
    pub(super) fn is_to_rest(&self, sequence: u64) -> bool {
        !self.is_empty() && !self.is_at_rest() && self.news.is_told() && self.news.is_left(sequence)
    }

    /// Keeps its voxels as they are published, or would be; `states` are the dense ones.
    pub(super) fn rest(&mut self, states: Arc<Vec<State>>) {
        debug_assert!(self.rest.is_none() && self.news.is_told());
        self.rest = Some(Arc::new(Rest::new(&std::mem::take(&mut self.voxels), states)));
    }

    /// Ends its rest; whether it was at rest.
    pub(super) fn wake(&mut self) -> bool {
        let Some(voxels) = self.rested() else { return false };
        self.voxels = voxels;
        self.rest = None;
        true
    }

    /// All voxels of a block at rest.
    fn rested(&self) -> Option<Vec<Voxel>> {
        self.rest.as_ref().map(|rest| rest.voxels(self.news.seen()))
    }

    pub(super) const fn is_at_rest(&self) -> bool {
        self.rest.is_some()
    }

    /// Whether it has no voxel.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Whether the voxel of a cell holds a point.
    pub(super) const fn contains(&self, cell: Cell) -> bool {
        self.cells.contains(cell)
    }

    /// Number of voxels that hold a point.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// The voxels that hold a point, by ascending cell. Of a block at rest they are made.
    pub(super) fn voxels(&self) -> Cow<'_, [Voxel]> {
        self.rested().map_or(Cow::Borrowed(&self.voxels), Cow::Owned)
    }

    /// The voxels that hold a point, by ascending cell, of a block that is awake.
    pub(super) fn awake(&self) -> &[Voxel] {
        debug_assert!(!self.is_at_rest());
        &self.voxels
    }

    /// The voxel of a cell in a block that is awake.
    pub(super) fn voxel(&self, cell: Cell) -> Option<&Voxel> {
        self.awake().get(self.rank(cell)?)
    }

    /// The voxel of this rank in a block that is awake.
    pub(super) fn at(&mut self, rank: usize) -> &mut Voxel {
        debug_assert!(!self.is_at_rest());
        &mut self.voxels[rank]
    }

    pub(super) fn voxel_mut(&mut self, cell: Cell) -> Option<&mut Voxel> {
        debug_assert!(!self.is_at_rest());
        let rank = self.rank(cell)?;
        self.voxels.get_mut(rank)
    }

    /// The rank of a cell's voxel: its place in the list, which is in the order of cells.
    fn rank(&self, cell: Cell) -> Option<usize> {
        self.cells.contains(cell).then(|| self.cells.rank(cell))
    }

    /// The voxel of a cell; `None` beyond the grid.
    pub(super) fn voxel_key(&self, cell: Cell) -> Option<VoxelKey> {
        voxel_key(self.corner(), cell)
    }

    /// Index of the first voxel along each axis.
    pub(super) fn corner(&self) -> [i32; 3] {
        self.key.map(|i| i * EDGE)
    }

    /// The same place, in voxels from the corner of voxel (0, 0, 0).
    pub(super) fn low(&self) -> Vector3<f64> {
        Vector3::from(self.corner()).map(f64::from)
    }

    /// The rank of a cell's voxel, and whether it was begun, without points, for there was none. All voxels before
    /// `from` have lower cells: who comes to cells in their order passes each voxel once.
    pub(super) fn rank_or_insert(&mut self, from: usize, cell: Cell) -> (usize, bool) {
        debug_assert!(from <= self.cells.rank(cell) && !self.is_at_rest());
        let rank = from + self.voxels[from..].iter().take_while(|voxel| voxel.cell < cell).count();
        let is_new = self.voxels.get(rank).is_none_or(|voxel| voxel.cell != cell);
        if is_new {
            self.insert(rank, Voxel::new(cell));
        }
        (rank, is_new)
    }

    /// Puts a voxel where none is; `false` where one is.
    pub(super) fn restore(&mut self, voxel: Voxel) -> bool {
        let is_new = !self.cells.contains(voxel.cell);
        if is_new {
            self.insert(self.cells.rank(voxel.cell), voxel);
        }
        is_new
    }

    fn insert(&mut self, rank: usize, voxel: Voxel) {
        self.cells.insert(voxel.cell);
        room::insert(&mut self.voxels, rank, voxel);
    }

    /// Takes a voxel out of a block that is awake, with all its points.
    pub(super) fn remove(&mut self, cell: Cell) -> Option<Voxel> {
        let rank = self.rank(cell)?;
        self.cells.remove(cell);
        Some(self.voxels.remove(rank))
    }

    /// Takes all voxels out.
    pub(super) fn empty(&mut self) {
        (self.cells, self.voxels, self.rest) = (Cells::default(), Vec::new(), None);
    }
}
