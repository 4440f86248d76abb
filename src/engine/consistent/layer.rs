//! The patches of all blocks, and where they meet.

use std::sync::Arc;

use nalgebra::Vector3;

use super::block::{Block, BlockIndex, CELLS, Cell, EDGE, offset_of};
use super::cells::{Cells, Window};
use super::contacts::Contacts;
use super::exact::Exact;
use super::graph::NodeId;
use super::grid::Grid;
use super::join::Contact;
use super::patch::Patch;
use super::patches::{LOOSE, Patches, segment};
use super::room;
use super::rules::Rules;
use super::state::{State, states};

/// A patch: its block, and its number there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct PatchId {
    pub(super) block: BlockIndex,
    pub(super) number: u8,
}

/// A block as it was published last.
#[derive(Clone, Debug)]
pub(super) struct Segmented {
    /// Its dense voxels by ascending cell; a block at rest has them too.
    pub(super) states: Arc<Vec<State>>,
    /// For each cell the number of its patch, [`LOOSE`] or [`EMPTY`].
    pub(super) labels: Box<[u8; CELLS]>,
    /// The cells that are in a patch.
    cells: Cells,
    pub(super) patches: Vec<Patch>,
    /// Where each patch meets others, of this block or another.
    pub(super) contacts: Vec<Contacts>,
    /// The sharper patch that each patch is a slice of.
    pub(super) slice_of: Vec<Option<PatchId>>,
    /// Dense voxels whose patch is found by what lies around them: those in none, and those of frayed patches.
    pub(super) loose: Vec<Loose>,
    /// Their cells, in the same order.
    pub(super) loose_cells: Cells,
    /// Most points of a voxel.
    most_points: u32,
}

/// Points below which a voxel may be thin; a surface that comes into view soon has more.
const THIN: u32 = 200;
/// One in so many of those of the voxel with the most points in its block: fewer are thin. An edge that covers as little of its
/// voxel moves the outline by less than that part of one.
///
/// On the laboratory at 30 scans a second all areas from 2 m^2 on are within 10 % by it. With one in 300, but below 100 points,
/// two of 26 are not, at 8 cm; from one in 200 on, whatever the points, a table's top loses a quarter of itself in some seeds
/// (every sixth scan, 8 cm). Where thin voxels are kept out of patches too, walls, doors and cupboards join.
const PART_OF_THIN: u64 = 600;

/// A dense voxel in no patch, or in one that is frayed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loose {
    /// Its place among the states.
    pub(super) place: u16,
    /// The patch beside it that it belongs to.
    pub(super) owner: Option<NodeId>,
    /// It has become dense since the block was published.
    pub(super) admitted: bool,
}

/// Not dense.
pub(super) const EMPTY: u8 = LOOSE - 1;

impl Segmented {
    pub(super) fn new(grid: &Grid, block: &Block, rules: &Rules) -> Self {
        Self::of(states(grid, block), block.corner(), rules)
    }

    /// Of these states, ascending, in the block with this corner.
    pub(super) fn of(states: Vec<State>, corner: [i32; 3], rules: &Rules) -> Self {
        let Patches { owner, kinds } = segment(&states, rules);
        let corner = Vector3::from(corner).map(f64::from);
        let mut labels = Box::new([EMPTY; CELLS]);
        let mut cells = Cells::default();
        let mut members: Vec<Vec<&State>> = Vec::new();
        for (state, &number) in states.iter().zip(&owner) {
            labels[state.cell().index()] = number;
            if number != LOOSE {
                members.resize(members.len().max(usize::from(number) + 1), Vec::new());
                members[usize::from(number)].push(state);
                cells.insert(state.cell());
            }
        }
        let patches = members
            .iter()
            .zip(kinds)
            .filter_map(|(states, kind)| Patch::new(states, &corner, kind, &rules.noise));
        let patches: Vec<_> = patches.collect();
        let (contacts, slice_of) = (vec![Contacts::default(); patches.len()], vec![None; patches.len()]);
        let (loose, loose_cells) = (Vec::new(), Cells::default());
        let most_points = states.iter().map(|state| state.count).max().unwrap_or(0);
        let states = Arc::new(states);
        let mut segmented =
            Self { states, labels, cells, patches, contacts, slice_of, loose, loose_cells, most_points };
        // Made of a list, it has no room to spare.
        let is_loose = |(place, number): (u16, &u8)| segmented.is_loose(*number).then_some(place);
        let loose: Vec<_> = (0..).zip(&owner).filter_map(is_loose).collect();
        let cell_of = |place: &u16| segmented.states[usize::from(*place)].cell();
        segmented.loose_cells = loose.iter().map(cell_of).collect();
        let begin = |place| Loose { place, owner: None, admitted: false };
        segmented.loose = loose.into_iter().map(begin).collect();
        segmented
    }

    /// Whether the patch of a dense voxel with this label is found by what lies around it.
    pub(super) fn is_loose(&self, label: u8) -> bool {
        self.patches.get(usize::from(label)).is_none_or(Patch::is_frayed)
    }

    /// Whether so few of the points hereabouts are in a voxel that it is no part of an outline: where a surface was looked at
    /// for long, what scatters beyond its edges becomes dense too.
    pub(super) fn is_thin(&self, state: &State) -> bool {
        state.count < THIN && u64::from(state.count) * PART_OF_THIN < u64::from(self.most_points)
    }

    /// Whether a patch has a voxel in a window.
    pub(super) fn is_any_patch_in(&self, window: &Window) -> bool {
        self.cells.any_in(window)
    }

    /// What a voxel adds to the sums of a cluster as one of its own patch; `corner` is that of the block.
    pub(super) fn share(&self, state: &State, corner: [i32; 3], rules: &Rules) -> Exact {
        let patch = &self.patches[usize::from(self.labels[state.cell().index()])];
        Exact::of(state, corner, patch.weight_of(state, &rules.noise))
    }

    /// The state of a cell that is dense.
    pub(super) fn state(&self, cell: Cell) -> Option<&State> {
        self.states.binary_search_by_key(&cell, |state| state.cell()).ok().map(|place| &self.states[place])
    }

    /// Takes in a voxel that has become dense since; it is loose until the block is published. Returns its place among the
    /// loose ones; `None` where it is known already.
    pub(super) fn admit(&mut self, state: State) -> Option<usize> {
        let place = self.states.binary_search_by_key(&state.cell(), |state| state.cell()).err()?;
        let number = self.loose.partition_point(|loose| usize::from(loose.place) < place);
        self.loose[number..].iter_mut().for_each(|loose| loose.place += 1);
        let loose = Loose { place: place as u16, owner: None, admitted: true };
        room::insert(&mut self.loose, number, loose);
        self.labels[state.cell().index()] = LOOSE;
        self.loose_cells.insert(state.cell());
        room::insert(Arc::make_mut(&mut self.states), place, state);
        Some(number)
    }

    /// An empty block.
    pub(super) fn empty() -> Self {
        Self {
            states: Arc::default(),
            labels: Box::new([EMPTY; CELLS]),
            cells: Cells::default(),
            patches: Vec::new(),
            contacts: Vec::new(),
            slice_of: Vec::new(),
            loose: Vec::new(),
            loose_cells: Cells::default(),
            most_points: 0,
        }
    }
}

pub(super) fn patch(segmented: &[Segmented], id: PatchId) -> &Patch {
    &segmented[id.block.0 as usize].patches[usize::from(id.number)]
}

/// Where a patch meets others.
pub(super) fn contacts_of(segmented: &[Segmented], id: PatchId) -> &Contacts {
    &segmented[id.block.0 as usize].contacts[usize::from(id.number)]
}

/// The sharper or broader patch that a patch is a slice of: of those it meets, the one its points fit best. A flat patch that
/// joins one with less noise as its equal, and fits that better, is no slice.
pub(super) fn sharper(segmented: &[Segmented], id: PatchId, rules: &Rules) -> Option<PatchId> {
    let own = patch(segmented, id);
    if !own.may_be_slice(rules) {
        return None;
    }
    let contacts = contacts_of(segmented, id);
    let equal = |(other, contact): (PatchId, &Contact)| {
        let other = patch(segmented, other);
        let is_equal = !own.is_rough() && other.has_less_noise(own) && own.joins(other, contact, rules);
        is_equal.then(|| own.misfit(other, rules))
    };
    let equal = contacts.iter().filter_map(equal).fold(f64::INFINITY, f64::min);
    let candidates = contacts
        .iter()
        .filter_map(|(other, _)| own.slice_of(patch(segmented, other), rules).map(|misfit| (misfit, other)));
    let best = candidates.min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(misfit, _)| *misfit < equal).map(|(_, other)| other)
}

/// Whether two patches that meet so are joined. A slice is with its sharper patch, and else with what lies on that one's plane
/// too.
pub(super) fn are_joined(
    segmented: &[Segmented],
    a: PatchId,
    b: PatchId,
    contact: &Contact,
    rules: &Rules,
) -> bool {
    let slice_of = |id: PatchId| segmented[id.block.0 as usize].slice_of[usize::from(id.number)];
    let [of_a, of_b] = [a, b].map(slice_of);
    if of_a == Some(b) || of_b == Some(a) {
        return true;
    }
    let [here, there] = [a, b].map(|id| patch(segmented, id));
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
    let is_own = direction == [0; 3];
    // Few pairs of patches meet, and one pair meets many times in a row.
    let mut contacts: Vec<((u8, u8), Contact)> = Vec::new();
    if there.patches.len() < 1 + usize::from(is_own) {
        return contacts;
    }
    let mut last = 0;
    for cell in here.cells.and(&Cells::border(direction, reach)).iter() {
        let (at, number) = (cell.coordinates(), here.labels[cell.index()]);
        there.cells.near(seen_from(at, direction), reach).for_each(|other| {
            let label = there.labels[other.index()];
            if is_own && label <= number {
                return;
            }
            let pair = (number, label);
            if contacts.get(last).is_none_or(|(met, _)| *met != pair) {
                last = contacts.iter().position(|(met, _)| *met == pair).unwrap_or_else(|| {
                    contacts.push((pair, Contact::default()));
                    contacts.len() - 1
                });
            }
            let contact = &mut contacts[last].1;
            contact.pairs += 1;
            let to = other.coordinates();
            contact.sum +=
                Vector3::from_fn(|i, _| f64::from(2 * corner[i] + at[i] + to[i] + EDGE * direction[i]) + 1.0);
        });
    }
    contacts
}

/// Coordinates of a cell as the block in `direction` counts them.
pub(super) fn seen_from(at: [i32; 3], direction: [i32; 3]) -> [i32; 3] {
    [0, 1, 2].map(|axis| at[axis] - EDGE * direction[axis])
}
