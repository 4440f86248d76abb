//! Why a bag can be fed no further.

use thiserror::Error;

/// Feeding has to end.
#[derive(Debug, Error)]
pub enum FeedError<E> {
    /// The system gives no thread.
    #[error("cannot start the thread that reads: {0}")]
    Start(std::io::Error),
    /// The visitor cannot go on.
    #[error(transparent)]
    Visitor(E),
    /// What the whole bag would have said of the frame is not known, and scans in the wrong one are none.
    #[error(
        "stopped by a signal while the frame of the map was looked for in the whole bag: there is no result"
    )]
    Stopped,
    /// How the sensor moved is not told on the topics that are read.
    #[error(
        "the bag has no transforms on {changing} and {lasting}, but others: choose with {choices}; where the sensor stood still, with -p \
         fixed_frame:= and its own frame"
    )]
    Elsewhere {
        /// The topic of transforms that change.
        changing: String,
        /// Of those that hold for all time.
        lasting: String,
        /// The arguments that have the others read.
        choices: String,
    },
    /// The reading thread has panicked.
    #[error("the thread that reads has died")]
    Died,
}

impl<E> FeedError<E> {
    /// Whether another argument would have been right.
    pub const fn is_wrong_argument(&self) -> bool {
        matches!(self, Self::Elsewhere { .. })
    }
}
