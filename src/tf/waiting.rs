//! Scans that wait for the transform at their stamp.
//!
//! A cloud usually comes some milliseconds before the transform for its stamp, so it is never dropped on the first
//! miss. Keeps true: at most `capacity` items, or as many as when it was lowered; every item leaves exactly
//! once, as ready, pushed out, expired or taken with the rest. Time is an argument.

use std::collections::VecDeque;
use std::time::Duration;

use super::LookupError;
use crate::engine::{JUMP_BACK, Stamp};

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

/// A bounded queue of items that wait for a transform.
#[derive(Debug)]
pub struct WaitingQueue<T, E = LookupError> {
    capacity: usize,
    /// In the order of arrival. Not of stamps: after the clock has jumped back, the newest item has the oldest stamp.
    entries: VecDeque<Entry<T, E>>,
}

#[derive(Debug)]
struct Entry<T, E> {
    item: T,
    stamp: Stamp,
    frame_id: String,
    since: Moment,
    last_error: Option<E>,
}

/// An item that left without its transform.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Waited<T, E = LookupError> {
    /// The item.
    pub item: T,
    /// Its stamp.
    pub stamp: Stamp,
    /// Its frame.
    pub frame_id: String,
    /// How long it waited.
    pub waited: Duration,
    /// What its last lookup lacked, `None` if there was none.
    pub last_error: Option<E>,
}

impl<T, E> WaitingQueue<T, E> {
    /// An empty queue for `capacity` items.
    pub fn new(capacity: usize) -> Self {
        Self { capacity, entries: VecDeque::new() }
    }

    /// Lets so many items wait; where more do, a new one takes the place of the one that has waited longest until others
    /// have left.
    pub const fn set_capacity(&mut self, capacity: usize) {
        self.capacity = capacity;
    }

    /// How many items may wait.
    pub const fn capacity(&self) -> usize {
        self.capacity
    }

    /// The number of items that wait.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether no item waits.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// How long the item has waited that has waited longest; 0 where none does.
    pub fn longest_wait(&self, now: impl Into<Moment>) -> Duration {
        self.entries.front().map_or(Duration::ZERO, |entry| now.into().since(entry.since))
    }

    /// The frame of the item that has waited longest, and what its last lookup lacked.
    pub fn oldest(&self) -> Option<(&str, Option<&E>)> {
        self.entries.front().map(|entry| (entry.frame_id.as_str(), entry.last_error.as_ref()))
    }

    /// Lets `item` wait for the transform of `frame_id` at `stamp`. Gives the item that has waited longest where the
    /// queue was full.
    pub fn push(
        &mut self,
        item: T,
        stamp: Stamp,
        frame_id: String,
        now: impl Into<Moment>,
    ) -> Option<Waited<T, E>> {
        let now = now.into();
        self.entries.push_back(Entry { item, stamp, frame_id, since: now, last_error: None });
        let too_many = self.entries.len() > self.capacity;
        too_many.then(|| self.entries.pop_front())?.map(|entry| entry.waited(now))
    }

    /// Takes every item for which `lookup` now gives a transform, with that transform, by ascending stamp (of equal
    /// stamps the first to come first). The others keep waiting and remember the error.
    ///
    /// An item whose transform is still missing does not hold back later ones: they may be of another sensor.
    pub fn take_ready<R>(&mut self, mut lookup: impl FnMut(&T, &str, Stamp) -> Result<R, E>) -> Vec<(T, R)> {
        let mut ready = Vec::new();
        for mut entry in std::mem::take(&mut self.entries) {
            match lookup(&entry.item, &entry.frame_id, entry.stamp) {
                Ok(found) => ready.push((entry.stamp, entry.item, found)),
                Err(error) => {
                    entry.last_error = Some(error);
                    self.entries.push_back(entry);
                }
            }
        }
        ready.sort_by_key(|&(stamp, ..)| stamp);
        ready.into_iter().map(|(_, item, found)| (item, found)).collect()
    }

    /// Takes the items that have waited for `timeout` or longer, in the order in which they came.
    pub fn take_expired(&mut self, now: impl Into<Moment>, timeout: Duration) -> Vec<Waited<T, E>> {
        let now = now.into();
        let expired = |entry: &Entry<T, E>| now.since(entry.since) >= timeout;
        let (gone, kept): (VecDeque<_>, VecDeque<_>) =
            std::mem::take(&mut self.entries).into_iter().partition(expired);
        self.entries = kept;
        gone.into_iter().map(|entry| entry.waited(now)).collect()
    }

    /// Takes the items that `leaves` says, in the order in which they came.
    pub fn take_if(&mut self, now: impl Into<Moment>, leaves: impl Fn(&T) -> bool) -> Vec<Waited<T, E>> {
        let now = now.into();
        let (gone, kept): (VecDeque<_>, VecDeque<_>) =
            std::mem::take(&mut self.entries).into_iter().partition(|entry| leaves(&entry.item));
        self.entries = kept;
        gone.into_iter().map(|entry| entry.waited(now)).collect()
    }

    /// Takes all items, in the order in which they came: for the end, and for a clock that jumped back.
    pub fn take_all(&mut self, now: impl Into<Moment>) -> Vec<Waited<T, E>> {
        let now = now.into();
        std::mem::take(&mut self.entries).into_iter().map(|entry| entry.waited(now)).collect()
    }
}

impl<T, E> Entry<T, E> {
    fn waited(self, now: Moment) -> Waited<T, E> {
        let Self { item, stamp, frame_id, since, last_error } = self;
        Waited { item, stamp, frame_id, waited: now.since(since), last_error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Queue = WaitingQueue<char, &'static str>;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn queue(capacity: usize, stamps: &[(char, i64)]) -> Queue {
        let mut queue = Queue::new(capacity);
        for &(item, stamp) in stamps {
            assert_eq!(queue.push(item, Stamp::from_nanos(stamp), "camera".into(), ms(stamp as u64)), None);
        }
        queue
    }

    fn until(newest: i64) -> impl FnMut(&char, &str, Stamp) -> Result<i64, &'static str> {
        move |_, _, stamp| if stamp.nanos() <= newest { Ok(stamp.nanos()) } else { Err("later") }
    }

    #[test]
    fn ready_items_leave_once_by_ascending_stamp_with_their_transform() {
        let mut queue = queue(8, &[('c', 30), ('a', 10), ('d', 40), ('b', 10)]);
        assert_eq!(queue.take_ready(until(30)), [('a', 10), ('b', 10), ('c', 30)]);
        assert_eq!(queue.take_ready(until(30)), []);
        assert_eq!((queue.len(), queue.take_ready(until(40))), (1, vec![('d', 40)]));
        assert!(queue.is_empty());
    }

    #[test]
    fn an_item_without_a_transform_holds_nobody_back() {
        let mut queue = Queue::new(8);
        queue.push('a', Stamp::from_nanos(1), "lost".into(), ms(0));
        queue.push('b', Stamp::from_nanos(2), "camera".into(), ms(0));
        let ready = queue.take_ready(|_, frame, _| if frame == "camera" { Ok(()) } else { Err("unknown") });
        assert_eq!(ready, [('b', ())]);
        assert_eq!(queue.len(), 1);
    }

    #[test]
    fn a_full_queue_pushes_out_what_has_waited_longest_even_if_its_stamp_is_newer() {
        let mut queue = queue(2, &[('a', 90), ('b', 95)]);
        assert_eq!(queue.take_ready(until(0)), []);
        let out = queue.push('c', Stamp::from_nanos(1), "camera".into(), ms(100)).unwrap();
        assert_eq!((out.item, out.waited, out.last_error), ('a', ms(10), Some("later")));
        assert_eq!(queue.take_ready(until(100)), [('c', 1), ('b', 95)]);
    }

    #[test]
    fn a_queue_of_no_capacity_gives_the_item_back() {
        let out = Queue::new(0).push('a', Stamp::from_nanos(1), "camera".into(), ms(5)).unwrap();
        assert_eq!((out.item, out.waited, out.last_error), ('a', ms(0), None));
    }

    #[test]
    fn items_expire_after_the_timeout_with_their_last_error() {
        let mut queue = queue(8, &[('a', 0), ('b', 100), ('c', 150)]);
        assert_eq!(queue.take_ready(until(-1)), []);
        assert!(queue.take_expired(ms(199), ms(200)).is_empty());
        let expired = queue.take_expired(ms(300), ms(200));
        let summary: Vec<_> = expired.iter().map(|w| (w.item, w.waited, w.last_error)).collect();
        assert_eq!(summary, [('a', ms(300), Some("later")), ('b', ms(200), Some("later"))]);
        assert_eq!(queue.take_all(ms(300)).into_iter().map(|w| w.item).collect::<Vec<_>>(), ['c']);
        assert!(queue.is_empty());
    }

    #[test]
    fn what_came_just_before_a_step_of_the_simulated_clock_has_waited_by_the_other_one() {
        let moment = |wall: u64, simulated: i64| {
            let simulated = Some(Stamp::from_nanos(simulated * 1_000_000));
            Moment { wall: ms(wall), simulated }
        };
        let before_a_step = moment(1001, 5000);
        assert_eq!(moment(1040, 6000).since(before_a_step), ms(39));
        assert_eq!(moment(9000, 5100).since(before_a_step), ms(100), "a slow simulator");
        assert_eq!(moment(9000, 4000).since(before_a_step), ms(0), "one that comes late");
        assert_eq!(moment(9000, 3999).since(before_a_step), ms(7999), "one that has jumped back");
        assert_eq!(Moment::from(ms(1500)).since(before_a_step), ms(499));
    }

    #[test]
    fn a_clock_that_goes_back_expires_nothing() {
        assert!(queue(8, &[('a', 100)]).take_expired(ms(0), ms(200)).is_empty());
    }
}
