//! The verbs of the command line, and what they share.

pub(crate) mod demo;
pub(crate) mod experiment;
mod laboratory;
mod progress;
pub(crate) mod replay;
pub(crate) mod run;
pub(crate) mod simulate;
mod stop;
mod truth;

use std::ffi::OsString;
use std::io::{self, IsTerminal};

use cfodi::node::Setup;
use cfodi::node::args::ArgsError;
use tracing_subscriber::EnvFilter;

/// The command line as text.
pub(crate) fn arguments() -> anyhow::Result<Vec<String>> {
    let text = |argument: OsString| {
        argument.into_string().map_err(|argument| anyhow::anyhow!("the argument {argument:?} is no text"))
    };
    std::env::args_os().map(text).collect()
}

/// Splits the ROS arguments off the command line and checks them.
pub(crate) fn setup(args: &[String]) -> Result<(Setup, Vec<String>), ArgsError> {
    // What is no text is no number either, and is refused as such.
    let domain = std::env::var_os("ROS_DOMAIN_ID").map(|domain| domain.to_string_lossy().into_owned());
    Setup::parse(args, domain.as_deref(), "cfodi")
}

/// The middleware's own chatter stays out below errors; its listener calls it an error to leave a network without
/// multicast, and what matters of it comes back as a failure to open.
const QUIET: &str = "rustdds=error,ros2_client=error,rustdds::network::udp_listener=off";

/// Logs to stderr; `RUST_LOG` decides where it is set.
pub(crate) fn start_log(level: Option<&str>) {
    let level = match level {
        Some("fatal") => "error",
        Some(level) => level,
        None => "info",
    };
    let filter =
        EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(format!("{level},{QUIET}")));
    let colours = io::stderr().is_terminal();
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_target(false).with_ansi(colours);
    log.with_writer(io::stderr).init();
}
