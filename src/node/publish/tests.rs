//! What goes out of the worker's outputs, and what of it waits.

use std::time::Duration;

use tokio::sync::Semaphore;

use super::*;
use crate::engine::{self, Engine, Isometry3, Params, Scan, Stamp};
use crate::node::fake::Fake;
use crate::node::record::tests::{begun, recorded};

fn reach() -> Reach {
    Reach::new("odom".to_owned(), 0.08)
}

/// Lets so many maps through.
fn slow(maps: usize) -> Rc<Fake> {
    Rc::new(Fake { through: Some(Semaphore::new(maps)), ..Fake::default() })
}

/// What a worker gives that takes in this many scans, with the map after each.
fn outputs(scans: i64) -> Vec<Output> {
    let mut engine = Engine::new(Params::default());
    let mut outputs = Vec::new();
    for number in 0..scans {
        let update = engine.insert(&Scan {
            stamp: Stamp::from_nanos(1 + number),
            fixed_from_sensor: Isometry3::identity(),
            points: engine::Points::F32(vec![[0.0, 0.0, 1.0]; 20]),
        });
        let snapshot = Arc::new(engine.snapshot());
        outputs.extend([
            Output::Scan {
                session: 1,
                sensor: 0,
                stamp: update.stamp,
                points: 20,
                update,
                took: Duration::ZERO,
            },
            Output::Snapshot { session: 1, snapshot, took: Took::default() },
        ]);
    }
    outputs
}

#[test]
fn that_snapshots_are_put_off_for_long_is_said_once_a_session() {
    let mut put_off = PutOff::default();
    let mut said = |session, [freezing, making]: [u64; 2]| {
        let [freezing, making] = [freezing, making].map(Duration::from_millis);
        put_off.line(session, 2_000_000, Took { freezing, making })
    };
    assert_eq!(said(1, [100, 900]), None);
    let line = said(1, [250, 900]).unwrap();
    assert!(line.contains("of 2000000 dense voxels takes 900 ms, in 250 ms of which"), "{line}");
    assert!(line.contains("2.2 s after"), "{line}");
    assert_eq!([said(1, [300, 0]), said(3, [20, 900])], [None, None]);
    assert!(said(2, [300, 0]).is_some() && said(3, [20, 1100]).is_some());
}

#[test]
fn points_beyond_the_grid_are_said_once_a_session_and_once_in_a_while_where_sessions_alternate() {
    let mut beyond = Beyond::new(reach());
    let (start, points) = (Instant::now(), Points { all: 20, beyond_grid: 1 });
    let mut says =
        |session, seconds| beyond.line(session, points, start + Duration::from_secs(seconds)).is_some();
    assert!(says(1, 0) && !says(1, 9) && says(2, 10));
    assert!((3..9).all(|session| !says(session, 11)), "sessions that alternate");
    assert!(says(9, 15) && !says(9, 30));
    assert!(beyond.line(10, Points { all: 20, beyond_grid: 0 }, start + Duration::from_secs(60)).is_none());
}

#[tokio::test]
async fn a_map_that_waits_holds_up_no_delta_and_is_followed_by_the_newest() {
    let slow = slow(0);
    let (sender, receiver) = mpsc::channel(1);
    let config = Config::new([]).unwrap();
    let outlets = Outlets { transport: Rc::clone(&slow), recorder: None };
    let publishing = publish(outlets, receiver, Seen::default(), config, None, mpsc::channel(1).0, messages);
    let worker = async {
        for output in outputs(4) {
            sender.send(output).await.unwrap();
        }
        while sender.capacity() == 0 {
            tokio::task::yield_now().await;
        }
        drop(sender);
        assert_eq!(*slow.sent.borrow(), [1, 2, 3, 4].map(|number| ("delta", number)));
        slow.through.as_ref().unwrap().add_permits(4);
    };
    let (ended, ()) = tokio::join!(publishing, worker);
    assert_eq!(slow.sent.borrow()[4..], [("map", 1), ("map", 4)]);
    assert_eq!(ended.map.map(|map| map.sequence), Some(4));
}

#[tokio::test]
async fn what_is_sent_of_the_map_is_recorded_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("result.mcap");
    let (record, recorder) = begun(&path);
    let slow = slow(1);
    let (sender, receiver) = mpsc::channel(10);
    outputs(1).into_iter().for_each(|output| sender.try_send(output).unwrap());
    drop(sender);
    let config = Config::new([]).unwrap();
    let outlets = Outlets { transport: Rc::clone(&slow), recorder: Some(recorder) };
    publish(outlets, receiver, Seen::default(), config, None, mpsc::channel(1).0, messages).await;
    record.finish().unwrap();
    assert_eq!(*slow.sent.borrow(), [("delta", 1), ("map", 1)]);
    let mut topics = recorded(&path);
    topics.sort();
    let names = ["clusters", "clusters_delta", "markers", "points_labelled"];
    assert_eq!(topics, names.map(|name| format!("/cfodi/{name}")));
}

#[tokio::test]
async fn a_map_from_before_the_first_scan_is_not_live_though_that_scan_overtakes_it() {
    let is_live = async |map: usize| {
        let (sender, receiver) = mpsc::channel(2);
        let scan_2 = 2;
        let mut chosen: Vec<_> = outputs(2).into_iter().enumerate().collect();
        chosen.retain(|(number, _)| [scan_2, map].contains(number));
        chosen.sort_by_key(|(number, _)| *number != scan_2);
        for (_, output) in chosen {
            sender.send(output).await.unwrap();
        }
        drop(sender);
        let outlets = Outlets { transport: slow(0), recorder: None };
        let wire = Wire { outlets, unsent: RefCell::default(), frame_id: "odom".to_owned() };
        let (newest, maps) = watch::channel(None);
        Taking::new(&wire, newest, Seen::default(), None, reach()).all(receiver).await;
        maps.borrow().as_ref().is_some_and(|map| map.is_live)
    };
    let [map_1, map_2] = [1, 3];
    assert!(!is_live(map_1).await && is_live(map_2).await);
}

#[tokio::test]
async fn the_polygons_of_a_map_go_out_once_and_one_of_no_cluster_among_them() {
    let slow = slow(8);
    let wire = Wire {
        outlets: Outlets { transport: Rc::clone(&slow), recorder: None },
        unsent: RefCell::default(),
        frame_id: "odom".to_owned(),
    };
    let mut publisher = Maps::new(Twins { polygons: true, ..Twins::default() }, messages);
    let mut maps = vec![Arc::new(Engine::new(Params::default()).snapshot())];
    for output in outputs(2) {
        if let Output::Snapshot { snapshot, .. } = output {
            maps.push(snapshot);
        }
    }
    // Another sensor's scan, whose clock is behind.
    let mut same_stamp = Snapshot::clone(&maps[2]);
    same_stamp.sequence += 1;
    maps.push(Arc::new(same_stamp));
    let shown =
        [(1, 0, false), (1, 1, true), (1, 1, true), (1, 2, true), (1, 2, true), (1, 3, true), (2, 2, true)];
    // Of a map that was saved nothing goes out.
    for (session, map, is_live) in shown.into_iter().chain([(3, 2, false)]) {
        let snapshot = Arc::clone(&maps[map]);
        publisher.send(Newest { session, snapshot, is_live }, &wire).await.unwrap();
    }
    let of_none = slow.sent.borrow().iter().filter(|sent| **sent == ("polygon", 0)).count();
    assert_eq!(of_none, 4, "with each map that is new: {:?}", slow.sent.borrow());
}
