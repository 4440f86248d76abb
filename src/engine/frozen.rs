//! A map as it was after a scan, for whoever wants all of it while the engine goes on.

use serde::{Serialize, Serializer};

use super::consistent::FrozenConsistent;
use super::now::Taken;
use super::paper::Cfodi;
use super::params::Params;
use super::saved::{self, Saved, SavedMap, Shape};
use super::snapshot::Snapshot;

/// The map as it was after a scan; see [`Engine::freeze`](super::Engine::freeze).
#[derive(Clone, Debug)]
pub struct Frozen {
    pub(super) params: Params,
    pub(super) method: Method,
}

#[derive(Clone, Debug)]
pub(super) enum Method {
    Paper(Box<Cfodi>),
    Consistent(Box<FrozenConsistent>),
}

impl Frozen {
    /// The whole map as it was. Costs O(map).
    pub fn snapshot(&self) -> Snapshot {
        match &self.method {
            Method::Paper(map) => map.snapshot(),
            Method::Consistent(map) => map.snapshot(),
        }
    }

    /// All that an engine needs to go on from there as if it had never stopped. Costs O(map).
    pub fn save(&self) -> SavedMap {
        SavedMap(self.saved(FrozenConsistent::save))
    }

    fn saved<'a, C>(&'a self, consistent: impl FnOnce(&'a FrozenConsistent) -> C) -> Saved<C> {
        let method = match &self.method {
            Method::Paper(map) => saved::Method::Paper(Box::new(map.save())),
            Method::Consistent(map) => saved::Method::Consistent(Box::new(consistent(map))),
        };
        let taken = Taken { is_resumed: false, ..*self.taken() };
        Saved { shape: Shape::of(&self.params), taken, method }
    }

    /// Number of scans taken in until then.
    pub const fn sequence(&self) -> u64 {
        self.taken().sequence
    }

    const fn taken(&self) -> &Taken {
        match &self.method {
            Method::Paper(map) => map.taken(),
            Method::Consistent(map) => map.taken(),
        }
    }
}

/// As [`Frozen::save`], but in mode `consistent` without all of that in memory: a [`SavedMap`] reads it.
impl Serialize for Frozen {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.saved(FrozenConsistent::pieces).serialize(serializer)
    }
}
