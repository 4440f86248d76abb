//! Clusters whose state becomes another by time alone, which is told when it does and not when their turn comes.
//!
//! **Kept true.** They are those of the clusters as they are told of: [`Waiting::set`] is called wherever that changes, so that a
//! map that is restored has the same.
//!
//! **Cost.** To set costs O(log); to look follows what is due, and what was first seen within a fraction of a second.

use std::collections::BTreeSet;

use crate::engine::consistent::by::By;
use crate::engine::consistent::describe::{Waits, is_grown, is_new};
use crate::engine::consistent::graph::ComponentId;
use crate::engine::now::Now;
use crate::engine::params::Params;
use crate::engine::scan::Stamp;

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
        let before = std::mem::replace(self.waits.reach(component), waits);
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
