//! Whether the middleware still does anything.
//!
//! One forged `HEARTBEAT` is enough to hold RustDDS 0.15.1: from the numbers that it claims the thread that reads every
//! socket lists those that it misses, up to 2^63 of them, and takes memory for each. The thread lives, the node is deaf, and
//! nothing says so. But a message that is written is taken up by that same thread; one that may wait for it shows it.

use std::time::Duration;

use rustdds::no_key::DataWriter;
use rustdds::policy::{History, Ownership, Reliability, ResourceLimits};
use rustdds::{QosPolicyBuilder, WriteOptionsBuilder};
use tokio::time::{sleep, timeout};

use super::Opener;
use crate::msg::topic::Named;
use crate::node::middleware::OpenError;
use crate::node::topics::PULSE;

/// Time between two messages, and that is waited for one to be taken up.
const BEAT: Duration = Duration::from_secs(1);

/// So many in a row that are not taken up are no stall.
const MISSED: u32 = 5;

pub(super) struct Pulse(DataWriter<u8>);

impl Pulse {
    pub(super) fn open(opener: &Opener) -> Result<Self, OpenError> {
        let qos = QosPolicyBuilder::new()
            .reliability(Reliability::BestEffort)
            .history(History::KeepLast { depth: 1 })
            // No reader of ROS asks for that: none is matched, so that no slow link has a part in it.
            .ownership(Ownership::Exclusive { strength: 0 })
            // One that is not yet taken up leaves no room for the next.
            .resource_limits(ResourceLimits { max_samples: 1, max_instances: 1, max_samples_per_instance: 1 })
            .build();
        let topic = opener.topic(Named { name: PULSE, type_name: "std_msgs/msg/Empty" }, &qos)?;
        let publisher = opener.participant.create_publisher(&qos).map_err(OpenError::opening(PULSE))?;
        publisher.create_datawriter_no_key_cdr(&topic, None).map(Self).map_err(OpenError::opening(PULSE))
    }

    /// Whether the message before is taken up within [`BEAT`].
    async fn beats(&self) -> bool {
        let waits = WriteOptionsBuilder::new().best_effort_may_block(true).build();
        matches!(timeout(BEAT, self.0.async_write_with_options(0, waits)).await, Ok(Ok(_)))
    }

    /// Whether the middleware works now: the first of two may find the place of one that was taken up long ago.
    pub(super) async fn is_there(&self) -> bool {
        self.beats().await && self.beats().await
    }

    /// Resolves when it has stopped, with how long it was waited for. Beats are counted and no clock is read: while the
    /// process is stopped, or its machine sleeps, time goes by for both sides.
    pub(super) async fn stops(&self) -> Duration {
        let mut missed = 0;
        while missed < MISSED {
            if self.beats().await {
                missed = 0;
                sleep(BEAT).await;
            } else {
                missed += 1;
            }
        }
        missed * BEAT
    }
}
