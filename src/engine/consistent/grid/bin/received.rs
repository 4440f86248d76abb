//! What a scan puts into each voxel.
//!
//! Points are taken in tiles of 64 (`tile`), and what a tile has put into a voxel is added to what the scan has put there so
//! far. That is found by block and cell: the block in a small table by its place (`recent`), and in a map only when the table
//! does not hold it; the cell in a list of the block's.
//!
//! The loops are compiled for what the target has always had, for AVX2 and for AVX-512, and the processor is asked which to
//! take ([`dispatch`], by `pulp`).

use hashbrown::HashMap;
use nalgebra::Isometry3;
use rustc_hash::FxBuildHasher;

use super::recent::Recent;
use super::region::{LocalKey, SensorRegion};
use super::tile::{Lanes, Listed, OnTiles, Pixels, Plain, SIDE, Sink, TILE, Tile, dispatch, sum_by_voxel};
use crate::engine::binning::{BATCH, Fixed, UNITS};
use crate::engine::consistent::block::{BlockKey, CELLS, Cell, block_and_cell};
use crate::engine::consistent::cells::Cells;
use crate::engine::consistent::sums::ScanSums;
use crate::engine::key::VoxelKey;
use crate::engine::points::{Depths, Points};
use crate::engine::scan::Scan;

/// The voxels that received points, each with the sums of these; its memory stays for the next scan.
#[derive(Clone, Debug, Default)]
pub(super) struct Received {
    sums: Vec<ScanSums>,
    /// The blocks of these voxels first; the others are memory.
    blocks: Vec<ReceivedBlock>,
    /// The places of these blocks in that list, by ascending key once the scan is taken in.
    order: Vec<u32>,
    index: HashMap<BlockKey, u32, FxBuildHasher>,
    recent: Recent,
    /// Points beyond the grid.
    beyond: u32,
    /// For each axis what a column of the image adds to a unit of depth, those of a tile together.
    columns: [Vec<[f64; SIDE]>; 3],
}

/// A block that received points.
#[derive(Clone, Debug)]
struct ReceivedBlock {
    key: BlockKey,
    /// The cells of its voxels that did.
    cells: Cells,
    /// By cell: where its sums are, or [`NONE`].
    places: Box<[u32; CELLS]>,
}

/// In place of the sums of a voxel that has received no point.
const NONE: u32 = u32::MAX;

/// Blocks whose memory is kept in any case, 8 MB: a Kinect's view has some hundred to a thousand.
const KEPT: usize = 4096;
/// Voxels whose sums' memory is kept in any case, 10 MB: such a view has some thousand to ten thousand.
const KEPT_SUMS: usize = 1 << 17;

impl ReceivedBlock {
    fn new() -> Self {
        Self { key: [0; 3], cells: Cells::default(), places: Box::new([NONE; CELLS]) }
    }

    fn begin(&mut self, key: BlockKey) {
        (self.key, self.cells) = (key, Cells::default());
        self.places.fill(NONE);
    }
}

impl Received {
    /// Takes in a scan in place of the one before; returns how many of its points lie beyond the grid.
    pub(super) fn take(&mut self, scan: &Scan, voxel_size: f64) -> u32 {
        self.make_room();
        self.recent.clear();
        self.beyond = 0;
        let pose = &scan.fixed_from_sensor;
        match (&scan.points, SensorRegion::new(pose, voxel_size)) {
            (Points::Depths(depths), Some(region)) => {
                let receiver = Receiver { received: self, region, pose, voxel_size };
                dispatch(OfDepths { depths, receiver });
            }
            (Points::F32(points) | Points::Ended { points, .. }, Some(region)) => {
                let receiver = Receiver { received: self, region, pose, voxel_size };
                dispatch(OfPoints { points, receiver });
            }
            (Points::Depths(depths), None) => self.take_far(&depths.list(), pose, voxel_size),
            (Points::F32(points) | Points::Ended { points, .. }, None) => {
                self.take_far(points, pose, voxel_size);
            }
            (Points::F64(points), _) => self.take_far(points, pose, voxel_size),
        }
        self.order.sort_unstable_by_key(|&block| self.blocks[block as usize].key);
        self.beyond
    }

    /// Forgets the scan before. Of its memory as much stays as that scan needed twice, and not less than is usual.
    fn make_room(&mut self) {
        let blocks = KEPT.max(2 * self.order.len());
        let sums = KEPT_SUMS.max(2 * self.sums.len());
        self.sums.clear();
        self.sums.shrink_to(sums);
        self.blocks.truncate(blocks);
        self.blocks.shrink_to(blocks);
        self.order.clear();
        self.order.shrink_to(blocks);
        self.index.clear();
        // A map has up to twice the room that is asked for, and to clear it costs all of that.
        if self.index.capacity() > 4 * blocks {
            self.index.shrink_to(blocks);
        }
    }

    /// The blocks by ascending key, each with its voxels by ascending cell.
    pub(super) fn in_order(
        &self,
    ) -> impl Iterator<Item = (BlockKey, impl Iterator<Item = (Cell, &ScanSums)>)> {
        self.order.iter().map(|&block| {
            let block = &self.blocks[block as usize];
            let sums = |cell: Cell| &self.sums[block.places[cell.index()] as usize];
            (block.key, block.cells.iter().map(move |cell| (cell, sums(cell))))
        })
    }

    /// Points that lie anywhere in the grid or beyond it.
    fn take_far<T: Copy + Into<f64>>(&mut self, points: &[[T; 3]], pose: &Isometry3<f64>, voxel_size: f64) {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let mut fixed = Fixed::new(rotation, pose.translation.vector, voxel_size);
        for batch in points.chunks(BATCH) {
            for at in fixed.place(batch) {
                let [ix, iy, iz] = at.map(|units| (units >> UNITS.ilog2()) as i32);
                let Some(key) = VoxelKey::new(ix, iy, iz) else {
                    self.beyond += 1;
                    continue;
                };
                let (block, cell) = block_and_cell(key);
                let block = self.block(block);
                self.sums_of(block, cell).add(at.map(|units| (units & (UNITS - 1)) as u64));
            }
        }
    }

    /// Where a block is; it is begun where it has not been yet.
    fn block(&mut self, key: BlockKey) -> u32 {
        let next = self.order.len() as u32;
        let found = *self.index.entry(key).or_insert(next);
        if found == next {
            self.order.push(next);
            if self.blocks.len() < self.order.len() {
                self.blocks.push(ReceivedBlock::new());
            }
            self.blocks[next as usize].begin(key);
        }
        found
    }

    /// The sums of a voxel; they are begun where it has none.
    #[inline(always)]
    fn sums_of(&mut self, block: u32, cell: Cell) -> &mut ScanSums {
        let block = &mut self.blocks[block as usize];
        let place = &mut block.places[cell.index()];
        if *place == NONE {
            *place = self.sums.len() as u32;
            block.cells.insert(cell);
            self.sums.push(ScanSums::default());
        }
        &mut self.sums[*place as usize]
    }
}

/// A scan on its way into the voxels.
struct Receiver<'a> {
    received: &'a mut Received,
    region: SensorRegion,
    pose: &'a Isometry3<f64>,
    voxel_size: f64,
}

impl Sink for Receiver<'_> {
    #[inline(always)]
    fn add(&mut self, key: LocalKey, sums: &ScanSums) {
        let block = match self.received.recent.get(key.block()) {
            Some(block) => block,
            None => self.find(key.block()),
        };
        match block {
            Recent::BEYOND => self.received.beyond += sums.count,
            block => self.received.sums_of(block, key.cell()).merge(sums),
        }
    }
}

impl Receiver<'_> {
    /// The block with this first voxel; all of it lies within the grid or beyond.
    #[cold]
    fn find(&mut self, first: LocalKey) -> u32 {
        let voxel = self.region.voxel(first);
        let block = voxel.map_or(Recent::BEYOND, |voxel| self.received.block(block_and_cell(voxel).0));
        self.received.recent.put(first, block);
        block
    }

    /// Takes in points that lie beyond the region.
    #[cold]
    fn take_far(&mut self, points: impl Iterator<Item = [f32; 3]>) {
        let points: Vec<_> = points.collect();
        self.received.take_far(&points, self.pose, self.voxel_size);
    }
}

/// The pixels of a camera.
struct OfDepths<'a> {
    depths: &'a Depths,
    receiver: Receiver<'a>,
}

/// Rows of pixels in which one row of tiles lies.
struct Strip<'a> {
    rows: [&'a [f32]; SIDE],
    rays: [f32; SIDE],
    /// What is left of the rows where tiles do not divide them.
    ends: [[f32; SIDE]; SIDE],
}

impl<'a> Strip<'a> {
    /// `None` where there are no more rows.
    #[inline(always)]
    fn next(rows: &mut impl Iterator<Item = (&'a [f32], &'a f32)>) -> Option<Self> {
        let mut strip = Self { rows: [&[]; SIDE], rays: [0.0; SIDE], ends: [[0.0; SIDE]; SIDE] };
        for place in 0..SIDE {
            let Some((row, ray)) = rows.next() else { return (place > 0).then_some(strip) };
            (strip.rows[place], strip.rays[place]) = (row, *ray);
            let end = row.as_chunks::<SIDE>().1;
            strip.ends[place][..end.len()].copy_from_slice(end);
        }
        Some(strip)
    }

    /// The depths of the tile that begins at a column.
    #[inline(always)]
    fn tile(&self, first: usize) -> [&[f32; SIDE]; SIDE] {
        let mut depths = self.ends.each_ref();
        for (depths, row) in depths.iter_mut().zip(&self.rows) {
            if let Some(full) = row.get(first..).and_then(|row| row.first_chunk()) {
                *depths = full;
            }
        }
        depths
    }
}

impl OnTiles for OfDepths<'_> {
    #[inline(always)]
    fn run(mut self, lanes: impl Lanes) {
        let (depths, region) = (self.depths, self.receiver.region);
        let rays = depths.rays();
        // A place is depth x (column + row) from the sensor.
        let mut columns = std::mem::take(&mut self.receiver.received.columns);
        for (columns, [x, _, z]) in columns.iter_mut().zip(region.units) {
            columns.clear();
            columns.extend(rays.x.chunks(SIDE).map(|rays| {
                let mut tile = [0.0; SIDE];
                tile.iter_mut().zip(rays).for_each(|(column, &ray)| *column = x * f64::from(ray) + z);
                tile
            }));
        }
        let mut rows = depths.rows().zip(&rays.y);
        while let Some(strip) = Strip::next(&mut rows) {
            let mut steps = [[0.0; 3]; SIDE];
            for (step, ray) in steps.iter_mut().zip(&strip.rays) {
                (0..3).for_each(|axis| step[axis] = region.units[axis][1] * f64::from(*ray));
            }
            let [xs, ys, zs] = &columns;
            for (number, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
                let first = number * SIDE;
                let pixels = Pixels { depths: strip.tile(first), columns: [x, y, z], rows: &steps };
                let mut tile = lanes.of_pixels(&pixels, &region);
                if tile.has_far() {
                    self.take_far(&pixels, &strip.rays, first);
                }
                sum_by_voxel(lanes, &mut tile, &mut self.receiver);
            }
        }
        self.receiver.received.columns = columns;
    }
}

impl OfDepths<'_> {
    #[cold]
    fn take_far(&mut self, pixels: &Pixels<'_>, rows: &[f32; SIDE], first: usize) {
        let columns = &self.depths.rays().x;
        let tile = Plain.of_pixels(pixels, &self.receiver.region);
        let far = (0..TILE).filter(|&i| tile.is_far(i)).map(|i| {
            let z = pixels.depths[i / SIDE][i % SIDE];
            [columns.get(first + i % SIDE).map_or(0.0, |x| x * z), rows[i / SIDE] * z, z]
        });
        self.receiver.take_far(far);
    }
}

/// Points in a list.
struct OfPoints<'a> {
    points: &'a [[f32; 3]],
    receiver: Receiver<'a>,
}

impl OnTiles for OfPoints<'_> {
    #[inline(always)]
    fn run(mut self, lanes: impl Lanes) {
        let region = self.receiver.region;
        for batch in self.points.chunks(TILE) {
            let mut listed: Listed = [[f32::INFINITY; TILE]; 3];
            for (i, point) in batch.iter().enumerate() {
                (0..3).for_each(|axis| listed[axis][i] = point[axis]);
            }
            let mut tile = lanes.of_points(&listed, &region);
            if tile.has_far() {
                let far = Plain.of_points(&listed, &region);
                self.receiver.take_far((0..TILE).filter(|&i| far.is_far(i)).map(|i| batch[i]));
            }
            sum_by_voxel(lanes, &mut tile, &mut self.receiver);
        }
    }
}

#[cfg(test)]
mod tests;
