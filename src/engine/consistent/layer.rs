//! The patches of all blocks, and where they meet.

use std::sync::Arc;

use nalgebra::Vector3;

use super::block::{Block, BlockIndex, CELLS, Cell, EDGE, offset_of};
use super::cells::{Cells, Window};
use super::cluster::{Member, Share};
use super::contacts::{Contact, Contacts};
use super::graph::NodeId;
use super::grid::Grid;
use super::patch::{Host, Patch, PatchId};
use super::patches::{LOOSE, Patches, segment};
use super::room;
use super::rules::Rules;
use super::shared::Shared;
use super::state::{State, states};

/// A block as it was published last.
#[derive(Clone, Debug, Default)]
pub(super) struct Segmented {
    /// Its dense voxels by ascending cell; a block at rest has them too.
    pub(super) states: Arc<Vec<State>>,
    /// The cells that are in a patch.
    cells: Cells,
    pub(super) patches: Vec<Patch>,
    pub(super) contacts: Contacts,
    /// Dense voxels whose patch is found by what lies around them: those in none, and those of frayed patches.
    pub(super) loose: Vec<Loose>,
    /// Their cells, in the same order.
    pub(super) loose_cells: Cells,
    /// Most points of a voxel.
    most_points: u32,
}

/// All blocks.
pub(super) type SegmentedBlocks = Shared<BlockIndex, Segmented>;

/// How far the voxels of two patches that meet may lie apart, along each axis, in voxels.
pub(super) const CONTACT_REACH: i32 = 1;
/// Points below which a voxel may be thin, where they are a sliver of it: one that a surface covers was seen for a short time alone.
const THIN: u32 = 200;
/// One in so many of those of the voxel with the most points in its block: fewer are thin. An edge that covers as little of its
/// voxel moves the outline by less than that part of one.
///
/// On the laboratory at 30 scans a second all areas from 2 m^2 on are within 10 % by it. With one in 300, but below 100 points,
/// two of 26 are not, at 8 cm; from one in 200 on, whatever the points, a table's top loses a quarter of itself in some seeds
/// (every sixth scan, 8 cm). Where thin voxels are kept out of patches too, walls, doors and cupboards join.
const PART_OF_THIN: u64 = 600;

/// A dense voxel in no patch, or in one that is frayed. Most voxels of furniture are such: it has no room to spare.
#[derive(Clone, Copy, Debug)]
#[repr(Rust, packed(2))]
pub(super) struct Loose {
    /// Its place among the states; [`ADMITTED`] where it has become dense since the block was published.
    place: u16,
    /// The node of the patch beside it that it belongs to; [`NONE`] where there is none.
    owner: u32,
}

const ADMITTED: u16 = 1 << 15;
const NONE: u32 = u32::MAX;

impl Loose {
    const fn new(place: u16) -> Self {
        Self { place, owner: NONE }
    }

    /// Its place among the states.
    pub(super) const fn place(self) -> usize {
        (self.place & !ADMITTED) as usize
    }

    /// Whether it has become dense since the block was published.
    pub(super) const fn is_admitted(self) -> bool {
        self.place & ADMITTED != 0
    }

    /// The patch beside it that it belongs to.
    pub(super) fn owner(self) -> Option<NodeId> {
        let owner = self.owner;
        (owner != NONE).then_some(NodeId(owner))
    }

    pub(super) fn set_owner(&mut self, owner: Option<NodeId>) {
        self.owner = owner.map_or(NONE, |owner| owner.0);
    }
}

impl Segmented {
    pub(super) fn new(grid: &Grid, block: &Block, rules: &Rules) -> Self {
        Self::of(states(grid, block), block.corner(), rules)
    }

    /// The patches of these states, ascending, in the block with this lower corner (voxel indices).
    pub(super) fn of(states: Vec<State>, corner: [i32; 3], rules: &Rules) -> Self {
        let Patches { owner, kinds } = segment(&states, rules);
        let mut members: Vec<Vec<&State>> = vec![Vec::new(); kinds.len()];
        for (state, &number) in states.iter().zip(&owner).filter(|(_, number)| **number != LOOSE) {
            members[usize::from(number)].push(state);
        }
        let middle = Vector3::from(corner).map(f64::from);
        let patch = |(states, kind): (&Vec<&State>, _)| Patch::new(states, &middle, kind, rules);
        // With no room to spare.
        let mut patches = Vec::with_capacity(members.len());
        patches.extend(members.iter().zip(kinds).filter_map(patch));
        let is_loose = |number: u8| patches.get(usize::from(number)).is_none_or(Patch::is_frayed);
        let loose: Vec<_> = (0..).zip(&owner).filter(|(_, number)| is_loose(**number)).collect();
        let loose: Vec<_> = loose.into_iter().map(|(place, _)| Loose::new(place)).collect();
        Self {
            cells: patches.iter().flat_map(|patch| patch.cells.iter()).collect(),
            loose_cells: loose.iter().map(|loose| states[loose.place()].cell()).collect(),
            loose,
            most_points: states.iter().map(|state| state.count).max().unwrap_or(0),
            states: Arc::new(states),
            patches,
            contacts: Contacts::new(corner),
        }
    }

    /// The number of the patch that a cell is in.
    pub(super) fn number_of(&self, cell: Cell) -> Option<u8> {
        let number = self.patches.iter().position(|patch| patch.cells.contains(cell))?;
        Some(number as u8)
    }

    /// For each cell the number of its patch, or [`LOOSE`]: for a walk over all of them.
    pub(super) fn numbers(&self) -> [u8; CELLS] {
        let mut numbers = [LOOSE; CELLS];
        for (number, patch) in (0..).zip(&self.patches) {
            patch.cells.iter().for_each(|cell| numbers[cell.index()] = number);
        }
        numbers
    }

    /// Whether the patch of a dense voxel with this number is found by what lies around it.
    pub(super) fn is_loose(&self, number: u8) -> bool {
        self.patches.get(usize::from(number)).is_none_or(Patch::is_frayed)
    }

    /// The loose voxel of this number.
    pub(super) fn loose_state(&self, number: usize) -> &State {
        &self.states[self.loose[number].place()]
    }

    /// Whether so few of the points hereabouts are in a voxel that it is no part of an outline: where a surface was looked at
    /// for long, what scatters beyond its edges becomes dense too.
    pub(super) fn is_thin(&self, state: &State, rules: &Rules) -> bool {
        let has_few =
            state.count < THIN && u64::from(state.count) * PART_OF_THIN < u64::from(self.most_points);
        has_few && state.is_sliver(&rules.noise)
    }

    /// Whether a patch has a voxel in a window.
    pub(super) fn is_any_patch_in(&self, window: &Window) -> bool {
        self.cells.any_in(window)
    }

    /// A voxel of this block as a cluster counts it: as one of its own patch, of the number `own`, or, where that is `None`, as one
    /// beside a patch. `None` beyond the grid.
    pub(super) fn member<'a>(
        &self,
        block: &Block,
        state: &'a State,
        own: Option<u8>,
        rules: &Rules,
    ) -> Option<Member<'a>> {
        let key = block.voxel_key(state.cell())?;
        let share = own.map(|number| {
            let patch = &self.patches[usize::from(number)];
            let weight = patch.weight_of(state, &rules.noise);
            Share { corner: block.corner(), weight, normal: patch.normal(), noise: patch.noise() }
        });
        Some(Member { key, state, is_thin: self.is_thin(state, rules), share })
    }

    /// The state of a cell that is dense.
    pub(super) fn state(&self, cell: Cell) -> Option<&State> {
        self.states.binary_search_by_key(&cell, State::cell).ok().map(|place| &self.states[place])
    }

    /// Takes in a voxel that has become dense since; it is loose until the block is published. Returns its place among the
    /// loose ones; `None` where it is known already.
    pub(super) fn admit(&mut self, state: State) -> Option<usize> {
        let place = self.states.binary_search_by_key(&state.cell(), State::cell).err()?;
        let number = self.loose.partition_point(|loose| loose.place() < place);
        self.loose[number..].iter_mut().for_each(|loose| loose.place += 1);
        room::insert(&mut self.loose, number, Loose::new(place as u16 | ADMITTED));
        self.loose_cells.insert(state.cell());
        room::insert(Arc::make_mut(&mut self.states), place, state);
        Some(number)
    }
}

pub(super) fn patch(segmented: &SegmentedBlocks, id: PatchId) -> &Patch {
    &segmented[id.block].patches[usize::from(id.number)]
}

/// Where a patch meets others.
pub(super) fn contacts_of(
    segmented: &SegmentedBlocks,
    id: PatchId,
) -> impl Iterator<Item = (PatchId, Contact)> {
    segmented[id.block].contacts.of(id.number)
}

/// What a patch is a part of, by those that it meets.
pub(super) fn host(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Host {
    let slice_of = sharper(segmented, id, rules).map(Host::SliceOf);
    let end_of = || {
        let may_be = patch(segmented, id).may_be_bridge();
        may_be.then(|| end_of_bridge(segmented, id, rules)).flatten().map(Host::BridgeTo)
    };
    slice_of.or_else(end_of).unwrap_or_default()
}

/// Of the patches that a patch joins the one that its points fit best, where two of these are no single surface: as where the
/// foot of a ramp, seen from afar, has a plane between those of floor and ramp. `None` where all of them agree.
fn end_of_bridge(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Option<PatchId> {
    let own = patch(segmented, id);
    let ends = || {
        contacts_of(segmented, id).filter(|&(other, _)| {
            let end = patch(segmented, other);
            !end.is_narrow() && !end.is_rough() && !end.is_folded()
        })
    };
    // Of two that differ one is turned by half of that at least; on most patches of walls and floors none is.
    let most = (0.5 * rules.join_angle).cos();
    if ends().all(|(other, _)| own.normal().dot(&patch(segmented, other).normal()) >= most) {
        return None;
    }
    let joined = |(other, contact): (PatchId, Contact)| {
        own.joins(patch(segmented, other), &contact, rules).then_some(other)
    };
    let ends: Vec<_> = ends().filter_map(joined).collect();
    let differ = |a: PatchId, b: PatchId| patch(segmented, a).differs_from(patch(segmented, b), rules);
    let is_bridge = ends.iter().enumerate().any(|(i, &a)| ends[i + 1..].iter().any(|&b| differ(a, b)));
    let misfit = |&end: &PatchId| (own.misfit(patch(segmented, end), rules), end);
    is_bridge.then(|| best_fit(segmented, ends.iter().map(misfit))).flatten().map(|(_, end)| end)
}

/// The least misfit; of equals the patch whose block comes first in space.
fn best_fit(
    segmented: &SegmentedBlocks,
    fits: impl Iterator<Item = (f64, PatchId)>,
) -> Option<(f64, PatchId)> {
    let place = |id: PatchId| (segmented[id.block].contacts.corner(), id.number);
    fits.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| place(a.1).cmp(&place(b.1))))
}

/// The sharper, broader or whole patch that a patch is a slice of: of those it meets, the one its points fit best. A flat patch
/// that joins one with less noise as its equal, and fits that better, is no slice; what leads away from the best is no equal. Of
/// several that fit alike it is the one whose block comes first in space.
fn sharper(segmented: &SegmentedBlocks, id: PatchId, rules: &Rules) -> Option<PatchId> {
    let own = patch(segmented, id);
    if !own.may_be_slice() {
        return None;
    }
    let contacts = || contacts_of(segmented, id);
    let candidates = contacts()
        .filter_map(|(other, _)| own.slice_of(patch(segmented, other), rules).map(|misfit| (misfit, other)));
    let (misfit, best) = best_fit(segmented, candidates)?;
    // Where a wall and a door that stands ajar meet, so do their scatters. One that lies on the best plane too, and is turned off it,
    // leads from the one surface to the other.
    let leads_away = |other: &Patch| {
        let best = patch(segmented, best);
        other.normal().dot(&best.normal()) < rules.join_angle.cos() && other.slice_of(best, rules).is_some()
    };
    let fits_equal = |(other, contact): (PatchId, Contact)| {
        let other = patch(segmented, other);
        own.misfit(other, rules) <= misfit && own.is_equal_of(other, &contact, rules) && !leads_away(other)
    };
    (!contacts().any(fits_equal)).then_some(best)
}

/// Whether two patches that meet so are joined. A slice is with the one it is a slice of, and else with what lies on that one's
/// plane too; where one is folded or a bridge, which lies on two planes, those that the two are parts of must lie on each
/// other's.
pub(super) fn are_joined(
    segmented: &SegmentedBlocks,
    a: PatchId,
    b: PatchId,
    contact: &Contact,
    rules: &Rules,
) -> bool {
    let [here, there] = [a, b].map(|id| patch(segmented, id));
    let (of_a, of_b) = (here.host.patch(), there.host.patch());
    if of_a == Some(b) || of_b == Some(a) {
        return true;
    }
    let is_part = |own: &Patch| own.host.is_bridge() || own.is_folded() && own.host != Host::None;
    if is_part(here) || is_part(there) {
        let [host_a, host_b] = [(a, of_a), (b, of_b)].map(|(own, of)| patch(segmented, of.unwrap_or(own)));
        return here.joins(there, contact, rules)
            && host_a.lies_on(host_b, rules)
            && host_b.lies_on(host_a, rules);
    }
    let lies_on =
        |own: &Patch, of: Option<PatchId>| of.is_none_or(|of| own.lies_on(patch(segmented, of), rules));
    here.joins(there, contact, rules) && lies_on(there, of_a) && lies_on(here, of_b)
}

/// Contacts between the patches of a block and those of the block in direction `place` (of [`Around`]), by their numbers.
pub(super) fn contacts(
    here: &Segmented,
    there: &Segmented,
    place: usize,
    corner: [i32; 3],
    reach: i32,
) -> Vec<((u8, u8), Contact)> {
    let direction = offset_of(place);
    let border = Cells::border(direction, reach);
    let mut contacts = Vec::new();
    for (number, own) in (0..).zip(&here.patches) {
        // In its own block, each pair is met once.
        let first = if direction == [0; 3] { usize::from(number) + 1 } else { 0 };
        let others = there.patches.get(first..).unwrap_or_default();
        let cells = own.cells.and(&border);
        if cells.is_empty() || others.is_empty() {
            continue;
        }
        let mut met = vec![Contact::default(); others.len()];
        for cell in cells.iter() {
            let at = cell.coordinates();
            let near = Window::around(seen_from(at, direction), reach);
            if !there.is_any_patch_in(&near) {
                continue;
            }
            let middles = |to: [i32; 3]| {
                Vector3::from_fn(|i, _| f64::from(2 * corner[i] + at[i] + to[i] + EDGE * direction[i]) + 1.0)
            };
            for (contact, other) in met.iter_mut().zip(others) {
                for to in other.cells.within(&near) {
                    contact.pairs += 1;
                    contact.sum += middles(to.coordinates());
                }
            }
        }
        let met = (first as u8..).zip(met).filter(|(_, contact)| contact.pairs > 0);
        contacts.extend(met.map(|(other, contact)| ((number, other), contact)));
    }
    contacts
}

/// Coordinates of a cell as the block in `direction` counts them.
pub(super) fn seen_from(at: [i32; 3], direction: [i32; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| at[axis] - EDGE * direction[axis])
}

#[cfg(test)]
pub(super) mod tests;
