//! Sessions: a map, until a clock jumps back or somebody asks for an empty one.

use std::time::Instant;

use tracing::Level;

use super::Live;
use super::calls_for_map::{Call, begun};
use crate::engine::Stamp;
use crate::msg::ros::TriggerResponse;
use crate::node::clock::now;
use crate::node::throttle::say;
use crate::node::transport::{Service, Transport};
use crate::reason::SESSION_ENDED;

/// A session id that was not used before: the time of day in ns, or one more than the one before.
pub(super) fn new_session(before: u64) -> u64 {
    now().nanos().cast_unsigned().max(before + 1)
}

impl<T: Transport> Live<T> {
    pub(super) fn clock(&mut self, stamp: Stamp) {
        if let Some(back) = self.clocks.hear(stamp, Instant::now()) {
            let given_up = self.join.clock_jumped_back(stamp, self.clocks.moment());
            self.count_ended(given_up.len());
            for intake in &mut self.intakes {
                intake.newest.take_if(|newest| stamp.jump_back_from(*newest).is_some());
            }
            self.start_session(&format!("/clock has jumped back by {back:.3} s"), true);
        }
    }

    pub(super) async fn reset(&mut self, request: T::Request) {
        let given_up = self.join.begin_session(self.clocks.moment());
        self.count_ended(given_up.len());
        self.start_session("~/reset was called", false);
        let call = Call { service: Service::Reset, session: self.session, request };
        let (success, message) = match &self.calls_for_map {
            None => (true, begun(call.session)),
            Some(calls) if calls.is_full() => {
                self.save(None);
                (
                    false,
                    format!("{}; whether the saved one is forgotten is not waited for", begun(call.session)),
                )
            }
            // It is forgotten when the empty one is on the disk.
            Some(_) => return self.save(Some(call)),
        };
        self.answer(Service::Reset, call.request, TriggerResponse { success, message }).await;
    }

    /// Counts scans whose session has ended.
    pub(super) fn count_ended(&self, scans: usize) {
        (0..scans).for_each(|_| self.counts.borrow_mut().skip(SESSION_ENDED));
    }

    /// Begins a session. Nobody has asked for a jump: the map that it ends is kept, and the new one saved. A reset does the latter
    /// itself, to be answered by it.
    pub(super) fn start_session(&mut self, why: &str, is_jump: bool) {
        self.session = new_session(self.session);
        let is_kept = is_jump && self.calls_for_map.is_some();
        let thrown_away =
            if is_kept { self.worker.jump(self.session) } else { self.worker.reset(self.session) };
        self.count_ended(thrown_away);
        self.diagnosis.handed().begin_session(thrown_away);
        self.say_begun(format!("{why}: {}", begun(self.session)), is_jump);
        self.worker.request_snapshot();
        if is_jump {
            // What is given up must not come back after a crash.
            self.save(None);
        }
    }

    /// Two publishers on one topic begin a session with every other scan.
    fn say_begun(&mut self, line: String, is_jump: bool) {
        if is_jump {
            self.warn("session", format_args!("{line}"));
            self.diagnosis.jumped(line);
        } else {
            say(self.throttle.level("reset", Level::INFO), &line);
        }
    }
}
