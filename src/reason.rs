//! Why something that was sent is not used, for accounts.

/// A key to count by, and what it means to a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reason {
    /// Short, and the same in every version.
    pub key: &'static str,
    /// A whole sentence.
    pub sentence: &'static str,
}

/// Keys of scans that are skipped for no fault of theirs, by the live node and by a replay.
pub const SESSION_ENDED: &str = "session_ended";
/// As above, at the end.
pub const SHUTDOWN: &str = "shutdown";

impl Reason {
    /// A reason by its key and its sentence.
    pub const fn new(key: &'static str, sentence: &'static str) -> Self {
        Self { key, sentence }
    }
}
