//! When what a result bag holds is logged.
//!
//! Results are logged by their stamps, the input at the times of its recording. Only a new session moves either: what comes after a
//! jump back is logged after what was before it, and input and results lie to each other as in the first session. Its results
//! come after the newest one before, which may be that of a sensor whose clock is ahead of that of the one that jumps back.
//!
//! In a bag in a loop the times of recording may jump back as well. That shows before the session does, for a scan waits for its
//! transforms: so input that comes after a step back is held back until it is known whether it is of a new session. Messages out of
//! order, of which there is no session, keep their times.

use std::collections::BTreeMap;
use std::time::Duration;

use super::read::Message;
use crate::engine::{JUMP_BACK, Stamp};

/// From where on a step back of the times of recording may be that of a lap (ns).
const BACK: u64 = (JUMP_BACK * 1e9) as u64;

/// Bytes of input that are held back at most.
const MOST_HELD: usize = 64 << 20;

/// What a message takes beside its bytes.
const MESSAGE: usize = 128;

/// When results and input are logged.
#[derive(Debug, Default)]
pub(super) struct Clock {
    /// Added to the stamps of results (ns).
    ahead: u64,
    /// Added to the times of recording (ns).
    input_ahead: i64,
    /// The input was recorded by another clock than that of the stamps.
    follows: bool,
    /// How long after its stamp the first scan of each sensor is logged (ns). What first comes with a later session is taken to lie
    /// as it should.
    lags: BTreeMap<usize, i64>,
    /// A session has begun, and its first scan is still to come.
    is_new: bool,
    /// When the message before was recorded.
    last: u64,
    /// When the newest message of the input is logged.
    newest: u64,
    /// When the newest result is logged.
    newest_result: u64,
    step: Option<Step>,
}

/// A step back of the times of recording of which it is not known yet what it means.
#[derive(Debug)]
struct Step {
    /// When the message before it was recorded.
    before: u64,
    /// The earliest time since then.
    earliest: u64,
    held: Vec<Message>,
    /// What these take.
    bytes: usize,
}

impl Step {
    /// Whether what was recorded then lies behind the step.
    fn is_behind(&self, recorded: u64) -> bool {
        recorded.saturating_add(BACK) < self.before
    }
}

/// A clock of ROS has 63 bits: a time beyond them is copied as it is, and moves nothing.
fn is_time(recorded: u64) -> bool {
    i64::try_from(recorded).is_ok()
}

impl Clock {
    /// See [`super::ResultBag::follow_stamps`].
    pub(super) const fn follow_stamps(&mut self, offset: i64) {
        (self.follows, self.input_ahead) = (true, offset);
    }

    /// When a result of this stamp is logged.
    pub(super) fn result(&mut self, stamp: Stamp) -> u64 {
        let logged = self.of_result(stamp);
        self.newest_result = self.newest_result.max(logged);
        logged
    }

    fn of_result(&self, stamp: Stamp) -> u64 {
        unmoved(stamp).saturating_add(self.ahead)
    }

    /// A session begins: the stamps have jumped back by this many seconds.
    pub(super) fn begin_session(&mut self, seconds: f64) {
        self.ahead = self.ahead.saturating_add((seconds * 1e9) as u64);
        self.is_new = true;
    }

    /// A scan of this sensor, of this stamp, was recorded at this time. Gives what of the input was held back and is to be logged.
    pub(super) fn scan(&mut self, sensor: usize, stamp: Stamp, recorded: Duration) -> Vec<Message> {
        let begins = std::mem::take(&mut self.is_new);
        let recorded = u64::try_from(recorded.as_nanos()).unwrap_or(u64::MAX);
        if !self.follows && is_time(recorded) {
            self.meet(sensor, stamp, recorded, begins);
        }
        if begins {
            self.go_on_after_results(stamp);
        }
        if let (true, Ok(recorded)) = (self.follows, i64::try_from(recorded)) {
            self.input_ahead = self.moved(stamp).saturating_sub(recorded);
        }
        let is_known = begins || self.step.as_ref().is_some_and(|step| step.is_behind(recorded));
        if is_known { self.release() } else { Vec::new() }
    }

    /// Moves whichever is behind, input or results, where a session begins.
    fn meet(&mut self, sensor: usize, stamp: Stamp, recorded: u64, begins: bool) {
        if begins {
            self.go_on_after_a_step_back(recorded);
        }
        let logged = i64::try_from(self.shifted(recorded)).unwrap_or(i64::MAX);
        let late = logged.saturating_sub(self.moved(stamp));
        let lag = *self.lags.entry(sensor).or_insert(late);
        if begins {
            let more = late.saturating_sub(lag);
            self.ahead = self.ahead.saturating_add(u64::try_from(more).unwrap_or(0));
            self.input_ahead = self.input_ahead.saturating_sub(more.min(0));
        }
    }

    /// Lets the input of a session whose first scan was recorded at this time come after all before, where it would not.
    fn go_on_after_a_step_back(&mut self, recorded: u64) {
        let (before, earliest) =
            self.step.as_ref().map_or((self.last, recorded), |it| (it.before, it.earliest));
        if recorded.saturating_add(BACK) < before {
            let back = self.newest.saturating_sub(self.shifted(earliest.min(recorded)));
            self.input_ahead = self.input_ahead.saturating_add_unsigned(back);
        }
    }

    /// Lets the results of a session whose first scan has this stamp come after all results before, where they would not; its input
    /// goes with them. Results are logged by the newest stamp of their session, so none comes before that of its first scan.
    fn go_on_after_results(&mut self, stamp: Stamp) {
        let back = self.newest_result.saturating_sub(self.of_result(stamp));
        self.ahead = self.ahead.saturating_add(back);
        self.input_ahead = self.input_ahead.saturating_add_unsigned(back);
    }

    /// A message of the input was recorded at this time. Gives what was held back before it and is to be logged first.
    pub(super) fn message(&mut self, recorded: u64) -> Vec<Message> {
        if !is_time(recorded) {
            return Vec::new();
        }
        let last = std::mem::replace(&mut self.last, recorded);
        match &mut self.step {
            Some(step) if step.is_behind(recorded) => step.earliest = step.earliest.min(recorded),
            // In a lap it takes all of it to come back to where the one before has ended.
            Some(_) => return self.release(),
            None if recorded.saturating_add(BACK) < last => {
                let (before, earliest) = (last, recorded);
                self.step = Some(Step { before, earliest, held: Vec::new(), bytes: 0 });
            }
            None => {}
        }
        Vec::new()
    }

    /// Holds a message back, where it is not known yet when it is logged; gives it back where it is to be logged as it comes.
    pub(super) fn hold<'a>(&mut self, message: &'a Message) -> Option<&'a Message> {
        let step = self.step.as_mut().filter(|_| is_time(message.log_time));
        let Some(step) = step.filter(|step| step.bytes < MOST_HELD) else { return Some(message) };
        step.bytes += message.data.len() + MESSAGE;
        step.held.push(message.clone());
        None
    }

    /// What is held back.
    pub(super) fn release(&mut self) -> Vec<Message> {
        self.step.take().map_or_else(Vec::new, |step| step.held)
    }

    /// When a message of the input is logged that was recorded at this time.
    pub(super) fn logged(&mut self, recorded: u64) -> u64 {
        if !is_time(recorded) {
            return recorded;
        }
        let logged = self.shifted(recorded);
        self.newest = self.newest.max(logged);
        logged
    }

    /// A stamp with what is added to it, also where that lies before 1970.
    const fn moved(&self, stamp: Stamp) -> i64 {
        stamp.nanos().saturating_add_unsigned(self.ahead)
    }

    const fn shifted(&self, recorded: u64) -> u64 {
        recorded.saturating_add_signed(self.input_ahead)
    }
}

/// When a result of this stamp is logged where nothing moves it.
pub(super) fn unmoved(stamp: Stamp) -> u64 {
    u64::try_from(stamp.nanos()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::sync::Arc;

    use super::*;

    fn message(log_time: u64, bytes: usize) -> Message {
        let channel = mcap::Channel {
            id: 1,
            topic: "/tf".to_owned(),
            schema: None,
            message_encoding: "cdr".to_owned(),
            metadata: BTreeMap::new(),
        };
        let (channel, data) = (Arc::new(channel), vec![0; bytes]);
        Message { channel, log_time, publish_time: log_time, sequence: 0, data, damage: None }
    }

    /// Times in ns; those of recording jump back by 90 s with the stamps, or do not.
    #[test]
    fn what_lies_behind_a_step_back_waits_until_it_is_known_whether_a_session_begins() {
        const SECOND: u64 = 1_000_000_000;
        for (begins, logged) in [(true, 100), (false, 10)] {
            let mut clock = Clock::default();
            assert!(clock.message(100 * SECOND).is_empty());
            assert_eq!(clock.logged(100 * SECOND), 100 * SECOND);
            let behind = message(10 * SECOND, 9);
            assert!(clock.message(behind.log_time).is_empty() && clock.hold(&behind).is_none());
            // One that no clock of ROS can tell says nothing of order.
            let beyond = message(u64::MAX, 9);
            assert!(clock.message(beyond.log_time).is_empty() && clock.hold(&beyond).is_some());
            // A scan that was recorded before the step does not tell.
            let scan =
                |seconds: u64| (Stamp::from_nanos((seconds * SECOND) as i64), Duration::from_secs(seconds));
            let (stamp, recorded) = scan(100);
            assert!(clock.scan(0, stamp, recorded).is_empty());
            if begins {
                clock.begin_session(90.0);
            }
            let (stamp, recorded) = scan(10);
            assert_eq!(clock.scan(0, stamp, recorded), [behind]);
            assert_eq!((clock.logged(10 * SECOND), clock.logged(u64::MAX)), (logged * SECOND, u64::MAX));
            assert_eq!(clock.result(Stamp::default()), (logged - 10) * SECOND);
        }
    }

    #[test]
    fn what_is_held_back_is_bounded_and_what_is_beyond_keeps_its_time() {
        let mut clock = Clock::default();
        clock.message(u64::MAX / 4);
        let large = message(7, MOST_HELD / 2);
        let held = (0..9).filter(|_| {
            assert!(clock.message(large.log_time).is_empty());
            clock.hold(&large).is_none()
        });
        assert_eq!(held.count(), 2);
        assert_eq!(clock.release().len(), 2);
    }
}
