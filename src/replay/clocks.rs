//! The two clocks of a bag: the one by which its messages are stamped, and the one by which they were recorded.

use std::sync::atomic::AtomicBool;

use crate::bag::{Bag, Decoder, Recorded};

/// Scans that are looked at: the stamp of one alone may be a stray.
const FIRST: usize = 9;

/// From how far apart on they are two clocks (ns), a minute: scans are late by seconds at most, and a clock that counts from the
/// start of a simulator or a driver is off by years.
const APART: u64 = 60_000_000_000;

/// From how far after zero on the stamps (ns) are those of a clock that tells the date, a year: others count from the start of a
/// simulator or a driver.
const DATED: u64 = 365 * 24 * 3600 * 1_000_000_000;

/// How far the stamps of the scans lie after the times at which they were recorded (ns), by the median of the first few, read
/// up to `stop`; `None` where both are of one clock.
pub fn clock_offset(bag: &Bag, mut decoder: Decoder, stop: &AtomicBool) -> Option<i64> {
    // Without its camera no image is a scan, and that may come last.
    decoder.look_for_cameras(bag.readable_until(stop));
    let offsets = stamps(bag, decoder, stop)
        .filter_map(|(stamp, recorded)| stamp.checked_sub(i64::try_from(recorded).ok()?));
    median(offsets).filter(|offset| offset.unsigned_abs() > APART)
}

/// Whether zero is a time like any other by the clock of the stamps: whether the median of the first few lies near it.
pub(super) fn begins_at_zero(bag: &Bag, decoder: Decoder, stop: &AtomicBool) -> bool {
    median(stamps(bag, decoder, stop).map(|(stamp, _)| stamp))
        .is_some_and(|stamp| stamp.unsigned_abs() < DATED)
}

/// When the scans were taken, and when recorded (ns); those of stamp zero may be of a driver that does not say.
fn stamps(bag: &Bag, mut decoder: Decoder, stop: &AtomicBool) -> impl Iterator<Item = (i64, u64)> {
    let scans = bag.readable_until(stop).flat_map(move |message| {
        let clouds = decoder.decode(&message).into_iter().filter_map(|recorded| match recorded {
            Recorded::Cloud { cloud: Ok(cloud), .. } => Some(cloud.stamp.nanos()),
            _ => None,
        });
        clouds.map(|stamp| (stamp, message.log_time)).collect::<Vec<_>>()
    });
    scans.filter(|(stamp, _)| *stamp != 0)
}

/// Of the first few.
fn median(values: impl Iterator<Item = i64>) -> Option<i64> {
    let mut values: Vec<_> = values.take(FIRST).collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied()
}
