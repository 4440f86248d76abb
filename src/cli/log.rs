//! The log on stderr.

use std::env;
use std::io::{self, IsTerminal};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use cfodi::args::Setup;
use cfodi::node::rosout::{Lines, listen};
use cfodi::say::{self, Stderr};
use tracing::{Metadata, info, warn};
use tracing_subscriber::filter::{DynFilterFn, EnvFilter};
use tracing_subscriber::fmt;
use tracing_subscriber::layer::{Layer as _, SubscriberExt as _};
use tracing_subscriber::util::SubscriberInitExt as _;

/// The middleware's own chatter stays out below errors. Its listener calls it an error to leave a network without multicast,
/// and its topics that they cannot sign off where the network is joined anew; what matters of both comes back as a failure
/// to open. With DDS Security whoever has no keys could fill the log by knocking. What cannot be decoded is said by the node.
const QUIET: &str = "rustdds=error,ros2_client=error,rustdds::network::udp_listener=off,rustdds::dds::pubsub=off,\
                     rustdds::rtps::message_receiver=off,rustdds::security=off,cdr_encoding=off,zenoh=error";

/// Logs to stderr, and where `rosout` says so, what a node says to the others too; `RUST_LOG` decides where it asks for
/// something, and then says all.
pub(crate) fn start(level: Option<&str>, rosout: bool) -> Lines {
    say::start();
    let variable = env::var(EnvFilter::DEFAULT_ENV).ok();
    let (filter, is_bounded) = filter(variable.as_deref(), level);
    let bound = Bound::default();
    let within = DynFilterFn::new(move |about, _| !is_bounded || bound.allows(about, Instant::now()));
    let colours = io::stderr().is_terminal();
    let lines =
        fmt::layer().with_target(false).with_ansi(colours).with_writer(|| Stderr).log_internal_errors(false);
    let lines = lines.with_filter(within);
    let (listener, said) = listen();
    let listener = listener.with_filter(DynFilterFn::new(move |_, _| rosout));
    tracing_subscriber::registry().with(lines).with(listener).with(filter).init();
    said
}

/// Says which parameters have no effect: those that a file gives to all nodes of a robot, those that are for other nodes alone, those
/// of which another value counts, and values that are hardly meant so.
pub(crate) fn say_idle(setup: &Setup) {
    for line in setup.warnings() {
        warn!("{line}");
    }
    for name in setup.idle() {
        info!("the parameter {name} has no effect on this node");
    }
}

/// What is logged, and whether the lines of the libraries are bounded.
fn filter(variable: Option<&str>, level: Option<&str>) -> (EnvFilter, bool) {
    let level = match level {
        Some("fatal") => "error",
        Some(level) => level,
        None => "info",
    };
    match variable.and_then(asked) {
        Some(filter) => (filter, false),
        None => (EnvFilter::new(format!("{level},{QUIET}")), true),
    }
}

/// What the value of `RUST_LOG` asks for. One without a directive would be a filter that lets nothing pass, and is as good as
/// none; blanks around a directive make the library read another one.
fn asked(value: &str) -> Option<EnvFilter> {
    let directives: Vec<_> = value.split(',').map(str::trim).filter(|one| !one.is_empty()).collect();
    if directives.is_empty() { None } else { EnvFilter::try_new(directives.join(",")).ok() }
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
    use tracing_subscriber::filter::LevelFilter;

    use super::*;

    #[test]
    fn a_rust_log_that_asks_for_nothing_is_as_good_as_none() {
        let default = filter(None, None).0.to_string();
        assert!(default.contains("rustdds"), "{default}");
        for nothing in ["", ",", " , ,\t", "[[[", "trace=trace=trace"] {
            let (filter, is_bounded) = filter(Some(nothing), None);
            assert_eq!((filter.to_string(), is_bounded), (default.clone(), true), "{nothing:?}");
        }
    }

    #[test]
    fn a_rust_log_that_asks_for_something_says_all() {
        let (told, is_bounded) = filter(Some(",\u{2003}warn ,"), Some("debug"));
        assert_eq!((told.max_level_hint(), is_bounded), (Some(LevelFilter::WARN), false));
        // A bare word that is no level is the target of a library, or of nobody.
        assert!(asked("nonsense").is_some());
        assert_eq!(filter(None, Some("fatal")).0.max_level_hint(), Some(LevelFilter::ERROR));
    }

    #[test]
    fn libraries_have_so_many_lines_in_five_seconds_and_then_again() {
        let (bound, start) = (Bound::default(), Instant::now());
        let said = |seconds| (0..1000).filter(|_| bound.counts(start + Duration::from_secs(seconds))).count();
        assert_eq!([said(0), said(4), said(5)], [20, 0, 20]);
    }
}
