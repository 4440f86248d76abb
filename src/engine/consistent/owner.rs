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
    /// What the voxels of frayed patches may go to; found once asked for.
    rivals: Option<Vec<Rival<'a>>>,
}

/// A patch that some voxels of a narrow or a cut one may fit better.
struct Rival<'a> {
    id: PatchId,
    plane: Plane,
    cells: &'a Cells,
    /// The direction of its block, and the cells that are within reach of it.
    direction: [i32; 3],
    near: Cells,
}

/// How far a rival may lie from a voxel.
const RIVAL_REACH: i32 = 2;
/// How many times as well a voxel must fit a narrow patch as another one: the plane of a narrow one follows its voxels.
const NARROW_HANDICAP: f64 = 2.0;

impl<'a> Owners<'a> {
    pub(super) fn new(block: &'a Block, segmented: &'a [Segmented], rules: &'a Rules) -> Self {
        let corner = Vector3::from(block.corner()).map(f64::from);
        Self { around: &block.around, corner, segmented, rules, rivals: None }
    }

    /// The patch that a loose voxel of the block belongs to: the nearest that its points fit, as far as noise and half a
    /// voxel let them. One of a frayed patch stays there, unless it fits a broader one within two voxels better.
    pub(super) fn of(&mut self, state: &State) -> Option<PatchId> {
        let Some(own) = self.frayed_patch_of(state) else { return self.nearest(state) };
        let Some((rival, misfit)) = self.best_rival(state, own) else { return Some(own) };
        let handicap = if patch(self.segmented, own).is_narrow() { NARROW_HANDICAP } else { 1.0 };
        let stays = state.within(&self.plane(own), self.rules).is_some_and(|own| handicap * own <= misfit);
        Some(if stays { own } else { rival })
    }

    /// The rival of its own patch that a voxel fits best, and how well.
    fn best_rival(&mut self, state: &State, own: PatchId) -> Option<(PatchId, f64)> {
        let rules = self.rules;
        let at = state.cell.coordinates();
        let rivals = self.rivals().iter().filter(|rival| rival.near.contains(state.cell) && rival.id != own);
        let near = rivals
            .filter(|rival| rival.cells.any_in(&Window::around(seen_from(at, rival.direction), RIVAL_REACH)));
        let fitting = near.filter_map(|rival| Some((rival.id, state.within(&rival.plane, rules)?)));
        fitting.min_by(|a, b| a.1.total_cmp(&b.1))
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

    /// The patches in and around the block that have planes of their own, in a fixed order.
    fn rivals(&mut self) -> &[Rival<'a>] {
        if self.rivals.is_none() {
            let blocks = self.around.iter().enumerate();
            let blocks = blocks.filter_map(|(place, block)| Some((offset_of(place), (*block)?)));
            self.rivals =
                Some(blocks.flat_map(|(direction, block)| self.rivals_in(direction, block)).collect());
        }
        self.rivals.as_deref().unwrap_or_default()
    }

    fn rivals_in(&self, direction: [i32; 3], block: BlockIndex) -> impl Iterator<Item = Rival<'a>> {
        let near = Cells::border(direction, RIVAL_REACH);
        let patches = (0..).zip(&self.segmented[block.0 as usize].patches);
        let patches = patches.filter(|(_, patch)| !patch.is_narrow() && !patch.is_rough());
        patches.map(move |(number, patch)| {
            let id = PatchId { block, number };
            Rival { id, plane: self.plane(id), cells: &patch.cells, direction, near }
        })
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
