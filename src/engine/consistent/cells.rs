//! A set of the cells of a block, a bit for each: what lies around a cell is found in eight words instead of by a walk.

use super::block::{Cell, EDGE};

/// A word for each x, in it a byte for each y, in it a bit for each z: ascending bits are ascending cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cells([u64; EDGE as usize]);

/// One bit in each byte.
const EACH_BYTE: u64 = 0x0101_0101_0101_0101;

/// The bits from one to before another of a byte.
const fn bits(from: i32, to: i32) -> u64 {
    ((1 << to) - 1) & !((1 << from) - 1)
}

/// The bytes from one to before another of a word.
const fn bytes(from: i32, to: i32) -> u64 {
    // Up to eight, of which the last is not below the others.
    let below = ((1_u128 << (8 * to)) - 1) as u64;
    below & !(((1_u128 << (8 * from)) - 1) as u64)
}

impl Cells {
    pub(super) const fn insert(&mut self, cell: Cell) {
        self.0[cell.index() / 64] |= 1 << (cell.index() % 64);
    }

    pub(super) const fn remove(&mut self, cell: Cell) {
        self.0[cell.index() / 64] &= !(1 << (cell.index() % 64));
    }

    /// The cells of the set that lie within `reach` of these coordinates along each axis, which may lie outside of the
    /// block; ascending.
    pub(super) fn near(&self, at: [i32; 3], reach: i32) -> impl Iterator<Item = Cell> + use<> {
        let range = |axis: usize| ((at[axis] - reach).max(0), (at[axis] + reach + 1).min(EDGE));
        let [(from, to), (y_from, y_to), (z_from, z_to)] = [range(0), range(1), range(2)];
        let is_empty = from >= to || y_from >= y_to || z_from >= z_to;
        let mask = if is_empty { 0 } else { bytes(y_from, y_to) & (bits(z_from, z_to) * EACH_BYTE) };
        let words = self.0;
        let range = if is_empty { 0..0 } else { from..to };
        range.flat_map(move |x| Ones(words[x as usize] & mask).map(move |bit| Cell((x * 64) as u16 + bit)))
    }
}

impl FromIterator<Cell> for Cells {
    fn from_iter<T: IntoIterator<Item = Cell>>(cells: T) -> Self {
        let mut set = Self::default();
        cells.into_iter().for_each(|cell| set.insert(cell));
        set
    }
}

/// The places of the bits of a word, ascending.
struct Ones(u64);

impl Iterator for Ones {
    type Item = u16;

    #[inline]
    fn next(&mut self) -> Option<u16> {
        let bit = (self.0 != 0).then(|| self.0.trailing_zeros() as u16)?;
        self.0 &= self.0 - 1;
        Some(bit)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_lies_near_is_found_as_by_a_walk(
            cells in prop::collection::btree_set(0_u16..512, 0..80), gone in 0_u16..512,
            at in prop::array::uniform3(-9..17_i32), reach in 0..4_i32,
        ) {
            let mut set: Cells = cells.iter().copied().map(Cell).collect();
            set.remove(Cell(gone));
            let is_near = |cell: &Cell| {
                let to = cell.coordinates();
                (0..3).all(|i| (to[i] - at[i]).abs() <= reach)
            };
            let walk = cells.into_iter().filter(|cell| *cell != gone).map(Cell).filter(is_near);
            prop_assert_eq!(set.near(at, reach).collect::<Vec<_>>(), walk.collect::<Vec<_>>());
        }
    }
}
