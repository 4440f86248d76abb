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

    pub(super) const fn contains(&self, cell: Cell) -> bool {
        self.0[cell.index() / 64] >> (cell.index() % 64) & 1 == 1
    }

    /// The cells of the set that lie within `reach` of these coordinates along each axis, which may lie outside of the
    /// block; ascending.
    pub(super) fn near(&self, at: [i32; 3], reach: i32) -> impl Iterator<Item = Cell> + use<> {
        let (window, words) = (Window::around(at, reach), self.0);
        let ones = move |x: usize| Ones(words[x] & window.mask).map(move |bit| Cell((x * 64) as u16 + bit));
        (window.from..window.to).flat_map(ones)
    }
}

impl Cells {
    /// The cells that lie within `reach` of the block in this direction, each part of which is -1, 0 or 1.
    pub(super) const fn border([x, y, z]: [i32; 3], reach: i32) -> Self {
        let (x_from, x_to) = side(x, reach);
        let (y_from, y_to) = side(y, reach);
        let (z_from, z_to) = side(z, reach);
        let mask = bytes(y_from, y_to) & (bits(z_from, z_to) * EACH_BYTE);
        let mut words = [0; EDGE as usize];
        let mut at = x_from;
        while at < x_to {
            words[at as usize] = mask;
            at += 1;
        }
        Self(words)
    }

    /// Whether one of the cells lies in a window.
    #[inline]
    pub(super) fn any_in(&self, window: &Window) -> bool {
        self.0[window.from..window.to].iter().any(|word| word & window.mask != 0)
    }

    /// The cells that are in both sets.
    pub(super) fn and(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|x| self.0[x] & other.0[x]))
    }

    /// Takes in another set.
    pub(super) fn extend(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word |= other);
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.0 == [0; EDGE as usize]
    }

    /// Ascending.
    pub(super) fn iter(&self) -> impl Iterator<Item = Cell> + use<> {
        (0..).zip(self.0).flat_map(|(x, word)| Ones(word).map(move |bit| Cell(x * 64 + bit)))
    }

    /// Number of cells of the set below this one.
    #[inline]
    pub(super) fn rank(&self, cell: Cell) -> usize {
        let (word, bit) = (cell.index() / 64, cell.index() % 64);
        let below: u32 = self.0[..word].iter().map(|word| word.count_ones()).sum();
        (below + (self.0[word] & ((1 << bit) - 1)).count_ones()) as usize
    }
}

/// The cells along one axis that lie within `reach` of what is in this direction.
const fn side(direction: i32, reach: i32) -> (i32, i32) {
    match direction {
        -1 => (0, reach),
        1 => (EDGE - reach, EDGE),
        _ => (0, EDGE),
    }
}

/// A box of cells: some words, and in each of them the same bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    from: usize,
    to: usize,
    mask: u64,
}

impl Window {
    /// What lies within `reach` of these coordinates, which may lie outside of the block, along each axis.
    pub(super) fn around(at: [i32; 3], reach: i32) -> Self {
        let range = |axis: usize| ((at[axis] - reach).max(0), (at[axis] + reach + 1).min(EDGE));
        let [(from, to), (y_from, y_to), (z_from, z_to)] = [range(0), range(1), range(2)];
        if from >= to || y_from >= y_to || z_from >= z_to {
            return Self { from: 0, to: 0, mask: 0 };
        }
        let mask = bytes(y_from, y_to) & (bits(z_from, z_to) * EACH_BYTE);
        Self { from: from as usize, to: to as usize, mask }
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
            let near: Vec<_> = set.near(at, reach).collect();
            prop_assert_eq!(set.any_in(&Window::around(at, reach)), !near.is_empty());
            prop_assert_eq!(near, walk.collect::<Vec<_>>());
        }

        #[test]
        fn borders_and_ranks_are_those_of_a_list(
            cells in prop::collection::btree_set(0_u16..512, 0..80),
            direction in prop::array::uniform3(-1..2_i32), reach in 1..4_i32,
        ) {
            let set: Cells = cells.iter().copied().map(Cell).collect();
            prop_assert_eq!((set.len(), set.is_empty()), (cells.len(), cells.is_empty()));
            prop_assert!(set.iter().enumerate().all(|(rank, cell)| set.rank(cell) == rank));
            prop_assert!((0..512).all(|cell| set.contains(Cell(cell)) == cells.contains(&cell)));
            let is_at_border = |cell: &Cell| {
                let at = cell.coordinates();
                (0..3).all(|i| match direction[i] {
                    -1 => at[i] < reach,
                    1 => at[i] >= EDGE - reach,
                    _ => true,
                })
            };
            let border = set.and(&Cells::border(direction, reach));
            let walk = cells.iter().copied().map(Cell).filter(is_at_border);
            prop_assert_eq!(border.iter().collect::<Vec<_>>(), walk.collect::<Vec<_>>());
            let mut both = border;
            both.extend(&set);
            prop_assert_eq!(both, set);
        }
    }
}
