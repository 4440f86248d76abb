//! Which patch a loose voxel belongs to.

use nalgebra::Vector3;

use super::block::{Around, Block, BlockIndex, Cell, EDGE, OWN, offset_of, place_of};
use super::cells::{Cells, Window};
use super::layer::{PatchId, Segmented, patch, seen_from};
use super::patches::LOOSE;
use super::rules::Rules;
use super::state::{Plane, State};

/// Finds the patches that the loose voxels of one block belong to.
pub(super) struct Owners<'a> {
    around: &'a Around,
    corner: Vector3<f64>,
    segmented: &'a [Segmented],
    rules: &'a Rules,
    /// For each frayed patch of the block, once asked for.
    rivals: Vec<Option<Vec<Rival>>>,
}

/// A whole patch that some voxels of a frayed one may fit better.
struct Rival {
    id: PatchId,
    plane: Plane,
    /// The cells that are within reach of its block.
    near: Cells,
}

impl<'a> Owners<'a> {
    pub(super) fn new(block: &'a Block, segmented: &'a [Segmented], rules: &'a Rules) -> Self {
        let corner = Vector3::from(block.corner()).map(f64::from);
        Self { around: &block.around, corner, segmented, rules, rivals: Vec::new() }
    }

    /// The patch that a loose voxel of the block belongs to: the nearest that its points fit, as far as noise and half a
    /// voxel let them. One of a frayed patch stays there, unless it fits a whole one better that this meets in a block
    /// within reach.
    pub(super) fn of(&mut self, state: &State) -> Option<PatchId> {
        let Some(own) = self.frayed_patch_of(state) else { return self.nearest(state) };
        let plane = self.plane(own);
        let rules = self.rules;
        let fitting = self.rivals(own).iter().filter(|rival| rival.near.contains(state.cell));
        let fitting = fitting.filter_map(|rival| Some((state.within(&rival.plane, rules)?, rival.id)));
        let best = fitting.min_by(|a, b| a.0.total_cmp(&b.0));
        let better =
            |(misfit, _): &(f64, PatchId)| state.within(&plane, rules).is_none_or(|own| *misfit < own);
        Some(best.filter(better).map_or(own, |(_, id)| id))
    }

    fn frayed_patch_of(&self, state: &State) -> Option<PatchId> {
        let block = self.around[OWN]?;
        let number = self.segmented[block.0 as usize].labels[state.cell.index()];
        (number != LOOSE).then_some(PatchId { block, number })
    }

    /// The plane of a patch, from the corner of the block.
    fn plane(&self, id: PatchId) -> Plane {
        let plane = patch(self.segmented, id).plane;
        Plane { point: plane.point - self.corner, ..plane }
    }

    /// The whole patches that a frayed one of the block meets in blocks within reach, ascending.
    fn rivals(&mut self, of: PatchId) -> &[Rival] {
        let number = usize::from(of.number);
        if self.rivals.get(number).is_none_or(Option::is_none) {
            let met = self.segmented[of.block.0 as usize].contacts[number].keys();
            let rivals = met.filter_map(|&id| self.rival(id)).collect();
            self.rivals.resize_with(self.rivals.len().max(number + 1), || None);
            self.rivals[number] = Some(rivals);
        }
        self.rivals[number].as_deref().unwrap_or_default()
    }

    fn rival(&self, id: PatchId) -> Option<Rival> {
        let patch = patch(self.segmented, id);
        if patch.is_frayed() || patch.is_rough() {
            return None;
        }
        let place = self.around.iter().position(|block| *block == Some(id.block))?;
        let near = Cells::border(offset_of(place), self.rules.rim_reach);
        Some(Rival { id, plane: self.plane(id), near })
    }

    /// The patch that fits best of those with the nearest voxels.
    fn nearest(&self, state: &State) -> Option<PatchId> {
        (1..=self.rules.rim_reach).find_map(|reach| self.best_at(state, reach))
    }

    /// The patch that fits best of those with a voxel within `reach` and none nearer.
    fn best_at(&self, state: &State, reach: i32) -> Option<PatchId> {
        let mut best: Option<(f64, PatchId)> = None;
        for (block, at) in self.blocks_near(state.cell, reach) {
            let there = &self.segmented[block.0 as usize];
            let near = Window::around(at, reach);
            if !there.is_any_patch_in(&near) {
                continue;
            }
            let nearer = Window::around(at, reach - 1);
            for (number, patch) in (0..).zip(&there.patches) {
                if !patch.cells.any_in(&near) || reach > 1 && patch.cells.any_in(&nearer) {
                    continue;
                }
                let id = PatchId { block, number };
                let Some(misfit) = state.beside(&self.plane(id), self.rules) else { continue };
                if best.is_none_or(|(least, of)| misfit < least || misfit == least && id < of) {
                    best = Some((misfit, id));
                }
            }
        }
        best.map(|(_, id)| id)
    }

    /// The blocks within `reach` of a cell, each with the cell's coordinates as that block counts them.
    fn blocks_near(&self, cell: Cell, reach: i32) -> impl Iterator<Item = (BlockIndex, [i32; 3])> {
        let at = cell.coordinates();
        let sides = move |i: usize| -i32::from(at[i] < reach)..=i32::from(at[i] >= EDGE - reach);
        let directions =
            sides(0).flat_map(move |x| sides(1).flat_map(move |y| sides(2).map(move |z| [x, y, z])));
        directions
            .filter_map(move |direction| Some((self.around[place_of(direction)]?, seen_from(at, direction))))
    }
}
