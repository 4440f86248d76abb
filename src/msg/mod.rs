//! Messages: wire types, and the engine's values as messages.
//!
//! Pure functions from values to values; a field order here is the order on the wire. [`ros`] holds the types of the
//! ROS packages, [`parameters`] those of the parameter services, [`clusters`] those of `cfodi_msgs` (in the folder `msg/`),
//! [`twins`] the clusters in messages of others; [`outgoing`] is any of those that go out, [`sent`] on which topics, and [`types`] of which types those are that
//! come: scans in any [`form`], and what is [`heard`] beside them.

pub mod caps;
#[cfg(feature = "bag")]
pub(crate) mod cdr;
pub mod clusters;
pub mod form;
pub mod heard;
pub mod labelled;
pub mod markers;
#[cfg(feature = "bag")]
pub mod outgoing;
pub mod parameters;
pub mod reports;
pub mod ros;
pub mod sent;
#[cfg(feature = "bag")]
pub(crate) mod status;
pub mod topic;
pub mod twins;
pub mod types;
