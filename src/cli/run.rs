//! `cfodi run`: the live node beside a robot's driver.

use std::env;
use std::ffi::OsString;
use std::future::pending;
use std::io;
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::Command;

use cfodi::args::security::Security;
use cfodi::args::{BEGINS_ANEW, Rmw, Setup};
use cfodi::cloud::z_is_not_up;
use cfodi::config::Value;
use cfodi::node::check_names;
use cfodi::node::dds::Dds;
use cfodi::node::middleware::Middleware;
use cfodi::node::process::{ProcessError, live_node};
use cfodi::node::resume::begin;
use cfodi::node::rosout::Lines;
#[cfg(feature = "zenoh")]
use cfodi::node::zenoh::Zenoh;
use cfodi::say::flush;
use clap::Args;
use tracing::warn;

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Go on with the saved map: the file that the parameter `snapshot_path` names
    #[arg(long)]
    resume: bool,
}

pub(crate) fn run(setup: &Setup, options: &Options, lines: Lines) -> anyhow::Result<()> {
    if let Some(line) = z_is_not_up(&setup.config().fixed_frame) {
        warn!("{line}");
    }
    match setup.rmw().map_err(ProcessError::from)? {
        Rmw::Dds => run_over::<Dds>(setup, options, lines),
        #[cfg(feature = "zenoh")]
        Rmw::Zenoh => run_over::<Zenoh>(setup, options, lines),
    }
}

fn run_over<T: Middleware>(setup: &Setup, options: &Options, lines: Lines) -> anyhow::Result<()> {
    // Before a map is set aside for a node that cannot start.
    check_names(setup).map_err(ProcessError::from)?;
    let security = T::check(setup).map_err(ProcessError::from)?;
    let (engine, _lock) = begin(setup.config(), options.resume).map_err(ProcessError::from)?;
    match live_node::<T, ProcessError>(setup, engine, None, lines, |_| Ok(()), pending()) {
        Err(ProcessError::Deaf { why, changed }) => {
            let path = setup.config().snapshot_path.as_deref();
            let map = path.map_or_else(
                || "an empty map, for snapshot_path names none".to_owned(),
                |path| format!("the map of {}", path.display()),
            );
            warn!("{why}: the process begins anew in its place, with {map}");
            let adds_resume = path.is_some() && !options.resume;
            let error = anyhow::Error::from(begin_anew(adds_resume, &changed, &security));
            Err(error.context("the node is deaf, and the process cannot begin anew"))
        }
        ended => Ok(ended.map(drop)?),
    }
}

/// Puts this program in its own place, under the same process id: nothing else ends a thread of the middleware that does not
/// come back, or frees what it holds. Returns only where that fails.
fn begin_anew(adds_resume: bool, changed: &[(String, Value)], security: &Security) -> io::Error {
    let program = match env::current_exe() {
        Ok(program) => in_place(program),
        Err(error) => return error,
    };
    let args = env::args_os().skip(1).collect();
    let args = if adds_resume { resuming(args) } else { args };
    let mut command = anew(program, with_changes(args, changed), security);
    // The thread that writes them is gone with this.
    flush();
    command.exec()
}

/// Says to the next process what it is, too: an interface that has gone meanwhile must not end it.
fn anew(program: PathBuf, args: Vec<OsString>, security: &Security) -> Command {
    let mut command = Command::new(program);
    command.args(args).envs(with_keys(security)).env(BEGINS_ANEW, "1");
    command
}

/// A node that had keys does not come back without: those that are gone by then end it.
fn with_keys(security: &Security) -> Option<(&'static str, &'static str)> {
    matches!(security, Security::Keys(_)).then_some(("ROS_SECURITY_STRATEGY", "Enforce"))
}

/// What lies where the program lay: Linux adds a word to the path of a file that another has taken the place of.
fn in_place(program: PathBuf) -> PathBuf {
    let replaced = program.to_str().and_then(|path| path.strip_suffix(" (deleted)")).map(PathBuf::from);
    replaced.filter(|path| !program.exists() && path.exists()).unwrap_or(program)
}

/// The option belongs behind the verb: what follows may be ROS arguments.
fn resuming(mut args: Vec<OsString>) -> Vec<OsString> {
    let verb = args.iter().position(|arg| arg == "run").map_or(0, |verb| verb + 1);
    args.insert(verb, "--resume".into());
    args
}

/// What was set while the node ran goes after what was given: of several values of a parameter the last one counts.
fn with_changes(mut args: Vec<OsString>, changed: &[(String, Value)]) -> Vec<OsString> {
    if !changed.is_empty() {
        args.push("--ros-args".into());
    }
    for (name, value) in changed {
        args.extend(["-p".into(), format!("{name}:={value}").into()]);
    }
    args
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use cfodi::args::Environment;
    use cfodi::args::security::Enclave;

    use super::*;

    #[test]
    fn who_begins_anew_resumes_with_the_arguments_it_had() {
        let words = |line: &str| line.split(' ').map(OsString::from).collect::<Vec<_>>();
        let resumed = resuming(words("run --ros-args -p snapshot_path:=map"));
        assert_eq!(resumed, words("run --resume --ros-args -p snapshot_path:=map"));
        let resumed = resuming(words("--ros-args -p a:=1 -- run"));
        assert_eq!(resumed, words("--ros-args -p a:=1 -- run --resume"));
    }

    #[test]
    fn who_had_keys_does_not_begin_anew_without() {
        let keys = Security::Keys(Enclave { name: "/cfodi".to_owned(), folder: PathBuf::from("/keys") });
        assert_eq!(with_keys(&keys), Some(("ROS_SECURITY_STRATEGY", "Enforce")));
        assert_eq!(with_keys(&Security::Off), None);
    }

    /// One adapter of two was pulled meanwhile.
    #[test]
    fn who_begins_anew_says_so_and_does_with_one_of_its_interfaces() {
        let command = anew(PathBuf::from("cfodi"), vec!["run".into()], &Security::Off);
        let given: Vec<_> = command.get_envs().collect();
        assert_eq!(given, [(BEGINS_ANEW.as_ref(), Some("1".as_ref()))]);
        let checked = |begins_anew: bool, addresses: &str| {
            let environment = Environment { begins_anew, ..Environment::default() };
            let args = ["--ros-args".to_owned(), "-p".to_owned(), format!("network_interfaces:={addresses}")];
            Dds::check(&Setup::parse(&args, &environment, "cfodi").unwrap().0)
        };
        // No machine has the last one, which is for documents.
        let (one, two, none) = (r#"["127.0.0.1"]"#, r#"["127.0.0.1", "192.0.2.1"]"#, r#"["192.0.2.1"]"#);
        assert_eq!([one, two, none].map(|given| checked(false, given).is_ok()), [true, false, false]);
        assert_eq!([one, two, none].map(|given| checked(true, given).is_ok()), [true, true, false]);
    }

    #[test]
    fn a_program_that_was_replaced_begins_anew_as_the_new_one() {
        let folder = tempfile::tempdir().unwrap();
        let [there, gone] = ["cfodi", "gone"].map(|name| folder.path().join(name));
        std::fs::write(&there, "").unwrap();
        let replaced = |path: &Path| PathBuf::from(format!("{} (deleted)", path.display()));
        assert_eq!(in_place(there.clone()), there);
        assert_eq!(in_place(replaced(&there)), there);
        assert_eq!(in_place(replaced(&gone)), replaced(&gone));
        let odd = replaced(&there);
        std::fs::write(&odd, "").unwrap();
        assert_eq!(in_place(odd.clone()), odd, "such a name is one like any other");
    }

    #[test]
    fn who_begins_anew_has_the_parameters_as_they_were_set_last() {
        let parsed = |args: &[OsString]| {
            let args: Vec<_> = args.iter().map(|arg| arg.to_str().unwrap().to_owned()).collect();
            Setup::parse(&args, &Environment::default(), "cfodi").unwrap().0
        };
        let changed = [
            ("clearing", Value::Boolean(false)),
            ("max_voxels", Value::Integer(5000)),
            ("min_range", Value::Double(1e-7)),
            ("optical", Value::Text("yes".into())),
            ("publish_rate", Value::Double(1.0)),
        ];
        let changed = changed.map(|(name, value)| (name.to_owned(), value));
        for line in ["run", "run --ros-args -p max_voxels:=7 -p depth:=3", "--ros-args -p optical:=no -- run"]
        {
            let args: Vec<_> = line.split(' ').map(OsString::from).collect();
            assert_eq!(with_changes(args.clone(), &[]), args);
            let (before, after) = (parsed(&args), parsed(&with_changes(args, &changed)));
            let expected = before.parameters.values().map(|(name, value)| {
                let set = changed.iter().find(|(changed, _)| changed == name);
                (name, set.map_or(value, |(_, value)| value))
            });
            assert!(after.parameters.values().eq(expected), "{line}");
        }
    }
}
