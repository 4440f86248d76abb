//! Marker ids of 32 bits for cluster ids of 64.

use std::collections::{BTreeMap, BTreeSet};

use crate::engine::{Cluster, ClusterId};

/// A slot for each cluster, its own as long as the cluster lives, then used again.
#[derive(Debug, Default)]
pub(super) struct Slots {
    taken: BTreeMap<ClusterId, i32>,
    free: BTreeSet<i32>,
}

impl Slots {
    /// Frees the slots of all but these clusters, which are by ascending id.
    pub(super) fn keep(&mut self, clusters: &[Cluster]) {
        let Self { taken, free } = self;
        taken.retain(|id, slot| {
            let stays = clusters.binary_search_by_key(id, |cluster| cluster.id).is_ok();
            if !stays {
                free.insert(*slot);
            }
            stays
        });
    }

    /// The slot of a cluster, the lowest free one where it has none yet.
    pub(super) fn of(&mut self, id: ClusterId) -> i32 {
        let Self { taken, free } = self;
        let unused = taken.len() + free.len();
        *taken.entry(id).or_insert_with(|| free.pop_first().unwrap_or(unused as i32))
    }
}
