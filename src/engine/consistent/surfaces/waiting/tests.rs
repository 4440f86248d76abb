//! What waits is what the clusters wait for, and is due when its time has come.

use super::*;
use crate::engine::consistent::surfaces::Surfaces;

impl Surfaces {
    /// Asserts that what waits, and how many clusters have an id, is as found by a scan of all; returns how many are told to be
    /// in another state than they are in.
    pub(in crate::engine::consistent) fn check_waiting(&self, params: &Params, now: Now) -> usize {
        let mut anew = Waiting::default();
        for (component, cluster) in self.clusters.each() {
            anew.set(component, cluster.as_deref().and_then(Waits::of));
        }
        assert_eq!((&self.waiting.new, &self.waiting.grown), (&anew.new, &anew.grown));
        let clusters: Vec<&Cluster> = self.clusters.iter().filter_map(Option::as_deref).collect();
        let with_id = clusters.iter().filter(|cluster| cluster.identity.id.is_some()).count();
        assert_eq!(self.counted.clusters, with_id);
        let is_late = |cluster: &&&Cluster| {
            cluster.told.as_ref().is_some_and(|told| told.state != state(cluster, params, now))
        };
        clusters.iter().filter(is_late).count()
    }

    /// By how much (s) a cluster was seen later than it is told to have been, at most.
    pub(in crate::engine::consistent) fn most_behind(&self) -> f64 {
        let behind = |cluster: &Cluster| {
            let told = cluster.told.as_ref()?;
            Some(cluster.identity.last_seen.seconds_since(told.last_seen))
        };
        self.clusters.iter().filter_map(|cluster| behind(cluster.as_deref()?)).fold(0.0, f64::max)
    }

    /// Leaves `more` slots free, as after many clusters that are gone.
    pub(in crate::engine::consistent) fn add_free_slots(&mut self, more: usize) {
        let slots = self.clusters.len() + more;
        self.clusters.set_len(slots);
    }
}

fn now(sequence: u64, seconds: f64) -> Now {
    Now { sequence, stamp: Stamp::from_nanos((seconds * 1e9) as i64) }
}

#[test]
fn what_waits_is_due_when_its_time_has_come_and_no_more_when_it_waits_for_something_else() {
    let params = Params::default().with_expansion_interval(10).unwrap();
    let mut waiting = Waiting::default();
    let new = |seconds| Some(Waits::New(now(0, seconds).stamp));
    let grown = |sequence| Some(Waits::Grown(sequence));
    for (component, waits) in [(3, new(1.0)), (1, new(1.2)), (2, grown(7)), (0, grown(5))] {
        waiting.set(ComponentId(component), waits);
    }
    let due =
        |waiting: &Waiting, now| waiting.due(&params, now).map(|component| component.0).collect::<Vec<_>>();
    assert!(due(&waiting, now(14, 1.25)).is_empty());
    assert_eq!(due(&waiting, now(15, 1.35)), [3, 0]);
    assert_eq!(due(&waiting, now(17, 1.6)), [3, 1, 0, 2]);
    assert_eq!(due(&waiting, now(14, 0.5)), [3, 1], "they were seen before a restart, by another clock");
    for (component, waits) in [(3, grown(17)), (0, None), (2, grown(7))] {
        waiting.set(ComponentId(component), waits);
    }
    assert_eq!(due(&waiting, now(17, 1.6)), [1, 2]);
    let never = params.with_expansion_interval(0).unwrap();
    assert_eq!(waiting.due(&never, now(100, 1.6)).count(), 1);
}
