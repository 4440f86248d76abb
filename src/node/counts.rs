//! Where every cloud went; a depth image counts as the cloud that it becomes.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

/// Clouds since the node's start: each that was sent is taken in, replaced, lost, or skipped for a reason.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Clouds that arrived, good or bad.
    pub received: u64,
    /// Scans the engine has taken in.
    pub taken_in: u64,
    /// Scans that waited for the engine and were replaced by newer ones.
    pub replaced: u64,
    /// Clouds that were sent and never arrived.
    pub lost: u64,
    /// Clouds that arrived and could not be used, by reason.
    pub skipped: BTreeMap<&'static str, u64>,
}

/// Why a cloud is skipped, beside what its [`CloudError`](crate::cloud::CloudError) says: it got no transform in time.
pub const TRANSFORM_TIMEOUT: &str = "transform_timeout";
/// It waited for its transform and made place for another.
pub const WAITING_QUEUE_FULL: &str = "waiting_queue_full";
/// Scans of its sensor are made of what comes in another form.
pub const OTHER_INPUT: &str = "other_input";
/// The engine's thread has died.
pub const ENGINE_DIED: &str = "engine_died";

impl Counts {
    /// Counts clouds that never arrived: so many that the sum saturates where somebody makes up numbers.
    pub fn lose(&mut self, clouds: u64) {
        self.lost = self.lost.saturating_add(clouds);
    }

    /// Counts a cloud that could not be used.
    pub fn skip(&mut self, reason: &'static str) {
        *self.skipped.entry(reason).or_default() += 1;
    }
}

impl fmt::Display for Counts {
    /// As JSON on one line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&serde_json::to_string(self).map_err(|_| fmt::Error)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_one_line_of_json() {
        let mut counts = Counts { received: 5, taken_in: 2, ..Counts::default() };
        counts.skip("data_too_short");
        counts.skip("bad_stamp");
        counts.skip("data_too_short");
        assert_eq!(
            counts.to_string(),
            r#"{"received":5,"taken_in":2,"replaced":0,"lost":0,"skipped":{"bad_stamp":1,"data_too_short":2}}"#
        );
    }
}
