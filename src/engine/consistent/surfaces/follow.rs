//! Blocks that get other places in the grid's list.

use std::collections::BTreeSet;

use super::Surfaces;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::grid::moves::Moves;
use crate::engine::consistent::patch::PatchId;

impl Surfaces {
    /// Follows the blocks of `grid`, which has moved them. Those that have gone were published without a voxel.
    pub(in super::super) fn follow(&mut self, grid: &Grid, moves: &Moves) {
        debug_assert!(moves.gone().iter().all(|&gone| self.segmented[gone].states.is_empty()));
        moves.apply(&mut self.segmented);
        moves.apply(&mut self.nodes);
        let moved = moves.moved().iter().map(|(_, to)| *to);
        let around = moved.clone().flat_map(|block| grid.block(block).around.iter());
        for block in around.map(|(_, block)| block).collect::<BTreeSet<_>>() {
            // Most name none: then nothing is copied that a frozen map shares. A host is met as well.
            if !self.segmented[block].contacts.names_any_beyond(moves.slots()) {
                continue;
            }
            let here = &mut self.segmented[block];
            here.contacts.follow(moves);
            for patch in &mut here.patches {
                patch.host = patch.host.moved(|id| PatchId { block: moves.of(id.block), ..id });
            }
        }
        for block in moved {
            for (number, &node) in (0..).zip(&self.nodes[block]) {
                self.patches[node] = Some(PatchId { block, number });
            }
        }
    }
}
