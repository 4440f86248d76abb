//! The columns at the rim of a footprint, each with those around it.
//!
//! The eight directions around a column are counted counter-clockwise, `2 * s` towards its side `s`; opposite to `d` is
//! `d ^ 4`.

use super::footprint::{Column, Footprint, TileRim};
use super::rim::Cut;

/// In place of a column that is not at the rim.
pub(crate) const NONE: u32 = u32::MAX;

/// A column of the rim.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OfRim {
    pub(crate) column: Column,
    pub(crate) cut: Cut,
    /// By direction: the place of the neighbour at the rim, or [`NONE`].
    pub(crate) near: [u32; 8],
    /// Bit `d` is set where the neighbour in direction `d` counts as inside.
    pub(crate) inside: u8,
    /// It counts as outside.
    pub(crate) is_outside: bool,
    /// It took over what one that counts as outside covers, and stays inside.
    pub(crate) is_kept: bool,
    /// Edges that a ring was followed over: bit `s` where this column is inside and the one beyond side `s` outside, bit
    /// `4 + s` where it is the one outside.
    pub(crate) visited: u8,
}

impl OfRim {
    pub(crate) const fn is_inside(&self, direction: usize) -> bool {
        self.inside >> direction & 1 == 1
    }

    /// The side on which the neighbour takes over the covered part, where that is less than half and can be taken over.
    pub(crate) fn may_lie_outside(&self) -> Option<usize> {
        let cut = &self.cut;
        if self.is_kept || cut.fraction >= 0.5 {
            return None;
        }
        let shrunk = |&side: &usize| cut.is_open(side) && !cut.is_open(side ^ 2) && cut.reach[side] < 0.5;
        let inner = (0..4).filter(shrunk).map(|side| side ^ 2).find(|side| self.is_inside(2 * side))?;
        self.is_simple().then_some(inner)
    }

    /// Whether the columns inside around it hang together without it (Hilditch's crossing number is 1).
    fn is_simple(&self) -> bool {
        const SIDES: u8 = 0b0101_0101;
        let next = self.inside.rotate_right(1) | self.inside.rotate_right(2);
        (!self.inside & next & SIDES).is_power_of_two()
    }
}

/// Finds the rim of a footprint, ascending, every column of the footprint inside; `tiles` and `ranks` are memory to work in.
pub(crate) fn find(
    footprint: &Footprint,
    tiles: &mut Vec<TileRim>,
    ranks: &mut Vec<u64>,
    rim: &mut Vec<OfRim>,
) {
    rim.clear();
    ranks.clear();
    footprint.rim(tiles, |column, joined, content| {
        ranks.push(rank(column));
        rim.push(OfRim {
            column,
            cut: Cut::new(content, joined),
            near: [NONE; 8],
            inside: 0,
            is_outside: false,
            is_kept: false,
            visited: 0,
        });
    });
    let (mut before, mut after) = (0, 0);
    let skip = |from: usize, to: u64| from + ranks[from..].iter().take_while(|rank| **rank < to).count();
    for (here, (of_rim, &rank)) in rim.iter_mut().zip(&*ranks).enumerate() {
        // The lowest of three in the line before, in that after and in its own.
        let firsts = [rank - LINE - 1, rank + LINE - 1, rank - 1];
        (before, after) = (skip(before, firsts[0]), skip(after, firsts[1]));
        let from = [before, after, here.saturating_sub(1)];
        let directions = [[5, 4, 3], [7, 0, 1], [6, ITSELF, 2]];
        for ((first, from), directions) in firsts.into_iter().zip(from).zip(directions) {
            for (place, other) in (from..).zip(ranks[from..].iter().take(3)) {
                let direction = directions.get((other.wrapping_sub(first)) as usize).copied();
                if let Some(near) = direction.and_then(|direction| of_rim.near.get_mut(direction)) {
                    *near = place as u32;
                }
            }
        }
    }
    (0..rim.len()).for_each(|here| rim[here].inside = inside(rim, here));
}

/// In place of the direction of a column from itself.
const ITSELF: usize = 8;
/// What the rank of a column in the next line is more.
const LINE: u64 = 1 << 32;

/// Place of a column in the order of all; its neighbours have the ranks beside its own and those a line away.
fn rank([x, y]: Column) -> u64 {
    let positive = |along: i32| (i64::from(along) - i64::from(i32::MIN)) as u64;
    positive(x) * LINE + positive(y)
}

/// Which neighbours are covered. A covered one that is not at the rim has all its neighbours.
fn inside(rim: &[OfRim], here: usize) -> u8 {
    let OfRim { near, cut, .. } = &rim[here];
    let mut inside = 0;
    for side in 0..4 {
        if cut.is_open(side) {
            continue;
        }
        inside |= 1 << (2 * side);
        // The two beside that one.
        for (turn, direction) in [(side + 1, 2 * side + 1), (side + 3, 2 * side + 7)] {
            let beyond = rim.get(near[2 * side] as usize);
            if beyond.is_none_or(|beyond| !beyond.cut.is_open(turn % 4)) {
                inside |= 1 << (direction % 8);
            }
        }
    }
    (0..8)
        .filter(|&direction| near[direction] != NONE)
        .fold(inside, |inside, direction| inside | 1 << direction)
}
