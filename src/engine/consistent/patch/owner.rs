//! Which patch a loose voxel belongs to.

use nalgebra::Vector3;

use super::candidate::Candidate;
use super::segmented::SegmentedBlocks;
use super::{Patch, PatchId};
use crate::engine::consistent::block::{Around, Block, BlockIndex, Cell, Direction, EDGE};
use crate::engine::consistent::cells::Window;
use crate::engine::consistent::plane::Plane;
use crate::engine::consistent::rules::{NOISE_FACTOR, RIM_NOISE_FACTOR, Rules};
use crate::engine::consistent::state::State;

/// Finds the patches that the loose voxels of one block belong to.
pub(crate) struct Owners<'a> {
    around: &'a Around,
    corner: Vector3<f64>,
    segmented: &'a SegmentedBlocks,
    rules: &'a Rules,
}

/// A block with the coordinates of a voxel as that block counts them.
type Seen = (BlockIndex, [i32; 3]);

/// How far a voxel beside a patch may lie from it, along each axis, in voxels.
pub(crate) const RIM_REACH: i32 = 3;
/// How far a rival of its own patch may lie from a voxel.
const RIVAL_REACH: i32 = 2;
/// How many times as well a voxel must fit a narrow patch as another one: the plane of a narrow one follows its voxels.
const NARROW_HANDICAP: f64 = 2.0;

impl<'a> Owners<'a> {
    pub(crate) fn new(block: &'a Block, segmented: &'a SegmentedBlocks, rules: &'a Rules) -> Self {
        let corner = block.low();
        Self { around: &block.around, corner, segmented, rules }
    }

    /// The patch that a loose voxel of the block belongs to: the nearest that its points fit, as far as noise and
    /// [`Rules::rim_flatness`] let them. One of a frayed patch stays there, unless it belongs to the plane of one within two
    /// voxels that is neither narrow nor rough, and fits that better; where its own is narrow, [`NARROW_HANDICAP`] times as
    /// badly will do.
    pub(crate) fn of(&self, state: &State) -> Option<PatchId> {
        let candidate = Candidate::new(state, &self.rules.noise);
        match self.frayed_patch_of(state.cell()) {
            Some(own) => self.best_rival(state.cell(), &candidate, own).or(Some(own)),
            None => self.nearest(state.cell(), &candidate),
        }
    }

    /// Whether a loose voxel still belongs to the patch that it belonged to (`None` = to none) before the blocks in the
    /// directions `anew` were segmented anew. `with` lies in none of these. Conservative: `false` may be wrong, `true`
    /// never is.
    pub(crate) fn stays(&self, state: &State, with: Option<PatchId>, anew: &[Direction]) -> bool {
        let (candidate, at) = (Candidate::new(state, &self.rules.noise), state.cell().coordinates());
        let seen = |&anew: &Direction| Some((self.around.get(anew)?, anew.seen_from(at)));
        let mut anew = anew.iter().filter_map(seen);
        match (self.frayed_patch_of(state.cell()), with) {
            (Some(own), Some(with)) => {
                let most = self.claim(&candidate, own, with).min(1.0);
                let is_better = |rival: &Patch| self.within(&candidate, rival, most).is_some();
                !anew.any(|there| self.rivals(there).any(|(_, rival)| is_better(rival)))
            }
            (Some(_), None) => false,
            (None, with) => {
                let (reach, misfit) = with.map_or((RIM_REACH, 1.0), |with| self.hold(at, &candidate, with));
                !anew.any(|there| self.is_beside(&candidate, there, reach, misfit))
            }
        }
    }

    /// What a rival's misfit must be below to take a voxel of its own patch from the one that it is with.
    fn claim(&self, candidate: &Candidate, own: PatchId, with: PatchId) -> f64 {
        let patch = self.segmented.patch(with);
        let handicap = if own == with && patch.is_narrow() { NARROW_HANDICAP } else { 1.0 };
        self.within(candidate, patch, 1.0).map_or(f64::INFINITY, |misfit| handicap * misfit)
    }

    /// The rival of its own patch that a voxel fits best; `None` where it fits none better than that.
    fn best_rival(&self, cell: Cell, candidate: &Candidate, own: PatchId) -> Option<PatchId> {
        let (mut best, mut most) = (None, self.claim(candidate, own, own));
        for there in self.blocks_near(cell, RIVAL_REACH) {
            for (id, rival) in self.rivals(there).filter(|(id, _)| *id != own) {
                if let Some(misfit) =
                    self.within(candidate, rival, most.min(1.0)).filter(|misfit| *misfit < most)
                {
                    (best, most) = (Some(id), misfit);
                }
            }
        }
        best
    }

    /// The patches of a block near a voxel that have planes of their own.
    fn rivals(&self, (block, at): Seen) -> impl Iterator<Item = (PatchId, &'a Patch)> {
        let near = Window::around(at, RIVAL_REACH);
        let there = &self.segmented[block];
        let patches = (0..).zip(if there.is_any_patch_in(&near) { &there.patches[..] } else { &[] });
        patches
            .filter(move |(_, patch)| !patch.is_narrow() && !patch.is_rough() && patch.cells.any_in(&near))
            .map(move |(number, patch)| (PatchId { block, number }, patch))
    }

    fn frayed_patch_of(&self, cell: Cell) -> Option<PatchId> {
        let block = self.around.get(Direction::OWN)?;
        let number = self.segmented[block].number_of(cell)?;
        Some(PatchId { block, number })
    }

    /// The patch that fits best of those with the nearest voxels.
    fn nearest(&self, cell: Cell, candidate: &Candidate) -> Option<PatchId> {
        (1..=RIM_REACH).find_map(|reach| self.best_at(cell, candidate, reach))
    }

    /// The patch that fits best of those with a voxel within `reach` and none nearer; of equals that of the block which lies
    /// first, as [`Self::blocks_near`] has them.
    fn best_at(&self, cell: Cell, candidate: &Candidate, reach: i32) -> Option<PatchId> {
        let mut best: Option<(f64, PatchId)> = None;
        for (block, at) in self.blocks_near(cell, reach) {
            let there = &self.segmented[block];
            let near = Window::around(at, reach);
            if !there.is_any_patch_in(&near) {
                continue;
            }
            let nearer = Window::around(at, reach - 1);
            for (number, patch) in (0..).zip(&there.patches) {
                if !patch.cells.any_in(&near) || reach > 1 && patch.cells.any_in(&nearer) {
                    continue;
                }
                let Some(misfit) = self.beside(candidate, patch, 1.0) else { continue };
                if best.is_none_or(|(least, _)| misfit < least) {
                    best = Some((misfit, PatchId { block, number }));
                }
            }
        }
        best.map(|(_, id)| id)
    }

    /// How far the patch that a voxel at these coordinates is beside lies from it, and how well it fits there.
    fn hold(&self, at: [i32; 3], candidate: &Candidate, with: PatchId) -> (i32, f64) {
        let most = RIM_REACH;
        let found = self.around.iter().find(|(_, block)| *block == with.block);
        let Some(at) = found.map(|(direction, _)| direction.seen_from(at)) else { return (most, 1.0) };
        let patch = self.segmented.patch(with);
        let reach = (1..most).find(|reach| patch.cells.any_in(&Window::around(at, *reach)));
        (reach.unwrap_or(most), self.beside(candidate, patch, 1.0).unwrap_or(1.0))
    }

    /// Whether a voxel fits a patch of a block nearer than `reach`, or there by `misfit`.
    fn is_beside(&self, candidate: &Candidate, (block, at): Seen, reach: i32, misfit: f64) -> bool {
        let (near, nearer) = (Window::around(at, reach), Window::around(at, reach - 1));
        let there = &self.segmented[block];
        let fits = |patch: &Patch| {
            let most = if reach > 1 && patch.cells.any_in(&nearer) { 1.0 } else { misfit };
            patch.cells.any_in(&near) && self.beside(candidate, patch, most).is_some()
        };
        there.is_any_patch_in(&near) && there.patches.iter().any(fits)
    }

    /// How well a voxel's points lie on the plane of a patch, as far as their noise lets them; `None` beyond `most`.
    fn within(&self, candidate: &Candidate, patch: &Patch, most: f64) -> Option<f64> {
        candidate.misfit(&self.local(&patch.plane()), NOISE_FACTOR, self.rules.flatness, most)
    }

    /// How well a voxel's points lie on the plane of a patch beside it, as far as noise and [`Rules::rim_flatness`] let them;
    /// `None` beyond `most`.
    fn beside(&self, candidate: &Candidate, patch: &Patch, most: f64) -> Option<f64> {
        candidate.misfit(&self.local(&patch.plane()), RIM_NOISE_FACTOR, self.rules.rim_flatness, most)
    }

    /// A plane with its point from the corner of the block.
    fn local(&self, plane: &Plane) -> Plane {
        Plane { point: plane.point - self.corner, ..*plane }
    }

    /// The blocks within `reach`, less than half an edge, of a cell: its own, and those beyond the faces that it is near.
    fn blocks_near(&self, cell: Cell, reach: i32) -> impl Iterator<Item = Seen> {
        let at = cell.coordinates();
        let side = at.map(|along| i32::from(along >= EDGE - reach) - i32::from(along < reach));
        // A bit for each axis along which there is another block.
        let has = |bits: u8, axis: usize| bits >> axis & 1 == 1;
        let all = (0..3).fold(0, |all, axis| all | u8::from(side[axis] != 0) << axis);
        let some = (0..8_u8).filter(move |bits| bits & !all == 0);
        let offset = move |bits| [0, 1, 2].map(|axis| if has(bits, axis) { side[axis] } else { 0 });
        some.map(move |bits| Direction::of(offset(bits)))
            .filter_map(move |direction| Some((self.around.get(direction)?, direction.seen_from(at))))
    }
}

#[cfg(test)]
mod tests;
