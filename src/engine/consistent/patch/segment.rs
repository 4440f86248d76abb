//! The planar patches of one block: a function of the states of its dense voxels alone.
//!
//! Where one plane passes through all dense voxels, they are one patch. Else patches grow from seeds, the flattest
//! neighbourhood first, which is what was seen from near: a voxel joins while the points in it lie on the plane, as far as
//! their noise lets them, and face the same side; the plane is fitted anew each time the patch has grown by half. Along an
//! edge, where no neighbourhood is flat, those in it that lie on the plane of one voxel's own points are: two rows between a
//! lintel and a ceiling are a seed. In the end every voxel goes to the patch beside it that fits it best, so that no patch keeps what it
//! took at an edge by being first. Where points scatter over two layers of voxels, a slope that passes from one layer to the next
//! is flattened in each: of two patches of which one lies on the other, one is made. Patches too narrow to have a plane are none.
//!
//! What reaches no further along the line of sight than its noise spreads it is no patch, for its plane is that of the sight.
//!
//! From what is left, and lies beside no plane either, **strips** grow: sharp voxels whose own points have the breadth that
//! a row of means has not, as where a surface crosses a corner of the block, or ends behind another. Then **rough** patches
//! grow in the same way with half a voxel's tolerance: plants, cables, shelves full of things. What then is left is in no
//! patch.
//!
//! Costs some 30 us for a block with one surface's edge in it.

use std::cell::OnceCell;

use super::Kind;
use super::plane_sums::{PlaneSums, ResidualSums};
use crate::engine::consistent::block::CELLS;
use crate::engine::consistent::cells::Cells;
use crate::engine::consistent::plane::Plane;
use crate::engine::consistent::rules::{NOISE_FACTOR, RIM_NOISE_FACTOR, Rules};
use crate::engine::consistent::state::State;

/// Least number of voxels of a patch.
const MIN_VOXELS: usize = 5;

/// How many times its noise a patch must spread along the line of sight, as variances.
const STREAK: f64 = 1.5;

/// Angle between the planes of two layers of one scatter, at most (rad): 20 degrees, for each border of voxels cuts the scatter,
/// and flattens what is left of it.
const LAYERS_ANGLE: f64 = 0.35;
/// Part of the smaller of two layers that lies right on the other, at least. With half of it facets of the pillar become one;
/// with 0.8 of it the floor and the foot of the ramp are joined in one seed of six.
const LAYERED: f64 = 0.65;

/// Cells around one.
const AROUND: usize = 26;

const NO_STATE: u16 = u16::MAX;
/// The number of the patch of what is in none.
pub(crate) const NO_PATCH: u8 = u8::MAX;
/// Most patches of a block, of each kind; what lies beyond is in none.
const MAX_PATCHES: usize = 80;

/// Planes of a patch that grows are numbered; it has been refused by none, or is in a patch.
const NO_PLANE: u8 = 0;
const TAKEN: u8 = u8::MAX;

/// The patches of a block.
pub(super) struct Patches {
    /// For each state the number of its patch, from 0; [`NO_PATCH`] = in none.
    pub(super) owner: Vec<u8>,
    /// How each was grown.
    pub(super) kinds: Vec<Kind>,
}

/// Finds the flat patches, then the strips and the rough ones among what none of these takes beside it.
pub(super) fn segment(states: &[State], rules: &Rules) -> Patches {
    let mut flat = Segmentation::new(states, rules, Kind::Flat);
    flat.run();
    let kinds = vec![Kind::Flat; usize::from(flat.count())];
    let mut rest = flat.left_over(flat.count());
    let mut patches = Patches { owner: flat.owner, kinds };
    let is_sharp = |state: &usize| states[*state].is_sheet();
    let sharp: Vec<_> = rest.iter().copied().filter(is_sharp).collect();
    patches.grow(Kind::Strip, states, &sharp, rules);
    rest.retain(|&state| patches.owner[state] == NO_PATCH);
    patches.grow(Kind::Rough, states, &rest, &rules.rough());
    patches
}

impl Patches {
    /// Grows patches of a kind among some of the states, which are in none.
    fn grow(&mut self, kind: Kind, states: &[State], some: &[usize], rules: &Rules) {
        if some.len() < MIN_VOXELS {
            return;
        }
        let picked: Vec<_> = some.iter().map(|&state| states[state].clone()).collect();
        let mut segmentation = Segmentation::new(&picked, rules, kind);
        segmentation.run();
        let first = self.kinds.len() as u8;
        let found = some.iter().zip(&segmentation.owner).filter(|(_, number)| **number != NO_PATCH);
        found.for_each(|(&state, number)| self.owner[state] = first + number);
        self.kinds.resize(self.kinds.len() + usize::from(segmentation.count()), kind);
    }
}

struct Segmentation<'a> {
    states: &'a [State],
    /// What each of them adds to a fit.
    shares: Vec<(PlaneSums, ResidualSums)>,
    /// All were seen from one side, whichever two are compared.
    is_one_side: bool,
    rules: &'a Rules,
    kind: Kind,
    /// The cells of the states, in the same order.
    occupied: Cells,
    /// Found when patches grow: a block of one plane needs none.
    neighbours: OnceCell<Neighbours>,
    owner: Vec<u8>,
    planes: Vec<Plane>,
}

/// For each state those of the cells around its own.
struct Neighbours {
    /// Where those of each state begin, and where the last end.
    begins: Vec<u16>,
    /// One state after another, ascending.
    all: Vec<u16>,
}

impl Neighbours {
    /// Of states with these cells.
    fn new(states: &[State], mut others: Cells) -> Self {
        let mut places = [NO_STATE; CELLS];
        (0..).zip(states).for_each(|(place, state)| places[state.cell().index()] = place);
        let (mut begins, mut all) = (Vec::with_capacity(states.len() + 1), Vec::new());
        begins.push(0);
        for state in states {
            others.remove(state.cell());
            let near = others.near(state.cell().coordinates());
            near.for_each(|cell| all.push(places[cell.index()]));
            others.insert(state.cell());
            begins.push(all.len() as u16);
        }
        Self { begins, all }
    }

    fn of(&self, state: usize) -> impl Iterator<Item = usize> {
        let [begin, end] = [0, 1].map(|next| usize::from(self.begins[state + next]));
        self.all[begin..end].iter().map(|&other| usize::from(other))
    }
}

/// A voxel and those around it that lie on one plane.
struct Window {
    plane: Plane,
    /// Mean square distance of their points to it, in voxels^2.
    distance: f64,
}

struct Seed {
    state: usize,
    /// Mean square distance of its window's points to their plane, in voxels^2; what is seen from near is flatter than what noise
    /// has spread.
    distance: f64,
}

impl<'a> Segmentation<'a> {
    fn new(states: &'a [State], rules: &'a Rules, kind: Kind) -> Self {
        let shares = states
            .iter()
            .map(|state| (kind.share(state, &rules.noise), ResidualSums::one(state, &rules.noise)))
            .collect();
        let (owner, is_one_side) = (vec![NO_PATCH; states.len()], is_one_side(states));
        let occupied = states.iter().map(State::cell).collect();
        let (neighbours, planes) = (OnceCell::new(), Vec::new());
        Self { states, shares, is_one_side, rules, kind, occupied, neighbours, owner, planes }
    }

    /// The states of the cells around a state's, ascending.
    fn neighbours(&self, state: usize) -> impl Iterator<Item = usize> {
        self.neighbours.get_or_init(|| Neighbours::new(self.states, self.occupied)).of(state)
    }

    fn plane_sums(&self, states: impl Iterator<Item = usize>) -> PlaneSums {
        let mut sums = PlaneSums::default();
        states.for_each(|state| sums.join(&self.shares[state].0));
        sums
    }

    fn residual_sums(&self, states: impl Iterator<Item = usize>) -> ResidualSums {
        let mut residuals = ResidualSums::default();
        states.for_each(|state| residuals.join(&self.shares[state].1));
        residuals
    }

    /// How far a voxel's points are off a plane, by what its noise and [`Rules::flatness`] allow, 0 to 1; `None` where it is more,
    /// or where the plane was seen from the other side.
    fn within(&self, state: usize, plane: &Plane) -> Option<f64> {
        let (sums, residuals) = &self.shares[state];
        let is_seen = sums.is_seen_from(plane);
        let misfit = is_seen.then(|| residuals.misfit_of_one(plane, NOISE_FACTOR, self.rules.flatness));
        misfit.filter(|misfit| *misfit <= 1.0)
    }

    /// Whether it is within what they allow.
    fn belongs(&self, state: usize, plane: &Plane) -> bool {
        let (sums, residuals) = &self.shares[state];
        sums.is_seen_from(plane) && residuals.is_one_allowed(plane, NOISE_FACTOR, self.rules.flatness)
    }

    fn run(&mut self) {
        if !self.is_one_plane() {
            self.grow_all();
            self.settle();
            if self.kind == Kind::Flat {
                self.unite_layers();
            }
        }
        self.drop_fragments();
    }

    /// Number of patches.
    fn count(&self) -> u8 {
        let numbers = self.owner.iter().filter(|number| **number != NO_PATCH);
        numbers.max().map_or(0, |number| number + 1)
    }

    /// The sums of the patches below number `patches`, by number.
    fn sums_by_patch(&self, patches: usize) -> Vec<PlaneSums> {
        let mut all = vec![PlaneSums::default(); patches];
        for ((share, _), &owner) in self.shares.iter().zip(&self.owner) {
            if let Some(sums) = all.get_mut(usize::from(owner)) {
                sums.join(share);
            }
        }
        all
    }

    /// The states that are in no patch and fit the plane of none below number `patches`.
    fn left_over(&self, patches: u8) -> Vec<usize> {
        let all = self.sums_by_patch(usize::from(patches));
        let planes: Vec<_> = all.iter().filter_map(|sums| Some(sums.fit()?.plane)).collect();
        let flatness = self.rules.rim_flatness;
        let is_left = |&state: &usize| {
            let (sums, residuals) = &self.shares[state];
            let fits = |plane| {
                sums.is_seen_from(plane) && residuals.is_one_allowed(plane, RIM_NOISE_FACTOR, flatness)
            };
            self.owner[state] == NO_PATCH && !planes.iter().any(fits)
        };
        (0..self.states.len()).filter(is_left).collect()
    }

    /// Whether one plane passes through all; then they are patch 0.
    fn is_one_plane(&mut self) -> bool {
        let Some(plane) = self.plane_of(&self.plane_sums(0..self.states.len())) else { return false };
        let one = (0..self.states.len()).all(|state| self.belongs(state, &plane));
        if one {
            self.owner.fill(0);
            self.planes.push(plane);
        }
        one
    }

    fn grow_all(&mut self) {
        let mut seeds: Vec<_> = (0..self.states.len()).filter_map(|state| self.seed(state)).collect();
        seeds.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.state.cmp(&b.state)));
        for seed in seeds {
            if self.owner[seed.state] == NO_PATCH && self.planes.len() < MAX_PATCHES {
                self.grow(seed.state);
            }
        }
    }

    /// The plane of a voxel and its free neighbours. Where they lie on none, as along an edge, that of the neighbours which
    /// lie on the plane of the voxel's own points, or in its own layer.
    fn window(&self, state: usize) -> Option<Window> {
        let towards = self.states[state].towards();
        let same_side = |other: usize| self.is_one_side || self.states[other].towards().dot(&towards) > 0.0;
        self.window_of(state, same_side)
            .or_else(|| self.window_on(state, &self.states[state].own_plane()?))
            .or_else(|| self.window_on(state, &self.layer(state, same_side)?))
    }

    fn window_on(&self, state: usize, plane: &Plane) -> Option<Window> {
        self.window_of(state, |other| self.belongs(other, plane))
    }

    /// The plane through a voxel's mean that is turned as its free neighbours lie, where patches are rough: of two layers of
    /// voxels that points fill, as where poses sway by the width of one, each is flat enough, and both together are not.
    fn layer(&self, state: usize, is_in: impl Fn(usize) -> bool) -> Option<Plane> {
        if self.kind != Kind::Rough {
            return None;
        }
        let is_free = |other: &usize| self.owner[*other] == NO_PATCH && is_in(*other);
        let near = self.neighbours(state).filter(is_free).chain([state]);
        let Plane { normal, .. } = self.plane_sums(near).fit()?.plane;
        Some(Plane { point: self.states[state].mean(), normal })
    }

    fn window_of(&self, state: usize, is_in: impl Fn(usize) -> bool) -> Option<Window> {
        let is_in = |other: &usize| self.owner[*other] == NO_PATCH && is_in(*other);
        let mut others = [0; AROUND];
        let mut count = 0;
        for other in self.neighbours(state).filter(is_in) {
            others[count] = other;
            count += 1;
        }
        let (mut sums, mut residuals) = self.shares[state];
        others[..count].iter().for_each(|&other| residuals.join(&self.shares[other].1));
        if count + 1 < self.kind.least_window() || residuals.fits_none(NOISE_FACTOR, self.rules.flatness) {
            return None;
        }
        others[..count].iter().for_each(|&other| sums.join(&self.shares[other].0));
        let plane = self.plane_of(&sums)?;
        let fits = self.shares[state].0.is_seen_from(&plane)
            && residuals.misfit(&plane, NOISE_FACTOR, self.rules.flatness) <= 1.0;
        fits.then(|| Window { plane, distance: residuals.square_distance(&plane) })
    }

    fn seed(&self, state: usize) -> Option<Seed> {
        self.window(state).map(|window| Seed { state, distance: window.distance })
    }

    fn grow(&mut self, seed: usize) {
        let Some(mut plane) = self.window(seed).map(|window| window.plane) else { return };
        if !self.belongs(seed, &plane) {
            return;
        }
        let mut members = self.reach(seed, &plane);
        // The second fit sees the whole patch, the third what that one reaches.
        for _ in 0..3 {
            let fitted = self.plane_of(&self.plane_sums(members.iter().copied()));
            let Some(fitted) = fitted.filter(|plane| self.belongs(seed, plane)) else { break };
            plane = fitted;
            let reached = self.reach(seed, &plane);
            if reached == members {
                break;
            }
            members = reached;
        }
        let sums = self.plane_sums(members.iter().copied());
        if members.len() < MIN_VOXELS || self.is_streak(&members, &sums, &plane) {
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
        // Of each voxel the last plane that it did not belong to: it is not asked of that again.
        let mut refused: Vec<_> =
            self.owner.iter().map(|owner| if *owner == NO_PATCH { NO_PLANE } else { TAKEN }).collect();
        let mut number = NO_PLANE + 1;
        refused[seed] = TAKEN;
        let mut members = vec![seed];
        let mut sums = self.shares[seed].0;
        let (mut next, mut refit_at) = (0, 12);
        while next < members.len() {
            for other in self.neighbours(members[next]) {
                if refused[other] >= number {
                    continue;
                }
                if !self.belongs(other, &plane) {
                    refused[other] = number;
                    continue;
                }
                refused[other] = TAKEN;
                members.push(other);
                sums.join(&self.shares[other].0);
            }
            next += 1;
            if members.len() >= refit_at {
                refit_at = members.len() * 3 / 2;
                if let Some(fitted) = self.plane_of(&sums) {
                    (plane, number) = (fitted, number + 1);
                }
            }
        }
        members.sort_unstable();
        members
    }

    /// Gives every voxel to the patch in its neighbourhood that fits it best, twice.
    fn settle(&mut self) {
        for _ in 0..2 {
            self.owner = self.best_owners();
            self.refit();
        }
    }

    /// For each voxel the patch that fits it best of those in its neighbourhood, of equals the first.
    fn best_owners(&self) -> Vec<u8> {
        let mut best = vec![(NO_PATCH, f64::INFINITY); self.states.len()];
        for (number, (cells, plane)) in (0..).zip(self.cells().iter().zip(&self.planes)) {
            for state in self.occupied.ranks_of(&cells.with_around()) {
                if let Some(misfit) = self.within(state, plane).filter(|misfit| *misfit < best[state].1) {
                    best[state] = (number, misfit);
                }
            }
        }
        best.into_iter().map(|(number, _)| number).collect()
    }

    /// The cells of each patch.
    fn cells(&self) -> Vec<Cells> {
        let mut cells = vec![Cells::default(); self.planes.len()];
        for (state, &owner) in self.states.iter().zip(&self.owner) {
            if let Some(cells) = cells.get_mut(usize::from(owner)) {
                cells.insert(state.cell());
            }
        }
        cells
    }

    /// Makes one of two patches that are layers of one scatter.
    fn unite_layers(&mut self) {
        let (patches, mut cells) = (self.planes.len(), self.cells());
        for (a, b) in (0..patches).flat_map(|a| (a + 1..patches).map(move |b| (a, b))) {
            let Some(plane) = self.plane_of_layers([a, b], [&cells[a], &cells[b]]) else { continue };
            self.planes[a] = plane;
            self.owner
                .iter_mut()
                .filter(|owner| usize::from(**owner) == b)
                .for_each(|owner| *owner = a as u8);
            let other = std::mem::take(&mut cells[b]);
            cells[a].extend(&other);
        }
    }

    /// The plane through two patches with these cells; `None` unless they face one way, most of the smaller one lies right on the
    /// other, and the points of both lie on it.
    fn plane_of_layers(&self, patches: [usize; 2], cells: [&Cells; 2]) -> Option<Plane> {
        let [a, b] = patches.map(|patch| self.planes[patch].normal.into_inner());
        let [smaller, larger] = if cells[0].len() <= cells[1].len() { cells } else { [cells[1], cells[0]] };
        let layered = || larger.beside((a + b).iamax()).and(smaller).len();
        if smaller.is_empty()
            || a.dot(&b) < LAYERS_ANGLE.cos()
            || (layered() as f64) < LAYERED * smaller.len() as f64
        {
            return None;
        }
        let members = |patch: usize| {
            (0..self.states.len()).filter(move |&state| usize::from(self.owner[state]) == patch)
        };
        let plane = self.plane_of(&self.plane_sums(patches.into_iter().flat_map(members)))?;
        let fits = |&patch: &usize| {
            let residuals = self.residual_sums(members(patch));
            residuals.misfit(&plane, NOISE_FACTOR, self.rules.flatness) <= 1.0
        };
        patches.iter().all(fits).then_some(plane)
    }

    fn refit(&mut self) {
        let planes = self.sums_by_patch(self.planes.len()).into_iter().zip(&self.planes);
        self.planes = planes.map(|(sums, plane)| self.plane_of(&sums).unwrap_or(*plane)).collect();
    }

    /// Splits patches that are not connected, and leaves out what is too small to have a plane. They are numbered by their first
    /// voxels.
    fn drop_fragments(&mut self) {
        let (mut left, mut patches) = (self.cells(), 0);
        let before = std::mem::replace(&mut self.owner, vec![NO_PATCH; self.states.len()]);
        for (state, &number) in self.states.iter().zip(&before) {
            let left = left.get_mut(usize::from(number)).filter(|left| left.contains(state.cell()));
            let Some(left) = left else { continue };
            let fragment = left.connected_with(state.cell());
            *left = left.without(&fragment);
            let members: Vec<_> = self.occupied.ranks_of(&fragment).collect();
            let sums = self.plane_sums(members.iter().copied());
            let is_patch = self.plane_of(&sums).is_some_and(|plane| !self.is_streak(&members, &sums, &plane));
            if members.len() >= MIN_VOXELS && is_patch && patches < MAX_PATCHES {
                members.iter().for_each(|&member| self.owner[member] = patches as u8);
                patches += 1;
            }
        }
    }

    /// Whether voxels with these sums reach no further along the line of sight, within their plane, than noise spreads them.
    /// Such a plane is the one of the sight, and what scatters there is of another.
    fn is_streak(&self, members: &[usize], sums: &PlaneSums, plane: &Plane) -> bool {
        let residuals = self.residual_sums(members.iter().copied());
        sums.sight_in(plane)
            .is_some_and(|sight| sums.variance_along(&sight) < STREAK * residuals.noise_along(&sight))
    }

    /// The plane of voxels that are broad enough to have one.
    fn plane_of(&self, sums: &PlaneSums) -> Option<Plane> {
        sums.fit().filter(|fit| fit.variances[1] >= self.kind.least_breadth()).map(|fit| fit.plane)
    }
}

/// Whether any two of these directions towards the sensor differ by less than a right angle, for all differ from the first
/// by less than half of one.
fn is_one_side(states: &[State]) -> bool {
    let Some(first) = states.first().map(State::towards) else { return true };
    let is_near = |state: &State| {
        let towards = state.towards();
        let along = first.dot(&towards);
        along > 0.0 && 2.0 * along * along > first.norm_squared() * towards.norm_squared()
    };
    states.iter().all(is_near)
}

#[cfg(test)]
mod tests;
