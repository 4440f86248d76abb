//! Where the patches of a block meet others.

use nalgebra::Vector3;

use super::PatchId;
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::grid::moves::Moves;
use crate::engine::consistent::lists::by::Place;

/// Where two patches meet: their voxels that touch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Contact {
    /// Number of pairs of voxels.
    pub(crate) pairs: u32,
    /// Sum of the cells' middles over the pairs' voxels, two a pair.
    pub(crate) sum: Vector3<f64>,
}

/// Where each patch of a block meets others, of this block or another: a list of a handful for each patch, one after the
/// other. Their sums are whole numbers, and are kept from the corner of the block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contacts {
    corner: [i32; 3],
    /// Ascending by patch of the block, block of the other, and its number there.
    met: Vec<Met>,
}

#[derive(Clone, Copy, Debug)]
struct Met {
    number: u8,
    other: u8,
    /// Pairs of voxels that touch; of 512 no more than 13,824 can.
    pairs: u16,
    block: BlockIndex,
    /// Sum of the cells' middles, two a pair.
    sum: [i32; 3],
}

impl Met {
    const fn of(&self) -> (u8, PatchId) {
        (self.number, PatchId { block: self.block, number: self.other })
    }
}

impl Contacts {
    /// The lower corner of the block.
    pub(crate) const fn corner(&self) -> [i32; 3] {
        self.corner
    }

    /// No contacts yet, of a block with this lower corner (voxel indices).
    pub(crate) const fn new(corner: [i32; 3]) -> Self {
        Self { corner, met: Vec::new() }
    }

    /// Notes where a patch meets another, in place of what was known of that.
    pub(crate) fn insert(&mut self, number: u8, other: PatchId, contact: &Contact) {
        let from = self.corners(contact.pairs);
        let sum: [f64; 3] = (contact.sum - from).into();
        let met = Met {
            number,
            other: other.number,
            pairs: contact.pairs as u16,
            block: other.block,
            sum: sum.map(|along| along as i32),
        };
        debug_assert_eq!(self.contact(&met), *contact);
        match self.met.binary_search_by_key(&(number, other), Met::of) {
            Ok(place) => self.met[place] = met,
            Err(place) => self.met.insert(place, met),
        }
    }

    /// Whether there is no room to spare.
    pub(crate) const fn is_fit(&self) -> bool {
        self.met.len() == self.met.capacity()
    }

    /// Gives back what room there is to spare.
    pub(crate) fn fit(&mut self) {
        self.met.shrink_to_fit();
    }

    /// Whether a patch of the block meets one of a block whose place is `blocks` or beyond.
    pub(crate) fn names_any_beyond(&self, blocks: usize) -> bool {
        self.met.iter().any(|met| met.block.place() >= blocks)
    }

    /// Whether a patch of the block meets one of this other block.
    pub(crate) fn meets(&self, block: BlockIndex) -> bool {
        self.met.iter().any(|met| met.block == block)
    }

    /// Forgets the patches of another block.
    pub(crate) fn forget(&mut self, block: BlockIndex) {
        self.met.retain(|met| met.block != block);
    }

    /// Follows blocks to other places.
    pub(crate) fn follow(&mut self, moves: &Moves) {
        self.met.iter_mut().for_each(|met| met.block = moves.of(met.block));
        self.met.sort_unstable_by_key(Met::of);
    }

    /// The patches that a patch of the block meets, ascending.
    pub(crate) fn of(&self, number: u8) -> impl Iterator<Item = (PatchId, Contact)> {
        let from = self.met.partition_point(|met| met.number < number);
        let met = self.met[from..].iter().take_while(move |met| met.number == number);
        met.map(|met| (met.of().1, self.contact(met)))
    }

    fn contact(&self, met: &Met) -> Contact {
        let pairs = met.pairs.into();
        Contact { pairs, sum: Vector3::from(met.sum).map(f64::from) + self.corners(pairs) }
    }

    /// What the corner of the block contributes to the sum of `pairs` pairs.
    fn corners(&self, pairs: u32) -> Vector3<f64> {
        Vector3::from(self.corner).map(f64::from) * f64::from(2 * pairs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_patch_is_met_once_in_order_until_its_block_is_forgotten() {
        let id = |block, number| PatchId { block: BlockIndex(block), number };
        let met = |pairs| Contact { pairs, sum: Vector3::new(-8000.0, 7.0, 8e5) * f64::from(pairs) };
        let mut contacts = Contacts::new([-4000, 0, 400_000]);
        for (own, other, pairs) in
            [(1, id(7, 1), 3), (1, id(2, 0), 4), (0, id(9, 0), 2), (1, id(7, 0), 5), (1, id(7, 1), 6)]
        {
            contacts.insert(own, other, &met(pairs));
        }
        let seen = |contacts: &Contacts| contacts.of(1).collect::<Vec<_>>();
        assert_eq!(seen(&contacts), [(id(2, 0), met(4)), (id(7, 0), met(5)), (id(7, 1), met(6))]);
        contacts.forget(BlockIndex(7));
        assert_eq!(seen(&contacts), [(id(2, 0), met(4))]);
        assert_eq!(contacts.of(0).collect::<Vec<_>>(), [(id(9, 0), met(2))]);
        assert_eq!(contacts.of(2).count(), 0);
    }

    #[test]
    fn patches_of_a_block_that_moves_are_met_where_it_is_now() {
        let id = |block, number| PatchId { block: BlockIndex(block), number };
        let met = |pairs| Contact { pairs, sum: Vector3::zeros() };
        let mut contacts = Contacts::new([0; 3]);
        for (own, other, pairs) in [(0, id(9, 1), 1), (0, id(4, 0), 2), (1, id(3, 0), 3), (1, id(9, 0), 4)] {
            contacts.insert(own, other, &met(pairs));
        }
        contacts.follow(&Moves::new(10, vec![BlockIndex(2)]));
        assert_eq!(contacts.of(0).collect::<Vec<_>>(), [(id(2, 1), met(1)), (id(4, 0), met(2))]);
        assert_eq!(contacts.of(1).collect::<Vec<_>>(), [(id(2, 0), met(4)), (id(3, 0), met(3))]);
    }
}
