//! Which cluster is which: the voxels that were in a cluster before vote for the one they are in now.

use std::collections::{BTreeMap, BTreeSet};

use super::{Now, Old, Surfaces};
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::cluster::{Cluster, Identity};
use crate::engine::consistent::graph::{ComponentId, Outcome};
use crate::engine::consistent::layer::Segmented;
use crate::engine::consistent::patches::LOOSE;
use crate::engine::snapshot;

/// Votes of voxels: how many of a component are now in another.
pub(super) type Votes = BTreeMap<(ComponentId, ComponentId), u64>;

/// What goes where a cluster's voxels go: who it is, and what was told of it last, by which it is known whether it is told of
/// differently then.
struct Known {
    identity: Identity,
    told: Option<snapshot::Cluster>,
}

impl Surfaces {
    /// Where the voxels of each component that was touched are now.
    pub(super) fn votes(&self, blocks: &[BlockIndex], old: &[Old], outcome: &Outcome) -> Votes {
        let mut votes = Votes::new();
        for flow in &outcome.flows {
            *votes.entry((flow.from, flow.to)).or_default() += flow.weight;
        }
        for (&block, old) in blocks.iter().zip(old) {
            let [before, now] = [&old.segmented, &self.segmented[block.0 as usize]].map(Segmented::numbers);
            for state in old.segmented.states.iter() {
                let [before, now] = [before, now].map(|numbers| numbers[state.cell().index()]);
                if before == LOOSE || now == LOOSE {
                    continue;
                }
                let node = self.nodes[block.0 as usize][usize::from(now)];
                let pair = (old.components[usize::from(before)], self.graph.component(node));
                *votes.entry(pair).or_default() += 1;
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
            if let Some(cluster) = self.clusters[component.0 as usize].as_mut() {
                let identity = std::mem::replace(&mut cluster.identity, Identity::new(now.stamp));
                identities.insert(component, Known { identity, told: cluster.told.take() });
            }
        }
        let mut claims: BTreeMap<ComponentId, Vec<Known>> = BTreeMap::new();
        for (from, known) in identities {
            let candidates = votes.range((from, ComponentId(0))..=(from, ComponentId(u32::MAX)));
            let most = candidates.max_by_key(|((_, to), votes)| (**votes, std::cmp::Reverse(*to)));
            match most {
                Some(((_, to), _)) => claims.entry(*to).or_default().push(known),
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
            let unknown = || Known { identity: Identity::new(now.stamp), told: None };
            let Known { mut identity, told } = claimants.next().unwrap_or_else(unknown);
            for Known { identity: other, .. } in claimants {
                identity.take_in(&other);
                self.removed.extend(other.id);
            }
            let place = component.0 as usize;
            if self.clusters.len() <= place {
                self.clusters.resize_with(place + 1, || None);
            }
            match &mut self.clusters[place] {
                Some(cluster) => (cluster.identity, cluster.told) = (identity, told),
                none => *none = Some(Box::new(Cluster { told, ..Cluster::new(identity) })),
            }
            self.changed.insert(component);
        }
    }
}
