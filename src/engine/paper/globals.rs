//! Step 3 (section IV.B): global clusters absorb partial ones, merge, are refined and forgotten.
//!
//! A cluster of id `n` sits in slot `n - 1`. Merging links the younger slot to the older one (union-find), so that
//! voxels keep their label and a merge costs O(1). Each search for the cluster of a label halves the path that it goes, by
//! which it costs the logarithm of the number of clusters, amortised. A cluster's moments are at all times exactly those of its
//! voxels' centres: [`Globals::follow`] moves them along when centres move.

use std::collections::BTreeSet;

use nalgebra::UnitVector3;

mod saved;

pub(crate) use self::saved::SavedGlobals;
use super::extremes::Extremes;
use super::grid::{Grid, Label, Touched};
use super::moments::Moments;
use super::partial::Partial;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::plane::{PlaneFit, turned};
use crate::engine::scan::Stamp;

#[derive(Clone, Debug)]
pub(crate) struct Global {
    pub(crate) id: ClusterId,
    pub(crate) revision: u32,
    pub(crate) first_seen: Stamp,
    pub(crate) last_seen: Stamp,
    pub(crate) normal: UnitVector3<f64>,
    pub(crate) moments: Moments,
    pub(crate) point_count: u64,
    pub(crate) extremes: Extremes,
    /// The scan of its creation, absorption or merge, whichever was last (reading R10).
    pub(crate) grown: u64,
    /// The newest scan that changed anything about it.
    changed: u64,
    /// Ids taken in during the scan `changed`.
    pub(crate) merged_from: Vec<ClusterId>,
    /// Absorbed or merged in this scan, and so to be refined at its end.
    refine: bool,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Globals {
    slots: Vec<Option<Box<Global>>>,
    /// The slot that a slot was merged into; itself while it lives.
    parents: Vec<u32>,
    /// Slots changed in this scan, each once, and ids merged away in it.
    changed: Vec<u32>,
    removed: Vec<ClusterId>,
    /// (scan, slot) of the last growth of each living cluster, until it is decided whether that is complete by it.
    growths: BTreeSet<(u64, u32)>,
    /// Voxels in clusters.
    clustered: u32,
}

/// A global cluster (by slot) that may absorb a partial one (by number).
#[derive(Clone, Copy, Debug)]
struct Pair {
    slot: u32,
    partial: usize,
    vicinity: u32,
}

impl Globals {
    /// The living clusters by ascending id.
    pub(crate) fn living(&self) -> impl Iterator<Item = &Global> {
        self.slots.iter().flatten().map(Box::as_ref)
    }

    pub(crate) const fn clustered(&self) -> u32 {
        self.clustered
    }

    /// Tells the id of the cluster that a label stands for.
    pub(crate) fn ids(&self) -> impl Fn(Label) -> Option<ClusterId> {
        let roots = self.roots();
        move |label| {
            let Label::Global(slot) = label else { return None };
            self.slots[roots[slot as usize] as usize].as_ref().map(|global| global.id)
        }
    }

    /// Clusters changed by this scan, by ascending id.
    pub(crate) fn changed(&self) -> impl Iterator<Item = &Global> {
        self.changed.iter().filter_map(|&slot| self.slots[slot as usize].as_deref())
    }

    /// Ids merged away by this scan, ascending.
    pub(crate) fn removed(&self) -> &[ClusterId] {
        &self.removed
    }

    /// Forgets what the scan before has changed.
    pub(crate) fn begin(&mut self) {
        self.changed.clear();
        self.removed.clear();
    }

    /// Keeps sums current: the centres and counts of these voxels have changed.
    pub(crate) fn follow(&mut self, grid: &Grid, touched: &[Touched], now: Now) {
        for touched in touched {
            let voxel = &grid[touched.voxel];
            let (Label::Global(slot), Some(before)) = (voxel.label, touched.centre_before) else { continue };
            let Some(global) = self.change(slot, now) else { continue };
            global.moments.replace(before, voxel.centre());
            global.point_count += u64::from(voxel.count - touched.count_before);
            global.last_seen = now.stamp;
        }
    }

    /// Absorbs the partial clusters, merges what they join, and starts new clusters with those left over (reading R8).
    pub(crate) fn update(&mut self, grid: &mut Grid, partials: &[Partial], params: &Params, now: Now) {
        let mut owners = vec![None; partials.len()];
        for pair in self.pairs(grid, partials, params, now) {
            let slot = self.root(pair.slot);
            let partial = &partials[pair.partial];
            // The similarity that is tested again is that of the two that would join: of the partial cluster while it is
            // free, of its owner afterwards. (Testing the partial cluster in both cases misses the acceptance values.)
            match owners[pair.partial] {
                Some(owner) => {
                    let owner = self.root(owner);
                    self.merge_if_similar(slot, owner, params, now);
                }
                None if self.similar(slot, &partial.normal, params) => {
                    self.absorb(slot, partial, grid, now);
                    owners[pair.partial] = Some(slot);
                }
                None => {}
            }
        }
        for (partial, owner) in partials.iter().zip(owners) {
            let slot = owner.unwrap_or_else(|| self.create(partial, grid, now));
            partial.members.iter().for_each(|&voxel| grid[voxel].label = Label::Global(slot));
            self.clustered += partial.moments.count();
        }
    }

    /// Refits the clusters that absorbed or merged, and only them, over all their voxels (reading R9).
    pub(crate) fn refine(&mut self) {
        for &slot in &self.changed {
            let Some(global) = self.slots[slot as usize].as_mut().filter(|global| global.refine) else {
                continue;
            };
            global.refine = false;
            if let Some(plane) = PlaneFit::new(global.moments.count(), &global.moments.covariance()) {
                global.normal = turned(plane.normal, &global.normal);
            }
        }
    }

    /// Notices clusters that have become complete, and counts the revisions of all that changed.
    pub(crate) fn finish(&mut self, params: &Params, now: Now) {
        self.complete(params, now);
        debug_assert!(self.growths.len() <= self.living().count(), "{:?}", self.growths);
        self.changed.sort_unstable();
        self.removed.sort_unstable();
        for &slot in &self.changed {
            if let Some(global) = self.slots[slot as usize].as_mut() {
                global.revision += 1;
                global.merged_from.sort_unstable();
            }
        }
    }

    fn complete(&mut self, params: &Params, now: Now) {
        while let Some(&(grown, slot)) = self.growths.first()
            && is_complete(grown, params, now)
        {
            self.growths.pop_first();
            if self.slots[slot as usize].as_deref().is_some_and(Global::is_reliable) {
                self.change(slot, now);
            }
        }
    }

    /// Active global clusters and the partial ones that they are similar to and near enough, nearest first.
    fn pairs(&mut self, grid: &Grid, partials: &[Partial], params: &Params, now: Now) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for (number, partial) in partials.iter().enumerate() {
            pairs.extend(self.vicinities(grid, partial).into_iter().filter_map(|(slot, vicinity)| {
                let global = self.slots[slot as usize].as_deref()?;
                let eligible = vicinity >= params.min_vicinity()
                    && is_tried(global.grown, params, now)
                    && params.similar(&global.normal, &partial.normal);
                eligible.then_some(Pair { slot, partial: number, vicinity })
            }));
        }
        pairs.sort_by_key(|pair| (std::cmp::Reverse(pair.vicinity), pair.slot, pair.partial));
        pairs
    }

    /// Definition 7: the number of directly connected pairs of voxels, by global cluster (slot, ascending).
    fn vicinities(&mut self, grid: &Grid, partial: &Partial) -> Vec<(u32, u32)> {
        let neighbours = partial.members.iter().flat_map(|&voxel| grid.dense_neighbours(voxel)).flatten();
        let mut slots: Vec<u32> = neighbours
            .filter_map(|voxel| if let Label::Global(slot) = grid[voxel].label { Some(slot) } else { None })
            .map(|slot| self.root(slot))
            .collect();
        slots.sort_unstable();
        slots.chunk_by(PartialEq::eq).map(|same| (same[0], same.len() as u32)).collect()
    }

    fn similar(&self, slot: u32, normal: &UnitVector3<f64>, params: &Params) -> bool {
        self.slots[slot as usize].as_ref().is_some_and(|global| params.similar(&global.normal, normal))
    }

    fn create(&mut self, partial: &Partial, grid: &Grid, now: Now) -> u32 {
        let slot = self.slots.len() as u32;
        // A slot number is never negative, so the id is never 0.
        let id = ClusterId::new(u64::from(slot) + 1).unwrap_or_else(|| unreachable!("ids count up from 1"));
        self.slots.push(Some(Box::new(Global {
            id,
            revision: 0,
            first_seen: now.stamp,
            last_seen: now.stamp,
            normal: partial.normal,
            moments: partial.moments,
            point_count: point_count(partial, grid),
            extremes: extremes(partial, grid),
            grown: now.sequence,
            changed: now.sequence,
            merged_from: Vec::new(),
            refine: false,
        })));
        self.parents.push(slot);
        self.changed.push(slot);
        self.growths.insert((now.sequence, slot));
        slot
    }

    fn absorb(&mut self, slot: u32, partial: &Partial, grid: &Grid, now: Now) {
        let (points, extremes) = (point_count(partial, grid), extremes(partial, grid));
        let Some(global) = self.grow(slot, now) else { return };
        global.normal =
            mean_normal((&global.normal, global.moments.count()), (&partial.normal, partial.moments.count()));
        global.moments.merge(&partial.moments);
        global.point_count += points;
        global.extremes.merge(&extremes);
        global.last_seen = now.stamp;
    }

    fn merge_if_similar(&mut self, a: u32, b: u32, params: &Params, now: Now) {
        let (older, younger) = (a.min(b), a.max(b));
        let Some(normal) = self.slots[younger as usize].as_ref().map(|global| global.normal) else { return };
        if older == younger || !self.similar(older, &normal, params) {
            return;
        }
        self.change(younger, now);
        let Some(gone) = self.slots[younger as usize].take() else { return };
        self.parents[younger as usize] = older;
        self.growths.remove(&(gone.grown, younger));
        self.removed.push(gone.id);
        let Some(global) = self.grow(older, now) else { return };
        global.normal =
            mean_normal((&global.normal, global.moments.count()), (&gone.normal, gone.moments.count()));
        global.moments.merge(&gone.moments);
        global.point_count += gone.point_count;
        global.extremes.merge(&gone.extremes);
        global.first_seen = global.first_seen.min(gone.first_seen);
        global.last_seen = global.last_seen.max(gone.last_seen);
        global.merged_from.extend(gone.merged_from);
        global.merged_from.push(gone.id);
    }

    /// A living cluster that absorbs or merges in this scan.
    fn grow(&mut self, slot: u32, now: Now) -> Option<&mut Global> {
        let root = self.root(slot);
        let grown = self.slots[root as usize].as_deref()?.grown;
        self.growths.remove(&(grown, root));
        self.growths.insert((now.sequence, root));
        let global = self.change(root, now)?;
        global.grown = now.sequence;
        global.refine = true;
        Some(global)
    }

    /// The living cluster that `slot` stands for, noted as changed in this scan.
    fn change(&mut self, slot: u32, now: Now) -> Option<&mut Global> {
        let root = self.root(slot);
        let global = self.slots[root as usize].as_deref_mut()?;
        if global.changed != now.sequence {
            global.changed = now.sequence;
            global.merged_from.clear();
            self.changed.push(root);
        }
        Some(global)
    }

    /// By slot: that of the living cluster that it has been merged into, or its own. Costs O(slots).
    fn roots(&self) -> Vec<u32> {
        let mut roots = self.parents.clone();
        // Nothing is merged into what is younger.
        for slot in 0..roots.len() {
            roots[slot] = roots[roots[slot] as usize];
        }
        roots
    }

    /// One of [`Self::roots`]; halves the path to it, so that the next search is short.
    fn root(&mut self, mut slot: u32) -> u32 {
        while self.parents[slot as usize] != slot {
            let parent = self.parents[slot as usize];
            self.parents[slot as usize] = self.parents[parent as usize];
            slot = parent;
        }
        slot
    }
}

impl Global {
    pub(crate) const fn is_reliable(&self) -> bool {
        self.moments.count() >= crate::engine::MIN_RELIABLE_VOXELS
    }
}

/// Whether a cluster that grew last in scan `grown` is tried for expansion in this one (reading R10).
fn is_tried(grown: u64, params: &Params, now: Now) -> bool {
    let interval = u64::from(params.expansion_interval());
    interval == 0 || now.sequence - grown <= interval
}

/// Whether after this scan a cluster that grew last in scan `grown` is not tried any more.
pub(crate) fn is_complete(grown: u64, params: &Params, now: Now) -> bool {
    let interval = u64::from(params.expansion_interval());
    interval > 0 && now.sequence - grown >= interval
}

/// Definition 6 for clusters: the mean of two unit normals weighted by voxel counts, the second one turned into the
/// first one's half space (reading R9).
fn mean_normal(
    (normal, count): (&UnitVector3<f64>, u32),
    (other, other_count): (&UnitVector3<f64>, u32),
) -> UnitVector3<f64> {
    let sum =
        normal.into_inner() * f64::from(count) + turned(*other, normal).into_inner() * f64::from(other_count);
    UnitVector3::new_normalize(sum)
}

fn point_count(partial: &Partial, grid: &Grid) -> u64 {
    partial.members.iter().map(|&voxel| u64::from(grid[voxel].count)).sum()
}

fn extremes(partial: &Partial, grid: &Grid) -> Extremes {
    let mut extremes = Extremes::of(grid[partial.members[0]].key);
    partial.members.iter().for_each(|&voxel| extremes.add(grid[voxel].key));
    extremes
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn the_cluster_of_a_slot_is_at_the_end_of_a_path_that_each_search_halves() {
        let parents = (0..100_u32).map(|slot| slot.saturating_sub(1)).collect();
        let mut globals = Globals { parents, ..Globals::default() };
        assert_eq!(globals.roots(), [0; 100]);
        for steps in [99, 50, 25, 13, 7, 4, 2, 1, 1] {
            let path = std::iter::successors(Some(99), |&slot| Some(globals.parents[slot as usize]));
            assert_eq!(path.take_while(|&slot| slot > 0).count(), steps);
            assert_eq!(globals.root(99), 0);
        }
    }

    #[test]
    fn definition_6_the_updated_normal_is_the_mean_weighted_by_voxel_counts() {
        let (z, x) = (Vector3::z_axis(), Vector3::x_axis());
        let mean = mean_normal((&z, 30), (&x, 10));
        assert!((mean.into_inner() - Vector3::new(0.25, 0.0, 0.75).normalize()).norm() < 1e-12);
        // A normal that points the other way is first turned into the cluster's half space.
        let tilted = UnitVector3::new_normalize(Vector3::new(0.1, 0.0, -1.0));
        let mean = mean_normal((&z, 1), (&tilted, 1));
        assert!(mean.z > 0.99 && mean.x < 0.0);
    }
}
