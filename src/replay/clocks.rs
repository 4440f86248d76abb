//! The two clocks of a bag: the one by which its messages are stamped, and the one by which they were recorded.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::bag::{Bag, Decoder, Recorded};
use crate::tf::JUMP_BACK;

/// Scans that are looked at: the stamp of one alone may be a stray.
const FIRST: usize = 9;

/// How far the stamps of the scans lie after the times at which they were recorded (ns), by the median of the first few; up to
/// `stop`.
///
/// 0 where that is a second at most, as where both are of one clock. More it is where a simulator's time was recorded by a
/// clock on the wall, or where a driver counts from its start.
pub fn stamps_after_recording(bag: &Bag, mut decoder: Decoder, stop: &AtomicBool) -> i64 {
    let messages = bag.messages().map_while(Result::ok).take_while(|_| !stop.load(Ordering::Relaxed));
    let scans = messages.flat_map(|message| {
        let clouds = decoder.decode(&message).into_iter().filter_map(|recorded| match recorded {
            Recorded::Cloud(Ok(cloud)) => Some(cloud.stamp.nanos()),
            _ => None,
        });
        let recorded = i64::try_from(message.log_time).ok();
        clouds.filter_map(|stamp| stamp.checked_sub(recorded?)).collect::<Vec<_>>()
    });
    let mut after: Vec<_> = scans.take(FIRST).collect();
    after.sort_unstable();
    let median = after.get(after.len() / 2).copied().unwrap_or_default();
    if median.unsigned_abs() as f64 * 1e-9 > JUMP_BACK { median } else { 0 }
}
