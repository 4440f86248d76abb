//! The columns that a planar cluster covers when its voxels are projected along an axis.
//!
//! A column is the pair of a voxel's two other indices. Its content is summed as integers, so that a footprint depends
//! on what is in it and on nothing else: neither on the order of changes nor on what has been there before. Columns lie in
//! tiles of 8 x 8, one bit each for being covered and their contents one after another: 16 bytes for a column and
//! some 60 for a tile. A change costs a look at its tile, which is the one of the change before as long as the
//! voxels of a block come together. The rim, the columns that lack one of their four neighbours, is found from the bits of
//! a tile at once; that costs O(tiles + rim).

mod columns;

use std::collections::BTreeMap;

use nalgebra::UnitVector3;

pub(crate) use self::columns::{Content, TileRim};
use self::columns::{EDGE_BITS, Kept, Tile, bit_of, column_of, tile_of};
use crate::engine::key::VoxelKey;

/// The two indices of a column, by ascending axis.
pub(crate) type Column = [i32; 2];

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

    /// This one while `normal` is not much longer along another, the dominant one else: of a surface at a slant between two, noise
    /// would have now the one and now the other. The part of a unit normal along it is 0.51 or more.
    pub(crate) fn kept(self, normal: &UnitVector3<f64>) -> Self {
        let dominant = Self::dominant(normal);
        let [own, longest] = [self, dominant].map(|axis| normal[axis.0].abs());
        if own >= KEPT * longest { self } else { dominant }
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

/// Part of the longest part of a normal that it has along an axis that is kept, at least: between two axes, 5 degrees to either
/// side.
const KEPT: f64 = 0.85;

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
    /// A footprint of no voxel, along this axis.
    pub(crate) const fn new(axis: Axis) -> Self {
        Self { axis, tiles: Vec::new(), places: BTreeMap::new(), last: 0, has_empty: false }
    }

    /// The axis along which its voxels were projected.
    pub(crate) const fn axis(&self) -> Axis {
        self.axis
    }

    /// Adds a voxel.
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

    /// Takes out a voxel that was added before.
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

    /// The columns that lack a neighbour, ascending; `rims` is memory to work in.
    pub(crate) fn rim(&self, rims: &mut Vec<TileRim>, mut each: impl FnMut(Column, u8, &Content)) {
        self.rims(rims);
        let mut start = 0;
        while let Some(first) = rims.get(start) {
            let end = start + rims[start..].partition_point(|rim| rim.key[0] == first.key[0]);
            for line in 0..1 << EDGE_BITS {
                for here in &rims[start..end] {
                    let mut bits = here.rim & 0xFF << (line << EDGE_BITS);
                    while bits != 0 {
                        let (at, bit) = (bits.trailing_zeros(), bits & bits.wrapping_neg());
                        bits ^= bit;
                        let tile = &self.tiles[here.place as usize];
                        each(
                            column_of(here.key, at),
                            here.joined(bit),
                            &tile.contents[tile.place(bit)].content(),
                        );
                    }
                }
            }
            start = end;
        }
    }

    /// What the tiles' columns lack, in the order of the tiles' keys.
    fn rims(&self, rims: &mut Vec<TileRim>) {
        rims.clear();
        let rim = |(&key, &place): (&Column, &u32)| {
            let covered = self.tiles[place as usize].covered;
            (covered != 0).then_some(TileRim { key, place, covered, rim: 0, beside: [0; 4] })
        };
        rims.extend(self.places.iter().filter_map(rim));
        let (mut before, mut after) = (0, 0);
        for here in 0..rims.len() {
            let [x, y] = rims[here].key;
            let seek =
                |from: usize, key: Column| from + rims[from..].iter().take_while(|rim| rim.key < key).count();
            (before, after) = (seek(before, [x - 1, y]), seek(after, [x + 1, y]));
            let of = |place: Option<usize>, key: Column| {
                let rim = place.and_then(|place| rims.get(place)).filter(|rim| rim.key == key);
                rim.map_or(0, |rim| rim.covered)
            };
            let others = [
                of(Some(after), [x + 1, y]),
                of(Some(here + 1), [x, y + 1]),
                of(Some(before), [x - 1, y]),
                of(here.checked_sub(1), [x, y - 1]),
            ];
            rims[here].meet(others);
        }
    }
}

#[cfg(test)]
impl Footprint {
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
mod tests;
