//! Columns by the 64: what lies in them, and which of them have no neighbour.

use std::ops::{AddAssign, SubAssign};

use super::Column;

/// What lies in a column: voxels, and the moments of their points along the two other axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Content {
    /// Number of member voxels.
    pub(crate) voxels: u32,
    /// Number of their points.
    pub(crate) points: u64,
    /// Offsets of the points from the column's lower corner, summed, in `voxel_size / 4096`.
    pub(crate) sum: [u64; 2],
    /// Squares of these offsets, summed.
    pub(crate) squares: [u64; 2],
}

impl Content {
    /// Counts a point; its offsets from the column's lower corner are below [`UNITS`](super::UNITS).
    #[cfg(test)]
    pub(crate) fn add_point(&mut self, offset: [u32; 2]) {
        self.points += 1;
        for (axis, offset) in offset.map(u64::from).into_iter().enumerate() {
            self.sum[axis] += offset;
            self.squares[axis] += offset * offset;
        }
    }
}

/// Bits of a sum, and of a sum of squares, that are not kept: of 1024 points each is still known to 2^-16 of a voxel.
const SUM_BITS: u32 = 6;
const SQUARE_BITS: u32 = 18;

/// A [`Content`] as it is kept. 2^16 voxels of 1024 points fit in; beyond, sums are too small by a multiple of 2^32 until
/// voxels go again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Kept {
    voxels: u32,
    points: u32,
    sum: [u32; 2],
    squares: [u32; 2],
}

impl Kept {
    pub(super) fn of(content: &Content) -> Self {
        let rounded = |sum: u64, bits: u32| ((sum + (1 << (bits - 1))) >> bits) as u32;
        Self {
            voxels: content.voxels,
            points: content.points as u32,
            sum: content.sum.map(|sum| rounded(sum, SUM_BITS)),
            squares: content.squares.map(|square| rounded(square, SQUARE_BITS)),
        }
    }

    pub(super) fn content(&self) -> Content {
        Content {
            voxels: self.voxels,
            points: u64::from(self.points),
            sum: self.sum.map(|sum| u64::from(sum) << SUM_BITS),
            squares: self.squares.map(|square| u64::from(square) << SQUARE_BITS),
        }
    }

    fn combine(&mut self, other: &Self, by: impl Fn(u32, u32) -> u32) {
        self.points = by(self.points, other.points);
        for axis in 0..2 {
            self.sum[axis] = by(self.sum[axis], other.sum[axis]);
            self.squares[axis] = by(self.squares[axis], other.squares[axis]);
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

/// Columns along an edge of a tile, as a power of two.
pub(super) const EDGE: u32 = 3;
/// Contents for which memory is taken at a time.
const ROOM: usize = 8;

/// The tile that a column is in.
pub(super) fn tile_of(column: Column) -> Column {
    column.map(|index| index >> EDGE)
}

/// The bit of a column in its tile: in the order of columns.
pub(super) fn bit_of(column: Column) -> u64 {
    let [row, place] = column.map(|index| index & ((1 << EDGE) - 1));
    1 << (row << EDGE | place)
}

/// The column of the bit of this number.
pub(super) fn column_of(tile: Column, number: u32) -> Column {
    let within = [number >> EDGE, number & ((1 << EDGE) - 1)];
    [0, 1].map(|axis| tile[axis] << EDGE | within[axis] as i32)
}

/// 8 x 8 columns.
#[derive(Clone, Debug)]
pub(super) struct Tile {
    pub(super) key: Column,
    /// By column, see [`bit_of`].
    pub(super) covered: u64,
    /// Of the covered columns, ascending.
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

/// A tile among its neighbours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(super) key: Column,
    pub(super) place: u32,
    pub(super) covered: u64,
    /// The covered columns that lack a neighbour.
    pub(super) rim: u64,
    /// By side: the columns beyond that side of which a column is covered.
    pub(super) beside: [u64; 4],
}

impl Row {
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
