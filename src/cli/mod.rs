//! The verbs of the command line, and what they share.

pub(crate) mod demo;
pub(crate) mod experiment;
mod input;
mod laboratory;
pub(crate) mod log;
mod progress;
pub(crate) mod replay;
pub(crate) mod run;
pub(crate) mod simulate;
mod stop;
mod truth;

use std::ffi::OsString;

use cfodi::args::{ArgsError, Environment, Setup};

/// The command line as text.
pub(crate) fn arguments() -> anyhow::Result<Vec<String>> {
    let text = |argument: OsString| {
        argument
            .into_string()
            .map_err(|argument| anyhow::anyhow!("the argument {} is no text", argument.display()))
    };
    std::env::args_os().map(text).collect()
}

/// Splits the ROS arguments off the command line and checks them.
pub(crate) fn setup(args: &[String]) -> Result<(Setup, Vec<String>), ArgsError> {
    Setup::parse(args, &Environment::of_process(), "cfodi")
}
