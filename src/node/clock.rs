//! The time of day: the only place that asks for it; and the time that `/clock` tells.

use std::time::{SystemTime, UNIX_EPOCH};

use super::parameters::Parameters;
use super::transport::Event;
use crate::engine::Stamp;
use crate::msg::ros::Clock;

/// Now; the epoch where the machine's clock is before it.
pub(super) fn now() -> Stamp {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX))
}

/// What a message on `/clock` says.
pub(super) fn event<R>(clock: Clock, parameters: &Parameters) -> Event<R> {
    let Some(stamp) = clock.clock.stamp() else {
        let text = format!("{} ns in a second", clock.clock.nanosec);
        return Event::Garbled { topic: "/clock".into(), text };
    };
    parameters.note_clock(stamp);
    Event::Clock(stamp)
}
