use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use super::*;
use crate::engine::{Isometry3, Params, Points, Stamp};

const PATIENCE: Duration = Duration::from_secs(60);

pub(super) fn scan(stamp: i64) -> Scan {
    Scan {
        stamp: Stamp::from_nanos(stamp),
        fixed_from_sensor: Isometry3::identity(),
        points: Points::F32(Vec::new()),
    }
}

/// Scans that may wait.
const PLACES: usize = 8;

fn engine() -> Engine {
    Engine::new(Params::paper())
}

fn started() -> (Worker, Receiver<Output>) {
    let (sender, receiver) = channel();
    (Worker::start(engine(), 1, PLACES, move |output| drop(sender.send(output))).unwrap(), receiver)
}

#[test]
fn in_a_full_mailbox_the_oldest_scan_is_replaced_and_said_to_be() {
    let (entered, enter) = channel();
    let (leave, left) = channel::<()>();
    let (left, (sender, receiver)) = (Arc::new(Mutex::new(left)), channel());
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        entered.send(()).unwrap();
        left.lock().unwrap().recv().unwrap();
        sender.send(output).unwrap();
    });
    let worker = worker.unwrap();
    assert_eq!(worker.submit(0, scan(1)), None);
    enter.recv_timeout(PATIENCE).unwrap();
    let places = PLACES as i64;
    assert!((2..2 + places).all(|stamp| worker.submit(stamp as usize, scan(stamp)).is_none()));
    assert_eq!(worker.submit(0, scan(2 + places)), Some(2));
    (0..=places).for_each(|_| leave.send(()).unwrap());
    drop(worker);
    let stamps: Vec<_> =
        receiver
            .iter()
            .filter_map(|output| {
                if let Output::Scan { update, .. } = output { Some(update.stamp.nanos()) } else { None }
            })
            .collect();
    assert_eq!(stamps, [1].into_iter().chain(3..3 + places).collect::<Vec<_>>());
}

#[test]
fn a_snapshot_that_was_put_off_comes_and_that_of_a_new_session_at_once() {
    let (worker, outputs) = started();
    let begin = Instant::now();
    worker.mailbox.rest(Took { freezing: 2 * SHORT, making: SHORT });
    worker.request_snapshot();
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Snapshot { session: 1, .. }));
    assert!(begin.elapsed() > SHORT * REST);
    worker.mailbox.rest(Took { freezing: 100 * PATIENCE, making: SHORT });
    assert_eq!(worker.reset(2), 0);
    worker.request_snapshot();
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Snapshot { session: 2, .. }));
}

/// A robot at its dock, its driver off.
#[test]
fn of_a_map_that_stays_as_it_is_the_same_snapshot_comes_again_and_no_other_is_made() {
    let (worker, outputs) = started();
    let map = || {
        worker.request_snapshot();
        loop {
            if let Output::Snapshot { session, snapshot, took } = outputs.recv_timeout(PATIENCE).unwrap() {
                return (session, snapshot, took);
            }
        }
    };
    let comes_again = |(session, snapshot, took): &(u64, Arc<Snapshot>, Took)| {
        worker.request_save();
        let again = map();
        (again.0, again.2) == (*session, *took) && Arc::ptr_eq(&again.1, snapshot)
    };
    let empty = map();
    assert!(comes_again(&empty) && comes_again(&empty));
    assert_eq!(worker.submit(0, scan(1)), None);
    let of_scan = map();
    assert_eq!((of_scan.0, of_scan.1.sequence), (1, 1));
    assert!(comes_again(&of_scan));
    worker.tune(Params::paper());
    let tuned = map();
    assert!(!Arc::ptr_eq(&tuned.1, &of_scan.1) && tuned.1 == of_scan.1);
    assert_eq!(worker.reset(2), 0);
    let of_reset = map();
    assert_eq!((of_reset.0, of_reset.1.sequence), (2, 0));
    assert!(comes_again(&of_reset));
}

/// A sink that lets a snapshot through when it is told to.
fn slow_for_maps() -> (Worker, Receiver<Output>, Sender<()>) {
    let (sender, receiver) = channel();
    let (leave, left) = channel::<()>();
    let left = Arc::new(Mutex::new(left));
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        if let Output::Snapshot { .. } = output {
            _ = left.lock().unwrap().recv();
        }
        drop(sender.send(output));
    });
    (worker.unwrap(), receiver, leave)
}

#[test]
fn while_a_snapshot_is_made_scans_are_taken_in_and_no_other_one_is_begun() {
    let (worker, outputs, leave) = slow_for_maps();
    let next = || outputs.recv_timeout(PATIENCE).unwrap();
    worker.request_snapshot();
    for stamp in 1..=3 {
        assert_eq!(worker.submit(0, scan(stamp)), None);
        worker.request_snapshot();
        assert!(matches!(next(), Output::Scan { update, .. } if update.sequence == stamp as u64));
    }
    leave.send(()).unwrap();
    assert!(matches!(next(), Output::Snapshot { snapshot, .. } if snapshot.sequence <= 1));
    leave.send(()).unwrap();
    assert!(matches!(next(), Output::Snapshot { snapshot, .. } if snapshot.sequence == 3));
    worker.request_snapshot();
    drop(leave);
    drop(worker);
    let left: Vec<_> = outputs.iter().collect();
    assert!(matches!(&left[..], [Output::Snapshot { snapshot, .. }] if snapshot.sequence == 3), "{left:?}");
}

#[test]
fn a_snapshot_of_a_session_never_comes_after_what_belongs_to_the_next() {
    let (worker, outputs, leave) = slow_for_maps();
    worker.request_snapshot();
    let patience = Instant::now();
    while !matches!(worker.mailbox.lock().off, Some(Off::Making)) {
        assert!(patience.elapsed() < PATIENCE, "no snapshot is made");
        std::thread::yield_now();
    }
    assert_eq!(worker.reset(2), 0);
    assert_eq!(worker.submit(0, scan(1)), None);
    assert!(outputs.recv_timeout(Duration::from_millis(50)).is_err(), "the next session waits for it");
    leave.send(()).unwrap();
    let sessions = (0..2).map(|_| match outputs.recv_timeout(PATIENCE).unwrap() {
        Output::Snapshot { session, .. } => ("map", session),
        Output::Scan { session, .. } => ("scan", session),
        other => panic!("{other:?}"),
    });
    assert_eq!(sessions.collect::<Vec<_>>(), [("map", 1), ("scan", 2)]);
}

#[test]
fn after_the_word_that_the_engine_has_died_nothing_comes_not_even_a_snapshot_that_was_being_made() {
    let (sender, outputs) = channel();
    let (leave, left) = channel::<()>();
    let left = Arc::new(Mutex::new(left));
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        match output {
            Output::Snapshot { .. } => _ = left.lock().unwrap().recv(),
            // At once: to say it on stderr takes its time.
            Output::Scan { .. } => resume_unwind(Box::new("no room")),
            _ => {}
        }
        drop(sender.send(output));
    });
    let worker = worker.unwrap();
    worker.request_snapshot();
    let patience = Instant::now();
    while !matches!(worker.mailbox.lock().off, Some(Off::Making)) {
        assert!(patience.elapsed() < PATIENCE, "no snapshot is made");
        std::thread::yield_now();
    }
    assert_eq!(worker.submit(0, scan(1)), None);
    assert!(outputs.recv_timeout(Duration::from_millis(100)).is_err(), "the end waits for it");
    leave.send(()).unwrap();
    drop(worker);
    let last: Vec<_> = outputs.iter().collect();
    assert!(matches!(&last[..], [Output::Snapshot { .. }, Output::Died(_)]), "{last:?}");
}

#[test]
fn a_panic_while_a_snapshot_is_made_is_reported_too() {
    let (sender, receiver) = channel();
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        assert!(!matches!(output, Output::Snapshot { .. }), "no room");
        drop(sender.send(output));
    });
    let worker = worker.unwrap();
    worker.request_snapshot();
    worker.request_snapshot();
    drop(worker);
    assert!(matches!(receiver.recv_timeout(PATIENCE).unwrap(), Output::Died(text) if text == "no room"));
}

#[test]
fn a_reset_throws_the_map_away_and_begins_a_session() {
    let (worker, outputs) = started();
    assert_eq!(worker.submit(0, scan(1)), None);
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { session: 1, .. }));
    assert_eq!(worker.reset(9), 0);
    worker.request_snapshot();
    let Output::Snapshot { session, snapshot, .. } = outputs.recv_timeout(PATIENCE).unwrap() else {
        panic!()
    };
    assert_eq!((session, snapshot.sequence), (9, 0));
}

#[test]
fn a_map_that_is_kept_comes_out_before_the_session_begins_unless_it_is_empty() {
    let (worker, outputs) = started();
    assert_eq!(worker.reset_and_keep(2), 0);
    worker.request_snapshot();
    let first = outputs.recv_timeout(PATIENCE).unwrap();
    assert!(matches!(first, Output::Snapshot { session: 2, .. }), "{first:?}");
    assert_eq!(worker.submit(0, scan(1)), None);
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { session: 2, .. }));
    assert_eq!(worker.reset_and_keep(3), 0);
    worker.request_save();
    drop(worker);
    let maps = outputs.iter().filter_map(|output| match output {
        Output::Ended { session, map } => Some(("ended", session, map.sequence())),
        Output::Saved { session, map } => Some(("saved", session, map.sequence())),
        _ => None,
    });
    assert_eq!(maps.collect::<Vec<_>>(), [("ended", 2, 1), ("saved", 3, 0)]);
}

/// A worker whose sink holds up the first scan until it is told to go on, or nobody is there to tell it.
fn held_up_at_first() -> (Worker, Receiver<Output>, Sender<()>) {
    let (sender, receiver) = channel();
    let (leave, left) = channel::<()>();
    let left = Arc::new(Mutex::new(left));
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        let is_first = matches!(&output, Output::Scan { update, .. } if update.sequence == 1);
        drop(sender.send(output));
        if is_first {
            _ = left.lock().unwrap().recv();
        }
    });
    (worker.unwrap(), receiver, leave)
}

#[test]
fn of_a_reset_that_keeps_the_map_and_one_that_does_not_before_the_engine_hears_of_either_the_first_decides_what_becomes_of_the_map()
 {
    type Begin = fn(&Worker, u64) -> usize;
    let ended = |first: Begin, second: Begin| {
        let (worker, outputs, leave) = held_up_at_first();
        assert_eq!(worker.submit(0, scan(1)), None);
        assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { .. }));
        assert_eq!([first(&worker, 2), second(&worker, 3)], [0, 0]);
        drop(leave);
        drop(worker);
        let ended = outputs.iter().filter_map(|output| match output {
            Output::Ended { session, map } => Some((session, map.sequence())),
            _ => None,
        });
        ended.collect::<Vec<_>>()
    };
    assert_eq!(
        ended(Worker::reset, Worker::reset_and_keep),
        [],
        "who called for the reset wants the map gone"
    );
    assert_eq!(ended(Worker::reset_and_keep, Worker::reset), [(1, 1)]);
    assert_eq!(ended(Worker::reset_and_keep, Worker::reset_and_keep), [(1, 1)]);
}

/// As a shorter `tf_timeout` has it.
#[test]
fn with_fewer_places_than_scans_wait_each_new_one_replaces_the_oldest_and_its_sensor_is_told() {
    let (mut worker, outputs, leave) = held_up_at_first();
    assert_eq!(worker.submit(9, scan(9)), None);
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { sensor: 9, .. }));
    assert!((0..4).all(|sensor| worker.submit(sensor, scan(sensor as i64)).is_none()));
    worker.set_places(2);
    assert_eq!([4, 5].map(|sensor| worker.submit(sensor, scan(sensor as i64))), [Some(0), Some(1)]);
    drop(leave);
    drop(worker);
    let taken_in = outputs.iter().filter_map(|output| match output {
        Output::Scan { sensor, stamp, .. } => Some((sensor, stamp.nanos())),
        _ => None,
    });
    assert_eq!(taken_in.collect::<Vec<_>>(), [(2, 2), (3, 3), (4, 4), (5, 5)]);
}

#[test]
fn the_last_maps_have_all_scans_that_were_waiting_when_the_worker_was_told_to_end() {
    let (worker, outputs, leave) = held_up_at_first();
    (1..=5).for_each(|stamp| assert_eq!(worker.submit(0, scan(stamp)), None));
    assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { .. }));
    worker.end(true);
    drop(leave);
    // It is dropped when all is done: that it is to end it has learned before.
    let last: Vec<_> = std::iter::from_fn(|| outputs.recv_timeout(PATIENCE).ok()).collect();
    drop(worker);
    let mut maps: Vec<_> = last
        .iter()
        .filter_map(|output| match output {
            Output::Saved { map, .. } => Some(("saved", map.sequence())),
            Output::Snapshot { snapshot, .. } => Some(("snapshot", snapshot.sequence)),
            _ => None,
        })
        .collect();
    maps.sort_unstable();
    assert_eq!(maps, [("saved", 5), ("snapshot", 5)]);
}

#[test]
fn a_panic_on_the_thread_is_reported_and_not_silent() {
    let (sender, receiver) = channel();
    let worker = Worker::start(engine(), 1, PLACES, move |output| {
        assert!(!matches!(output, Output::Scan { .. }), "no room");
        drop(sender.send(output));
    });
    assert_eq!(worker.unwrap().submit(0, scan(1)), None);
    assert!(matches!(receiver.recv_timeout(PATIENCE).unwrap(), Output::Died(text) if text == "no room"));
}
