//! The map as `visualization_msgs/MarkerArray`, in the way RViz likes it.
//!
//! A cluster with a boundary is a filled polygon (ns `surfaces`), its edges (`outlines`) and, where it can be relied on, its
//! id and class (`names`); one without, as in mode `paper`, is its voxels as cubes (`clusters`). All normals are one
//! marker (`normals`), and so are the voxels in no cluster (`unclustered`): obstacles that no surface shows.
//!
//! A marker's identity is (ns, id), and an id has 32 bits: cluster ids are mapped to slots, which are used
//! again when a cluster has gone. Each message holds all that is to be seen, since one who joins late gets no other;
//! markers are updated in place and deleted only when there is nothing more to show for them. No identity is twice
//! in a message, which RViz calls an error. A viewer keeps only the newest message and may miss many, so deletions are
//! said several times at once, and then again and again in turn, as long as nothing else has the identity.

mod fill;
mod shape;
mod shown;
mod slots;

use std::collections::{BTreeMap, BTreeSet};

use earcut::Earcut;

use super::clusters::Session;
use super::ros::{Header, Marker, MarkerArray};
use crate::engine::{Snapshot, Stamp};
use shape::Style;
use shown::Shown;
pub(super) use shown::left_out;
pub use shown::{MAX_CUBES, MAX_POINTS};
use slots::Slots;

/// Namespaces of the markers.
const SURFACES: &str = "surfaces";
const OUTLINES: &str = "outlines";
const NAMES: &str = "names";
const CLUSTERS: &str = "clusters";
const UNCLUSTERED: &str = "unclustered";
const NORMALS: &str = "normals";

/// How many messages say a deletion at once.
const REPEATS: u8 = 5;
/// Deletions that a message says again.
const AGAIN: usize = 50;
/// For how long (s, by the stamps) the messages of a session begin with the deletion of all: a viewer may be found seconds after the
/// node has begun, and what an earlier process has shown is not known.
const CLEARED: f64 = 10.0;

/// What a marker is known by.
type Identity = (String, i32);

/// Keeps track of what a viewer has been shown.
#[derive(Default)]
pub struct Markers {
    /// With another all begins anew.
    session: u64,
    slots: Slots,
    /// What the newest message shows.
    shown: BTreeSet<Identity>,
    /// What has gone, with the number of messages that have said so; slots are used again, so there are no more than the markers of
    /// the most clusters that were there at once.
    gone: BTreeMap<Identity, u8>,
    /// What was said again last.
    said_again: Option<Identity>,
    /// Messages sent in this session; the first ones tell viewers to delete what was there before.
    sent: u8,
    /// Stamp of the first of them: that of a saved map where the session goes on with one.
    first: Option<Stamp>,
    /// The first stamp that is another.
    began: Option<Stamp>,
    /// Its buffers serve all clusters.
    earcut: Earcut<f64>,
}

impl Markers {
    /// The markers of this map, and the deletions since the calls before. With another session viewers are told to delete everything,
    /// and those that miss it each marker of the sessions before, in turn.
    pub fn update(&mut self, session: &Session, snapshot: &Snapshot) -> MarkerArray {
        if self.session != session.id {
            self.begin(session.id);
        }
        let header = session.header(snapshot.stamp);
        let additions = self.additions(&header, snapshot);
        let mut markers = self.deletions(&header, snapshot.stamp, &additions);
        markers.extend(additions);
        MarkerArray { markers }
    }

    /// Whatever was shown has gone with its session. The deletion of all says so at first, and in turn it is said again.
    fn begin(&mut self, session: u64) {
        let Self { shown, gone, .. } = std::mem::take(self);
        let gone = gone.into_keys().chain(shown).map(|identity| (identity, REPEATS)).collect();
        *self = Self { session, gone, ..Self::default() };
    }

    fn additions(&mut self, header: &Header, snapshot: &Snapshot) -> Vec<Marker> {
        let shown = Shown::of(snapshot);
        let style = Style { header, voxel_size: snapshot.voxel_size };
        self.slots.keep(&snapshot.clusters);
        let mut markers = Vec::new();
        for cluster in &shown.polygons {
            let slot = self.slots.of(cluster.id);
            let triangles = fill::triangles(&mut self.earcut, cluster);
            markers.extend(style.surface(slot, cluster, &triangles));
            markers.push(style.outline(slot, cluster));
            markers.extend(style.name(slot, cluster));
        }
        for (cluster, voxels) in &shown.heaps {
            let slot = self.slots.of(cluster.id);
            markers.push(style.cubes(slot, cluster.id, voxels));
            markers.extend(style.name(slot, cluster));
        }
        markers.extend(style.unclustered(&shown.unclustered));
        markers.extend(style.normals(&shown));
        markers
    }

    /// What is to be deleted before `additions` are added.
    fn deletions(&mut self, header: &Header, stamp: Option<Stamp>, additions: &[Marker]) -> Vec<Marker> {
        let now: BTreeSet<Identity> = additions.iter().map(|marker| (marker.ns.clone(), marker.id)).collect();
        let before = std::mem::replace(&mut self.shown, now);
        self.gone.extend(before.into_iter().map(|identity| (identity, 0)));
        self.gone.retain(|identity, _| !self.shown.contains(identity));
        let mut deletions = Vec::new();
        if self.sent == 0 {
            self.first = stamp;
        } else if stamp != self.first {
            self.began = self.began.or(stamp);
        }
        let is_new = self.began.zip(stamp).is_some_and(|(began, now)| now.seconds_since(began) < CLEARED);
        if is_new || self.sent < REPEATS {
            self.sent = self.sent.saturating_add(1);
            deletions.push(Marker { header: header.clone(), action: Marker::DELETEALL, ..Marker::default() });
        }
        let again = self.again();
        let due =
            self.gone.iter_mut().filter(|(identity, said)| **said < REPEATS || again.contains(*identity));
        for ((ns, slot), said) in due {
            *said = said.saturating_add(1);
            deletions.push(Marker { action: Marker::DELETE, ..shape::marker(header, ns, *slot, 0) });
        }
        deletions
    }

    /// Which of those that have been said are said again: the next ones in turn.
    fn again(&mut self) -> BTreeSet<Identity> {
        let after = self.said_again.take();
        let is_later = |identity: &Identity| after.as_ref().is_none_or(|after| identity > after);
        let old = || self.gone.iter().filter(|(_, said)| **said >= REPEATS).map(|(identity, _)| identity);
        let later = old().filter(|identity| is_later(identity));
        let in_turn: Vec<_> = later.chain(old().filter(|identity| !is_later(identity))).take(AGAIN).collect();
        self.said_again = in_turn.last().map(|&identity| identity.clone());
        in_turn.into_iter().cloned().collect()
    }
}

#[cfg(test)]
pub(super) mod tests;
