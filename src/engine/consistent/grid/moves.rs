//! Blocks that have gone give their slots back: those at the end of the list take them, so that no slot is without a block.
//!
//! Costs O(blocks that have gone), for each table that is kept by slot.

use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::lists::by::Place;
use crate::engine::consistent::lists::shared::Shared;

/// What became of the slots.
#[derive(Clone, Debug)]
pub(crate) struct Moves {
    /// The slots that are left.
    slots: usize,
    /// The blocks that have gone, ascending.
    gone: Vec<BlockIndex>,
    /// Blocks beyond those slots and where they are now: ascending both.
    moved: Vec<(BlockIndex, BlockIndex)>,
}

impl Moves {
    /// Of `slots` slots those of `gone` (ascending) are given back.
    pub(crate) fn new(slots: usize, gone: Vec<BlockIndex>) -> Self {
        debug_assert!(gone.is_sorted_by(|a, b| a < b));
        let left = slots - gone.len();
        let (given, beyond) = gone.split_at(gone.partition_point(|block| block.place() < left));
        let last = (left..slots).map(BlockIndex::at);
        let last = last.filter(|block| beyond.binary_search(block).is_err());
        let moved = last.zip(given.iter().copied()).collect();
        Self { slots: left, gone, moved }
    }

    /// The slots that are left.
    pub(crate) const fn slots(&self) -> usize {
        self.slots
    }

    /// The blocks that have gone, by the slots that they had: ascending.
    pub(crate) fn gone(&self) -> &[BlockIndex] {
        &self.gone
    }

    /// The blocks that have moved: from where, and to where.
    pub(crate) fn moved(&self) -> &[(BlockIndex, BlockIndex)] {
        &self.moved
    }

    /// Where a block is now that has not gone.
    pub(crate) fn of(&self, block: BlockIndex) -> BlockIndex {
        if block.place() < self.slots {
            return block;
        }
        let place = self.moved.binary_search_by_key(&block, |(from, _)| *from);
        debug_assert!(place.is_ok(), "{block:?} has gone");
        place.map_or(block, |place| self.moved[place].1)
    }

    /// Names blocks by their slots of now, and leaves out those that have gone.
    pub(crate) fn rename(&self, blocks: &mut Vec<BlockIndex>) {
        blocks.retain_mut(|block| self.try_rename(block));
    }

    /// Names a block by its slot of now; `false` where it has gone.
    pub(crate) fn try_rename(&self, block: &mut BlockIndex) -> bool {
        let is_there = self.gone.binary_search(block).is_err();
        if is_there {
            *block = self.of(*block);
        }
        is_there
    }

    /// Follows in a table that has something for each slot.
    pub(crate) fn apply<T: Clone + Default>(&self, table: &mut Shared<BlockIndex, T>) {
        debug_assert_eq!(table.len(), self.slots + self.gone.len());
        self.moved.iter().for_each(|&(from, to)| table.swap(from, to));
        table.set_len(self.slots);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLOTS: u32 = 7;

    #[test]
    fn whatever_goes_the_others_fill_the_slots_and_are_found_by_their_new_names() {
        for bits in 0..1_u32 << SLOTS {
            let all = || (0..SLOTS).map(BlockIndex);
            let (gone, there): (Vec<_>, Vec<_>) = all().partition(|block| bits >> block.0 & 1 == 1);
            let moves = Moves::new(SLOTS as usize, gone.clone());
            let mut table: Shared<_, _> = all().map(Some).collect();
            moves.apply(&mut table);
            let mut sorted: Vec<_> = table.iter().copied().flatten().collect();
            sorted.sort_unstable();
            assert_eq!(sorted, there, "without {gone:?}");
            there.iter().for_each(|&block| assert_eq!(table[moves.of(block)], Some(block)));
            let stayed = there.iter().filter(|&&block| moves.of(block) == block).count();
            assert_eq!(stayed + moves.moved().len(), there.len());
            let mut renamed: Vec<_> = all().collect();
            moves.rename(&mut renamed);
            assert_eq!(renamed, there.iter().map(|&block| moves.of(block)).collect::<Vec<_>>());
        }
    }
}
