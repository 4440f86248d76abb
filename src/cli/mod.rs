//! The verbs of the command line, and what they share.

pub(crate) mod demo;
pub(crate) mod experiment;
mod input;
mod laboratory;
pub(crate) mod log;
mod pose_noise;
mod progress;
pub(crate) mod replay;
pub(crate) mod run;
pub(crate) mod simulate;
mod truth;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use cfodi::args::{Environment, Setup};
use cfodi::export::{WriteError, left_behind, left_behind_in};
use cfodi::line::one_line;
use cfodi::say::say;
use thiserror::Error;

/// How a verb has ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// All was done.
    Whole,
    /// An input was not read in full, or a signal has stopped it; that is said already.
    InPart,
}

/// Wrong arguments, as opposed to an input that fails. The text may have several lines: names in it are written out already.
#[derive(Debug, Error)]
#[error("{0}")]
pub(crate) struct Wrong(pub(crate) String);

/// Refuses an output below a folder `~` that is not there: the shell has not expanded it, as bash does not in `--out=~/a`.
pub(crate) fn check_home(outputs: &[PathBuf]) -> Result<(), Wrong> {
    let home = Path::new("~");
    let Some(path) = outputs.iter().find(|path| path.starts_with(home)).filter(|_| !home.exists()) else {
        return Ok(());
    };
    let name = path.display().to_string();
    Err(Wrong(format!(
        "the output {} begins with `~`, which is not expanded here and is no folder",
        one_line(&name)
    )))
}

/// Names what killed processes have left of these outputs: its names are hidden, and it may be gigabytes.
pub(crate) fn say_left_behind(outputs: &[PathBuf]) {
    say_left(outputs.iter().flat_map(|path| left_behind(path)));
}

/// As [`say_left_behind`], of all that is written into a folder.
pub(crate) fn say_left_behind_in(folder: &Path) {
    say_left(left_behind_in(folder));
}

fn say_left(files: impl IntoIterator<Item = PathBuf>) {
    for path in files {
        let name = path.display().to_string();
        say(format_args!("a process that has been killed left {}: it can be removed", one_line(&name)));
    }
}

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

/// Gives the first of these errors, which is said last, and says the others.
pub(crate) fn first_of(errors: impl IntoIterator<Item = WriteError>) -> anyhow::Result<()> {
    let mut errors = errors.into_iter();
    let Some(first) = errors.next() else { return Ok(()) };
    for other in errors {
        say(format_args!("cfodi: {}", one_line(&format!("{:#}", anyhow::Error::new(other)))));
    }
    Err(first.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_home_that_the_shell_has_not_expanded_is_no_folder_of_outputs() {
        let checked =
            |path: &str| check_home(&[PathBuf::from("a"), PathBuf::from(path)]).map_err(|error| error.0);
        let words = "the output ~/r/index.html begins with `~`, which is not expanded here and is no folder";
        assert_eq!(checked("~/r/index.html"), Err(words.to_owned()));
        assert!(checked("~").is_err());
        for other in ["./~/r", "~r", "a/~", "/~"] {
            assert_eq!(checked(other), Ok(()), "{other}");
        }
    }
}
