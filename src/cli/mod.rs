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

use cfodi::args::{Environment, Setup};
use cfodi::line::one_line;
use thiserror::Error;

/// How a verb has ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All was done.
    Whole,
    /// An input was not read in full, nothing of it was taken in, or a signal has stopped it; that is said already.
    InPart,
}

/// Wrong arguments, as opposed to an input that fails. The text may have several lines: names in it are written out already.
#[derive(Debug, Error)]
#[error("{0}")]
pub(crate) struct Wrong(pub(crate) String);

/// The command line as text.
pub(crate) fn arguments() -> Result<Vec<String>, Wrong> {
    let text = |argument: OsString| {
        argument.into_string().map_err(|argument| {
            let name = argument.display().to_string();
            Wrong(format!("the argument {} is no text", one_line(&name)))
        })
    };
    std::env::args_os().map(text).collect()
}

/// Splits the ROS arguments off the command line and checks them.
pub(crate) fn setup(args: &[String]) -> Result<(Setup, Vec<String>), Wrong> {
    let parsed = Setup::parse(args, &Environment::of_process(), "cfodi");
    parsed.map_err(|error| Wrong(one_line(&error.to_string()).into_owned()))
}
