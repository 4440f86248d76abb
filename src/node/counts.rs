//! Where every cloud went; a depth image counts as the cloud that it becomes.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::reason::Reason;

/// Clouds since the node's start: each that was sent is taken in, replaced, lost, or skipped for a reason.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub(super) struct Counts {
    /// Clouds that arrived, good or bad.
    pub(super) received: u64,
    /// Scans the engine has taken in.
    pub(super) taken_in: u64,
    /// Scans that waited for the engine and were replaced by newer ones.
    pub(super) replaced: u64,
    /// Clouds that were sent and never arrived.
    pub(super) lost: u64,
    /// Clouds that arrived and could not be used, by reason.
    pub(super) skipped: BTreeMap<Reason, u64>,
}

/// Why a cloud is skipped, beside what its [`CloudError`](crate::cloud::CloudError) says: it got no transform in time.
pub(super) const TRANSFORM_TIMEOUT: Reason =
    Reason::new("transform_timeout", "The cloud waited for its transform as long as tf_timeout lets it.");
/// It waited for its transform and made place for another.
pub(super) const WAITING_QUEUE_FULL: Reason =
    Reason::new("waiting_queue_full", "The cloud waited for its transform and made place for a newer one.");
/// Scans of its sensor are made of what comes in another form.
pub(super) const OTHER_INPUT: Reason =
    Reason::new("other_input", "The sensor’s scans are made of another of its inputs.");
/// The engine's thread has died.
pub(super) const ENGINE_DIED: Reason =
    Reason::new("engine_died", "The engine’s thread died before the scan was taken in.");

impl Counts {
    /// Counts clouds that never arrived: so many that the sum saturates where somebody makes up numbers.
    pub(super) fn lose(&mut self, clouds: u64) {
        self.lost = self.lost.saturating_add(clouds);
    }

    /// Counts a cloud that could not be used.
    pub(super) fn skip(&mut self, reason: Reason) {
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
    use crate::cloud::CloudError;
    use crate::reason::{SESSION_ENDED, SHUTDOWN};

    #[test]
    fn counts_are_one_line_of_json() {
        let mut counts = Counts { received: 5, taken_in: 2, ..Counts::default() };
        counts.skip(CloudError::ZeroPointStep.reason());
        counts.skip(CloudError::BadStamp { nanosec: u32::MAX }.reason());
        counts.skip(CloudError::ZeroPointStep.reason());
        assert_eq!(
            counts.to_string(),
            r#"{"received":5,"taken_in":2,"replaced":0,"lost":0,"skipped":{"bad_stamp":1,"zero_point_step":2}}"#
        );
    }

    /// Who reads the counts goes by them.
    #[test]
    fn the_keys_of_what_is_no_fault_of_a_cloud_stay_as_they_are() {
        let mut counts = Counts::default();
        [WAITING_QUEUE_FULL, TRANSFORM_TIMEOUT, SHUTDOWN, SESSION_ENDED, OTHER_INPUT, ENGINE_DIED]
            .into_iter()
            .for_each(|reason| counts.skip(reason));
        let keys: Vec<_> = counts.skipped.keys().map(|reason| reason.key).collect();
        let expected = [
            "engine_died",
            "other_input",
            "session_ended",
            "shutdown",
            "transform_timeout",
            "waiting_queue_full",
        ];
        assert_eq!(keys, expected);
    }
}
