//! Parameters that change while the node runs.

use std::time::Duration;

use tokio::time::{Interval, MissedTickBehavior};

use super::{Live, places};
use crate::config::Config;
use crate::node::transport::Transport;

/// What the node does from time to time.
pub(super) struct Timers {
    pub(super) snapshots: Interval,
    pub(super) savings: Interval,
}

impl Timers {
    pub(super) fn new(config: &Config) -> Self {
        let mut savings = interval(config.snapshot_period);
        // The first is due at once, and nothing has been learned.
        savings.reset();
        Self { snapshots: interval(config.publish_period), savings }
    }
}

pub(super) fn interval(period: Duration) -> Interval {
    let mut interval = tokio::time::interval(period);
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    interval
}

impl<T: Transport> Live<T> {
    /// Goes on by these parameters. What points are taken in of a message from outside is up to those who decode it.
    pub(super) fn change(&mut self, config: &Config) {
        let Timers { snapshots, savings } = &mut self.timers;
        if snapshots.period() != config.publish_period {
            *snapshots = interval(config.publish_period);
            snapshots.reset();
        }
        if savings.period() != config.snapshot_period {
            *savings = interval(config.snapshot_period);
            savings.reset();
        }
        (self.filter, self.tf_timeout) = (config.filter, config.tf_timeout);
        self.join.set_places(places(config));
        self.worker.set_places(places(config));
        self.worker.tune(config.engine);
    }
}
