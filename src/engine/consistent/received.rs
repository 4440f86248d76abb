//! What a scan puts into each voxel.
//!
//! Points are taken in tiles of 64 (`tile`), and what a tile has put into a voxel is added to what the scan has put there so
//! far; that is found in a small table by the voxel's place (`recent`), and in a map only when the table does not hold it.
//!
//! The loops are compiled for what x86-64 has always had, for AVX2 and for AVX-512, and the processor is asked which to take
//! (`pulp`).

use hashbrown::HashMap;
use nalgebra::Isometry3;
use pulp::{Arch, Simd, WithSimd};
use rustc_hash::FxBuildHasher;

use super::block::{BlockKey, Cell, EDGE, place};
use super::local::{Local, LocalKey};
use super::recent::Recent;
use super::sums::ScanSums;
use super::tile::{Places, SIDE, TILE, sum_by_voxel};
use crate::engine::binning::{BATCH, Fixed, UNITS};
use crate::engine::key::{GRID_REACH, VoxelKey};
use crate::engine::points::{Depths, Points};
use crate::engine::scan::Scan;

/// The voxels that received points, each with the sums of these; its memory stays for the next scan.
#[derive(Clone, Debug, Default)]
pub(super) struct Received {
    sums: Vec<ScanSums>,
    /// By the order of the voxels (see [`rank`]), then their places in `sums`.
    order: Vec<(u64, u32)>,
    index: HashMap<u64, u32, FxBuildHasher>,
    recent: Recent,
    /// Points beyond the grid.
    beyond: u32,
    /// For each axis what a column of the image adds to a unit of depth.
    columns: [Vec<f64>; 3],
}

const CELL_BITS: u32 = 9;
const BLOCK_BITS: u32 = 18;
/// What makes the indices of blocks positive.
const FIRST_BLOCK: i32 = GRID_REACH / EDGE;

/// Place of a voxel in the order of all: by the key of its block, then by its cell.
fn rank(key: VoxelKey) -> u64 {
    let (block, cell) = place(key);
    let block = block.iter().fold(0, |rank, &i| rank << BLOCK_BITS | (i + FIRST_BLOCK) as u64);
    block << CELL_BITS | u64::from(cell.0)
}

/// The block and the cell of a rank.
fn place_of(rank: u64) -> (BlockKey, Cell) {
    let index = |axis: u32| {
        let low = rank >> (CELL_BITS + (2 - axis) * BLOCK_BITS) & ((1 << BLOCK_BITS) - 1);
        low as i32 - FIRST_BLOCK
    };
    ([index(0), index(1), index(2)], Cell((rank & ((1 << CELL_BITS) - 1)) as u16))
}

impl Received {
    /// Takes in a scan in place of the one before; returns how many of its points lie beyond the grid.
    pub(super) fn take(&mut self, scan: &Scan, voxel_size: f64) -> u32 {
        self.sums.clear();
        self.order.clear();
        self.index.clear();
        self.recent.clear();
        self.beyond = 0;
        let pose = &scan.fixed_from_sensor;
        match (&scan.points, Local::new(pose, voxel_size)) {
            (Points::Depths(depths), Some(local)) => {
                let receiver = Receiver { received: self, local, pose, voxel_size };
                Arch::new().dispatch(OfDepths { depths, receiver });
            }
            (Points::F32(points), Some(local)) => {
                let receiver = Receiver { received: self, local, pose, voxel_size };
                Arch::new().dispatch(OfPoints { points, receiver });
            }
            (Points::Depths(depths), None) => self.take_far(&depths.list(), pose, voxel_size),
            (Points::F32(points), None) => self.take_far(points, pose, voxel_size),
            (Points::F64(points), _) => self.take_far(points, pose, voxel_size),
        }
        self.order.sort_unstable();
        self.beyond
    }

    /// The voxels, by the keys of their blocks and by their cells.
    pub(super) fn in_order(&self) -> impl Iterator<Item = (BlockKey, Cell, &ScanSums)> {
        self.order.iter().map(|&(rank, place)| {
            let (block, cell) = place_of(rank);
            (block, cell, &self.sums[place as usize])
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
                let place = self.find(key);
                self.sums[place as usize].add(at.map(|units| (units & (UNITS - 1)) as u64));
            }
        }
    }

    /// Where the sums of a voxel are; they are begun where it has none.
    fn find(&mut self, key: VoxelKey) -> u32 {
        let next = self.sums.len() as u32;
        let rank = rank(key);
        let found = *self.index.entry(rank).or_insert(next);
        if found == next {
            self.order.push((rank, next));
            self.sums.push(ScanSums::default());
        }
        found
    }
}

/// A scan on its way into the voxels.
struct Receiver<'a> {
    received: &'a mut Received,
    local: Local,
    pose: &'a Isometry3<f64>,
    voxel_size: f64,
}

impl Receiver<'_> {
    #[inline(always)]
    fn add(&mut self, key: LocalKey, sums: &ScanSums) {
        let place = match self.received.recent.get(key) {
            Some(place) => place,
            None => self.find(key),
        };
        match place {
            Recent::BEYOND => self.received.beyond += sums.count,
            place => self.received.sums[place as usize].merge(sums),
        }
    }

    #[cold]
    fn find(&mut self, key: LocalKey) -> u32 {
        let voxel = self.local.voxel(key);
        let place = voxel.map_or(Recent::BEYOND, |voxel| self.received.find(voxel));
        self.received.recent.put(key, place);
        place
    }

    /// Takes in a tile; `point` gives those points of it that lie beyond the region.
    #[inline(always)]
    fn take(&mut self, places: &Places, empty: usize, point: impl Fn(usize) -> [f32; 3]) {
        let missing = sum_by_voxel(places, |key, sums| self.add(key, sums));
        if missing > empty {
            self.take_far(places, point);
        }
    }

    #[cold]
    fn take_far(&mut self, places: &Places, point: impl Fn(usize) -> [f32; 3]) {
        let [xs, ys, zs] = places;
        let is_far = |&i: &usize| Local::key([xs[i], ys[i], zs[i]]) == LocalKey::NONE;
        let far = (0..TILE).filter(is_far).map(point).filter(|point| point[2].is_finite());
        let far: Vec<_> = far.collect();
        self.received.take_far(&far, self.pose, self.voxel_size);
    }
}

/// The pixels of a camera.
struct OfDepths<'a> {
    depths: &'a Depths,
    receiver: Receiver<'a>,
}

impl WithSimd for OfDepths<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let rays = self.depths.rays();
        let units = self.receiver.local.units;
        // A place is depth x (column + row) from the sensor.
        let mut columns = std::mem::take(&mut self.receiver.received.columns);
        for (column, [x, _, z]) in columns.iter_mut().zip(units) {
            column.clear();
            column.extend(rays.x.iter().map(|&ray| x * f64::from(ray) + z));
        }
        let depths = self.depths;
        let mut rows = depths.rows().zip(&rays.y);
        let mut strip: [(&[f32], &f32); SIDE] = [(&[], &0.0); SIDE];
        loop {
            let mut count = 0;
            for (place, row) in strip.iter_mut().zip(&mut rows) {
                *place = row;
                count += 1;
            }
            for first in (0..rays.x.len()).step_by(SIDE) {
                self.tile(&strip[..count], &columns, first);
            }
            if count < SIDE {
                break;
            }
        }
        self.receiver.received.columns = columns;
    }
}

impl OfDepths<'_> {
    /// Takes in 8 x 8 pixels, or what there is of them.
    #[inline(always)]
    fn tile(&mut self, rows: &[(&[f32], &f32)], columns: &[Vec<f64>; 3], first: usize) {
        let local = &self.receiver.local;
        let mut depths = [f32::INFINITY; TILE];
        let mut directions = [[0.0_f64; SIDE]; 3];
        let width = SIDE.min(columns[0].len() - first);
        for (directions, columns) in directions.iter_mut().zip(columns) {
            directions[..width].copy_from_slice(&columns[first..first + width]);
        }
        for ((row, _), depths) in rows.iter().zip(depths.chunks_exact_mut(SIDE)) {
            depths[..width].copy_from_slice(&row[first..first + width]);
        }
        let mut places = [[-1; TILE]; 3];
        for (axis, places) in places.iter_mut().enumerate() {
            for (i, (_, ray)) in rows.iter().enumerate() {
                let row = local.units[axis][1] * f64::from(**ray);
                for j in 0..SIDE {
                    let depth = f64::from(depths[i * SIDE + j]);
                    places[i * SIDE + j] = local.place(axis, depth * (directions[axis][j] + row));
                }
            }
        }
        let empty = depths.iter().map(|depth| usize::from(*depth == f32::INFINITY)).sum();
        let rays = self.depths.rays();
        self.receiver.take(&places, empty, |i| {
            let z = depths[i];
            let x = rays.x.get(first + i % SIDE).map_or(0.0, |x| x * z);
            [x, rows.get(i / SIDE).map_or(0.0, |(_, y)| *y * z), z]
        });
    }
}

/// Points in a list.
struct OfPoints<'a> {
    points: &'a [[f32; 3]],
    receiver: Receiver<'a>,
}

impl WithSimd for OfPoints<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let local = self.receiver.local;
        for batch in self.points.chunks(TILE) {
            let mut split = [[f32::INFINITY; TILE]; 3];
            for (i, point) in batch.iter().enumerate() {
                (0..3).for_each(|axis| split[axis][i] = point[axis]);
            }
            let [xs, ys, zs] = &split;
            let mut places = [[-1; TILE]; 3];
            for (axis, places) in places.iter_mut().enumerate() {
                let [a, b, c] = local.units[axis];
                for i in 0..TILE {
                    let [x, y, z] = [xs[i], ys[i], zs[i]].map(f64::from);
                    places[i] = local.place(axis, a * x + b * y + c * z);
                }
            }
            self.receiver.take(&places, TILE - batch.len(), |i| split.map(|axis| axis[i]));
        }
    }
}

#[cfg(test)]
mod tests;
