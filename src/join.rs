//! Clouds and transforms to scans: the path that the live node and a replay have in common.
//!
//! A cloud waits for the transform at its stamp; a scan whose stamp jumps back begins a new session. No clock inside:
//! time is an argument.

mod hint;
mod waiting;

use std::collections::BTreeMap;
use std::time::Duration;

use crate::cloud::{Cloud, CloudError};
use crate::engine::{Scan, Stamp};
use crate::msg::ros::TransformStamped;
use crate::tf::{FrameError, Frames, Inserted, Lack, LookupError};

pub use hint::GivenUp;
pub use waiting::{Moment, Waited};

use waiting::{Arrived, Waiting};

/// Pairs of a frame and a sensor that are remembered at most: a sender can make up ever new frames.
const SENSORS: usize = 1000;

/// Frames of REP 105 that stand still.
const MAPS: [&str; 4] = ["odom", "map", "world", "earth"];

/// Joins clouds with their transforms.
#[derive(Debug)]
pub struct Join {
    frames: Frames,
    waiting: Waiting,
    /// The oldest stamp of a cloud that has come since none waited: none that waits is older.
    waits_since: Stamp,
    /// Newest stamp that has arrived, whether or not a transform comes for it.
    arrived: BTreeMap<Key, Stamp>,
    /// Counts the arrivals whose stamps jumped back.
    lap: u64,
    /// What this session has had.
    sensors: BTreeMap<Key, Sensor>,
}

/// A frame, and which of the sensors has sent clouds in it: two may share one.
type Key = (String, usize);

/// A sensor that has had a scan in this session.
#[derive(Debug)]
struct Sensor {
    /// The newest stamp.
    newest: Stamp,
    /// How often the transforms had jumped back when it came. A scan whose stamp jumps back waits until they have jumped once
    /// more, if any of them move the sensor: those that are there are from before the jump.
    jumps: u64,
}

/// A cloud whose stamp says when it was taken: a moving sensor cannot be placed at the time when its scan happens to come.
/// Zero says nothing, but where the clock is a simulated one, which begins there.
///
/// # Errors
/// [`CloudError::NoStamp`].
pub fn with_stamp(cloud: Cloud, is_simulated: impl FnOnce() -> bool) -> Result<Cloud, CloudError> {
    if cloud.stamp.nanos() != 0 || is_simulated() { Ok(cloud) } else { Err(CloudError::NoStamp) }
}

/// A cloud whose transform is known.
#[derive(Clone, Debug)]
pub struct Joined {
    /// For the engine.
    pub scan: Scan,
    /// When its cloud came, by the clocks of [`Join::cloud`].
    pub at: Moment,
    /// Points in the message, valid or not.
    pub total: u32,
    /// Those of them without a measurement.
    pub invalid: u32,
    /// Where its stamp has jumped back: a new session begins with it.
    pub jumped_back: Option<Jump>,
}

/// A sensor's stamps have jumped back by more than [`JUMP_BACK`](crate::engine::JUMP_BACK).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// How far (s).
    pub seconds: f64,
    /// Clouds from before the jump that still waited and were given up.
    pub given_up: usize,
}

impl Join {
    /// Lets at most `places` clouds wait.
    pub fn new(places: usize) -> Self {
        Self {
            frames: Frames::new(),
            waiting: Waiting::new(places),
            waits_since: Stamp::default(),
            arrived: BTreeMap::new(),
            lap: 0,
            sensors: BTreeMap::new(),
        }
    }

    /// Lets at most `places` clouds wait from now on; where more do, a new one takes the place of the one that has waited longest
    /// until others have left.
    pub const fn set_places(&mut self, places: usize) {
        self.waiting.set_places(places);
    }

    /// The tree of frames.
    pub const fn frames(&self) -> &Frames {
        &self.frames
    }

    /// How many clouds may wait.
    pub const fn places(&self) -> usize {
        self.waiting.places()
    }

    /// The number of clouds that wait.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// How long the one has waited that has waited longest; 0 where none does.
    pub fn longest_wait(&self, now: Moment) -> Duration {
        self.waiting.longest_wait(now)
    }

    /// Whether a cloud waits, and the oldest of those that have come since none did was taken more than `by` before `stamp`.
    pub fn is_behind(&self, stamp: Stamp, by: Duration) -> bool {
        !self.waiting.is_empty() && stamp.seconds_since(self.waits_since) > by.as_secs_f64()
    }

    /// The frame of the cloud that has waited longest, and what its transform lacks.
    pub fn oldest(&self) -> Option<(&str, Option<&LookupError>)> {
        self.waiting.oldest()
    }

    /// The frames of the sensors that have sent a cloud in this session, that of the cloud that has waited longest first.
    pub fn sensors(&self) -> impl Iterator<Item = &str> {
        let oldest = self.oldest().map(|(frame, _)| frame);
        oldest.into_iter().chain(self.arrived.keys().map(|(frame, _)| frame.as_str()))
    }

    /// Which sensor has sent clouds in this frame.
    pub fn sensor_in(&self, frame: &str) -> Option<usize> {
        self.arrived.keys().find(|(known, _)| known == frame).map(|(_, sensor)| *sensor)
    }

    /// A warning of clouds whose frame is no sensor's: the fixed one, one above it, or one with the name of a map (REP 105). Only where
    /// something moves below that frame, for nobody knows then where the sensor stood; else `None`.
    pub fn without_viewpoint(&self, frame: &str, fixed_frame: &str) -> Option<String> {
        let is_no_sensor = MAPS.contains(&frame) || self.frames.is_above(frame, fixed_frame);
        (is_no_sensor && self.frames.moves_below(frame)).then(|| {
            format!(
                "clouds come in `{frame}`, so that nobody knows where the sensor stood: min_range, max_range, keep_radius and clearing go \
                 by that frame's origin; the driver's own cloud is in the sensor's frame"
            )
        })
    }

    /// Takes in a transform.
    ///
    /// # Errors
    /// As [`Frames::insert`].
    pub fn transform(
        &mut self,
        transform: &TransformStamped,
        is_static: bool,
    ) -> Result<Inserted, FrameError> {
        self.frames.insert(transform, is_static)
    }

    /// Whether a transform that was overtaken is still of use; see [`Frames::is_of_use`].
    pub fn is_of_use(&self, transform: &TransformStamped) -> bool {
        self.frames.is_of_use(transform)
    }

    /// Lets a cloud of a sensor wait for its transform; gives the one that has waited longest where there was no place.
    pub fn cloud(&mut self, sensor: usize, cloud: Cloud, now: Moment) -> Option<Waited> {
        let stamp = cloud.stamp;
        if self.arrived.len() >= SENSORS {
            self.arrived.clear();
        }
        // Clouds before a jump and after it must not be sorted together, and the stamps alone do not tell them apart.
        let before = self.arrived.insert((cloud.frame_id.clone(), sensor), stamp);
        self.lap += u64::from(before.is_some_and(|before| stamp.jump_back_from(before).is_some()));
        let is_alone = self.waiting.is_empty();
        self.waits_since = if is_alone { stamp } else { self.waits_since.min(stamp) };
        self.waiting.push(Arrived { sensor, cloud, lap: self.lap, at: now, lacks: None })
    }

    /// Takes the clouds whose way to `fixed_frame` is known now: those before a jump first, then by ascending stamp.
    pub fn ready(&mut self, fixed_frame: &str) -> Vec<Joined> {
        let Self { frames, waiting, sensors, .. } = self;
        let ready = waiting.take_ready(|arrived| {
            let (frame, at) = (arrived.cloud.frame_id.as_str(), arrived.cloud.stamp);
            let found = frames.lookup(fixed_frame, frame, at)?;
            let jumped =
                sensors.get(&arrived.key()).filter(|sensor| at.jump_back_from(sensor.newest).is_some());
            let goes_on = |sensor: &&Sensor| {
                sensor.jumps == frames.jumps() && frames.way_reaches_beyond(fixed_frame, frame, at)
            };
            match jumped.filter(goes_on) {
                None => Ok(found),
                Some(&Sensor { newest, .. }) => {
                    let (fixed, sensor) = (fixed_frame.to_owned(), frame.to_owned());
                    Err(LookupError { fixed, sensor, at, lack: Lack::NotJumpedBack { newest } })
                }
            }
        });
        let joined = ready.into_iter().map(|(arrived, fixed_from_sensor)| {
            // Only a scan with a transform tells the time: a stray stamp has none.
            let jumped_back = self.jumped_back(&arrived);
            let Arrived { cloud, at, .. } = arrived;
            let scan = Scan { stamp: cloud.stamp, fixed_from_sensor, points: cloud.points };
            Joined { scan, at, total: cloud.total, invalid: cloud.invalid, jumped_back }
        });
        joined.collect()
    }

    /// Notes a scan; gives the jump where it begins a new session. Its stamp is compared with those of its own sensor alone:
    /// another may be late, or its clock off.
    fn jumped_back(&mut self, scan: &Arrived) -> Option<Jump> {
        let (key, stamp) = (scan.key(), scan.cloud.stamp);
        let newest = self.sensors.get(&key).map(|sensor| sensor.newest);
        let jump = newest.and_then(|newest| stamp.jump_back_from(newest)).map(|seconds| {
            self.sensors.clear();
            Jump { seconds, given_up: self.waiting.drop_before(scan.lap) }
        });
        if self.sensors.len() >= SENSORS {
            self.sensors.clear();
        }
        let newest = if jump.is_some() { None } else { newest };
        let newest = newest.map_or(stamp, |newest| newest.max(stamp));
        self.sensors.insert(key, Sensor { newest, jumps: self.frames.jumps() });
        jump
    }

    /// Takes the clouds that have waited for `timeout` or longer.
    pub fn expired(&mut self, now: Moment, timeout: Duration) -> Vec<Waited> {
        self.waiting.take_expired(now, timeout)
    }

    /// Takes all clouds that wait: at the end, and for a new session.
    pub fn give_up(&mut self, now: Moment) -> Vec<Waited> {
        self.waiting.take_all(now)
    }

    /// Begins a session: stamps may be any again. Gives the clouds that waited.
    pub fn begin_session(&mut self, now: Moment) -> Vec<Waited> {
        self.sensors.clear();
        self.arrived.clear();
        self.give_up(now)
    }

    /// Begins a session with a clock that has jumped back to `stamp`; transforms of after it are forgotten. Gives the clouds that waited
    /// and are from before the jump. Those that were taken after it may have come before the clock did, and wait on.
    pub fn clock_jumped_back(&mut self, stamp: Stamp, now: Moment) -> Vec<Waited> {
        self.sensors.clear();
        self.arrived.retain(|_, newest| stamp.jump_back_from(*newest).is_none());
        self.frames.forget_after(stamp);
        self.waiting.take_from_before(stamp, now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Points;
    use crate::msg::ros::{Header, Transform};

    fn at(seconds: f64) -> Stamp {
        Stamp::from_nanos((seconds * 1e9) as i64)
    }

    fn cloud(seconds: f64) -> Cloud {
        let (stamp, points) = (at(seconds), Points::F32(vec![[0.0, 0.0, 1.0]]));
        Cloud { stamp, frame_id: "camera".into(), points, total: 2, invalid: 1, out_of_range: 0 }
    }

    fn joined_with_static_camera() -> Join {
        let mut join = Join::new(4);
        let header = Header { stamp: at(0.0).into(), frame_id: "map".into() };
        let child_frame_id = "camera".to_owned();
        let transform = TransformStamped { header, child_frame_id, transform: Transform::default() };
        join.transform(&transform, true).unwrap();
        join
    }

    fn back(join: &mut Join, seconds: f64) -> Vec<Option<f64>> {
        assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
        let jumps = join.ready("map").into_iter().map(|joined| joined.jumped_back);
        jumps.map(|jump| jump.map(|jump| jump.seconds)).collect()
    }

    #[test]
    fn a_stamp_of_zero_is_none_but_of_a_simulated_clock() {
        assert_eq!(with_stamp(cloud(0.0), || false), Err(CloudError::NoStamp));
        for (seconds, is_simulated) in [(0.0, true), (1e-9, false), (-1.0, false)] {
            assert_eq!(with_stamp(cloud(seconds), || is_simulated), Ok(cloud(seconds)));
        }
    }

    #[test]
    fn with_a_clock_that_jumps_back_what_is_from_before_it_goes_and_what_is_from_after_it_waits_on() {
        let mut join = Join::new(4);
        let stamps = |waited: &[Waited]| waited.iter().map(|waited| waited.cloud.stamp).collect::<Vec<_>>();
        for (sensor, seconds) in [(0, 20.0), (1, 20.0), (1, 1.0)] {
            assert_eq!(join.cloud(sensor, cloud(seconds), Moment::default()), None);
        }
        assert_eq!(stamps(&join.clock_jumped_back(at(1.1), Moment::default())), [at(20.0); 2]);
        assert_eq!(stamps(&join.begin_session(Moment::default())), [at(1.0)]);
    }

    #[test]
    fn a_step_back_of_a_second_is_a_jump_and_less_is_not() {
        let mut join = joined_with_static_camera();
        assert_eq!(back(&mut join, 10.0), [None]);
        assert_eq!(back(&mut join, 9.1), [None]);
        assert_eq!(back(&mut join, 8.75), [Some(1.25)]);
        assert_eq!(back(&mut join, 9.0), [None]);
        assert!(join.begin_session(Moment::default()).is_empty());
        assert_eq!(back(&mut join, 1.0), [None]);
    }

    #[test]
    fn a_cloud_waits_for_its_transform_and_knows_what_it_lacks() {
        let mut join = Join::new(1);
        assert!(join.cloud(0, cloud(1.0), Moment::default()).is_none());
        assert!(join.ready("map").is_empty());
        let (frame, lacks) = join.oldest().unwrap();
        assert!(
            frame == "camera" && lacks.is_some_and(|error| matches!(error.lack, Lack::UnknownFrame { .. }))
        );
        let pushed_out = join.cloud(0, cloud(2.0), Moment::default()).unwrap();
        assert_eq!((pushed_out.cloud.stamp, join.waiting()), (at(1.0), 1));
        let joined = join.ready("camera");
        assert_eq!((joined.len(), joined[0].scan.stamp), (1, at(2.0)));
        assert_eq!((joined[0].total, joined[0].invalid), (2, 1));
    }

    fn static_camera(join: &mut Join, name: &str) {
        let header = Header { stamp: at(0.0).into(), frame_id: "map".into() };
        let transform =
            TransformStamped { header, child_frame_id: name.to_owned(), transform: Transform::default() };
        join.transform(&transform, true).unwrap();
    }

    #[test]
    fn a_sensor_that_is_late_or_whose_clock_is_off_is_no_jump() {
        let mut join = joined_with_static_camera();
        static_camera(&mut join, "other");
        for seconds in [10.0, 10.1, 10.2] {
            assert_eq!(back(&mut join, seconds), [None]);
            let late = Cloud { frame_id: "other".into(), ..cloud(seconds - 5.0) };
            assert!(join.cloud(0, late, Moment::default()).is_none());
            assert_eq!(join.ready("map")[0].jumped_back, None);
        }
    }

    #[test]
    fn two_sensors_in_one_frame_are_held_against_themselves() {
        let mut join = joined_with_static_camera();
        let jumps =
            [(0, 10.0), (1, 8.0), (0, 10.1), (1, 8.1), (0, 10.2), (1, 7.0)].map(|(sensor, seconds)| {
                assert!(join.cloud(sensor, cloud(seconds), Moment::default()).is_none());
                join.ready("map")[0].jumped_back.is_some()
            });
        assert_eq!(jumps, [false, false, false, false, false, true]);
    }

    #[test]
    fn clouds_of_two_laps_that_wait_together_stay_apart_and_the_rest_of_the_first_is_given_up() {
        let mut join = Join::new(8);
        let lost = Cloud { frame_id: "lost".into(), ..cloud(11.0) };
        let laps = [cloud(10.0), cloud(10.5), lost, cloud(5.0), cloud(5.5)];
        assert!(laps.into_iter().all(|cloud| join.cloud(0, cloud, Moment::default()).is_none()));
        static_camera(&mut join, "camera");
        let ready = join.ready("map");
        let stamps: Vec<_> = ready.iter().map(|joined| joined.scan.stamp).collect();
        assert_eq!(stamps, [10.0, 10.5, 5.0, 5.5].map(at));
        let jumps: Vec<_> = ready.iter().map(|joined| joined.jumped_back).collect();
        assert_eq!(jumps, [None, None, Some(Jump { seconds: 5.5, given_up: 1 }), None]);
        assert_eq!(join.waiting(), 0);
    }

    /// Takes in where the camera is at this time.
    fn odometry(join: &mut Join, seconds: f64, x: f64) {
        let header = Header { stamp: at(seconds).into(), frame_id: "odom".into() };
        let mut transform = Transform::default();
        transform.translation.x = x;
        join.transform(&TransformStamped { header, child_frame_id: "camera".into(), transform }, false)
            .unwrap();
    }

    /// Stamp and x of the scans that are ready, and how many of them begin a session.
    fn places(join: &mut Join) -> (Vec<(Stamp, f64)>, usize) {
        let ready = join.ready("odom");
        let jumps = ready.iter().filter(|joined| joined.jumped_back.is_some()).count();
        let place = |joined: &Joined| (joined.scan.stamp, joined.scan.fixed_from_sensor.translation.x);
        (ready.iter().map(place).collect(), jumps)
    }

    #[test]
    fn a_waiting_cloud_leaves_when_its_transform_comes_or_when_it_has_waited_too_long() {
        let mut join = Join::new(8);
        odometry(&mut join, 2.0, 4.0);
        assert!(join.cloud(0, cloud(2.5), Moment::default()).is_none());
        assert_eq!(places(&mut join), (Vec::new(), 0));
        odometry(&mut join, 3.0, 6.0);
        assert_eq!(places(&mut join), (vec![(at(2.5), 5.0)], 0));

        assert!(join.cloud(0, cloud(9.0), Moment::default()).is_none());
        assert_eq!(places(&mut join), (Vec::new(), 0));
        let [early, late] = [199, 200].map(|ms| Moment::from(Duration::from_millis(ms)));
        assert!(join.expired(early, late.wall).is_empty());
        let expired = join.expired(late, late.wall);
        assert_eq!(expired[0].lacks.as_ref().unwrap().reason().key, "tf_too_late");
    }

    #[test]
    fn after_a_jump_back_the_transforms_of_before_count_no_more() {
        let mut join = Join::new(8);
        for tenth in 0..50 {
            assert!(join.cloud(0, cloud(f64::from(tenth) * 0.1), Moment::default()).is_none());
            odometry(&mut join, f64::from(tenth) * 0.1, 0.0);
            assert_eq!(places(&mut join).0.len(), 1);
        }
        // The robot is elsewhere, and its clouds come before their transforms.
        for tenth in 20..25 {
            let seconds = f64::from(tenth) * 0.1;
            assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
            assert_eq!(places(&mut join), (Vec::new(), 0), "at {seconds} s");
            odometry(&mut join, seconds, 20.0);
            assert_eq!(places(&mut join), (vec![(at(seconds), 20.0)], usize::from(tenth == 20)));
        }
    }

    /// As localization does it, so that its transforms count until the next.
    #[test]
    fn transforms_that_are_dated_ahead_have_jumped_back_too() {
        let mut join = Join::new(8);
        let mut sessions = Vec::new();
        for seconds in [8.0, 8.1, 8.2, 8.3, 3.0, 3.1, 3.2, 3.3] {
            odometry(&mut join, seconds, 0.0);
            let header = Header { stamp: at(seconds + 1.5).into(), frame_id: "map".into() };
            let (child_frame_id, transform) = ("odom".to_owned(), Transform::default());
            join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
            assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
            let ready = join.ready("odom").into_iter();
            sessions.extend(ready.map(|joined| joined.jumped_back.is_some()));
        }
        assert_eq!(sessions, [false, false, false, false, true, false, false, false]);
    }

    #[test]
    fn a_scan_that_comes_again_late_begins_no_session_and_costs_no_other() {
        let mut join = Join::new(8);
        let mut taken = 0;
        for tenth in 0..100 {
            let seconds = f64::from(tenth) * 0.1;
            odometry(&mut join, seconds, 0.0);
            assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
            if tenth == 50 {
                assert!(join.cloud(0, cloud(2.0), Moment::default()).is_none());
            }
            let (places, jumps) = places(&mut join);
            assert_eq!(jumps, 0);
            taken += places.len();
        }
        assert_eq!((taken, join.waiting()), (100, 1));
        let why = join.oldest().unwrap().1.unwrap().to_string();
        assert!(
            why.contains("7.800 s before that of the newest scan, and the transforms have not jumped back"),
            "{why}"
        );
    }

    /// A bag in a loop beside a robot that moves.
    #[test]
    fn transforms_that_do_not_move_a_sensor_do_not_keep_its_session_from_beginning() {
        let mut join = joined_with_static_camera();
        let mut now = 1000.0;
        let laps = [0, 1].map(|_| {
            let lap = (0..40).map(|tenth| {
                now += 0.1;
                let header = Header { stamp: at(now).into(), frame_id: "base_link".into() };
                let (child_frame_id, transform) = ("wheel".to_owned(), Transform::default());
                join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
                back(&mut join, 10.0 + f64::from(tenth) * 0.1)
            });
            lap.collect::<Vec<_>>()
        });
        assert!(laps.iter().flatten().all(|ready| ready.len() == 1), "{laps:?}");
        let sessions = laps.map(|lap| lap.iter().flatten().flatten().count());
        assert_eq!(sessions, [0, 1]);
    }

    #[test]
    fn a_stray_stamp_without_a_transform_wipes_nothing() {
        let mut join = joined_with_static_camera();
        assert_eq!(back(&mut join, 10.0), [None]);
        let stray = Cloud { frame_id: "lost".into(), ..cloud(9_000.0) };
        assert!(join.cloud(0, stray, Moment::default()).is_none());
        assert_eq!(back(&mut join, 10.1), [None]);
    }
}
