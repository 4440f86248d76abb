//! Clouds and transforms to scans: the path that the live node and a replay have in common.
//!
//! A cloud waits for the transform at its stamp; a scan whose stamp jumps back begins a new session. Keeps true: a lap (`laps`)
//! begins one session at most, whichever sensor's scan is ready first, and what it gives up is from before that lap. No clock
//! inside: time is an argument.

mod hint;
mod laps;
mod riding;
mod waiting;

use std::collections::BTreeMap;
use std::time::Duration;

use crate::cloud::{Cloud, CloudError, Decoded};
use crate::engine::{Scan, Stamp};
use crate::msg::ros::TransformStamped;
use crate::tf::{FrameError, Frames, Inserted, Lack, LookupError};

pub use hint::{GivenUp, TransformsFrom};
pub use waiting::{Moment, Waited};

use laps::Laps;
use riding::Riding;
use waiting::{Arrived, Waiting};

/// Pairs of a frame and a sensor that are remembered at most: a sender can make up ever new frames.
const SENSORS: usize = 1000;

/// Frames of REP 105 that stand still.
const MAPS: [&str; 4] = ["odom", "map", "world", "earth"];

/// Frames of a robot's body (REP 105, REP 120), whose origin is on the ground or near it.
const BODIES: [&str; 3] = ["base_link", "base_footprint", "base_stabilized"];

/// Whether a frame is one of [`MAPS`] by its name.
fn is_map(frame: &str) -> bool {
    MAPS.contains(&own_name(frame))
}

/// A frame's name without that of its robot, of several: `odom` of `robot1/odom`.
fn own_name(frame: &str) -> &str {
    frame.rsplit('/').next().unwrap_or_default()
}

/// Joins clouds with their transforms.
#[derive(Debug)]
pub struct Join {
    frames: Frames,
    waiting: Waiting,
    /// The oldest stamp of a cloud that has come since none waited: none that waits is older.
    waits_since: Stamp,
    /// Of all clouds that have come.
    laps: Laps,
    /// The lap that began this session.
    session: u64,
    /// What this session has had.
    sensors: BTreeMap<Key, Sensor>,
    /// Where the fixed frame may move, and the sensor with it.
    riding: Option<Riding>,
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
pub fn with_stamp(cloud: Cloud, is_simulated: impl FnOnce() -> bool) -> Decoded {
    if cloud.stamp.nanos() != 0 || is_simulated() { Ok(cloud) } else { Err(CloudError::NoStamp) }
}

/// A cloud whose transform is known.
#[derive(Clone, Debug)]
pub struct Joined {
    /// For the engine.
    pub scan: Scan,
    /// The sensor that it is of, as in [`Join::cloud`].
    pub sensor: usize,
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
            laps: Laps::default(),
            session: 0,
            sensors: BTreeMap::new(),
            riding: None,
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
        oldest.into_iter().chain(self.laps.sensors().map(|(frame, _)| frame.as_str()))
    }

    /// Which sensor has sent clouds in this frame.
    pub fn sensor_in(&self, frame: &str) -> Option<usize> {
        self.laps.sensors().find(|(known, _)| known == frame).map(|(_, sensor)| *sensor)
    }

    /// A warning of clouds whose frame is no sensor's: one that stands still while something moves below it, or the robot's body. The
    /// engine takes its origin for the place from which they were seen. `None` where it may well be that.
    pub fn without_viewpoint(&self, frame: &str, fixed_frame: &str) -> Option<String> {
        let is_body = BODIES.contains(&own_name(frame));
        (is_body || self.is_of_no_sensor(frame, fixed_frame)).then(|| {
            format!(
                "clouds come in `{frame}`, so that nobody knows where the sensor stood: min_range, max_range, keep_radius, clearing and \
                 the side from which a surface is seen go by that frame's origin, and floors and table tops can come out as ceilings; \
                 the driver's own cloud is in the sensor's frame"
            )
        })
    }

    /// Whether something moves below this frame, and it is the fixed one, one above it, or one with the name of a map (REP 105).
    fn is_of_no_sensor(&self, frame: &str, fixed_frame: &str) -> bool {
        (is_map(frame) || self.frames.is_above(frame, fixed_frame)) && self.frames.moves_below(frame)
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
        // Clouds before a jump and after it must not be sorted together, and the stamps alone do not tell them apart.
        let lap = self.laps.arrive((cloud.frame_id.clone(), sensor), stamp);
        let is_alone = self.waiting.is_empty();
        self.waits_since = if is_alone { stamp } else { self.waits_since.min(stamp) };
        self.waiting.push(Arrived { sensor, cloud, lap, at: now, lacks: None })
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
            let Arrived { sensor, cloud, at, .. } = arrived;
            let scan = Scan { stamp: cloud.stamp, fixed_from_sensor, points: cloud.points };
            Joined { scan, sensor, at, total: cloud.total, invalid: cloud.invalid, jumped_back }
        });
        joined.collect()
    }

    /// Notes a scan; gives the jump where it begins a new session. Its stamp is compared with those of its own sensor alone:
    /// another may be late, or its clock off.
    fn jumped_back(&mut self, scan: &Arrived) -> Option<Jump> {
        // Late, from before the jump that began this session: the sensor's first from after it would seem to jump from here.
        if scan.lap < self.session {
            return None;
        }
        let (key, stamp) = (scan.key(), scan.cloud.stamp);
        let newest = self.sensors.get(&key).map(|sensor| sensor.newest);
        let jump = newest.and_then(|newest| stamp.jump_back_from(newest)).map(|seconds| {
            self.enter(scan.lap);
            Jump { seconds, given_up: self.drop_before(scan) }
        });
        if self.sensors.len() >= SENSORS {
            self.sensors.clear();
        }
        let newest = if jump.is_some() { None } else { newest };
        let newest = newest.map_or(stamp, |newest| newest.max(stamp));
        self.sensors.insert(key, Sensor { newest, jumps: self.frames.jumps() });
        jump
    }

    /// Begins a session in this lap.
    fn enter(&mut self, lap: u64) {
        self.sensors.clear();
        self.session = lap;
    }

    /// Drops the clouds from before the lap that this scan begins; says how many there were. Of a sensor that is not in that lap yet,
    /// they are those whose stamps lie where the scan's has jumped back from: a sensor that sends once a lap is never seen to jump.
    fn drop_before(&mut self, scan: &Arrived) -> usize {
        let Self { laps, waiting, .. } = self;
        waiting.drop_where(|other| {
            let is_there_too = || laps.of(&other.key()).is_some_and(|lap| lap >= scan.lap);
            let is_after = || scan.cloud.stamp.jump_back_from(other.cloud.stamp).is_some();
            other.lap < scan.lap && (is_there_too() || is_after())
        })
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
        self.enter(self.laps.newest());
        self.laps.forget();
        self.give_up(now)
    }

    /// Begins a session with a clock that has jumped back to `stamp`; transforms of after it are forgotten. Gives the clouds that waited
    /// and are from before the jump. Those that were taken after it may have come before the clock did, and wait on.
    pub fn clock_jumped_back(&mut self, stamp: Stamp, now: Moment) -> Vec<Waited> {
        self.enter(self.laps.newest());
        self.laps.forget_before(stamp);
        self.frames.forget_after(stamp);
        self.waiting.take_from_before(stamp, now)
    }
}

#[cfg(test)]
mod tests;
