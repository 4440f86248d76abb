//! The log on stderr.

use std::io::{self, IsTerminal};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tracing::Metadata;
use tracing_subscriber::filter::{DynFilterFn, EnvFilter};
use tracing_subscriber::fmt;
use tracing_subscriber::layer::{Layer as _, SubscriberExt as _};
use tracing_subscriber::util::SubscriberInitExt as _;

/// The middleware's own chatter stays out below errors. Its listener calls it an error to leave a network without multicast,
/// and its topics that they cannot sign off where the network is joined anew; what matters of both comes back as a failure
/// to open. With DDS Security whoever has no keys could fill the log by knocking. What cannot be decoded is said by the node.
const QUIET: &str = "rustdds=error,ros2_client=error,rustdds::network::udp_listener=off,rustdds::dds::pubsub=off,\
                     rustdds::rtps::message_receiver=off,rustdds::security=off,cdr_encoding=off";

/// Logs to stderr; `RUST_LOG` decides where it is set, and then says all.
pub(crate) fn start(level: Option<&str>) {
    let level = match level {
        Some("fatal") => "error",
        Some(level) => level,
        None => "info",
    };
    let asked = EnvFilter::try_from_default_env().ok();
    let is_bounded = asked.is_none();
    let filter = asked.unwrap_or_else(|| EnvFilter::new(format!("{level},{QUIET}")));
    let bound = Bound::default();
    let within = DynFilterFn::new(move |about, _| !is_bounded || bound.allows(about, Instant::now()));
    let colours = io::stderr().is_terminal();
    let lines =
        fmt::layer().with_target(false).with_ansi(colours).with_writer(io::stderr).with_filter(within);
    tracing_subscriber::registry().with(lines).with(filter).init();
}

/// Lines of the libraries: they say one for each bad packet, and a sender could fill the disk with them.
#[derive(Default)]
struct Bound(Mutex<Option<(Instant, u32)>>);

impl Bound {
    const PERIOD: Duration = Duration::from_secs(5);
    const LINES: u32 = 20;

    fn allows(&self, about: &Metadata<'_>, now: Instant) -> bool {
        about.target().starts_with("cfodi") || self.counts(now)
    }

    fn counts(&self, now: Instant) -> bool {
        let mut period = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (since, lines) =
            period.filter(|(since, _)| now.duration_since(*since) < Self::PERIOD).unwrap_or((now, 0));
        *period = Some((since, lines.saturating_add(1)));
        lines < Self::LINES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_have_so_many_lines_in_five_seconds_and_then_again() {
        let (bound, start) = (Bound::default(), Instant::now());
        let said = |seconds| (0..1000).filter(|_| bound.counts(start + Duration::from_secs(seconds))).count();
        assert_eq!([said(0), said(4), said(5)], [20, 0, 20]);
    }
}
