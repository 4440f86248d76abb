//! Which cluster is which: the voxels that were in a cluster before vote for the one they are in now. And ids, for those that are
//! large enough to be told of.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::members::Old;
use super::{PublishedBlocks, Surfaces};
use crate::engine::consistent::block::Cell;
use crate::engine::consistent::cluster::{Cluster, ClusterPlane, Identity};
use crate::engine::consistent::graph::{ComponentId, Flow, Outcome};
use crate::engine::consistent::outline::footprint::{Axis, Footprint};
use crate::engine::consistent::patch::PatchId;
use crate::engine::consistent::patch::segment::NO_PATCH;
use crate::engine::consistent::patch::segmented::Segmented;
use crate::engine::key::ClusterId;
use crate::engine::now::Now;
use crate::engine::snapshot;

/// Voxels from which on a cluster is told of, and below which it no longer is.
const TOLD: u32 = 10;
const NO_LONGER_TOLD: u32 = 7;

/// Votes of voxels of patches.
#[derive(Debug, Default)]
pub(super) struct Votes {
    /// How many of a component are now in another.
    cast: BTreeMap<(ComponentId, ComponentId), u64>,
    /// How many there were of it; those that are gone or in no patch now cast none.
    entitled: BTreeMap<ComponentId, u64>,
}

impl Votes {
    fn cast(&mut self, from: ComponentId, to: ComponentId, votes: u64) {
        *self.cast.entry((from, to)).or_default() += votes;
    }

    fn entitle(&mut self, from: ComponentId, votes: u64) {
        *self.entitled.entry(from).or_default() += votes;
    }

    /// Where most voxels of a component went. Where fewer than half cast a vote, they must be half of the voxels from before
    /// that are there: else the floor would be the thing that was carried away off it, once what is left of that is a part of it.
    fn heir(&self, from: ComponentId) -> Option<ComponentId> {
        let cast = || self.cast.range((from, ComponentId::MIN)..=(from, ComponentId::MAX));
        let (&(_, to), &most) = cast().max_by_key(|((_, to), votes)| (**votes, Reverse(*to)))?;
        let entitled = self.entitled.get(&from).copied().unwrap_or(0);
        let is_quorate = 2 * cast().map(|(_, votes)| votes).sum::<u64>() >= entitled;
        (is_quorate || 2 * most >= self.cast_for(to)).then_some(to)
    }

    /// All votes for a component. Costs O(votes).
    fn cast_for(&self, to: ComponentId) -> u64 {
        self.cast.iter().filter(|((_, other), _)| *other == to).map(|(_, votes)| votes).sum()
    }
}

/// What goes where a cluster's voxels go: who it is, what was told of it last, by which it is known whether it is told of
/// differently then, and the plane that it had with the axis along which that was drawn.
struct Known {
    identity: Identity,
    told: Option<Arc<snapshot::Cluster>>,
    drawn: Option<(ClusterPlane, Axis)>,
}

impl Known {
    /// Takes from a cluster who it is.
    fn take(cluster: &mut Cluster, now: Now) -> Self {
        let identity = std::mem::replace(&mut cluster.identity, Identity::new(now.stamp));
        let drawn = cluster.plane.map(|plane| (plane, cluster.footprint.axis()));
        Self { identity, told: cluster.told.take(), drawn }
    }

    /// A cluster that is this one, of no voxel yet.
    fn begin(self) -> Cluster {
        let mut cluster = Cluster { told: self.told, ..Cluster::new(self.identity) };
        if let Some((plane, axis)) = self.drawn {
            (cluster.plane, cluster.footprint) = (Some(plane), Footprint::new(axis));
        }
        cluster
    }
}

impl Surfaces {
    /// Where the voxels of each component that was touched are now.
    pub(super) fn votes(&self, published: PublishedBlocks<'_>, old: &[Old], outcome: &Outcome) -> Votes {
        let mut votes = Votes::default();
        for flow in &outcome.flows {
            votes.entitle(flow.from, flow.weight);
            votes.cast(flow.from, flow.to, flow.weight);
        }
        for (block, old) in published.iter().zip(old) {
            let [before, now] = [&old.segmented, &self.segmented[block]].map(Segmented::numbers);
            for state in old.segmented.states.iter() {
                let [before, now] = [&before, &now].map(|numbers| numbers[state.cell().index()]);
                if before == NO_PATCH {
                    continue;
                }
                let from = old.components[usize::from(before)];
                votes.entitle(from, 1);
                if now != NO_PATCH {
                    let node = self.nodes[block][usize::from(now)];
                    votes.cast(from, self.graph.component(node), 1);
                }
            }
        }
        votes
    }

    /// Gives every component that was touched the identity that most of its voxels vote for, or a new one.
    pub(super) fn identify(&mut self, votes: &Votes, outcome: &Outcome, now: Now) {
        let touched: BTreeSet<_> = outcome
            .flows
            .iter()
            .map(|flow| flow.to)
            .chain(outcome.added.iter().map(|(_, component)| *component))
            .chain(outcome.created.iter().copied())
            .collect();
        let mut before: BTreeSet<_> = outcome.gone.iter().map(|(_, component)| *component).collect();
        before.extend(outcome.flows.iter().map(|flow| flow.from));
        let mut identities: BTreeMap<ComponentId, Known> = BTreeMap::new();
        for component in before {
            if let Some(cluster) = self.clusters[component].as_mut() {
                identities.insert(component, Known::take(cluster, now));
            }
        }
        let mut parts = parts(&outcome.flows, &identities);
        let mut claims: BTreeMap<ComponentId, Vec<Known>> = BTreeMap::new();
        for (from, known) in identities {
            match votes.heir(from) {
                Some(to) => claims.entry(to).or_default().push(known),
                None => self.removed.extend(known.identity.id),
            }
        }
        for component in touched {
            let mut claimants = claims.remove(&component).unwrap_or_default();
            // The oldest id first; those without one come last, by when they were first seen.
            claimants.sort_by_key(|Known { identity, .. }| {
                (identity.id.is_none(), identity.id, identity.first_seen)
            });
            let mut claimants = claimants.into_iter();
            let part = parts.remove(&component);
            let new = || part.unwrap_or_else(|| Identity::new(now.stamp));
            let unknown = || Known { identity: new(), told: None, drawn: None };
            let mut known = claimants.next().unwrap_or_else(unknown);
            for Known { identity: other, .. } in claimants {
                known.identity.take_in(&other);
                self.removed.extend(other.id);
            }
            match self.clusters.grow_to(component) {
                Some(cluster) => (cluster.identity, cluster.told) = (known.identity, known.told),
                none => *none = Some(Box::new(known.begin())),
            }
            self.changed.insert(component);
        }
    }

    /// Gives ids to clusters that have become large enough and have a plane, and takes them from those that no longer are or
    /// have.
    pub(super) fn grant_ids(&mut self, now: Now) {
        let mut new = Vec::new();
        for &component in &self.changed {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            // Where all voxels of a patch have gone to broader ones, what lies beside it has no plane.
            let (voxels, has_shape) = (cluster.voxels, cluster.has_shape());
            let identity = &mut cluster.identity;
            identity.count(voxels, now.sequence);
            if identity.id.is_none() && voxels >= TOLD && has_shape {
                new.push(component);
            } else if voxels < NO_LONGER_TOLD || !has_shape {
                self.removed.extend(identity.id.take());
            }
        }
        // The order of components depends on what was there before, which must not decide.
        new.sort_by_cached_key(|&component| self.first_voxel(component));
        for component in new {
            self.ids_given += 1;
            if let Some(cluster) = self.clusters[component].as_deref_mut() {
                (cluster.identity.id, cluster.identity.revision) = (ClusterId::new(self.ids_given), 0);
            }
        }
        for &component in &self.changed {
            let Some(cluster) = self.clusters[component].as_deref_mut() else { continue };
            let counted = if cluster.identity.id.is_some() { cluster.voxels } else { 0 };
            self.counted.count(std::mem::replace(&mut cluster.counted, counted), counted);
        }
    }

    /// The first voxel of a component's patches, by the corner of its block and its cell.
    fn first_voxel(&self, component: ComponentId) -> Option<([i32; 3], Cell)> {
        let ids = self.graph.nodes(component).iter().filter_map(|&node| self.patches[node]);
        let first = |id: PatchId| self.segmented.patch(id).cells.iter().next();
        ids.filter_map(|id| Some((self.segmented[id.block].corner(), first(id)?))).min()
    }
}

/// Who a component is that patches went to from others, if it is none of these.
fn parts(flows: &[Flow], identities: &BTreeMap<ComponentId, Known>) -> BTreeMap<ComponentId, Identity> {
    let mut parts: BTreeMap<_, Identity> = BTreeMap::new();
    for flow in flows {
        if let Some(Known { identity, .. }) = identities.get(&flow.from) {
            parts.entry(flow.to).or_insert_with(|| Identity::part_of(identity)).was_seen_with(identity);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Votes (from, to, how many), and how many voxels there were (of, how many).
    fn votes(cast: &[(u32, u32, u64)], entitled: &[(u32, u64)]) -> Votes {
        let mut votes = Votes::default();
        cast.iter().for_each(|&(from, to, number)| votes.cast(ComponentId(from), ComponentId(to), number));
        entitled.iter().for_each(|&(from, number)| votes.entitle(ComponentId(from), number));
        votes
    }

    fn heirs<const N: usize>(votes: &Votes, of: [u32; N]) -> [Option<u32>; N] {
        of.map(|from| votes.heir(ComponentId(from)).map(|to| to.0))
    }

    #[test]
    fn a_cluster_in_many_parts_is_the_largest_of_them_though_that_is_less_than_half() {
        let parts = votes(&[(1, 1, 30), (1, 5, 40), (1, 6, 40), (2, 5, 100)], &[(1, 120), (2, 100)]);
        assert_eq!(heirs(&parts, [1, 2, 3]), [Some(5), Some(5), None]);
    }

    #[test]
    fn what_is_left_of_a_cluster_is_it_where_it_stands_alone_and_is_not_where_it_is_part_of_another() {
        let alone = votes(&[(1, 7, 10), (2, 2, 300)], &[(1, 100), (2, 300)]);
        assert_eq!(heirs(&alone, [1, 2]), [Some(7), Some(2)]);
        let part = votes(&[(1, 2, 10), (2, 2, 300)], &[(1, 100), (2, 300)]);
        assert_eq!(heirs(&part, [1, 2]), [None, Some(2)]);
        // Half of it is enough.
        let half = votes(&[(1, 2, 10), (2, 2, 300)], &[(1, 20), (2, 300)]);
        assert_eq!(heirs(&half, [1, 2]), [Some(2), Some(2)]);
    }
}
