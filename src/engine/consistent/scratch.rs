//! The definition, from scratch: from the states of the voxels as they were published, every block segmented, every contact looked at,
//! components found by plain search.
//!
//! What the incremental layer is held to. It shares the local rules with it (what a patch is, when two join, where a loose
//! voxel belongs) and nothing of how the whole is kept.

use std::collections::BTreeMap;

use super::grid::Grid;
use super::patch::PatchId;
use super::patch::host::joined_with;
use super::patch::meet::meet_all;
use super::patch::owner::Owners;
use super::patch::segmented::SegmentedBlocks;
use super::rules::Rules;
use crate::engine::key::Partition;

/// What the definition makes of the states of segmented blocks, whatever else is known of these.
pub(super) fn partition(grid: &Grid, published: &SegmentedBlocks, rules: &Rules) -> Partition {
    let anew = grid.blocks().map(|(index, _)| published[index].anew(rules));
    partition_of(grid, anew.collect(), rules)
}

/// What the definition makes of blocks that were segmented just now.
pub(super) fn partition_of(grid: &Grid, mut segmented: SegmentedBlocks, rules: &Rules) -> Partition {
    let ids = meet_all(grid, &mut segmented, rules);
    let numbers = components(&ids, &segmented, rules);
    let mut partition = Partition::new();
    for (index, block) in grid.blocks() {
        let here = &segmented[index];
        let patches = here.numbers();
        for state in here.states.iter() {
            let number = patches[state.cell().index()];
            let patch = if here.is_loose(number) {
                // Anew for each, so that nothing that is kept for the others can be wrong in both.
                Owners::new(block, &segmented, rules).of(state)
            } else {
                Some(PatchId { block: index, number })
            };
            let number = patch.map(|patch| numbers[&patch]);
            partition.extend(block.voxel_key(state.cell()).map(|key| (key, number)));
        }
    }
    partition.sort_unstable();
    partition
}

/// The number of the component of each patch.
fn components(ids: &[PatchId], segmented: &SegmentedBlocks, rules: &Rules) -> BTreeMap<PatchId, u32> {
    let mut neighbours: BTreeMap<PatchId, Vec<PatchId>> = ids.iter().map(|&id| (id, Vec::new())).collect();
    for &id in ids {
        for other in joined_with(segmented, id, rules) {
            neighbours.entry(id).or_default().push(other);
            neighbours.entry(other).or_default().push(id);
        }
    }
    let mut numbers = BTreeMap::new();
    let mut next = 0;
    for &first in neighbours.keys() {
        if numbers.contains_key(&first) {
            continue;
        }
        let mut open = vec![first];
        numbers.insert(first, next);
        while let Some(patch) = open.pop() {
            for &other in &neighbours[&patch] {
                if numbers.insert(other, next).is_none() {
                    open.push(other);
                }
            }
        }
        next += 1;
    }
    numbers
}
