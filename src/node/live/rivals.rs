//! Publishers that place one moving frame differently at the same time, as wheel odometry and a filter over it do that both send
//! `odom` to `base_link`.
//!
//! Keeps true: two that send the same are none, however late one of them is, nor is one that takes the place of another: a false
//! alarm is worse than silence. So the speed of the frame explains as much of what lies between the two as it covers in the time
//! between their stamps, and what it does not explain has to last for longer than that: what has moved and stands again by the one
//! moves by the other before.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Quaternion, UnitQuaternion};

use crate::engine::Stamp;
use crate::msg::ros::TransformStamped;
use crate::node::heard::PublisherId;
use crate::tf::MAX_FRAMES;

/// Publishers of one frame that are compared at most.
const PUBLISHERS: usize = 4;

/// Each of two publishers that send by turns sends at least once in this time.
const BY_TURNS: Duration = Duration::from_secs(1);

/// For so long two contradict each other until it is said.
const LASTS: Duration = Duration::from_secs(2);

/// Stamps further apart (s) are not compared: less than [`LASTS`], and more than localisations stamp theirs ahead.
const MOST_LAG: f64 = 1.5;

/// Less than this is no contradiction: half a voxel, and as much at the end of the range (m, rad).
const TOLERANCE: Apart = Apart { by: 0.05, turned: 0.03 };

/// How far two places of a frame lie apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Apart {
    /// Metres.
    pub(super) by: f64,
    /// Radians.
    pub(super) turned: f64,
}

impl Apart {
    const NOT: Self = Self { by: 0.0, turned: 0.0 };

    fn between(one: &Isometry3<f64>, other: &Isometry3<f64>) -> Self {
        let by = (one.translation.vector - other.translation.vector).norm();
        Self { by, turned: one.rotation.angle_to(&other.rotation) }
    }

    fn of_each(self, other: Self, combine: impl Fn(f64, f64) -> f64) -> Self {
        Self { by: combine(self.by, other.by), turned: combine(self.turned, other.turned) }
    }

    fn scaled(self, factor: f64) -> Self {
        Self { by: self.by * factor, turned: self.turned * factor }
    }
}

/// What a publisher has sent last.
#[derive(Debug)]
struct Sent {
    publisher: PublisherId,
    at: Instant,
    stamp: Stamp,
    pose: Isometry3<f64>,
    /// Of its last step, in a second.
    speed: Apart,
}

impl Sent {
    /// How far this lies from what a rival has sent, where neither the last `step` nor what the frame moves between the two stamps
    /// explains that.
    fn contradicts(&self, step: Apart, rival: &Self) -> Option<Apart> {
        let lag = self.stamp.seconds_since(rival.stamp).abs();
        let motion = self.speed.of_each(rival.speed, f64::max).scaled(lag);
        let explained =
            [step, motion].into_iter().fold(TOLERANCE, |sum, more| sum.of_each(more, |a, b| a + b));
        let apart = Apart::between(&self.pose, &rival.pose);
        let is_beyond = apart.by > explained.by || apart.turned > explained.turned;
        (lag < MOST_LAG && is_beyond).then_some(apart)
    }
}

/// Who publishes a frame.
#[derive(Debug, Default)]
struct Frame {
    /// One of each, the newest last.
    sent: Vec<Sent>,
    /// Since when two have contradicted each other.
    since: Option<Instant>,
    is_said: bool,
}

impl Frame {
    /// Takes the place of what its publisher has sent before; gives how far the two lie apart that contradict each other, where they
    /// have done so for long enough.
    fn note(
        &mut self,
        publisher: PublisherId,
        at: Instant,
        stamp: Stamp,
        pose: Isometry3<f64>,
    ) -> Option<Apart> {
        let place = self.sent.iter().position(|sent| sent.publisher == publisher);
        let own = place.and_then(|place| self.sent.get(place));
        let step = own.map_or(Apart::NOT, |own| Apart::between(&own.pose, &pose));
        let seconds = own.map_or(1.0, |own| stamp.seconds_since(own.stamp).max(1e-3));
        let sent = Sent { publisher, at, stamp, pose, speed: step.scaled(1.0 / seconds) };
        // Those after it have sent since.
        let rivals = place.and_then(|place| self.sent.get(place + 1..)).unwrap_or_default();
        let is_by_turns = own.is_some_and(|own| at.duration_since(own.at) < BY_TURNS);
        let apart = rivals.iter().filter(|_| is_by_turns).find_map(|rival| sent.contradicts(step, rival));
        if !rivals.is_empty() {
            self.since = apart.map(|_| self.since.unwrap_or(at));
        }
        self.replace(place, sent);
        apart.filter(|_| self.since.is_some_and(|since| at.duration_since(since) >= LASTS))
    }

    fn replace(&mut self, place: Option<usize>, sent: Sent) {
        if let Some(place) = place {
            self.sent.remove(place);
        } else {
            self.is_said = false;
            if self.sent.len() >= PUBLISHERS {
                self.sent.remove(0);
            }
        }
        self.sent.push(sent);
    }
}

/// Who publishes which frame that moves.
#[derive(Debug, Default)]
pub(super) struct Rivals(BTreeMap<String, Frame>);

impl Rivals {
    /// Notes a transform that moves its frame below the same parent as before and was taken in; gives how far two publishers place it
    /// apart, where they have done so for a while.
    pub(super) fn note(
        &mut self,
        publisher: PublisherId,
        transform: &TransformStamped,
        at: Instant,
    ) -> Option<Apart> {
        let (stamp, pose) = (transform.header.stamp.stamp()?, pose(transform)?);
        if self.0.len() >= MAX_FRAMES && !self.0.contains_key(&transform.child_frame_id) {
            self.0.clear();
        }
        if let Some(frame) = self.0.get_mut(&transform.child_frame_id) {
            return frame.note(publisher, at, stamp, pose);
        }
        self.0.entry(transform.child_frame_id.clone()).or_default().note(publisher, at, stamp, pose)
    }

    /// Whether it is to be said of a frame: once, until yet another publisher sends it.
    pub(super) fn is_news(&mut self, child: &str) -> bool {
        self.0.get_mut(child).is_some_and(|frame| !std::mem::replace(&mut frame.is_said, true))
    }
}

fn pose(transform: &TransformStamped) -> Option<Isometry3<f64>> {
    let (t, r) = (transform.transform.translation, transform.transform.rotation);
    let rotation = UnitQuaternion::try_new(Quaternion::new(r.w, r.x, r.y, r.z), 0.5)?;
    Some(Isometry3::from_parts([t.x, t.y, t.z].into(), rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::ros::{Header, Transform, Vector3};
    use crate::node::heard::tests::publisher;

    /// Where a publisher places the frame at a time (s), how much later than this it sends that, and how often in a second.
    struct Plays {
        number: u32,
        x: fn(f64) -> f64,
        late: f64,
        rate: f64,
        times: std::ops::Range<f64>,
    }

    fn plays(number: u32, x: fn(f64) -> f64) -> Plays {
        Plays { number, x, late: 0.0, rate: 50.0, times: 0.0..6.0 }
    }

    /// What is noted of all that these send, by the time at which it comes.
    fn noted(publishers: &[Plays]) -> Vec<(f64, Apart)> {
        let mut sent: Vec<_> = publishers
            .iter()
            .flat_map(|plays| {
                let &Plays { number, x, late, rate, ref times } = plays;
                let times = times.clone();
                // Not all at once.
                let shift = 0.003 * f64::from(number);
                let stamps = (0..).map(move |i| times.start + shift + f64::from(i) / rate);
                stamps
                    .take_while(move |stamp| *stamp < times.end)
                    .map(move |stamp| (stamp + late, stamp, number, x(stamp)))
            })
            .collect();
        sent.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut rivals, start) = (Rivals::default(), Instant::now());
        let noted = sent.into_iter().filter_map(|(at, stamp, number, x)| {
            let header =
                Header { stamp: Stamp::from_nanos((stamp * 1e9) as i64).into(), frame_id: "odom".to_owned() };
            let transform = Transform { translation: Vector3 { x, y: 0.0, z: 0.0 }, ..Transform::default() };
            let transform = TransformStamped { header, child_frame_id: "base".to_owned(), transform };
            Some((at, rivals.note(publisher(number), &transform, start + Duration::from_secs_f64(9.0 + at))?))
        });
        noted.collect()
    }

    /// Drives ahead at 1 m/s, brakes at once and stands.
    fn drives(at: f64) -> f64 {
        at.min(3.0)
    }

    /// Is faster than any robot for a moment, and stands for long.
    fn hops(at: f64) -> f64 {
        (4.0 * (at - 0.3)).clamp(0.0, 0.8) - (4.0 * (at - 3.0)).clamp(0.0, 0.8)
    }

    #[test]
    fn two_that_place_a_frame_differently_are_told_whether_it_moves_or_not() {
        let found = noted(&[plays(1, drives), plays(2, |at| drives(at) - 0.4)]);
        let (first, apart) = found[0];
        assert!(
            (2.0..2.2).contains(&first) && (0.3..0.5).contains(&apart.by) && apart.turned == 0.0,
            "{found:?}"
        );
        assert!(found.len() > 300, "{}", found.len());
        // Of a localisation that stamps a second ahead, seldom, beside another one, and of three.
        let seldom = Plays { late: -1.0, rate: 5.0, ..plays(1, |_| 0.0) };
        assert!(!noted(&[seldom, plays(2, |_| 0.2)]).is_empty());
        assert!(!noted(&[plays(1, |_| 0.0), plays(2, |_| 0.0), plays(3, |_| 0.2)]).is_empty());
    }

    #[test]
    fn two_that_send_the_same_are_none_however_late_one_is() {
        for late in [0.0, 0.02, 0.3, 1.0, 1.4, 1.9] {
            for rate in [10.0, 50.0, 300.0] {
                for x in [drives, hops] {
                    let relayed = Plays { late, rate, ..plays(2, x) };
                    assert_eq!(noted(&[plays(1, x), relayed]), [], "{late} s late at {rate} Hz");
                }
            }
        }
    }

    /// A driver that was started again begins at its origin; one that is a spare sends once in a while.
    #[test]
    fn one_that_takes_the_place_of_another_or_is_seldom_is_none() {
        let before = Plays { times: 0.0..3.0, ..plays(1, drives) };
        let after = |since| Plays { times: since..6.0, ..plays(2, |_| 0.0) };
        assert_eq!(noted(&[Plays { times: 0.0..3.0, ..plays(1, drives) }, after(3.2)]), []);
        assert_eq!(noted(&[before, after(2.5)]), [], "both for half a second");
        assert_eq!(noted(&[plays(1, |_| 0.0), Plays { rate: 0.9, ..plays(2, |_| 1.0) }]), []);
    }

    #[test]
    fn it_is_said_once_until_yet_another_publisher_comes() {
        let mut rivals = Rivals::default();
        let mut send = |number| {
            let child_frame_id = "base".to_owned();
            let transform = TransformStamped { child_frame_id, ..TransformStamped::default() };
            rivals.note(publisher(number), &transform, Instant::now());
            [(); 2].map(|()| rivals.is_news("base"))
        };
        assert_eq!([send(1), send(1), send(2)], [[true, false], [false, false], [true, false]]);
    }
}
