//! Columns by the 64: what lies in them, and which of them have no neighbour.

use std::ops::{AddAssign, SubAssign};

use super::Column;
use crate::engine::binning::nearest;

/// What lies in a column: its voxels, and moments of where their points lie along the two other axes, every voxel counting
/// the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Content {
    /// Number of member voxels.
    pub(crate) voxels: u32,
    /// Mean offsets of their points from the column's lower corner, summed, in `voxel_size` / [`UNITS`].
    sum: [u32; 2],
    /// Means of the squares of these offsets, summed, in `voxel_size`^2 / [`UNITS`].
    squares: [u32; 2],
}

/// Units of a column's edge in which offsets are counted.
const UNITS: f64 = 1024.0;

impl Content {
    /// The content of one voxel, by the means of its points' offsets and of their squares, each 0 to 1, in `voxel_size` and its square.
    pub(crate) fn of(means: [f64; 2], squares: [f64; 2]) -> Self {
        let whole = |mean: f64| nearest((mean * UNITS).max(0.0)) as u32;
        Self { voxels: 1, sum: means.map(whole), squares: squares.map(whole) }
    }

    /// The content of a voxel with these points: their offsets from the column's lower corner, 0 to 1.
    #[cfg(test)]
    pub(crate) fn of_points(points: &[[f64; 2]]) -> Self {
        let mean = |of: &dyn Fn(f64) -> f64| {
            [0, 1].map(|axis| points.iter().map(|point| of(point[axis])).sum::<f64>() / points.len() as f64)
        };
        Self::of(mean(&|offset| offset), mean(&|offset| offset * offset))
    }

    /// Mean offsets of the points, in `voxel_size`; there is a voxel.
    pub(crate) fn means(&self) -> [f64; 2] {
        self.sum.map(|sum| f64::from(sum) / (UNITS * f64::from(self.voxels)))
    }

    /// Means of the squares of these offsets, in `voxel_size`^2.
    pub(crate) fn squares(&self) -> [f64; 2] {
        self.squares.map(|sum| f64::from(sum) / (UNITS * f64::from(self.voxels)))
    }
}

/// A number of three bytes, counted modulo 2^24.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Short([u8; 3]);

impl Short {
    fn get(self) -> u32 {
        let [a, b, c] = self.0;
        u32::from_le_bytes([a, b, c, 0])
    }
}

impl From<u32> for Short {
    fn from(number: u32) -> Self {
        let [a, b, c, _] = number.to_le_bytes();
        Self([a, b, c])
    }
}

/// A [`Content`] as it is kept. 2^14 voxels fit in; beyond, sums are too small by a multiple of 2^24 until voxels go again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Kept {
    voxels: u32,
    sum: [Short; 2],
    squares: [Short; 2],
}

impl Kept {
    pub(super) fn of(content: &Content) -> Self {
        Self {
            voxels: content.voxels,
            sum: content.sum.map(Short::from),
            squares: content.squares.map(Short::from),
        }
    }

    pub(super) fn content(&self) -> Content {
        Content { voxels: self.voxels, sum: self.sum.map(Short::get), squares: self.squares.map(Short::get) }
    }

    fn combine(&mut self, other: &Self, by: impl Fn(u32, u32) -> u32) {
        let by = |own: &mut Short, other: Short| *own = by(own.get(), other.get()).into();
        for axis in 0..2 {
            by(&mut self.sum[axis], other.sum[axis]);
            by(&mut self.squares[axis], other.squares[axis]);
        }
    }
}

impl AddAssign for Kept {
    fn add_assign(&mut self, other: Self) {
        self.voxels += other.voxels;
        self.combine(&other, u32::wrapping_add);
    }
}

impl SubAssign for Kept {
    fn sub_assign(&mut self, other: Self) {
        self.voxels -= other.voxels;
        self.combine(&other, u32::wrapping_sub);
    }
}

/// Columns along an edge of a tile, as the base-2 logarithm.
pub(super) const EDGE_BITS: u32 = 3;
/// Contents for which memory is taken at a time.
const ROOM: usize = 8;

/// The tile that a column is in.
pub(super) fn tile_of(column: Column) -> Column {
    column.map(|index| index >> EDGE_BITS)
}

/// The bit of a column in its tile: in the order of columns.
pub(super) fn bit_of(column: Column) -> u64 {
    let [row, place] = column.map(|index| index & ((1 << EDGE_BITS) - 1));
    1 << (row << EDGE_BITS | place)
}

/// The column of the bit of this number.
pub(super) fn column_of(tile: Column, number: u32) -> Column {
    let within = [number >> EDGE_BITS, number & ((1 << EDGE_BITS) - 1)];
    [0, 1].map(|axis| tile[axis] << EDGE_BITS | within[axis] as i32)
}

/// 8 x 8 columns.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) key: Column,
    /// By column, see [`bit_of`].
    pub(super) covered: u64,
    /// What the covered columns hold, by ascending column.
    pub(super) contents: Vec<Kept>,
}

impl Tile {
    /// Where the content of a column is, or would be.
    pub(super) const fn place(&self, bit: u64) -> usize {
        (self.covered & (bit - 1)).count_ones() as usize
    }

    pub(super) fn add(&mut self, bit: u64, kept: Kept) {
        let place = self.place(bit);
        if self.covered & bit != 0 {
            self.contents[place] += kept;
            return;
        }
        debug_assert!(kept.voxels > 0, "points without a voxel in {:?}", self.key);
        if self.contents.len() == self.contents.capacity() {
            self.contents.reserve_exact(ROOM);
        }
        self.contents.insert(place, kept);
        self.covered |= bit;
    }

    pub(super) fn remove(&mut self, bit: u64, kept: Kept) {
        let place = self.place(bit);
        if self.covered & bit == 0 {
            debug_assert!(false, "nothing in a column of {:?}", self.key);
            return;
        }
        let left = &mut self.contents[place];
        *left -= kept;
        if left.voxels == 0 {
            debug_assert_eq!(*left, Kept::default(), "points without a voxel in {:?}", self.key);
            self.contents.remove(place);
            self.covered &= !bit;
        }
    }
}

/// What of a tile is at the rim, which its neighbours say.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileRim {
    pub(super) key: Column,
    pub(super) place: u32,
    pub(super) covered: u64,
    /// The covered columns that lack a neighbour.
    pub(super) rim: u64,
    /// By side: the columns beyond that side of which a column is covered.
    pub(super) beside: [u64; 4],
}

impl TileRim {
    /// `others` are the covered columns of the tiles beyond its sides.
    pub(super) const fn meet(&mut self, others: [u64; 4]) {
        const FIRST: u64 = 0x0101_0101_0101_0101;
        const LAST: u64 = FIRST << 7;
        let covered = self.covered;
        let [below, right, above, left] = others;
        self.beside = [
            covered >> 8 | below << 56,
            (covered & !FIRST) >> 1 | (right & FIRST) << 7,
            covered << 8 | above >> 56,
            (covered & !LAST) << 1 | (left & LAST) >> 7,
        ];
        let [a, b, c, d] = self.beside;
        self.rim = covered & !(a & b & c & d);
    }

    /// Bit `s` is set where the column of `bit` has a neighbour beyond side `s`.
    pub(super) fn joined(&self, bit: u64) -> u8 {
        (0..4).map(|side| u8::from(self.beside[side] & bit != 0) << side).sum()
    }
}
