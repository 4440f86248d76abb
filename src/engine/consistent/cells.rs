//! A set of the cells of a block, a bit for each: what lies around a cell is found in eight words instead of by a walk.

use super::block::{Cell, Direction, EDGE};

/// A word for each x, in it a byte for each y, in it a bit for each z: ascending bits are ascending cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cells([u64; EDGE as usize]);

/// One bit in each byte.
const EACH_BYTE: u64 = 0x0101_0101_0101_0101;

/// The last bit of each byte.
const LAST_BITS: u64 = EACH_BYTE << 7;

/// In each byte the bits below one, of which there are up to eight.
const BITS_BELOW: [u64; 9] = below(1, EACH_BYTE);
/// The bytes of a word below one.
const BYTES_BELOW: [u64; 9] = below(8, 1);

/// For 0 to 8 steps what lies below them in a word: `step` bits for each of them, the same in every place of `places`.
const fn below(step: u32, places: u64) -> [u64; 9] {
    let (mut below, mut count) = ([0; 9], 1);
    while count < below.len() {
        let last = ((1 << step) - 1) << (step * (count as u32 - 1));
        below[count] = below[count - 1] | (last * places);
        count += 1;
    }
    below
}

/// Bits `z_from..z_to` of bytes `y_from..y_to`.
const fn mask([y_from, y_to]: [i32; 2], [z_from, z_to]: [i32; 2]) -> u64 {
    let bytes = BYTES_BELOW[y_to as usize] & !BYTES_BELOW[y_from as usize];
    let bits = BITS_BELOW[z_to as usize] & !BITS_BELOW[z_from as usize];
    bytes & bits
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

    /// The cells of the set at these coordinates and around them; ascending.
    pub(super) fn near(&self, at: [i32; 3]) -> impl Iterator<Item = Cell> + use<> {
        self.within(&Window::around(at, 1))
    }

    /// The cells of the set that lie in a window; ascending.
    pub(super) fn within(&self, window: &Window) -> impl Iterator<Item = Cell> + use<> {
        let (window, words) = (*window, self.0);
        let ones = move |x: usize| Ones(words[x] & window.mask).map(move |bit| Cell((x * 64) as u16 + bit));
        (window.from..window.to).flat_map(ones)
    }
}

impl Cells {
    /// The cells that lie within `reach` of the block in this direction.
    pub(super) const fn border(direction: Direction, reach: i32) -> Self {
        let [x, y, z] = direction.offset();
        let [x_from, x_to] = side(x, reach);
        let mask = mask(side(y, reach), side(z, reach));
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

    /// The cells right before and behind those of the set along an axis.
    pub(super) fn beside(&self, axis: usize) -> Self {
        let word = |x: usize| self.0.get(x).copied().unwrap_or(0);
        Self(std::array::from_fn(|x| match axis {
            0 => word(x.wrapping_sub(1)) | word(x + 1),
            1 => self.0[x] << 8 | self.0[x] >> 8,
            _ => (self.0[x] & !LAST_BITS) << 1 | (self.0[x] & !EACH_BYTE) >> 1,
        }))
    }

    /// The cells of the set and those around them.
    pub(super) fn with_around(&self) -> Self {
        let in_words = self.0.map(|word| {
            let beside = word | (word & !LAST_BITS) << 1 | (word & !EACH_BYTE) >> 1;
            beside | beside << 8 | beside >> 8
        });
        let word = |x: usize| in_words.get(x).copied().unwrap_or(0);
        Self(std::array::from_fn(|x| word(x.wrapping_sub(1)) | in_words[x] | word(x + 1)))
    }

    /// The cells of the set that a walk from one to the next around it reaches from this one.
    pub(super) fn connected_with(&self, cell: Cell) -> Self {
        let mut reached = Self::default();
        reached.insert(cell);
        loop {
            let next = reached.with_around().and(self);
            if next == reached {
                return reached;
            }
            reached = next;
        }
    }

    /// Those of the cells that are not in another set.
    pub(super) fn without(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|x| self.0[x] & !other.0[x]))
    }

    /// Takes in another set.
    pub(super) fn extend(&mut self, other: &Self) {
        self.0.iter_mut().zip(other.0).for_each(|(word, other)| *word |= other);
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// For each cell that is in both sets the number of cells of this one below it; ascending.
    pub(super) fn ranks_of(&self, others: &Self) -> impl Iterator<Item = usize> + use<> {
        let mut below = 0;
        self.0.into_iter().zip(others.0).flat_map(move |(own, other)| {
            let first = below;
            below += own.count_ones() as usize;
            Ones(own & other).map(move |bit| first + (own & ((1 << bit) - 1)).count_ones() as usize)
        })
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
const fn side(direction: i32, reach: i32) -> [i32; 2] {
    match direction {
        -1 => [0, reach],
        1 => [EDGE - reach, EDGE],
        _ => [0, EDGE],
    }
}

/// A box of cells: some words, and in each of them the same bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    from: usize,
    to: usize,
    mask: u64,
}

/// Longest reach of a window.
const MOST_REACH: i32 = 3;
/// Coordinates of the middles of windows along an axis: those of the block, of the blocks beside it and some beyond, as many as a
/// power of two.
const MIDDLES: i32 = 32;
const LEAST_MIDDLE: i32 = (EDGE - MIDDLES) / 2;

/// What of a block a window covers along one axis: as words, as the bytes of a word and as the bits of a byte.
#[derive(Clone, Copy)]
struct Side {
    words: [u8; 2],
    bytes: u64,
    bits: u64,
}

/// By reach and coordinate, from [`LEAST_MIDDLE`] on.
static SIDES: [[Side; MIDDLES as usize]; MOST_REACH as usize + 1] = sides();

const fn sides() -> [[Side; MIDDLES as usize]; MOST_REACH as usize + 1] {
    let mut sides = [[Side { words: [0; 2], bytes: 0, bits: 0 }; MIDDLES as usize]; MOST_REACH as usize + 1];
    let mut reach = 0;
    while reach <= MOST_REACH {
        let mut middle = 0;
        while middle < MIDDLES {
            let at = LEAST_MIDDLE + middle;
            let range = [clamped(at - reach), clamped(at + reach + 1)];
            sides[reach as usize][middle as usize] = Side {
                words: [range[0] as u8, range[1] as u8],
                bytes: mask(range, [0, EDGE]),
                bits: mask([0, EDGE], range),
            };
            middle += 1;
        }
        reach += 1;
    }
    sides
}

const fn clamped(end: i32) -> i32 {
    if end < 0 {
        0
    } else if end > EDGE {
        EDGE
    } else {
        end
    }
}

impl Window {
    /// What lies within `reach`, 0 to 3, of these coordinates along each axis; they may lie as far outside of the block as those
    /// of the blocks beside it.
    pub(super) fn around(at: [i32; 3], reach: i32) -> Self {
        debug_assert!((0..=MOST_REACH).contains(&reach), "{reach}");
        let sides = &SIDES[(reach & MOST_REACH) as usize];
        let side = |axis: usize| {
            let middle = at[axis] - LEAST_MIDDLE;
            debug_assert!((0..MIDDLES).contains(&middle), "{at:?}");
            &sides[(middle & (MIDDLES - 1)) as usize]
        };
        let [from, to] = side(0).words.map(usize::from);
        Self { from, to, mask: side(1).bytes & side(2).bits }
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
            let window = Window::around(at, reach);
            let near: Vec<_> = set.within(&window).collect();
            prop_assert_eq!(set.any_in(&window), !near.is_empty());
            prop_assert_eq!(near, walk.collect::<Vec<_>>());
        }

        #[test]
        fn what_lies_beside_is_found_as_by_a_walk(
            cells in prop::collection::btree_set(0_u16..512, 0..80), axis in 0_usize..3,
        ) {
            let is_beside = |cell: &Cell| {
                [-1, 1].iter().any(|step| {
                    let mut next = cell.coordinates();
                    next[axis] += step;
                    (0..EDGE).contains(&next[axis]) && cells.contains(&Cell::at(next).0)
                })
            };
            let walk = (0..512).map(Cell).filter(is_beside);
            let set: Cells = cells.iter().copied().map(Cell).collect();
            prop_assert_eq!(set.beside(axis).iter().collect::<Vec<_>>(), walk.collect::<Vec<_>>());
        }

        #[test]
        fn what_is_connected_is_found_as_by_a_walk(cells in prop::collection::btree_set(0_u16..512, 1..80)) {
            let set: Cells = cells.iter().copied().map(Cell).collect();
            let around = |cell: Cell| set.near(cell.coordinates());
            let first = Cell(*cells.first().unwrap());
            let mut walked = vec![first];
            let mut next = 0;
            while next < walked.len() {
                let new: Vec<_> = around(walked[next]).filter(|cell| !walked.contains(cell)).collect();
                walked.extend(new);
                next += 1;
            }
            prop_assert_eq!(set.connected_with(first), walked.into_iter().collect());
            let beside = (0..512).map(Cell).filter(|cell| set.any_in(&Window::around(cell.coordinates(), 1)));
            prop_assert!(set.with_around().iter().eq(beside));
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
            let beyond = Direction::of(direction);
            let border = set.and(&Cells::border(beyond, reach));
            let walk = cells.iter().copied().map(Cell).filter(is_at_border);
            prop_assert_eq!(border.iter().collect::<Vec<_>>(), walk.collect::<Vec<_>>());
            let ranks = border.iter().map(|cell| set.rank(cell));
            prop_assert!(set.ranks_of(&Cells::border(beyond, reach)).eq(ranks));
            prop_assert!(set.without(&border).iter().eq(set.iter().filter(|cell| !is_at_border(cell))));
            let mut both = border;
            both.extend(&set);
            prop_assert_eq!(both, set);
        }
    }
}
