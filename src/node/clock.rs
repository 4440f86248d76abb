//! The time of day: the only place that asks for it.

use std::time::{SystemTime, UNIX_EPOCH};

use crate::engine::Stamp;

/// Now; the epoch where the machine's clock is before it.
pub(super) fn now() -> Stamp {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX))
}
