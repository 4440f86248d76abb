//! Sessions: a map, until a clock jumps back or somebody asks for an empty one.

use std::fmt;
use std::time::Instant;

use tracing::Level;

use super::Live;
use super::calls_for_map::{Call, begun};
use crate::engine::Stamp;
use crate::msg::ros::TriggerResponse;
use crate::node::clock::now;
use crate::node::throttle::log;
use crate::node::transport::{Service, Transport};
use crate::reason::SESSION_ENDED;

/// A session id that was not used before: the time of day in ns, or one more than the one before.
pub(super) fn new_session(before: u64) -> u64 {
    now().nanos().cast_unsigned().max(before + 1)
}

/// Why a session begins.
#[derive(Clone, Copy, Debug)]
pub(super) enum Cause {
    /// Somebody has called for it.
    Reset,
    /// Scans have jumped back by so many seconds.
    ScansJumped(f64),
    /// The simulated clock has jumped back by so many seconds.
    ClockJumped(f64),
}

impl Cause {
    /// Whether nobody has asked for it.
    const fn is_jump(self) -> bool {
        !matches!(self, Self::Reset)
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Reset => write!(f, "~/reset was called"),
            Self::ScansJumped(back) => write!(f, "the stamps of the scans have jumped back by {back:.3} s"),
            Self::ClockJumped(back) => write!(f, "/clock has jumped back by {back:.3} s"),
        }
    }
}

impl<T: Transport> Live<T> {
    pub(super) fn clock(&mut self, stamp: Stamp) {
        if let Some(back) = self.clocks.hear(stamp, Instant::now()) {
            let given_up = self.join.clock_jumped_back(stamp, self.clocks.moment());
            self.count_ended(given_up.len());
            for intake in &mut self.intakes {
                intake.newest.take_if(|newest| stamp.jump_back_from(*newest).is_some());
            }
            self.start_session(Cause::ClockJumped(back));
        }
    }

    pub(super) async fn reset(&mut self, request: T::Request) {
        let given_up = self.join.begin_session(self.clocks.moment());
        self.count_ended(given_up.len());
        self.start_session(Cause::Reset);
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

    /// Begins a session. At a jump the map that it ends is kept, where maps are saved, for nobody has asked to lose it; and the new,
    /// empty one is saved. A reset asks for the latter itself, for its call is answered by that.
    pub(super) fn start_session(&mut self, cause: Cause) {
        self.session = new_session(self.session);
        let keeps_map = cause.is_jump() && self.calls_for_map.is_some();
        let thrown_away = if keeps_map {
            self.worker.reset_and_keep(self.session)
        } else {
            self.worker.reset(self.session)
        };
        self.count_ended(thrown_away);
        self.say_begun(cause);
        self.worker.request_snapshot();
        if cause.is_jump() {
            // What is given up must not come back after a crash.
            self.save(None);
        }
    }

    /// Two publishers on one topic begin a session with every other scan.
    fn say_begun(&mut self, cause: Cause) {
        let line = format!("{cause}: {}", begun(self.session));
        if cause.is_jump() {
            self.warn("session", format_args!("{line}"));
            self.diagnosis.jumped(line);
        } else {
            log(self.throttle.level_now("reset", Level::INFO), &line);
        }
    }
}
