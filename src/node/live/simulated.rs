//! The simulated clock that does not come.

use std::time::Instant;

use tracing::{info, warn};

use super::{Live, QUIET};
use crate::node::transport::Transport;

impl<T: Transport> Live<T> {
    /// What is to be said of the clock where the time is simulated and none comes.
    pub(super) fn clock_fault(&self) -> Option<String> {
        let silence = self.clocks.silence(Instant::now());
        if !self.simulated || silence < QUIET {
            return None;
        }
        Some(if self.clocks.is_heard() {
            format!("no /clock has come for {} s: the simulated time stands still", silence.as_secs())
        } else {
            "no /clock has come, which use_sim_time asks for: a bag is played with --clock, and a robot's time is not simulated"
                .to_owned()
        })
    }

    /// Says it once, and when it comes.
    pub(super) fn say_of_clock(&mut self) {
        let fault = self.clock_fault();
        let was_said = std::mem::replace(&mut self.said_clock, fault.is_some());
        match fault {
            Some(fault) if !was_said => warn!("{fault}"),
            None if was_said => info!("/clock comes now"),
            _ => {}
        }
    }
}
