//! A block as it was published last: its patches, what is loose, and where they meet others.

use std::sync::Arc;

use nalgebra::Vector3;

use super::contacts::{Contact, Contacts};
use super::segment::{NO_PATCH, Patches, segment};
use super::{Patch, PatchId};
use crate::engine::consistent::block::{Block, BlockIndex, CELLS, Cell, Direction, EDGE, voxel_key};
use crate::engine::consistent::cells::{Cells, Window};
use crate::engine::consistent::graph::NodeId;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::lists::room;
use crate::engine::consistent::lists::shared::Shared;
use crate::engine::consistent::rules::Rules;
use crate::engine::consistent::state::State;
use crate::engine::key::VoxelKey;

/// A block as it was published last.
#[derive(Clone, Debug, Default)]
pub(crate) struct Segmented {
    /// Its dense voxels by ascending cell; a block at rest has them too.
    pub(crate) states: Arc<Vec<State>>,
    /// The cells that are in a patch.
    cells: Cells,
    pub(crate) patches: Vec<Patch>,
    pub(crate) contacts: Contacts,
    /// Dense voxels whose patch is found by what lies around them: those in none, and those of frayed patches.
    pub(crate) loose: Vec<Loose>,
    /// Their cells, in the same order.
    pub(crate) loose_cells: Cells,
    /// Most points of a voxel.
    most_points: u32,
}

/// All blocks.
pub(crate) type SegmentedBlocks = Shared<BlockIndex, Segmented>;

/// How far the voxels of two patches that meet may lie apart, along each axis, in voxels.
const REACH: i32 = 1;
/// Points below which a voxel may be thin, where they are a sliver of it: one that a surface covers was seen for a short time alone.
const THIN: u32 = 200;
/// A voxel may be thin whose points are fewer than those of the voxel with the most in its block, divided by this. An edge that
/// covers as little of its voxel moves the outline by less than that part of one.
///
/// On the laboratory at 30 scans a second all areas from 2 m^2 on are within 10 % by it. With one in 300, but below 100 points,
/// two of 26 are not, at 8 cm; from one in 200 on, whatever the points, a table's top loses a quarter of itself in some seeds
/// (every sixth scan, 8 cm). Where thin voxels are kept out of patches too, walls, doors and cupboards join.
const PART_OF_THIN: u64 = 600;

/// A dense voxel in no patch, or in one that is frayed. Most voxels of furniture are such: it has no room to spare.
#[derive(Clone, Copy, Debug)]
#[repr(Rust, packed(2))]
pub(crate) struct Loose {
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
    pub(crate) const fn place(self) -> usize {
        (self.place & !ADMITTED) as usize
    }

    /// Whether it has become dense since the block was published.
    pub(crate) const fn is_admitted(self) -> bool {
        self.place & ADMITTED != 0
    }

    /// The patch beside it that it belongs to.
    pub(crate) fn owner(self) -> Option<NodeId> {
        let owner = self.owner;
        (owner != NONE).then_some(NodeId(owner))
    }

    pub(crate) fn set_owner(&mut self, owner: Option<NodeId>) {
        self.owner = owner.map_or(NONE, |owner| owner.0);
    }
}

impl Segmented {
    pub(crate) fn new(grid: &Grid, block: &Block, rules: &Rules) -> Self {
        Self::of(grid.states(block), block.corner(), rules)
    }

    /// The patches of these states, ascending, in the block with this lower corner (voxel indices).
    pub(crate) fn of(states: Vec<State>, corner: [i32; 3], rules: &Rules) -> Self {
        let Patches { owner, kinds } = segment(&states, rules);
        let mut members: Vec<Vec<&State>> = vec![Vec::new(); kinds.len()];
        for (state, &number) in states.iter().zip(&owner).filter(|(_, number)| **number != NO_PATCH) {
            members[usize::from(number)].push(state);
        }
        let low = Vector3::from(corner).map(f64::from);
        let patch = |(states, kind): (&Vec<&State>, _)| Patch::new(states, &low, kind, rules);
        // With no room to spare. Each has the voxels of a seed at least, so none is left out, and numbers stay.
        let mut patches = Vec::with_capacity(members.len());
        patches.extend(members.iter().zip(kinds).filter_map(patch));
        let loose: Vec<_> = (0..).zip(&owner).filter(|(_, number)| is_loose(&patches, **number)).collect();
        // From a list whose length is known, so that this one has no room to spare either.
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

    /// The same found anew from the states, with nothing known of what it meets.
    pub(crate) fn anew(&self, rules: &Rules) -> Self {
        let admitted = self.loose.iter().filter(|loose| loose.is_admitted());
        let admitted: Cells = admitted.map(|loose| self.states[loose.place()].cell()).collect();
        let (admitted, published): (Vec<_>, Vec<_>) =
            self.states.iter().cloned().partition(|state| admitted.contains(state.cell()));
        let mut anew = Self::of(published, self.corner(), rules);
        for state in admitted {
            anew.admit(state);
        }
        anew
    }

    /// The lower corner of the block (voxel indices). Of one that was never segmented it may be any.
    pub(crate) const fn corner(&self) -> [i32; 3] {
        self.contacts.corner()
    }

    /// The voxel of a cell; `None` beyond the grid.
    pub(crate) fn voxel_key(&self, cell: Cell) -> Option<VoxelKey> {
        voxel_key(self.corner(), cell)
    }

    /// The number of the patch that a cell is in.
    pub(crate) fn number_of(&self, cell: Cell) -> Option<u8> {
        let number = self.patches.iter().position(|patch| patch.cells.contains(cell))?;
        Some(number as u8)
    }

    /// For each cell the number of its patch, or [`NO_PATCH`]: for a walk over all of them.
    pub(crate) fn numbers(&self) -> [u8; CELLS] {
        let mut numbers = [NO_PATCH; CELLS];
        for (number, patch) in (0..).zip(&self.patches) {
            patch.cells.iter().for_each(|cell| numbers[cell.index()] = number);
        }
        numbers
    }

    /// Whether the patch of a dense voxel with this number is found by what lies around it.
    pub(crate) fn is_loose(&self, number: u8) -> bool {
        is_loose(&self.patches, number)
    }

    /// The loose voxel of this number.
    pub(crate) fn loose_state(&self, number: usize) -> &State {
        &self.states[self.loose[number].place()]
    }

    /// Whether so few of the points hereabouts are in a voxel that it is no part of an outline: where a surface was looked at
    /// for long, what scatters beyond its edges becomes dense too.
    pub(crate) fn is_thin(&self, state: &State, rules: &Rules) -> bool {
        let has_few =
            state.count < THIN && u64::from(state.count) * PART_OF_THIN < u64::from(self.most_points);
        has_few && state.is_sliver(&rules.noise)
    }

    /// Whether a patch has a voxel in a window.
    pub(crate) fn is_any_patch_in(&self, window: &Window) -> bool {
        self.cells.any_in(window)
    }

    /// The state of a cell that is dense.
    pub(crate) fn state(&self, cell: Cell) -> Option<&State> {
        self.states.binary_search_by_key(&cell, State::cell).ok().map(|place| &self.states[place])
    }

    /// Takes in a voxel that has become dense since; it is loose until the block is published. Returns its place among the
    /// loose ones; `None` where it is known already.
    pub(crate) fn admit(&mut self, state: State) -> Option<usize> {
        let place = self.states.binary_search_by_key(&state.cell(), State::cell).err()?;
        let number = self.loose.partition_point(|loose| loose.place() < place);
        self.loose[number..].iter_mut().for_each(|loose| loose.place += 1);
        room::insert(&mut self.loose, number, Loose::new(place as u16 | ADMITTED));
        self.loose_cells.insert(state.cell());
        room::insert(Arc::make_mut(&mut self.states), place, state);
        Some(number)
    }
}

/// Whether a dense voxel is loose that is in the patch of this number, or, beyond these patches, in none.
fn is_loose(patches: &[Patch], number: u8) -> bool {
    patches.get(usize::from(number)).is_none_or(Patch::is_frayed)
}

impl SegmentedBlocks {
    /// The patches of a block.
    pub(crate) fn ids(&self, block: BlockIndex) -> impl Iterator<Item = PatchId> + use<> {
        (0..self[block].patches.len()).map(move |number| PatchId { block, number: number as u8 })
    }

    pub(crate) fn patch(&self, id: PatchId) -> &Patch {
        &self[id.block].patches[usize::from(id.number)]
    }

    /// Where a patch meets others.
    pub(crate) fn contacts_of(&self, id: PatchId) -> impl Iterator<Item = (PatchId, Contact)> {
        self[id.block].contacts.of(id.number)
    }
}

/// Contacts between the patches of a block and those of the block in this direction, by their numbers.
pub(crate) fn contacts(
    here: &Segmented,
    there: &Segmented,
    direction: Direction,
) -> Vec<((u8, u8), Contact)> {
    let (corner, offset) = (here.corner(), direction.offset());
    let border = Cells::border(direction, REACH);
    let mut contacts = Vec::new();
    for (number, own) in (0..).zip(&here.patches) {
        // In its own block, each pair is met once.
        let first = if direction == Direction::OWN { usize::from(number) + 1 } else { 0 };
        let others = there.patches.get(first..).unwrap_or_default();
        let cells = own.cells.and(&border);
        if cells.is_empty() || others.is_empty() {
            continue;
        }
        let mut met = vec![Contact::default(); others.len()];
        for cell in cells.iter() {
            let at = cell.coordinates();
            let near = Window::around(direction.seen_from(at), REACH);
            if !there.is_any_patch_in(&near) {
                continue;
            }
            let middles = |to: [i32; 3]| {
                Vector3::from_fn(|i, _| f64::from(2 * corner[i] + at[i] + to[i] + EDGE * offset[i]) + 1.0)
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

#[cfg(test)]
pub(crate) mod tests;
