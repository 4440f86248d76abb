//! Where all patches of a map meet, and what they are parts of.

use super::PatchId;
use super::contacts::Contacts;
use super::host::host;
use super::segmented::{SegmentedBlocks, contacts};
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::rules::Rules;

/// Finds all contacts, slices and bridges; returns all patches.
pub(crate) fn meet_all(grid: &Grid, segmented: &mut SegmentedBlocks, rules: &Rules) -> Vec<PatchId> {
    let mut ids = Vec::new();
    for (index, block) in grid.blocks() {
        let mut met = Contacts::new(block.corner());
        for (direction, other) in block.around.iter() {
            let [here, there] = [index, other].map(|block| &segmented[block]);
            for ((a, b), contact) in contacts(here, there, direction) {
                met.insert(a, PatchId { block: other, number: b }, &contact);
                if other == index {
                    met.insert(b, PatchId { block: index, number: a }, &contact);
                }
            }
        }
        ids.extend(segmented.ids(index));
        segmented[index].contacts = met;
    }
    let hosts: Vec<_> = ids.iter().map(|&id| host(segmented, id, rules)).collect();
    for (id, host) in ids.iter().zip(hosts) {
        segmented[id.block].patches[usize::from(id.number)].host = host;
    }
    ids
}
