//! The state of a cluster, and which clusters wait for theirs to become another by time alone, so that it is told when it does and
//! not when their turn comes.
//!
//! **Kept true.** Those that wait are those of the clusters as they are told of: [`Waiting::set`] is called wherever that changes, so that a
//! map that is restored has the same.
//!
//! **Cost.** To set costs O(log); to look follows what is due, and what was first seen within a fraction of a second.

use std::collections::BTreeSet;

use crate::engine::consistent::cluster::Cluster;
use crate::engine::consistent::graph::ComponentId;
use crate::engine::consistent::lists::by::By;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::scan::Stamp;
use crate::engine::snapshot::ClusterState;

/// Voxels, and seconds since it was first seen, from which on a cluster can be relied on.
const RELIABLE_VOXELS: u32 = 20;
const RELIABLE_SECONDS: f64 = 0.3;

/// How far a cluster can be relied on.
pub(super) fn state(cluster: &Cluster, params: &Params, now: Now) -> ClusterState {
    let identity = &cluster.identity;
    if cluster.voxels < RELIABLE_VOXELS || is_new(identity.first_seen, now) {
        ClusterState::Tentative
    } else if is_grown(identity.grown, params, now) {
        ClusterState::Complete
    } else {
        ClusterState::Active
    }
}

/// Whether what was first seen then is too new to be relied on.
fn is_new(first_seen: Stamp, now: Now) -> bool {
    // Seen first by a later clock: before a restart, and so for long.
    (0.0..RELIABLE_SECONDS).contains(&now.stamp.seconds_since(first_seen))
}

/// Whether what has grown last in this scan is complete.
fn is_grown(grown: u64, params: &Params, now: Now) -> bool {
    let interval = u64::from(params.expansion_interval());
    interval > 0 && now.sequence - grown >= interval
}

/// What the state of a cluster waits for that becomes another by time alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Waits {
    /// It is large enough, and too new: first seen then.
    New(Stamp),
    /// It is active, and may be complete: it grew last in this scan.
    Grown(u64),
}

impl Waits {
    /// What the state that a cluster is told to have waits for.
    pub(super) fn of(cluster: &Cluster) -> Option<Self> {
        let (voxels, identity) = (cluster.voxels, &cluster.identity);
        match cluster.told.as_ref()?.state {
            ClusterState::Tentative if voxels >= RELIABLE_VOXELS => Some(Self::New(identity.first_seen)),
            ClusterState::Active => Some(Self::Grown(identity.grown)),
            ClusterState::Tentative | ClusterState::Complete => None,
        }
    }
}

#[derive(Clone, Debug, Default)]
pub(super) struct Waiting {
    /// What the sets hold of each.
    waits: By<ComponentId, Option<Waits>>,
    new: BTreeSet<(Stamp, ComponentId)>,
    grown: BTreeSet<(u64, ComponentId)>,
}

impl Waiting {
    /// Notes what a component waits for now.
    pub(super) fn set(&mut self, component: ComponentId, waits: Option<Waits>) {
        let before = std::mem::replace(self.waits.grow_to(component), waits);
        if before == waits {
            return;
        }
        match before {
            Some(Waits::New(first_seen)) => drop(self.new.remove(&(first_seen, component))),
            Some(Waits::Grown(grown)) => drop(self.grown.remove(&(grown, component))),
            None => {}
        }
        match waits {
            Some(Waits::New(first_seen)) => drop(self.new.insert((first_seen, component))),
            Some(Waits::Grown(grown)) => drop(self.grown.insert((grown, component))),
            None => {}
        }
    }

    /// Those whose state is another in this scan, the longest waiting first.
    pub(super) fn due<'a>(&'a self, params: &'a Params, now: Now) -> impl Iterator<Item = ComponentId> + 'a {
        // After a restart with another clock stamps may be later than now.
        let new = self.new.iter().filter(move |(first_seen, _)| !is_new(*first_seen, now));
        let grown = self.grown.iter().take_while(move |(grown, _)| is_grown(*grown, params, now));
        new.map(|(_, component)| *component).chain(grown.map(|(_, component)| *component))
    }
}

#[cfg(test)]
mod tests;
