//! Clouds that wait for the transform at their stamp.
//!
//! A cloud usually comes some milliseconds before the transform for its stamp, so it is never dropped on the first
//! miss. Keeps true: at most `places` clouds, or as many as when there were more places; every cloud leaves exactly
//! once, as ready, pushed out, expired, with its lap or with all the rest. Time is an argument.

use std::collections::VecDeque;
use std::time::Duration;

use nalgebra::Isometry3;

use super::Key;
use crate::cloud::Cloud;
use crate::engine::{JUMP_BACK, Stamp};
use crate::tf::LookupError;

/// When something happens, by two clocks: one that never goes back, such as the system's monotonic one, and a simulated one
/// where there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moment {
    /// By the first, since a moment that the caller has chosen.
    pub wall: Duration,
    /// By the simulated one.
    pub simulated: Option<Stamp>,
}

impl From<Duration> for Moment {
    fn from(wall: Duration) -> Self {
        Self { wall, simulated: None }
    }
}

impl Moment {
    /// The time since `earlier`: the shorter of the time by the wall and the simulated one. A simulator that is slow or halted sends
    /// transforms late, so its own time counts; one that is fast does not make the network faster, so that of the wall does. That
    /// alone counts while the simulated clock lies more than [`JUMP_BACK`] before `earlier`.
    pub fn since(self, earlier: Self) -> Duration {
        let wall = self.wall.saturating_sub(earlier.wall);
        let simulated = self.simulated.zip(earlier.simulated).map(|(now, then)| now.seconds_since(then));
        let simulated = simulated.filter(|seconds| *seconds >= -JUMP_BACK);
        let simulated = simulated.and_then(|seconds| Duration::try_from_secs_f64(seconds.max(0.0)).ok());
        simulated.map_or(wall, |simulated| simulated.min(wall))
    }
}

/// A bounded queue of clouds that wait for a transform.
#[derive(Debug)]
pub(super) struct Waiting {
    places: usize,
    /// In the order of arrival. Not of stamps: after the clock has jumped back, the newest cloud has the oldest stamp.
    clouds: VecDeque<Arrived>,
}

/// A cloud of a sensor, and its lap.
#[derive(Debug)]
pub(super) struct Arrived {
    pub(super) sensor: usize,
    pub(super) cloud: Cloud,
    pub(super) lap: u64,
    pub(super) at: Moment,
    /// What its last lookup lacked, of all that was covered since it came; `None` if there was none.
    pub(super) lacks: Option<LookupError>,
}

/// A cloud that left without its transform.
#[derive(Clone, Debug, PartialEq)]
pub struct Waited {
    /// The sensor that it is of, as in [`Join::cloud`](super::Join::cloud).
    pub sensor: usize,
    /// The cloud.
    pub cloud: Cloud,
    /// How long it waited.
    pub waited: Duration,
    /// What its last lookup lacked, `None` if there was none.
    pub lacks: Option<LookupError>,
}

impl Waiting {
    /// An empty queue with so many places.
    pub(super) const fn new(places: usize) -> Self {
        Self { places, clouds: VecDeque::new() }
    }

    /// Lets so many clouds wait; see [`Join::set_places`](super::Join::set_places).
    pub(super) const fn set_places(&mut self, places: usize) {
        self.places = places;
    }

    /// How many clouds may wait.
    pub(super) const fn places(&self) -> usize {
        self.places
    }

    /// The number of clouds that wait.
    pub(super) fn len(&self) -> usize {
        self.clouds.len()
    }

    /// Whether no cloud waits.
    pub(super) fn is_empty(&self) -> bool {
        self.clouds.is_empty()
    }

    /// How long the cloud has waited that has waited longest; 0 where none does.
    pub(super) fn longest_wait(&self, now: Moment) -> Duration {
        self.clouds.front().map_or(Duration::ZERO, |arrived| now.since(arrived.at))
    }

    /// The frame of the cloud that has waited longest, and what its last lookup lacked.
    pub(super) fn oldest(&self) -> Option<(&str, Option<&LookupError>)> {
        self.clouds.front().map(|arrived| (arrived.cloud.frame_id.as_str(), arrived.lacks.as_ref()))
    }

    /// Lets a cloud wait for its transform. Gives the one that has waited longest where there was no place.
    pub(super) fn push(&mut self, arrived: Arrived) -> Option<Waited> {
        let now = arrived.at;
        self.clouds.push_back(arrived);
        let too_many = self.clouds.len() > self.places;
        too_many.then(|| self.clouds.pop_front())?.map(|arrived| arrived.give_up(now))
    }

    /// Takes every cloud for which `lookup` now gives a transform, with that transform: those of earlier laps first, then by
    /// ascending stamp (of equal stamps the first to come first). The others keep waiting and remember the error.
    ///
    /// A cloud whose transform is still missing does not hold back later ones: they may be of another sensor.
    pub(super) fn take_ready(
        &mut self,
        mut lookup: impl FnMut(&Arrived) -> Result<Isometry3<f64>, LookupError>,
    ) -> Vec<(Arrived, Isometry3<f64>)> {
        let mut ready = Vec::new();
        for mut arrived in std::mem::take(&mut self.clouds) {
            match lookup(&arrived) {
                Ok(found) => ready.push((arrived, found)),
                Err(mut error) => {
                    if let Some(before) = &arrived.lacks {
                        error.keep_start(before);
                    }
                    arrived.lacks = Some(error);
                    self.clouds.push_back(arrived);
                }
            }
        }
        ready.sort_by_key(|(arrived, _)| (arrived.lap, arrived.cloud.stamp));
        ready
    }

    /// Takes the clouds that have waited for `timeout` or longer, in the order in which they came.
    pub(super) fn take_expired(&mut self, now: Moment, timeout: Duration) -> Vec<Waited> {
        self.take(now, |arrived| now.since(arrived.at) >= timeout)
    }

    /// Takes the clouds from before a jump back to `stamp`, in the order in which they came.
    pub(super) fn take_from_before(&mut self, stamp: Stamp, now: Moment) -> Vec<Waited> {
        self.take(now, |arrived| stamp.jump_back_from(arrived.cloud.stamp).is_some())
    }

    fn take(&mut self, now: Moment, goes: impl Fn(&Arrived) -> bool) -> Vec<Waited> {
        let (gone, kept): (VecDeque<_>, VecDeque<_>) =
            std::mem::take(&mut self.clouds).into_iter().partition(goes);
        self.clouds = kept;
        gone.into_iter().map(|arrived| arrived.give_up(now)).collect()
    }

    /// Drops these clouds; says how many there were.
    pub(super) fn drop_where(&mut self, goes: impl Fn(&Arrived) -> bool) -> usize {
        let before = self.clouds.len();
        self.clouds.retain(|arrived| !goes(arrived));
        before - self.clouds.len()
    }

    /// Takes all clouds, in the order in which they came.
    pub(super) fn take_all(&mut self, now: Moment) -> Vec<Waited> {
        std::mem::take(&mut self.clouds).into_iter().map(|arrived| arrived.give_up(now)).collect()
    }
}

impl Arrived {
    pub(super) fn key(&self) -> Key {
        (self.cloud.frame_id.clone(), self.sensor)
    }

    fn give_up(self, now: Moment) -> Waited {
        let Self { sensor, cloud, at, lacks, .. } = self;
        Waited { sensor, cloud, waited: now.since(at), lacks }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Points;
    use crate::tf::Lack;

    fn ms(ms: u64) -> Moment {
        Duration::from_millis(ms).into()
    }

    /// A cloud that was taken at this time (ns) and comes after as many milliseconds.
    fn arrived(sensor: usize, stamp: i64) -> Arrived {
        let (frame_id, points) = ("camera".to_owned(), Points::F32(Vec::new()));
        let stamp = Stamp::from_nanos(stamp);
        let cloud = Cloud { stamp, frame_id, points, total: 0, invalid: 0, out_of_range: 0 };
        Arrived { sensor, cloud, lap: 0, at: ms(stamp.nanos() as u64), lacks: None }
    }

    /// Clouds of sensors 0, 1 and so on, which were taken at these times (ns).
    fn waiting(places: usize, stamps: &[i64]) -> Waiting {
        let mut waiting = Waiting::new(places);
        for (sensor, &stamp) in stamps.iter().enumerate() {
            assert_eq!(waiting.push(arrived(sensor, stamp)), None);
        }
        waiting
    }

    /// What a cloud lacks whose transform comes later.
    fn later(arrived: &Arrived) -> LookupError {
        let (fixed, sensor) = ("odom".to_owned(), arrived.cloud.frame_id.clone());
        let lack = Lack::UnknownFrame { frame: fixed.clone() };
        LookupError { fixed, sensor, at: arrived.cloud.stamp, lack }
    }

    /// Takes what is ready where the way is known up to a time (ns): the sensors, and the x of the transforms, which is the stamp.
    fn ready(waiting: &mut Waiting, newest: i64) -> Vec<(usize, f64)> {
        let ready = waiting.take_ready(|arrived| {
            let nanos = arrived.cloud.stamp.nanos();
            let found = Isometry3::translation(nanos as f64, 0.0, 0.0);
            if nanos <= newest { Ok(found) } else { Err(later(arrived)) }
        });
        ready.into_iter().map(|(arrived, found)| (arrived.sensor, found.translation.x)).collect()
    }

    #[test]
    fn ready_clouds_leave_once_by_ascending_stamp_with_their_transform() {
        let mut waiting = waiting(8, &[30, 10, 40, 10]);
        assert_eq!(ready(&mut waiting, 30), [(1, 10.0), (3, 10.0), (0, 30.0)]);
        assert!(ready(&mut waiting, 30).is_empty());
        assert_eq!((waiting.len(), ready(&mut waiting, 40)), (1, vec![(2, 40.0)]));
        assert!(waiting.is_empty());
    }

    #[test]
    fn clouds_of_earlier_laps_are_ready_first_and_those_that_are_not_can_be_dropped_with_their_lap() {
        let mut waiting = waiting(8, &[30, 50]);
        for (sensor, stamp) in [(2, 20), (3, 60), (4, 10)] {
            assert_eq!(waiting.push(Arrived { lap: 1, ..arrived(sensor, stamp) }), None);
        }
        assert_eq!(ready(&mut waiting, 30), [(0, 30.0), (4, 10.0), (2, 20.0)]);
        let mut drop_first = || waiting.drop_where(|arrived| arrived.lap < 1);
        assert_eq!((drop_first(), drop_first()), (1, 0));
        assert_eq!(ready(&mut waiting, 60), [(3, 60.0)]);
    }

    #[test]
    fn a_cloud_without_a_transform_holds_nobody_back() {
        let mut waiting = Waiting::new(8);
        let mut lost = arrived(0, 1);
        lost.cloud.frame_id = "lost".to_owned();
        for arrived in [lost, arrived(1, 2)] {
            assert_eq!(waiting.push(arrived), None);
        }
        let ready = waiting.take_ready(|arrived| {
            let is_known = arrived.cloud.frame_id == "camera";
            if is_known { Ok(Isometry3::identity()) } else { Err(later(arrived)) }
        });
        assert_eq!(ready.iter().map(|(arrived, _)| arrived.sensor).collect::<Vec<_>>(), [1]);
        let (frame, lacks) = waiting.oldest().unwrap();
        assert_eq!(
            (waiting.len(), frame, lacks.map(|lacks| lacks.sensor.as_str())),
            (1, "lost", Some("lost"))
        );
    }

    #[test]
    fn a_full_queue_pushes_out_what_has_waited_longest_even_if_its_stamp_is_newer() {
        let mut waiting = waiting(2, &[90, 95]);
        assert!(ready(&mut waiting, 0).is_empty());
        let out = waiting.push(Arrived { at: ms(100), ..arrived(2, 1) }).unwrap();
        let Arrived { cloud, .. } = arrived(0, 90);
        let lacks = Some(later(&arrived(0, 90)));
        assert_eq!(out, Waited { sensor: 0, cloud, waited: Duration::from_millis(10), lacks });
        assert_eq!(ready(&mut waiting, 100), [(2, 1.0), (1, 95.0)]);
    }

    #[test]
    fn a_queue_of_no_places_gives_the_cloud_back() {
        let out = Waiting::new(0).push(arrived(3, 5)).unwrap();
        let cloud = arrived(3, 5).cloud;
        assert_eq!(out, Waited { sensor: 3, cloud, waited: Duration::ZERO, lacks: None });
    }

    #[test]
    fn clouds_expire_after_the_timeout_with_what_they_lack() {
        let mut waiting = waiting(8, &[0, 100, 150]);
        assert!(ready(&mut waiting, -1).is_empty());
        let timeout = Duration::from_millis(200);
        assert!(waiting.take_expired(ms(199), timeout).is_empty());
        assert_eq!(waiting.longest_wait(ms(300)), Duration::from_millis(300));
        let waited = |sensor: usize, stamp: i64, waited: u64| {
            let arrived = arrived(sensor, stamp);
            let lacks = Some(later(&arrived));
            Waited { sensor, cloud: arrived.cloud, waited: Duration::from_millis(waited), lacks }
        };
        assert_eq!(waiting.take_expired(ms(300), timeout), [waited(0, 0, 300), waited(1, 100, 200)]);
        assert_eq!(waiting.take_all(ms(300)), [waited(2, 150, 150)]);
        assert!(waiting.is_empty());
    }

    #[test]
    fn what_came_just_before_a_step_of_the_simulated_clock_has_waited_by_the_other_one() {
        let moment = |wall: u64, simulated: i64| {
            let simulated = Some(Stamp::from_nanos(simulated * 1_000_000));
            Moment { simulated, ..ms(wall) }
        };
        let before_a_step = moment(1001, 5000);
        let since = |now: Moment| now.since(before_a_step);
        let long = Duration::from_millis;
        assert_eq!(since(moment(1040, 6000)), long(39));
        assert_eq!(since(moment(9000, 5100)), long(100), "a slow simulator");
        assert_eq!(since(moment(9000, 4000)), long(0), "one that comes late");
        assert_eq!(since(moment(9000, 3999)), long(7999), "one that has jumped back");
        assert_eq!(since(ms(1500)), long(499));
    }

    #[test]
    fn a_clock_that_goes_back_expires_nothing() {
        assert!(waiting(8, &[100]).take_expired(ms(0), Duration::from_millis(200)).is_empty());
    }
}
