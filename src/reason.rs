//! Why something that was sent is not used, for accounts.

use serde::{Serialize, Serializer};

/// A key to count by, and what it means to a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reason {
    /// Short, and the same in every version.
    pub key: &'static str,
    /// A whole sentence.
    pub sentence: &'static str,
}

/// Why the live node and a replay skip scans for no fault of theirs: their session has ended.
pub const SESSION_ENDED: Reason = Reason::new(
    "session_ended",
    "The stamps jumped back, or the map was reset, while the scan waited for its transform.",
);
/// The same where the node or the replay was stopped.
pub const SHUTDOWN: Reason =
    Reason::new("shutdown", "It was stopped while the scan waited for its transform.");

impl Reason {
    /// A reason by its key and its sentence.
    pub const fn new(key: &'static str, sentence: &'static str) -> Self {
        Self { key, sentence }
    }

    /// Whether a transform was missing or of no use: `tf_` begins the keys of these.
    pub fn is_of_transforms(&self) -> bool {
        self.key.starts_with("tf_")
    }
}

impl Serialize for Reason {
    /// As its key.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.key)
    }
}
