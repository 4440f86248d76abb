//! A recorded bag through the same engine as the live node: every scan, in order, as fast as the processor allows.
//!
//! Two threads: `cfodi-bag` reads, decompresses and decodes, the caller's joins, clusters and writes. Between them wait a
//! few messages at most, so that memory is bounded whatever the bag's size. Nothing depends on which thread is faster:
//! the same bag gives the same bytes on every run.
//!
//! [`feed`] turns a bag into scans for a [`Visitor`]; [`Replay`] is the visitor that runs the engine and keeps account.

mod ahead;
mod body;
mod clocks;
mod clusters;
mod diagnosis;
mod disorder;
mod early;
mod error;
mod feed;
mod files;
mod finder;
mod fixed_frame;
mod pace;
mod reading;
mod run;
mod said;
mod summary;
mod tree;
mod visitor;

pub use clocks::clock_offset;
pub use clusters::write_clusters;
pub use error::FeedError;
pub use feed::{Ended, Fed, Feed, Progress, feed};
pub use files::{MapFiles, OpenMapFiles, Outputs, ResultFile};
pub use fixed_frame::FixedFrame;
pub use run::{Finished, Replay, Settings};
pub use said::Remark;
pub use summary::{Summary, Tally};
pub use visitor::{Go, Origin, Visitor};
