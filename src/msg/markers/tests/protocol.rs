//! What is added and deleted, and under which identities.

use proptest::prelude::*;

use super::*;

/// A cluster of one of the kinds that look differently.
fn cluster(id: u64, kind: u8) -> Cluster {
    match kind {
        0 => square(id),
        1 => Cluster { state: ClusterState::Tentative, ..square(id) },
        _ => heap(id),
    }
}

/// Maps one after the other.
fn histories() -> impl Strategy<Value = Vec<Snapshot>> {
    let clusters = prop::collection::btree_map(1..12_u64, 0..3_u8, 0..8);
    let one = (clusters, 0..3_u32).prop_map(|(clusters, unclustered)| {
        map(clusters.into_iter().map(|(id, kind)| cluster(id, kind)).collect(), unclustered)
    });
    prop::collection::vec(one, 1..25)
}

/// The slot of each cluster that a message shows.
fn slots(message: &MarkerArray) -> BTreeMap<String, i32> {
    let mut slots = BTreeMap::new();
    for marker in message.markers.iter().filter(|marker| [SURFACES, CLUSTERS].contains(&marker.ns.as_str())) {
        if marker.action == Marker::ADD {
            assert_eq!(slots.insert(marker.text.clone(), marker.id), None);
        }
    }
    slots
}

proptest! {
    #[test]
    fn who_joins_late_and_who_misses_a_few_messages_see_what_all_see(
        history in histories(),
        missed in prop::collection::vec(any::<bool>(), 25),
    ) {
        let mut markers = Markers::default();
        let mut faithful = Viewer::of(&Markers::default().update(&session(), &map(vec![square(99)], 3)));
        let (mut patchy, mut in_a_row) = (faithful.clone(), 0);
        for (snapshot, missed) in history.iter().zip(missed) {
            let message = markers.update(&session(), snapshot);
            faithful.take(&message);
            prop_assert_eq!(&faithful, &Viewer::of(&message));
            in_a_row = if missed { in_a_row + 1 } else { 0 };
            if in_a_row >= REPEATS || !missed {
                in_a_row = 0;
                patchy.take(&message);
                prop_assert_eq!(&patchy, &faithful);
            }
        }
    }

    #[test]
    fn what_is_deleted_was_added_before(history in histories()) {
        let (mut markers, mut added) = (Markers::default(), BTreeSet::new());
        for snapshot in &history {
            for marker in markers.update(&session(), snapshot).markers {
                let identity = (marker.ns, marker.id);
                match marker.action {
                    Marker::ADD => drop(added.insert(identity)),
                    Marker::DELETE => prop_assert!(added.contains(&identity), "{identity:?}"),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn a_cluster_keeps_its_slot_and_shares_it_with_none(history in histories()) {
        let mut markers = Markers::default();
        let (mut before, mut most) = (BTreeMap::new(), 0);
        for snapshot in &history {
            let now = slots(&markers.update(&session(), snapshot));
            most = most.max(snapshot.clusters.len());
            prop_assert_eq!(now.len(), snapshot.clusters.len());
            prop_assert_eq!(now.values().collect::<BTreeSet<_>>().len(), now.len());
            prop_assert!(now.values().all(|slot| (0..most as i32).contains(slot)), "{now:?}, at most {most}");
            for (id, slot) in &now {
                prop_assert!(before.get(id).is_none_or(|kept| kept == slot));
            }
            before = now;
        }
    }
}

#[test]
fn slots_of_gone_clusters_are_deleted_and_used_again() {
    let mut markers = Markers::default();
    let line = |ns: &str, id, action| (ns.to_owned(), id, action);
    let mut update = |ids: &[u64]| {
        let message = markers.update(&session(), &map(ids.iter().map(|&id| square(id)).collect(), 0));
        message.markers.into_iter().map(|m| (m.ns, m.id, m.action)).collect::<Vec<_>>()
    };
    let first = update(&[1, 1 << 40]);
    assert_eq!(first[0], line("", 0, Marker::DELETEALL));
    assert!(first.contains(&line(SURFACES, 1, Marker::ADD)));
    let gone = [SURFACES, OUTLINES, NAMES].map(|ns| line(ns, 0, Marker::DELETE));
    for _ in 0..REPEATS {
        let next = update(&[1 << 40]);
        assert!(gone.iter().all(|deletion| next.contains(deletion)));
    }
    let next = update(&[1 << 40]);
    assert!(gone.iter().all(|deletion| next.contains(deletion)), "they are said again, for they are few");
    let again = update(&[9, 1 << 40]);
    assert!(
        again.contains(&line(SURFACES, 0, Marker::ADD)) && again.contains(&line(SURFACES, 1, Marker::ADD))
    );
    assert!(again.iter().all(|(_, _, action)| *action == Marker::ADD));
}

/// However many messages it has missed, however many markers have gone meanwhile, and whatever sessions have begun.
#[test]
fn a_viewer_that_has_missed_many_messages_sees_what_all_see_after_some() {
    let few = map(vec![square(7)], 0);
    for sessions in [[1, 1], [1, 2], [2, 2], [2, 3]] {
        let mut markers = Markers::default();
        let mut late = Viewer::of(&markers.update(&session(), &map((1..=100).map(square).collect(), 0)));
        let mut next = |id| markers.update(&Session { id, ..session() }, &few);
        for id in sessions {
            (0..40).for_each(|_| drop(next(id)));
        }
        let mut messages = 0;
        let all = loop {
            let message = next(sessions[1]);
            assert!(message.markers.len() < AGAIN + 10, "{}", message.markers.len());
            late.take(&message);
            messages += 1;
            if late == Viewer::of(&message) {
                break messages;
            }
            assert!(messages < 100, "{sessions:?}: {} markers stay", late.0.len());
        };
        assert_eq!(all, (3 * 99_usize).div_ceil(AGAIN), "{sessions:?}");
    }
}

/// A viewer that is found late has what a node showed before that was ended.
#[test]
fn all_is_deleted_at_the_beginning_for_some_seconds_and_some_messages() {
    let begins = |first: i64, seconds: f64, messages: usize| {
        let mut markers = Markers::default();
        let stamps = (0..messages).map(|i| Stamp::from_nanos((seconds * 1e9 * i as f64) as i64 + 5));
        let updates = std::iter::once(Stamp::from_nanos(first)).chain(stamps).map(|stamp| {
            let map = Snapshot { stamp: Some(stamp), ..map(vec![square(1)], 0) };
            markers.update(&session(), &map).markers[0].action == Marker::DELETEALL
        });
        updates.take_while(|deletes| *deletes).count()
    };
    // Of an empty map, of one that was saved an hour before, and of one that was saved by a clock that is ahead.
    for first in [0, -3_600_000_000_000, 3_600_000_000_000] {
        assert_eq!(begins(first, 0.1, 300), 1 + 100);
        assert_eq!(begins(first, 60.0, 300), usize::from(REPEATS));
    }
}

#[test]
fn a_new_session_begins_with_the_deletion_of_all() {
    let mut markers = Markers::default();
    let mut viewer = Viewer::default();
    for _ in 0..2 * REPEATS {
        viewer.take(&markers.update(&session(), &map(vec![square(1), square(2)], 1)));
    }
    let message = markers.update(&Session { id: 2, ..session() }, &map(Vec::new(), 0));
    assert_eq!(message.markers[0].action, Marker::DELETEALL);
    viewer.take(&message);
    assert_eq!(viewer, Viewer::default());
}
