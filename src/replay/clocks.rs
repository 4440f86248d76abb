//! The two clocks of a bag: the one by which its messages are stamped, and the one by which they were recorded.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::bag::{Bag, Decoder, Recorded};

/// Scans that are looked at: the stamp of one alone may be a stray.
const FIRST: usize = 9;

/// From how far apart on they are two clocks (ns), a minute: scans are late by seconds at most, and a clock that counts from the
/// start of a simulator or a driver is off by years.
const APART: u64 = 60_000_000_000;

/// How far the stamps of the scans lie after the times at which they were recorded (ns), by the median of the first few, read
/// up to `stop`; `None` where both are of one clock.
pub fn clock_offset(bag: &Bag, mut decoder: Decoder, stop: &AtomicBool) -> Option<i64> {
    let messages = bag.messages().map_while(Result::ok).take_while(|_| !stop.load(Ordering::Relaxed));
    let scans = messages.flat_map(|message| {
        let clouds = decoder.decode(&message).into_iter().filter_map(|recorded| match recorded {
            Recorded::Cloud(Ok(cloud)) => Some(cloud.stamp.nanos()),
            _ => None,
        });
        let recorded = i64::try_from(message.log_time).ok();
        clouds.filter_map(|stamp| stamp.checked_sub(recorded?)).collect::<Vec<_>>()
    });
    let mut offsets: Vec<_> = scans.take(FIRST).collect();
    offsets.sort_unstable();
    offsets.get(offsets.len() / 2).copied().filter(|offset| offset.unsigned_abs() > APART)
}
