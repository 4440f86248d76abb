//! The columns that a planar cluster covers when its voxels are projected along an axis.
//!
//! A column is the pair of a voxel's two other indices. Its content is summed as integers, so that a footprint depends
//! on what is in it and on nothing else: neither on the order of changes nor on what has been there before. Columns lie in
//! tiles of 8 x 8, one bit each for being covered and their contents one after another: 24 bytes for a column and
//! some 60 for a tile. A change costs a look at its tile, which is the one of the change before as long as the
//! voxels of a block come together. The rim, the columns that lack one of their four neighbours, is found from the bits of
//! a tile at once; that costs O(tiles + rim).

use std::collections::BTreeMap;
use std::ops::{AddAssign, SubAssign};

use nalgebra::UnitVector3;

use crate::engine::key::VoxelKey;

/// The two indices of a column, by ascending axis.
pub(crate) type Column = [i32; 2];

/// Units of a column's edge in which offsets are counted.
pub(crate) const UNITS: u32 = 4096;

/// The sides of a column, counter-clockwise: side `s` lies opposite to `s ^ 2`.
pub(crate) const SIDES: [Column; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// The column beyond a side.
pub(crate) const fn beyond(column: Column, side: usize) -> Column {
    [column[0] + SIDES[side][0], column[1] + SIDES[side][1]]
}

/// The axis along which voxels are projected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Axis(usize);

impl Axis {
    /// The axis along which `normal` is longest, the lowest of equals.
    pub(crate) fn dominant(normal: &UnitVector3<f64>) -> Self {
        let [x, y, z] = [normal.x.abs(), normal.y.abs(), normal.z.abs()];
        Self(if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        })
    }

    /// The axis of this index; `None` above 2.
    pub(crate) fn of(index: u8) -> Option<Self> {
        (index < 3).then_some(Self(usize::from(index)))
    }

    /// 0 to 2.
    pub(crate) const fn index(self) -> usize {
        self.0
    }

    /// The two other axes, ascending.
    pub(crate) const fn others(self) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][self.0]
    }

    /// The column of a voxel.
    pub(crate) fn column(self, key: VoxelKey) -> Column {
        self.others().map(|axis| key.indices()[axis])
    }
}

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
    /// Counts a point; its offsets from the column's lower corner are below [`UNITS`].
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
struct Kept {
    voxels: u32,
    points: u32,
    sum: [u32; 2],
    squares: [u32; 2],
}

impl Kept {
    fn of(content: &Content) -> Self {
        let rounded = |sum: u64, bits: u32| ((sum + (1 << (bits - 1))) >> bits) as u32;
        Self {
            voxels: content.voxels,
            points: content.points as u32,
            sum: content.sum.map(|sum| rounded(sum, SUM_BITS)),
            squares: content.squares.map(|square| rounded(square, SQUARE_BITS)),
        }
    }

    fn content(&self) -> Content {
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
const EDGE: u32 = 3;
/// Contents for which memory is taken at a time.
const ROOM: usize = 8;

/// The tile that a column is in.
fn tile_of(column: Column) -> Column {
    column.map(|index| index >> EDGE)
}

/// The bit of a column in its tile: in the order of columns.
fn bit_of(column: Column) -> u64 {
    let [row, place] = column.map(|index| index & ((1 << EDGE) - 1));
    1 << (row << EDGE | place)
}

/// The column of the bit of this number.
fn column_of(tile: Column, number: u32) -> Column {
    let within = [number >> EDGE, number & ((1 << EDGE) - 1)];
    [0, 1].map(|axis| tile[axis] << EDGE | within[axis] as i32)
}

/// 8 x 8 columns.
#[derive(Clone, Debug)]
struct Tile {
    key: Column,
    /// By column, see [`bit_of`].
    covered: u64,
    /// Of the covered columns, ascending.
    contents: Vec<Kept>,
}

impl Tile {
    /// Where the content of a column is, or would be.
    const fn place(&self, bit: u64) -> usize {
        (self.covered & (bit - 1)).count_ones() as usize
    }

    fn add(&mut self, bit: u64, kept: Kept) {
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

    fn remove(&mut self, bit: u64, kept: Kept) {
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

/// The columns of a cluster.
#[derive(Clone, Debug)]
pub(crate) struct Footprint {
    axis: Axis,
    tiles: Vec<Tile>,
    /// Where the tiles are in that list.
    places: BTreeMap<Column, u32>,
    /// The tile that was looked at last.
    last: usize,
    /// Some tile may hold nothing.
    has_empty: bool,
}

impl Footprint {
    /// Of no voxel.
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, tiles: Vec::new(), places: BTreeMap::new(), last: 0, has_empty: false }
    }

    /// The axis along which its voxels were projected.
    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    /// Adds voxels, points or both; points alone only where a voxel is.
    pub(crate) fn add(&mut self, column: Column, content: &Content) {
        self.add_kept(column, Kept::of(content));
    }

    fn add_kept(&mut self, column: Column, kept: Kept) {
        let key = tile_of(column);
        if self.find(key).is_none() {
            self.last = self.tiles.len();
            self.places.insert(key, self.last as u32);
            if self.tiles.len() == self.tiles.capacity() {
                // A small cluster has few tiles.
                self.tiles.reserve_exact(1 + self.tiles.len() / 4);
            }
            self.tiles.push(Tile { key, covered: 0, contents: Vec::new() });
        }
        self.tiles[self.last].add(bit_of(column), kept);
    }

    /// Takes out what was added before; the points of a voxel go at the latest with it.
    pub(crate) fn remove(&mut self, column: Column, content: &Content) {
        let Some(tile) = self.find(tile_of(column)) else {
            debug_assert!(false, "nothing in {column:?}");
            return;
        };
        tile.remove(bit_of(column), Kept::of(content));
        self.has_empty |= tile.covered == 0;
    }

    fn find(&mut self, key: Column) -> Option<&mut Tile> {
        if self.tiles.get(self.last).is_none_or(|tile| tile.key != key) {
            self.last = *self.places.get(&key)? as usize;
        }
        self.tiles.get_mut(self.last)
    }

    /// Frees the memory of tiles that hold nothing, which are kept for what may come until then.
    pub(crate) fn tidy(&mut self) {
        if !std::mem::take(&mut self.has_empty) {
            return;
        }
        for place in (0..self.tiles.len()).rev() {
            if self.tiles[place].covered != 0 {
                continue;
            }
            self.places.remove(&self.tiles.swap_remove(place).key);
            if let Some(moved) = self.tiles.get(place) {
                self.places.insert(moved.key, place as u32);
            }
        }
    }

    /// The columns that lack a neighbour, ascending; `rows` is memory to work in.
    pub(crate) fn rim(&self, rows: &mut Vec<Row>, mut each: impl FnMut(Column, u8, &Content)) {
        self.rows(rows);
        let mut begin = 0;
        while let Some(first) = rows.get(begin) {
            let end = begin + rows[begin..].partition_point(|row| row.key[0] == first.key[0]);
            for line in 0..1 << EDGE {
                for row in &rows[begin..end] {
                    let mut bits = row.rim & 0xFF << (line << EDGE);
                    while bits != 0 {
                        let (at, bit) = (bits.trailing_zeros(), bits & bits.wrapping_neg());
                        bits ^= bit;
                        let tile = &self.tiles[row.place as usize];
                        each(
                            column_of(row.key, at),
                            row.joined(bit),
                            &tile.contents[tile.place(bit)].content(),
                        );
                    }
                }
            }
            begin = end;
        }
    }

    /// What the tiles' columns lack, in the order of the tiles' keys.
    fn rows(&self, rows: &mut Vec<Row>) {
        rows.clear();
        let row = |(&key, &place): (&Column, &u32)| {
            let covered = self.tiles[place as usize].covered;
            (covered != 0).then_some(Row { key, place, covered, rim: 0, beside: [0; 4] })
        };
        rows.extend(self.places.iter().filter_map(row));
        let (mut before, mut after) = (0, 0);
        for here in 0..rows.len() {
            let [x, y] = rows[here].key;
            let seek =
                |from: usize, key: Column| from + rows[from..].iter().take_while(|row| row.key < key).count();
            (before, after) = (seek(before, [x - 1, y]), seek(after, [x + 1, y]));
            let of = |place: Option<usize>, key: Column| {
                place
                    .and_then(|place| rows.get(place))
                    .filter(|row| row.key == key)
                    .map_or(0, |row| row.covered)
            };
            let others = [
                of(Some(after), [x + 1, y]),
                of(Some(here + 1), [x, y + 1]),
                of(Some(before), [x - 1, y]),
                of(here.checked_sub(1), [x, y - 1]),
            ];
            rows[here].meet(others);
        }
    }
}

/// A tile among its neighbours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    key: Column,
    place: u32,
    covered: u64,
    /// The covered columns that lack a neighbour.
    rim: u64,
    /// By side: the columns beyond that side of which a column is covered.
    beside: [u64; 4],
}

impl Row {
    /// `others` are the covered columns of the tiles beyond its sides.
    const fn meet(&mut self, others: [u64; 4]) {
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
    fn joined(&self, bit: u64) -> u8 {
        (0..4).map(|side| u8::from(self.beside[side] & bit != 0) << side).sum()
    }
}

#[cfg(test)]
impl Footprint {
    /// Whether a member lies in this column.
    pub(crate) fn contains(&self, column: Column) -> bool {
        self.content(column).is_some()
    }

    /// What lies in this column.
    pub(crate) fn content(&self, column: Column) -> Option<Content> {
        let tile = &self.tiles[*self.places.get(&tile_of(column))? as usize];
        let bit = bit_of(column);
        (tile.covered & bit != 0).then(|| tile.contents[tile.place(bit)].content())
    }

    /// The columns of the rim, ascending.
    pub(crate) fn rim_columns(&self) -> Vec<Column> {
        let mut columns = Vec::new();
        self.rim(&mut Vec::new(), |column, _, _| columns.push(column));
        columns
    }

    /// All columns, ascending.
    fn columns(&self) -> Vec<(Column, Kept)> {
        let mut columns = Vec::new();
        for tile in self.places.values().map(|&place| &self.tiles[place as usize]) {
            let bits = (0..64).filter(|bit| tile.covered >> bit & 1 == 1);
            columns.extend(bits.map(|bit| column_of(tile.key, bit)).zip(tile.contents.iter().copied()));
        }
        columns.sort_unstable_by_key(|(column, _)| *column);
        columns
    }

    /// Takes in another cluster's columns along the same axis.
    pub(crate) fn merge(&mut self, other: &Self) {
        debug_assert_eq!(self.axis, other.axis);
        other.columns().into_iter().for_each(|(column, kept)| self.add_kept(column, kept));
    }
}

#[cfg(test)]
impl PartialEq for Footprint {
    fn eq(&self, other: &Self) -> bool {
        self.axis == other.axis && self.columns() == other.columns()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn content() -> impl Strategy<Value = Content> {
        proptest::collection::vec(proptest::array::uniform2(0..UNITS), 0..6).prop_map(|points| {
            let mut content = Content { voxels: 1, ..Content::default() };
            points.into_iter().for_each(|point| content.add_point(point));
            content
        })
    }

    fn voxels() -> impl Strategy<Value = Vec<(Column, Content)>> {
        proptest::collection::vec((proptest::array::uniform2(-4..4), content()), 0..90)
    }

    fn of(voxels: &[(Column, Content)]) -> Footprint {
        let mut footprint = Footprint::new(Axis(2));
        voxels.iter().for_each(|&(column, content)| footprint.add(column, &content));
        footprint
    }

    /// The rim by its definition.
    fn naive_rim(voxels: &[(Column, Content)]) -> Vec<Column> {
        let columns: BTreeSet<Column> = voxels.iter().map(|&(column, _)| column).collect();
        let lacks = |&column: &Column| (0..4).any(|side| !columns.contains(&beyond(column, side)));
        columns.iter().copied().filter(lacks).collect()
    }

    proptest! {
        #[test]
        fn it_depends_on_what_is_in_it_and_not_on_order_or_history(
            stay in voxels(), go in voxels(), turn in 0usize..90,
        ) {
            let whole = of(&stay);
            prop_assert_eq!(whole.rim_columns(), naive_rim(&stay));

            let mut mixed: Vec<_> = stay.iter().chain(&go).copied().collect();
            let middle = turn.min(mixed.len());
            mixed.rotate_left(middle);
            let mut running = of(&mixed);
            go.iter().rev().for_each(|&(column, content)| running.remove(column, &content));
            prop_assert_eq!(&running, &whole);

            let at = turn.min(stay.len());
            let mut halves = of(&stay[..at]);
            halves.merge(&of(&stay[at..]));
            prop_assert_eq!(&halves, &whole);
        }
    }

    #[test]
    fn more_points_in_a_member_change_its_content_alone() {
        let mut footprint = of(&[([0, 0], Content { voxels: 1, ..Content::default() })]);
        let mut more = Content::default();
        more.add_point([512, 1024]);
        footprint.add([0, 0], &more);
        assert_eq!(footprint.content([0, 0]).unwrap().squares, [1 << 18, 1 << 20]);
        footprint.remove([0, 0], &more);
        assert_eq!(footprint, of(&[([0, 0], Content { voxels: 1, ..Content::default() })]));
    }

    #[test]
    fn the_axis_is_that_of_the_longest_part_of_the_normal_and_the_lowest_of_equals() {
        let of =
            |x, y, z| Axis::dominant(&UnitVector3::new_normalize(nalgebra::Vector3::new(x, y, z))).index();
        assert_eq!(
            [of(0.1, -0.9, 0.3), of(0.0, 0.0, -1.0), of(1.0, 1.0, 1.0), of(0.1, -1.0, 1.0)],
            [1, 2, 0, 1]
        );
        let key = VoxelKey::new(3, 4, 5).unwrap();
        assert_eq!([0, 1, 2].map(|axis| Axis(axis).column(key)), [[4, 5], [3, 5], [3, 4]]);
    }
}
