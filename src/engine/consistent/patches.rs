//! The planar patches of one block: a function of the states of its dense voxels alone.
//!
//! Where one plane passes through all dense voxels, they are one patch. Else patches grow from seeds, the flattest
//! neighbourhood first: a voxel joins while the points in it lie on the plane, as far as their noise lets them, and face the
//! same side; the plane is fitted anew each time the patch has grown by half. In the end every voxel goes to the patch
//! beside it that fits it best, so that no patch keeps what it took at an edge by being first. Patches too narrow to have a
//! plane are none.
//!
//! From what is left, and lies beside no plane either, **rough** patches grow in the same way with half a voxel's tolerance:
//! plants, cables, shelves full of things. What then is left are loose voxels.
//!
//! Costs some 30 us for a block with one surface's edge in it.

use super::block::{CELLS, Cell};
use super::cells::Cells;
use super::region::{Fit, Region};
use super::rules::Rules;
use super::state::{Plane, State};

/// Least number of voxels of a patch.
const MIN_VOXELS: usize = 5;
/// Least variance of a patch's means across its narrow side, in voxels^2: two rows of voxels have 0.25.
const MIN_BREADTH: f64 = 0.2;

const NO_STATE: u16 = u16::MAX;
const FREE: u8 = u8::MAX;

/// The patches of a block.
pub(super) struct Patches {
    /// For each state the number of its patch, from 0; [`LOOSE`] = in none.
    pub(super) owner: Vec<u8>,
    /// The number from which on they are rough.
    pub(super) flat: u8,
}

/// Finds the flat patches, and then the rough ones among what none of these takes beside it.
pub(super) fn segment(states: &[State], rules: &Rules) -> Patches {
    let mut owner = Segmentation::new(states, rules).run();
    let flat = count(&owner);
    let planes = planes(states, &owner, flat);
    let is_taken = |state: &State| planes.iter().any(|plane| state.beside(plane, rules).is_some());
    let rest = (0..states.len()).filter(|&state| owner[state] == FREE && !is_taken(&states[state]));
    let rest: Vec<_> = rest.collect();
    if rest.len() >= MIN_VOXELS {
        let rough: Vec<_> = rest.iter().map(|&state| states[state].clone()).collect();
        let again = Segmentation::new(&rough, &rules.rough()).run();
        for (state, number) in rest.into_iter().zip(again).filter(|(_, number)| *number != FREE) {
            owner[state] = flat + number;
        }
    }
    Patches { owner, flat }
}

/// Number of patches.
fn count(owner: &[u8]) -> u8 {
    owner.iter().filter(|number| **number != FREE).max().map_or(0, |number| number + 1)
}

/// Their planes.
fn planes(states: &[State], owner: &[u8], patches: u8) -> Vec<Plane> {
    let mut regions = vec![Region::default(); usize::from(patches)];
    for (state, &owner) in states.iter().zip(owner) {
        if let Some(region) = regions.get_mut(usize::from(owner)) {
            region.add(state);
        }
    }
    regions.iter().filter_map(|region| Some(region.fit()?.plane)).collect()
}

/// In no patch.
pub(super) const LOOSE: u8 = FREE;
/// Most patches of a block, of each kind; what lies beyond is loose.
const MAX_PATCHES: usize = 100;

struct Segmentation<'a> {
    states: &'a [State],
    rules: &'a Rules,
    /// State of each cell.
    places: [u16; CELLS],
    /// The cells that have one.
    cells: Cells,
    owner: Vec<u8>,
    planes: Vec<Plane>,
}

struct Seed {
    state: usize,
    /// Mean misfit of the neighbourhood; less is better.
    misfit: f64,
}

impl<'a> Segmentation<'a> {
    fn new(states: &'a [State], rules: &'a Rules) -> Self {
        let mut places = [NO_STATE; CELLS];
        (0..).zip(states).for_each(|(place, state)| places[state.cell.index()] = place);
        let cells = states.iter().map(|state| state.cell).collect();
        Self { states, rules, places, cells, owner: vec![FREE; states.len()], planes: Vec::new() }
    }

    fn misfit(&self, state: &State, plane: &Plane) -> f64 {
        state.misfit(plane, self.rules.noise_factor, self.rules.flatness)
    }

    fn belongs(&self, state: &State, plane: &Plane) -> bool {
        state.within(plane, self.rules).is_some()
    }

    fn run(mut self) -> Vec<u8> {
        if !self.is_one_plane() {
            self.grow_all();
            self.settle();
        }
        self.drop_fragments();
        self.owner
    }

    /// Whether one plane passes through all; then they are patch 0.
    fn is_one_plane(&mut self) -> bool {
        let Some(fit) = Region::of(self.states).fit().filter(is_broad) else { return false };
        let one = self.states.iter().all(|state| self.belongs(state, &fit.plane));
        if one {
            self.owner.fill(0);
            self.planes.push(fit.plane);
        }
        one
    }

    fn grow_all(&mut self) {
        let mut seeds: Vec<_> = (0..self.states.len()).filter_map(|state| self.seed(state)).collect();
        seeds.sort_by(|a, b| a.misfit.total_cmp(&b.misfit).then(a.state.cmp(&b.state)));
        for seed in seeds {
            if self.owner[seed.state] == FREE && self.planes.len() < MAX_PATCHES {
                self.grow(seed.state);
            }
        }
    }

    /// The plane of a voxel and its free neighbours, and how well they lie on it.
    fn window(&self, state: usize) -> Option<(Fit, f64)> {
        let own = &self.states[state];
        let same_side =
            |&other: &usize| self.owner[other] == FREE && self.states[other].towards.dot(&own.towards) > 0.0;
        let mut members = [own; 27];
        let mut count = 0;
        for other in self.around(state).filter(same_side) {
            members[count] = &self.states[other];
            count += 1;
        }
        // Its own place comes last.
        let members = &members[..=count];
        let fit = Region::of(members.iter().copied()).fit();
        let fit = fit.filter(|fit| is_broad(fit) && own.is_seen_from(&fit.plane))?;
        let misfits: f64 = members.iter().map(|state| self.misfit(state, &fit.plane)).sum();
        let count = members.len() as f64;
        Some((fit, misfits / count)).filter(|_| count >= 4.0)
    }

    fn seed(&self, state: usize) -> Option<Seed> {
        self.window(state).filter(|(_, misfit)| *misfit <= 1.0).map(|(_, misfit)| Seed { state, misfit })
    }

    fn grow(&mut self, seed: usize) {
        let Some((fit, misfit)) = self.window(seed) else { return };
        if misfit > 1.0 || !self.belongs(&self.states[seed], &fit.plane) {
            return;
        }
        let mut plane = fit.plane;
        let mut members = self.reach(seed, &plane);
        // The second fit sees the whole patch, the third what that one reaches.
        for _ in 0..3 {
            let region = Region::of(members.iter().map(|&member| &self.states[member]));
            let Some(fit) = region.fit().filter(is_broad) else { break };
            if !self.belongs(&self.states[seed], &fit.plane) {
                break;
            }
            plane = fit.plane;
            let reached = self.reach(seed, &plane);
            if reached == members {
                break;
            }
            members = reached;
        }
        if members.len() < MIN_VOXELS {
            return;
        }
        let number = self.planes.len() as u8;
        members.iter().for_each(|&member| self.owner[member] = number);
        self.planes.push(plane);
    }

    /// The free voxels that belong to the plane and are connected with the seed, ascending; the plane is fitted anew each
    /// time they have become half as many again.
    fn reach(&self, seed: usize, plane: &Plane) -> Vec<usize> {
        let mut plane = *plane;
        let mut free: Cells = self.free().collect();
        free.remove(self.states[seed].cell);
        let mut members = vec![seed];
        let mut region = Region::of([&self.states[seed]]);
        let (mut next, mut refit_at) = (0, 12);
        while next < members.len() {
            for other in self.among(free, members[next]) {
                if !self.belongs(&self.states[other], &plane) {
                    continue;
                }
                free.remove(self.states[other].cell);
                members.push(other);
                region.add(&self.states[other]);
            }
            next += 1;
            if members.len() >= refit_at {
                refit_at = members.len() * 3 / 2;
                plane = region.fit().filter(is_broad).map_or(plane, |fit| fit.plane);
            }
        }
        members.sort_unstable();
        members
    }

    /// The cells of the voxels that are in no patch.
    fn free(&self) -> impl Iterator<Item = Cell> {
        let free = self.states.iter().zip(&self.owner).filter(|(_, owner)| **owner == FREE);
        free.map(|(state, _)| state.cell)
    }

    /// Gives every voxel to the patch in its neighbourhood that fits it best, twice.
    fn settle(&mut self) {
        for _ in 0..2 {
            let owner = (0..self.states.len()).map(|state| self.best_owner(state)).collect();
            self.owner = owner;
            self.refit();
        }
    }

    fn best_owner(&self, state: usize) -> u8 {
        let own = &self.states[state];
        let owners = self.around(state).chain([state]).map(|other| self.owner[other]);
        let near = owners.filter(|&owner| owner != FREE).fold(0_u128, |near, owner| near | 1 << owner);
        let candidates = (0..self.planes.len() as u8).filter(|patch| near >> patch & 1 == 1);
        let within = |patch: u8| own.within(&self.planes[usize::from(patch)], self.rules);
        let fitting = candidates.filter_map(|patch| Some((within(patch)?, patch)));
        fitting.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(FREE, |(_, patch)| patch)
    }

    fn refit(&mut self) {
        let mut regions = vec![Region::default(); self.planes.len()];
        for (state, &owner) in self.states.iter().zip(&self.owner) {
            if let Some(region) = regions.get_mut(usize::from(owner)) {
                region.add(state);
            }
        }
        for (plane, region) in self.planes.iter_mut().zip(regions) {
            *plane = region.fit().filter(is_broad).map_or(*plane, |fit| fit.plane);
        }
    }

    /// Splits patches that are not connected, and sets loose what is too small to have a plane.
    fn drop_fragments(&mut self) {
        let before = std::mem::replace(&mut self.owner, vec![FREE; self.states.len()]);
        let mut seen = vec![false; self.states.len()];
        let mut patches = 0;
        for first in 0..self.states.len() {
            if seen[first] || before[first] == FREE {
                continue;
            }
            let members = self.connected(first, &before, &mut seen);
            let fit = Region::of(members.iter().map(|&member| &self.states[member])).fit();
            if members.len() >= MIN_VOXELS && fit.is_some_and(|fit| is_broad(&fit)) && patches < MAX_PATCHES {
                members.iter().for_each(|&member| self.owner[member] = patches as u8);
                patches += 1;
            }
        }
    }

    fn connected(&self, first: usize, owner: &[u8], seen: &mut [bool]) -> Vec<usize> {
        let mut members = vec![first];
        seen[first] = true;
        let mut next = 0;
        while next < members.len() {
            for other in self.around(members[next]) {
                if !seen[other] && owner[other] == owner[first] {
                    seen[other] = true;
                    members.push(other);
                }
            }
            next += 1;
        }
        members
    }

    /// The states of the cells around that of one, ascending.
    fn around(&self, state: usize) -> impl Iterator<Item = usize> {
        self.among(self.cells, state)
    }

    /// Those of these cells.
    fn among(&self, mut cells: Cells, state: usize) -> impl Iterator<Item = usize> {
        let cell = self.states[state].cell;
        cells.remove(cell);
        cells.near(cell.coordinates(), 1).map(|cell| usize::from(self.places[cell.index()]))
    }
}

fn is_broad(fit: &Fit) -> bool {
    fit.variances[1] >= MIN_BREADTH
}
