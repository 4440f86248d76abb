//! Several sensors whose stamps jump back together, in whatever order that is noticed.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

/// When a lap ends: more than what is kept of transforms after its beginning.
const END: f64 = 60.0;

/// What each sensor sends where two laps meet: the last of the one, and the first of the other.
const CLOUDS: [f64; 3] = [END, 0.0, 0.1];

/// A bag in a loop. What its sensors send where two laps meet comes in any order but their own.
struct Loop {
    join: Join,
    /// By how much the clock of each sensor is ahead (s).
    ahead: Vec<f64>,
    /// Whether nothing moves the sensors, so that their clouds wait for nothing.
    stands: bool,
    /// Scans, by sensor and stamp, and how many of them began a session.
    scans: BTreeSet<(usize, Stamp)>,
    sessions: usize,
}

fn frame(sensor: usize) -> String {
    format!("camera{sensor}")
}

impl Loop {
    fn new(ahead: &[f64], stands: bool) -> Self {
        let (join, ahead) = (Join::new(64), ahead.to_vec());
        let mut played = Self { join, ahead, stands, scans: BTreeSet::new(), sessions: 0 };
        (0..played.ahead.len()).filter(|_| stands).for_each(|sensor| {
            static_camera(&mut played.join, &frame(sensor));
        });
        played.end();
        played
    }

    fn cloud(&mut self, sensor: usize, seconds: f64) {
        let cloud = Cloud { frame_id: frame(sensor), ..cloud(seconds + self.ahead[sensor]) };
        assert!(self.join.cloud(sensor, cloud, Moment::default()).is_none());
        self.take_ready();
    }

    fn transform(&mut self, sensor: usize, seconds: f64) {
        if !self.stands {
            let header = Header { stamp: at(seconds + self.ahead[sensor]).into(), frame_id: "map".into() };
            let (child_frame_id, transform) = (frame(sensor), Transform::default());
            self.join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
            self.take_ready();
        }
    }

    fn take_ready(&mut self) {
        for joined in self.join.ready("map") {
            self.sessions += usize::from(joined.jumped_back.is_some());
            self.scans.insert((joined.sensor, joined.scan.stamp));
        }
    }

    /// The rest of a lap, but for its last clouds.
    fn end(&mut self) {
        for sensor in 0..self.ahead.len() {
            // In one leap it would be that of a second publisher.
            [20.0, 40.0, END - 0.1].iter().for_each(|seconds| self.transform(sensor, *seconds));
            self.cloud(sensor, END - 0.1);
        }
    }

    /// A lap, from the last clouds of the one before. The order has a number for each cloud, that of its sensor, and one for the first
    /// transforms of each sensor. Gives the scans of where the laps meet, by sensor and stamp, and the sessions that have begun.
    fn lap(&mut self, order: &[usize]) -> (BTreeSet<(usize, Stamp)>, usize) {
        let sensors = self.ahead.len();
        (self.scans, self.sessions) = (BTreeSet::new(), 0);
        let mut sent = vec![0; sensors];
        for &number in order {
            if number < sensors {
                self.cloud(number, CLOUDS[sent[number]]);
                sent[number] += 1;
            } else {
                self.transform(number - sensors, 0.0);
                self.transform(number - sensors, 0.2);
            }
        }
        let scans = std::mem::take(&mut self.scans);
        self.end();
        (scans, self.sessions)
    }

    /// All clouds from after a jump, by sensor and stamp.
    fn of_next_lap(&self) -> BTreeSet<(usize, Stamp)> {
        let of = |(sensor, ahead): (usize, f64)| CLOUDS[1..].iter().map(move |s| (sensor, at(s + ahead)));
        self.ahead.iter().copied().enumerate().flat_map(of).collect()
    }
}

/// What stands in the order of [`Loop::lap`].
fn events(sensors: usize) -> Vec<usize> {
    (0..sensors).flat_map(|sensor| [sensor, sensor, sensor, sensors + sensor]).collect()
}

/// Calls `each` with every order of these.
fn orders(counts: &mut [usize], order: &mut Vec<usize>, each: &mut impl FnMut(&[usize])) {
    if counts.iter().all(|count| *count == 0) {
        return each(order);
    }
    for number in 0..counts.len() {
        if counts[number] > 0 {
            counts[number] -= 1;
            order.push(number);
            orders(counts, order, each);
            order.pop();
            counts[number] += 1;
        }
    }
}

#[test]
fn what_another_sensor_has_sent_since_the_jump_waits_on_when_one_begins_the_session() {
    let mut join = Join::new(8);
    static_camera(&mut join, "other");
    let send = |join: &mut Join, frame: &str, seconds: f64| {
        let cloud = Cloud { frame_id: frame.into(), ..cloud(seconds) };
        assert!(join.cloud(0, cloud, Moment::default()).is_none());
        let ready = join.ready("map").into_iter();
        ready.map(|joined| (joined.scan.stamp, joined.jumped_back)).collect::<Vec<_>>()
    };
    let transform = |join: &mut Join, seconds: f64| {
        let header = Header { stamp: at(seconds).into(), frame_id: "map".into() };
        let (child_frame_id, transform) = ("camera".to_owned(), Transform::default());
        join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
    };
    transform(&mut join, 60.0);
    assert_eq!(["camera", "other"].map(|frame| send(&mut join, frame, 60.0).len()), [1, 1]);
    // One of before the jump, and two from after it.
    assert!([60.1, 0.0, 0.1].iter().all(|seconds| send(&mut join, "camera", *seconds).is_empty()));
    let begun = send(&mut join, "other", 0.05);
    assert_eq!(begun, [(at(0.05), Some(Jump { seconds: 59.95, given_up: 1 }))]);
    [0.0, 0.1].iter().for_each(|seconds| transform(&mut join, *seconds));
    assert_eq!(send(&mut join, "other", 0.15), [0.0, 0.1, 0.15].map(|seconds| (at(seconds), None)));
}

#[test]
fn a_sensor_that_sends_once_a_lap_loses_nothing_to_a_session_that_another_begins() {
    let mut join = joined_with_static_camera();
    let map = |join: &mut Join| {
        let cloud = Cloud { frame_id: "lidar".into(), ..cloud(0.0) };
        assert!(join.cloud(1, cloud, Moment::default()).is_none());
        join.ready("map").len()
    };
    assert_eq!((map(&mut join), back(&mut join, 60.0).len()), (0, 1));
    // The one of the first lap has found no way: it lies where that of the second does, and waits on beside it.
    assert_eq!((map(&mut join), back(&mut join, 0.0).into_iter().flatten().count()), (0, 1));
    assert_eq!(join.waiting(), 2);
}

#[test]
fn in_every_order_two_sensors_begin_one_session_a_lap_and_lose_none_of_it() {
    for other in [0.0, 100.0, -100.0] {
        orders(&mut [3, 3, 1, 1], &mut Vec::new(), &mut |order| {
            let mut played = Loop::new(&[0.0, other], false);
            for lap in 1..3 {
                let found = played.lap(order);
                assert_eq!(found, (played.of_next_lap(), 1), "{order:?}, {other} s ahead, in lap {lap}");
            }
        });
    }
}

proptest! {
    #[test]
    fn in_any_order_three_sensors_begin_one_session_a_lap_and_lose_none_of_it(
        laps in prop::collection::vec(Just(events(3)).prop_shuffle(), 1..4),
        ahead in prop::sample::select(vec![[0.0, 0.0, 0.0], [0.0, 0.0, 3600.0], [0.0, 100.0, -100.0]]),
    ) {
        let mut played = Loop::new(&ahead, false);
        for order in laps {
            prop_assert_eq!(played.lap(&order), (played.of_next_lap(), 1));
        }
    }

    #[test]
    fn what_a_sensor_that_stands_still_sends_late_begins_no_second_session(
        laps in prop::collection::vec(Just(events(3)).prop_shuffle(), 1..4),
        ahead in prop::sample::select(vec![[0.0, 0.0, 0.0], [0.0, 100.0, -100.0]]),
    ) {
        let mut played = Loop::new(&ahead, true);
        for order in laps {
            let (scans, sessions) = played.lap(&order);
            prop_assert!(scans.is_superset(&played.of_next_lap()));
            prop_assert_eq!(sessions, 1);
        }
    }

    #[test]
    fn whoever_is_silent_in_a_lap_it_begins_one_session_at_most(
        laps in prop::collection::vec(
            (prop::collection::vec(prop::option::of(0..500_u32), 3), Just([[0; 15], [1; 15], [2; 15]].concat()).prop_shuffle()),
            1..6),
    ) {
        let mut played = Loop::new(&[0.0; 3], true);
        for (starts, order) in laps {
            played.sessions = 0;
            let mut sent = [0; 3];
            for sensor in order {
                if let Some(start) = starts[sensor] {
                    played.cloud(sensor, 0.1 * f64::from(start + sent[sensor]));
                    sent[sensor] += 1;
                }
            }
            prop_assert!(played.sessions <= 1, "{} sessions", played.sessions);
        }
    }
}
