//! Where each block is in the grid's list, found by its place.
//!
//! Many small tables, not one: a table that has no room left takes a larger one and moves all that it holds there, which in a
//! building would make one scan wait for it. Of these each holds one block in [`TABLES`], and they grow in different scans.

use std::hash::BuildHasher;

use hashbrown::HashMap;
use rustc_hash::FxBuildHasher;

use crate::engine::consistent::block::{BlockIndex, BlockKey};

/// A power of two. With ten million dense voxels each table has some two thousand blocks, which it takes a tenth of a millisecond
/// to move.
const TABLES: usize = 64;

#[derive(Clone, Debug)]
pub(super) struct Index([HashMap<BlockKey, BlockIndex, FxBuildHasher>; TABLES]);

impl Index {
    pub(super) fn new() -> Self {
        Self(std::array::from_fn(|_| HashMap::default()))
    }

    pub(super) fn get(&self, key: BlockKey) -> Option<BlockIndex> {
        self.0[table_of(&key)].get(&key).copied()
    }

    /// Where the block was before, if it was there.
    pub(super) fn insert(&mut self, key: BlockKey, block: BlockIndex) -> Option<BlockIndex> {
        self.0[table_of(&key)].insert(key, block)
    }

    /// The places of all blocks, in no order.
    pub(super) fn keys(&self) -> impl Iterator<Item = BlockKey> {
        self.0.iter().flat_map(|table| table.keys().copied())
    }

    /// A table that has lost most of what it held gives most of its room back.
    pub(super) fn remove(&mut self, key: BlockKey) {
        let table = &mut self.0[table_of(&key)];
        table.remove(&key);
        if table.len() < table.capacity() / 4 {
            table.shrink_to(2 * table.len());
        }
    }
}

/// By other bits of the hash than those by which a table finds its place for a key.
fn table_of(key: &BlockKey) -> usize {
    (FxBuildHasher.hash_one(key) >> 40) as usize % TABLES
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_blocks_of_a_building_fill_all_tables_alike_and_leave_no_room_behind() {
        let mut index = Index::new();
        let blocks = || (0..200).flat_map(|x| (-100..100).flat_map(move |y| (0..4).map(move |z| [x, y, z])));
        for (block, key) in (0..).map(BlockIndex).zip(blocks()) {
            assert_eq!(index.insert(key, block), None);
        }
        let mean = blocks().count() / TABLES;
        let lengths = index.0.each_ref().map(HashMap::len);
        assert!(lengths.iter().all(|len| (mean / 2..2 * mean).contains(len)), "{lengths:?}");
        blocks().for_each(|key| index.remove(key));
        let room: usize = index.0.iter().map(HashMap::capacity).sum();
        assert!(room < 10 * TABLES, "{room}");
    }

    proptest! {
        #[test]
        fn blocks_are_found_as_in_one_table(
            changes in prop::collection::vec((prop::array::uniform3(-2..2_i32), prop::option::of(0..9_u32)), 0..200),
        ) {
            let (mut index, mut plain) = (Index::new(), BTreeMap::new());
            for (key, block) in changes {
                if let Some(block) = block.map(BlockIndex) {
                    prop_assert_eq!(index.insert(key, block), plain.insert(key, block));
                } else {
                    index.remove(key);
                    plain.remove(&key);
                }
                prop_assert_eq!(index.get(key), plain.get(&key).copied());
            }
            let mut keys: Vec<_> = index.keys().collect();
            keys.sort_unstable();
            prop_assert_eq!(keys, plain.into_keys().collect::<Vec<_>>());
        }
    }
}
