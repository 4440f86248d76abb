//! The sparse grid: voxels in blocks of 8 x 8 x 8, what each has counted, and the binning of a scan (section III.B).
//!
//! A block is found by one hash look-up a run of points that stay in one voxel; neighbouring blocks know each other, so
//! that walks over the neighbourhood need none. Sums are exact and free of order (see `sums`), and so are the places of
//! blocks: those that a scan brings are numbered by their keys.
//!
//! A block that has lost all its voxels gives its memory back and its place to the next block that comes
//! ([`Grid::release`]); it keeps 1.5 KB until then, so memory follows the most blocks that were there at once.

use hashbrown::HashMap;
use nalgebra::{Isometry3, Point3, Vector3};
use rustc_hash::FxBuildHasher;

use super::noise::NoiseModel;
use super::sums::{ScanSums, Sums, UNITS};
use super::view::Clearance;
use crate::engine::binning::{floor, map};
use crate::engine::key::VoxelKey;
use crate::engine::params::{MAX_POINTS, Params};
use crate::engine::scan::{Points, Scan};

/// Voxels along the edge of a block.
pub(super) const EDGE: i32 = 8;
/// Voxels of a block.
pub(super) const CELLS: usize = 512;

/// Place of a block in the grid's list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct BlockIndex(pub(super) u32);

/// Place of a voxel in its block: (x * 8 + y) * 8 + z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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

    pub(super) const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Integer place of a block: voxel indices divided by 8, rounded down.
pub(super) type BlockKey = [i32; 3];

/// The block of a voxel and its cell there.
pub(super) fn place(key: VoxelKey) -> (BlockKey, Cell) {
    let indices = key.indices();
    (indices.map(|i| i.div_euclid(EDGE)), Cell::at(indices.map(|i| i.rem_euclid(EDGE))))
}

#[derive(Clone, Debug)]
pub(super) struct Voxel {
    pub(super) cell: Cell,
    /// Points counted since it was last cleared.
    pub(super) count: u32,
    pub(super) sums: Sums,
    /// Weight of the sums when the block was published last.
    pub(super) published_weight: u64,
    /// Place among the voxels touched by the scan that is being taken in.
    touched: u32,
    /// Scan that put a point here last.
    pub(super) hit: u64,
    /// How often it was seen through.
    clearance: Clearance,
}

const UNTOUCHED: u32 = u32::MAX;
const NO_VOXEL: u16 = u16::MAX;

/// The 26 blocks around a block and itself, by (dx + 1) * 9 + (dy + 1) * 3 + dz + 1.
pub(super) type Around = [Option<BlockIndex>; 27];

#[derive(Clone, Debug)]
pub(super) struct Block {
    pub(super) key: BlockKey,
    pub(super) around: Around,
    places: Box<[u16; CELLS]>,
    voxels: Vec<Voxel>,
    /// Number of dense voxels.
    dense: u32,
    /// Voxels that have become dense since the block was published.
    renewed: u32,
    /// A dense voxel has gone: its place must not be told of any longer.
    lost: bool,
    /// Dense voxels whose weight has doubled since then.
    outgrown: u32,
    /// The scan in which it was published last; 0 = never.
    published: u64,
    /// The scan that put a point here last.
    seen: u64,
}

/// Scans between two publications of a block.
const PUBLICATION_INTERVAL: u64 = 4;
/// Scans without a point after which a block is published whatever has changed in it.
const LEFT_ALONE: u64 = 15;

impl Block {
    /// A block without a place in space.
    fn new() -> Self {
        Self {
            key: [0; 3],
            around: [None; 27],
            places: Box::new([NO_VOXEL; CELLS]),
            voxels: Vec::new(),
            dense: 0,
            renewed: 0,
            lost: false,
            outgrown: 0,
            published: 0,
            seen: 0,
        }
    }

    /// Begins anew, at this place.
    fn begin(&mut self, key: BlockKey) {
        (self.key, self.published, self.outgrown) = (key, 0, 0);
        (self.renewed, self.lost) = (0, false);
    }

    /// Whether its states are to be published: at once where a dense voxel has gone; where a quarter of the dense voxels are
    /// new or have doubled their weight; and where the sensor has turned away, whatever has changed. A sensor that stands
    /// still so changes nothing in the end, though noise makes a voxel dense now and then.
    pub(super) const fn is_due(&self, sequence: u64) -> bool {
        let waited = self.published == 0 || sequence - self.published >= PUBLICATION_INTERVAL;
        let much = (self.renewed + self.outgrown) * 4 > self.dense;
        let left = sequence - self.seen >= LEFT_ALONE;
        self.lost || self.is_stale() && (waited && much || left)
    }

    /// Whether anything has changed since its states were published.
    pub(super) const fn is_stale(&self) -> bool {
        self.lost || self.renewed > 0 || self.outgrown > 0
    }

    /// Notes that its states are published as they are now.
    pub(super) fn note_published(&mut self, sequence: u64) {
        self.voxels.iter_mut().for_each(|voxel| voxel.published_weight = voxel.sums.weight);
        (self.renewed, self.lost, self.outgrown, self.published) = (0, false, 0, sequence);
    }

    /// The voxels that hold a point, in the order of their first points.
    pub(super) fn voxels(&self) -> &[Voxel] {
        &self.voxels
    }

    pub(super) fn voxel(&self, cell: Cell) -> Option<&Voxel> {
        self.voxels.get(usize::from(self.places[cell.index()]))
    }

    /// The voxel key of a cell.
    pub(super) fn voxel_key(&self, cell: Cell) -> Option<VoxelKey> {
        let [x, y, z] = cell.coordinates();
        VoxelKey::new(self.key[0] * EDGE + x, self.key[1] * EDGE + y, self.key[2] * EDGE + z)
    }

    /// Index of the first voxel along each axis.
    pub(super) fn corner(&self) -> [i32; 3] {
        self.key.map(|i| i * EDGE)
    }

    /// Takes a voxel out with all its points.
    fn remove(&mut self, cell: Cell) -> Option<Voxel> {
        let place = std::mem::replace(&mut self.places[cell.index()], NO_VOXEL);
        if place == NO_VOXEL {
            return None;
        }
        let removed = self.voxels.swap_remove(usize::from(place));
        if let Some(moved) = self.voxels.get(usize::from(place)) {
            self.places[moved.cell.index()] = place;
        }
        Some(removed)
    }

    /// Takes all voxels out.
    fn empty(&mut self) -> Vec<Voxel> {
        let voxels = std::mem::take(&mut self.voxels);
        voxels.iter().for_each(|voxel| self.places[voxel.cell.index()] = NO_VOXEL);
        voxels
    }
}

/// A voxel that received points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touched {
    pub(super) block: BlockIndex,
    pub(super) cell: Cell,
    /// It became dense by them.
    pub(super) newly_dense: bool,
    sums: ScanSums,
}

/// What binning a scan did.
#[derive(Clone, Debug, Default)]
pub(super) struct Binned {
    /// Every voxel that received a point, once, in the order of the first points.
    pub(super) touched: Vec<Touched>,
    pub(super) newly_dense: u32,
    /// Points beyond the grid's reach.
    pub(super) beyond: u32,
}

#[derive(Clone, Debug)]
pub(super) struct Grid {
    voxel_size: f64,
    min_points: u32,
    noise: NoiseModel,
    index: HashMap<BlockKey, BlockIndex, FxBuildHasher>,
    blocks: Vec<Block>,
    /// Places of the list that no block has.
    free: Vec<BlockIndex>,
    /// Blocks that the scan brought which is being binned, in the order of their first points.
    new: Vec<BlockIndex>,
    /// Points of one scan that prove a voxel to be occupied.
    proof: u32,
    dense: u32,
    voxels: usize,
}

/// Fewer points of one scan than this may be strays.
const MOST_STRAYS: u32 = 3;

/// Consecutive points of one voxel, summed before they are looked up.
struct Run {
    index: [i32; 3],
    /// `None` beyond the grid's reach.
    key: Option<VoxelKey>,
    sums: ScanSums,
}

impl Run {
    fn begin(index: [i32; 3]) -> Self {
        let [ix, iy, iz] = index;
        Self { index, key: VoxelKey::new(ix, iy, iz), sums: ScanSums::default() }
    }
}

impl Grid {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            voxel_size: params.voxel_size(),
            min_points: params.min_points(),
            noise: params.noise_model(),
            index: HashMap::default(),
            blocks: Vec::new(),
            free: Vec::new(),
            new: Vec::new(),
            proof: (params.min_points() / 4).clamp(1, MOST_STRAYS),
            dense: 0,
            voxels: 0,
        }
    }

    pub(super) const fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// Number of dense voxels.
    pub(super) const fn dense(&self) -> u32 {
        self.dense
    }

    /// Number of voxels that hold a point.
    pub(super) const fn len(&self) -> usize {
        self.voxels
    }

    pub(super) const fn is_dense(&self, voxel: &Voxel) -> bool {
        voxel.count >= self.min_points
    }

    pub(super) const fn noise(&self) -> NoiseModel {
        self.noise
    }

    /// Blocks that the list has a place for.
    pub(super) const fn slots(&self) -> usize {
        self.blocks.len()
    }

    pub(super) fn blocks(&self) -> impl Iterator<Item = (BlockIndex, &Block)> {
        (0..).map(BlockIndex).zip(&self.blocks)
    }

    pub(super) fn block(&self, block: BlockIndex) -> &Block {
        &self.blocks[block.0 as usize]
    }

    pub(super) fn note_published(&mut self, block: BlockIndex, sequence: u64) {
        self.blocks[block.0 as usize].note_published(sequence);
    }

    pub(super) fn find(&self, key: BlockKey) -> Option<BlockIndex> {
        self.index.get(&key).copied()
    }

    /// Mean of a voxel's points (m), fixed frame.
    pub(super) fn centre(&self, block: &Block, voxel: &Voxel) -> Point3<f64> {
        let corner = Vector3::from(block.corner()) + Vector3::from(voxel.cell.coordinates());
        Point3::from((corner.map(f64::from) + voxel.sums.mean()) * self.voxel_size)
    }

    /// Takes a voxel out with all its points.
    pub(super) fn remove(&mut self, block: BlockIndex, cell: Cell) -> Option<Voxel> {
        let removed = self.blocks[block.0 as usize].remove(cell)?;
        self.voxels -= 1;
        if self.is_dense(&removed) {
            let block = &mut self.blocks[block.0 as usize];
            block.dense -= 1;
            block.lost = true;
            self.dense -= 1;
        }
        Some(removed)
    }

    /// Takes all voxels of a block out.
    pub(super) fn empty(&mut self, block: BlockIndex) {
        let block = &mut self.blocks[block.0 as usize];
        self.voxels -= block.empty().len();
        self.dense -= block.dense;
        block.lost |= block.dense > 0;
        block.dense = 0;
    }

    /// Gives back what a block takes if it has no voxel; nothing may refer to it any longer, so what it was must have been
    /// published.
    pub(super) fn release(&mut self, index: BlockIndex) {
        let block = &mut self.blocks[index.0 as usize];
        if !block.voxels.is_empty() || self.index.get(&block.key) != Some(&index) {
            return;
        }
        self.index.remove(&block.key);
        block.voxels = Vec::new();
        let around = std::mem::take(&mut block.around);
        for (place, neighbour) in around.into_iter().enumerate() {
            if let Some(other) = neighbour {
                self.blocks[other.0 as usize].around[26 - place] = None;
            }
        }
        self.free.push(index);
    }

    /// Notes that a voxel was seen through; whether it is to be cleared.
    pub(super) fn seen_through(&mut self, block: BlockIndex, cell: Cell) -> bool {
        let block = &mut self.blocks[block.0 as usize];
        let voxel = block.voxels.get_mut(usize::from(block.places[cell.index()]));
        voxel.is_some_and(|voxel| voxel.clearance.seen_through())
    }

    /// Puts the points of a scan into their voxels; `sequence` is the number of the scan.
    pub(super) fn bin(&mut self, scan: &Scan, sequence: u64, binned: &mut Binned) {
        binned.touched.clear();
        (binned.newly_dense, binned.beyond) = (0, 0);
        match &scan.points {
            Points::F32(points) => self.bin_points(points, &scan.fixed_from_sensor, binned),
            Points::F64(points) => self.bin_points(points, &scan.fixed_from_sensor, binned),
        }
        self.number_new(binned);
        for touched in &mut binned.touched {
            self.fold(touched, &scan.fixed_from_sensor, sequence);
            binned.newly_dense += u32::from(touched.newly_dense);
        }
        self.dense += binned.newly_dense;
    }

    fn bin_points<T: Copy + Into<f64>>(
        &mut self,
        points: &[[T; 3]],
        fixed_from_sensor: &Isometry3<f64>,
        binned: &mut Binned,
    ) {
        let rotation = fixed_from_sensor.rotation.to_rotation_matrix().into_inner();
        let translation = fixed_from_sensor.translation.vector;
        let mut run = Run::begin([0; 3]);
        for &point in points {
            let point = map(&rotation, &translation, point.map(Into::into)) / self.voxel_size;
            let index = [floor(point.x), floor(point.y), floor(point.z)];
            if index != run.index {
                self.flush(&run, binned);
                run = Run::begin(index);
            }
            if run.key.is_none() {
                binned.beyond += 1;
                continue;
            }
            let offset = |axis: usize| ((point[axis] - f64::from(index[axis])) * UNITS) as u64;
            run.sums.add([offset(0), offset(1), offset(2)]);
        }
        self.flush(&run, binned);
    }

    fn flush(&mut self, run: &Run, binned: &mut Binned) {
        let Some(key) = run.key.filter(|_| run.sums.count > 0) else { return };
        let (block_key, cell) = place(key);
        let block = self.block_at(block_key);
        let here = &mut self.blocks[block.0 as usize];
        let place = here.places[cell.index()];
        if place == NO_VOXEL {
            here.places[cell.index()] = here.voxels.len() as u16;
            here.voxels.push(Voxel {
                cell,
                count: 0,
                sums: Sums::default(),
                published_weight: 0,
                touched: UNTOUCHED,
                hit: 0,
                clearance: Clearance::default(),
            });
            self.voxels += 1;
        }
        let voxel = &mut here.voxels[usize::from(here.places[cell.index()])];
        if voxel.touched == UNTOUCHED {
            voxel.touched = binned.touched.len() as u32;
            let sums = ScanSums::default();
            binned.touched.push(Touched { block, cell, newly_dense: false, sums });
        }
        binned.touched[voxel.touched as usize].sums.merge(&run.sums);
    }

    /// Adds what a scan put into a voxel to what it had.
    fn fold(&mut self, touched: &mut Touched, fixed_from_sensor: &Isometry3<f64>, sequence: u64) {
        let block = &mut self.blocks[touched.block.0 as usize];
        let corner = Vector3::from(block.corner()) + Vector3::from(touched.cell.coordinates());
        let place = usize::from(block.places[touched.cell.index()]);
        let voxel = &mut block.voxels[place];
        let mean = (corner.map(f64::from) + touched.sums.mean()) * self.voxel_size;
        let in_sensor = fixed_from_sensor.inverse_transform_point(&Point3::from(mean));
        // The depth axis of a depth camera is the dominant one of every ray it has, whichever way its frame is turned.
        let weight = self.noise.weight(in_sensor.coords.amax());
        let towards = (fixed_from_sensor.translation.vector - mean).try_normalize(0.0);
        let doubled = |voxel: &Voxel| voxel.sums.weight >= 2 * voxel.published_weight;
        let was_doubled = doubled(voxel);
        voxel.sums.fold(&touched.sums, weight, &towards.unwrap_or_default());
        let was_dense = voxel.count >= self.min_points;
        voxel.count = voxel.count.saturating_add(touched.sums.count).min(MAX_POINTS);
        voxel.touched = UNTOUCHED;
        voxel.hit = sequence;
        if touched.sums.count >= self.proof {
            voxel.clearance.received_points();
        } else {
            voxel.clearance.received_strays();
        }
        touched.newly_dense = !was_dense && voxel.count >= self.min_points;
        block.outgrown += u32::from(was_dense && !was_doubled && doubled(voxel));
        block.dense += u32::from(touched.newly_dense);
        block.renewed += u32::from(touched.newly_dense);
        block.seen = sequence;
    }

    fn block_at(&mut self, key: BlockKey) -> BlockIndex {
        let next = self.free.last().copied().unwrap_or(BlockIndex(self.blocks.len() as u32));
        let found = *self.index.entry(key).or_insert(next);
        if found == next {
            if self.free.pop().is_none() {
                self.blocks.push(Block::new());
            }
            self.blocks[next.0 as usize].begin(key);
            self.link(key, next);
            self.new.push(next);
        }
        found
    }

    /// A block and its neighbours get to know each other.
    fn link(&mut self, key: BlockKey, index: BlockIndex) {
        let mut around: Around = [None; 27];
        for (place, neighbour) in around.iter_mut().enumerate() {
            let [dx, dy, dz] = offset_of(place);
            *neighbour = self.index.get(&[key[0] + dx, key[1] + dy, key[2] + dz]).copied();
            if let Some(other) = neighbour
                && *other != index
            {
                self.blocks[other.0 as usize].around[26 - place] = Some(index);
            }
        }
        self.blocks[index.0 as usize].around = around;
    }

    /// Gives the places of the blocks that this scan brought to them by ascending key, so that the order of its points
    /// does not matter.
    fn number_new(&mut self, binned: &mut Binned) {
        let key = |grid: &Self, block: BlockIndex| grid.blocks[block.0 as usize].key;
        let mut by_key = std::mem::take(&mut self.new);
        let mut places = by_key.clone();
        places.sort_unstable();
        by_key.sort_unstable_by_key(|&block| key(self, block));
        if places != by_key {
            let moved: HashMap<_, _, FxBuildHasher> =
                by_key.iter().copied().zip(places.iter().copied()).collect();
            let blocks: Vec<_> = by_key
                .iter()
                .map(|block| std::mem::replace(&mut self.blocks[block.0 as usize], Block::new()))
                .collect();
            for (&place, block) in places.iter().zip(blocks) {
                self.index.insert(block.key, place);
                self.blocks[place.0 as usize] = block;
            }
            places.iter().for_each(|&place| self.link(key(self, place), place));
            for touched in &mut binned.touched {
                touched.block = moved.get(&touched.block).copied().unwrap_or(touched.block);
            }
        }
        by_key.clear();
        self.new = by_key;
    }
}

/// The direction of a place in [`Around`].
pub(super) const fn offset_of(place: usize) -> [i32; 3] {
    let place = place as i32;
    [place / 9 - 1, place / 3 % 3 - 1, place % 3 - 1]
}
