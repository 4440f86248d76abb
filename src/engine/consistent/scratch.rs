//! The definition, from scratch: every contact of segmented blocks looked at, components found by plain search.
//!
//! What the incremental layer is held to. It shares the local rules with it (what a patch is, when two join, where a loose
//! voxel belongs) and nothing of how the whole is kept.

use std::collections::BTreeMap;

use super::contacts::Contacts;
use super::grid::Grid;
use super::host::{are_joined, host};
use super::owner::Owners;
use super::patch::PatchId;
use super::rules::Rules;
use super::segmented::{SegmentedBlocks, contacts, contacts_of};
use crate::engine::key::Partition;

/// What the definition makes of segmented blocks, whatever is known of their contacts.
pub(super) fn partition(grid: &Grid, segmented: &SegmentedBlocks, rules: &Rules) -> Partition {
    let mut segmented = segmented.clone();
    let ids = meet(grid, &mut segmented, rules);
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

/// Finds all contacts, slices and bridges; returns all patches.
pub(super) fn meet(grid: &Grid, segmented: &mut SegmentedBlocks, rules: &Rules) -> Vec<PatchId> {
    let mut ids = Vec::new();
    for (index, block) in grid.blocks() {
        let mut met = Contacts::new(block.corner());
        for (place, other) in block.around.iter() {
            let [here, there] = [index, other].map(|block| &segmented[block]);
            for ((a, b), contact) in contacts(here, there, place, block.corner()) {
                met.insert(a, PatchId { block: other, number: b }, &contact);
                if other == index {
                    met.insert(b, PatchId { block: index, number: a }, &contact);
                }
            }
        }
        let count = segmented[index].patches.len();
        ids.extend((0..count).map(|number| PatchId { block: index, number: number as u8 }));
        segmented[index].contacts = met;
    }
    let hosts: Vec<_> = ids.iter().map(|&id| host(segmented, id, rules)).collect();
    for (id, host) in ids.iter().zip(hosts) {
        segmented[id.block].patches[usize::from(id.number)].host = host;
    }
    ids
}

/// The number of the component of each patch.
fn components(ids: &[PatchId], segmented: &SegmentedBlocks, rules: &Rules) -> BTreeMap<PatchId, u32> {
    let mut neighbours: BTreeMap<PatchId, Vec<PatchId>> = ids.iter().map(|&id| (id, Vec::new())).collect();
    for &id in ids {
        for (other, contact) in contacts_of(segmented, id) {
            if are_joined(segmented, id, other, &contact, rules) {
                neighbours.entry(id).or_default().push(other);
                neighbours.entry(other).or_default().push(id);
            }
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
