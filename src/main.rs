//! The `cfodi` binary: one verb a file below `cli/`.
//!
//! Exit status: 0 when all went well, 1 when something failed or an input was not read in full, 2 for wrong arguments,
//! parameters or keys.

mod cli;

use std::ffi::OsStr;
use std::process::ExitCode;

use cfodi::args::ArgsError;
use cfodi::export::WriteError;
use cfodi::line::one_line;
use cfodi::node::process::ProcessError;
use cfodi::replay::FeedError;
use cfodi::say::{flush, say};
use cfodi::signals::outlive_limit_of_files;
use clap::error::ErrorKind;
use clap::{Parser, Subcommand};

use crate::cli::{Ending, Wrong, demo, experiment, replay, run, simulate};

/// Clouds are megabytes, taken by one thread and given back by another, for weeks: the C library's allocator keeps some 64 MB
/// for each thread that ever had one, or maps and clears every cloud's pages anew.
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// Clap never sees them, so its help does not tell of them by itself.
const ROS_ARGUMENTS: &str = "ROS arguments follow --ros-args: -r from:=to, -p name:=value, --params-file FILE, \
                             --log-level LEVEL, --enclave NAME\n\
                             For example: --ros-args -r points:=TOPIC";

/// Surfaces from a moving Kinect, live.
#[derive(Debug, Parser)]
#[command(version, after_help = ROS_ARGUMENTS)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// The live ROS 2 node: clouds in, surface clusters out
    #[command(after_help = ROS_ARGUMENTS)]
    Run(run::Options),
    /// A recorded bag through the same engine: every scan, in order, as fast as the processor allows
    #[command(after_help = ROS_ARGUMENTS)]
    Replay(replay::Options),
    /// The paper's figures and tables on a recording, CFODI and mode consistent beside STATIC; with --scene, scores against a simulator's truth
    #[command(after_help = ROS_ARGUMENTS)]
    Experiment(experiment::Options),
    /// The main job with nothing installed: a simulated robot drives, the live node clusters and publishes
    #[command(after_help = ROS_ARGUMENTS)]
    Demo(demo::Options),
    /// A simulated drive through a built-in scene as a bag, with the truth about its surfaces
    Simulate(simulate::Options),
}

fn main() -> ExitCode {
    // Where it is refused, such a file ends the program as it ends any.
    drop(outlive_limit_of_files());
    let ended = verb();
    if let Err(error) = &ended {
        say(format_args!("cfodi: {}", text(error)));
    }
    flush();
    ExitCode::from(status(&ended))
}

fn verb() -> anyhow::Result<Ending> {
    let (setup, rest) = cli::setup(&cli::arguments()?)?;
    let cli = Cli::try_parse_from(&rest).unwrap_or_else(|error| refused(&error, &rest));
    let lines = cli::log::start(setup.log_level.as_deref(), setup.rosout);
    cli::log::say_idle(&setup);
    match cli.verb {
        Verb::Run(options) => run::run(&setup, &options, lines).map(|()| Ending::Whole),
        Verb::Replay(options) => replay::replay(&setup, &options),
        Verb::Experiment(options) => experiment::experiment(&setup, &options),
        Verb::Demo(options) => demo::demo(&setup, &options, lines).map(|()| Ending::Whole),
        Verb::Simulate(options) => simulate::simulate(&setup, &options),
    }
}

/// Ends the program as Clap does, with help and version too; where ROS arguments stand before `--ros-args`, says where they belong.
fn refused(error: &clap::Error, arguments: &[impl AsRef<OsStr>]) -> ! {
    drop(error.print());
    let is_ros = |argument: &&str| {
        ["-p", "--param", "-r", "--remap", "--params-file", "--log-level"].contains(argument)
    };
    let ros = arguments.iter().filter_map(|argument| argument.as_ref().to_str()).find(is_ros);
    if let Some(argument) = ros.filter(|_| error.kind() == ErrorKind::UnknownArgument) {
        say(format_args!(
            "{argument} is a ROS argument: it follows --ros-args, as in --ros-args {argument} ..."
        ));
    }
    if let Some(value) = voxel_size(arguments).filter(|_| error.kind() == ErrorKind::ArgumentConflict) {
        say(format_args!("on a recording: --ros-args -p voxel_size:={}", one_line(value)));
    }
    std::process::exit(error.exit_code())
}

/// What follows `--voxel-size`, which is an option beside `--scene` alone.
fn voxel_size(arguments: &[impl AsRef<OsStr>]) -> Option<&str> {
    let arguments: Vec<_> = arguments.iter().filter_map(|argument| argument.as_ref().to_str()).collect();
    if arguments.iter().any(|argument| argument.starts_with("--scene")) {
        return None;
    }
    let at = arguments.iter().position(|argument| argument.starts_with("--voxel-size"))?;
    arguments[at].strip_prefix("--voxel-size=").or_else(|| arguments.get(at + 1).copied())
}

fn text(error: &anyhow::Error) -> String {
    let wrong = error.downcast_ref::<Wrong>().map(ToString::to_string);
    wrong.unwrap_or_else(|| one_line(&format!("{error:#}")).into_owned())
}

fn status(ended: &anyhow::Result<Ending>) -> u8 {
    let is_configuration = |error: &anyhow::Error| {
        error.is::<Wrong>()
            || error.is::<ArgsError>()
            || error.downcast_ref::<ProcessError>().is_some_and(ProcessError::is_configuration)
            || error.downcast_ref::<FeedError<WriteError>>().is_some_and(FeedError::is_wrong_argument)
    };
    match ended {
        Ok(Ending::Whole) => 0,
        Err(error) if is_configuration(error) => 2,
        Ok(Ending::InPart) | Err(_) => 1,
    }
}

#[cfg(test)]
mod tests {
    use anyhow::anyhow;
    use cfodi::args::{Environment, Setup};
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_status_tells_wrong_arguments_from_what_fails_and_from_what_is_not_whole() {
        let parameter = ["--ros-args", "-p", "no_such_parameter:=1"].map(str::to_owned);
        let args_error = || Setup::parse(&parameter, &Environment::default(), "cfodi").unwrap_err();
        let wrong = || Wrong("first line\nsecond line".to_owned());
        let ended = [
            (Ok(Ending::Whole), 0),
            (Ok(Ending::InPart), 1),
            (Err(anyhow!("it fails")), 1),
            (Err(ProcessError::Runtime(std::io::Error::other("it fails")).into()), 1),
            (Err(wrong().into()), 2),
            (Err(ProcessError::from(args_error()).into()), 2),
            (Err(args_error().into()), 2),
            (Err(anyhow::Error::from(args_error()).context("an output's name")), 2),
            (cli::setup(&parameter).map(|_| Ending::Whole).map_err(anyhow::Error::from), 2),
        ];
        for (ended, expected) in ended {
            assert_eq!(status(&ended), expected, "{ended:?}");
        }
        assert_eq!(text(&wrong().into()), "first line\nsecond line");
        assert_eq!(text(&anyhow!("a\u{1b}[2J").context("b\nc")), "b\\nc: a\\u{1b}[2J");
    }

    #[test]
    fn the_arguments_do_not_contradict_each_other() {
        Cli::command().debug_assert();
    }

    #[test]
    fn who_gives_the_option_of_a_scene_to_a_recording_is_told_of_the_parameter() {
        let value = |line: &str| {
            let arguments: Vec<_> = line.split(' ').collect();
            let is_refused = Cli::try_parse_from(&arguments)
                .is_err_and(|error| error.kind() == ErrorKind::ArgumentConflict);
            voxel_size(&arguments).filter(|_| is_refused).map(str::to_owned)
        };
        let begin = "cfodi experiment bag --out a";
        for option in ["--voxel-size 0.05", "--voxel-size=0.05"] {
            let line = format!("{begin} {option}");
            assert_eq!(value(&line).as_deref(), Some("0.05"), "{option}");
        }
        assert_eq!(value("cfodi experiment bag --out a --seeds 3"), None);
        assert_eq!(value("cfodi experiment bag --scene lab --out a --voxel-size 0.05"), None);
        assert_eq!(value("cfodi experiment --scene lab --out a --voxel-size 0.05"), None);
    }

    #[test]
    fn the_help_of_an_experiment_lists_what_a_scene_takes_by_itself() {
        let command = Cli::command();
        let arguments = command.find_subcommand("experiment").unwrap().get_arguments();
        let with_scene = arguments.filter(|argument| argument.get_help_heading() == Some("With --scene"));
        let names: Vec<_> = with_scene.filter_map(clap::Arg::get_long).collect();
        assert_eq!(names, ["seeds", "seconds", "scan-step", "score-every", "voxel-size", "pose-noise"]);
    }

    #[test]
    fn each_verb_that_takes_ros_arguments_says_so_in_its_help() {
        let command = Cli::command();
        for verb in ["run", "replay", "experiment", "demo"] {
            let help = command.find_subcommand(verb).and_then(clap::Command::get_after_help);
            assert!(
                help.is_some_and(|help| help.to_string().contains("--ros-args -r points:=TOPIC")),
                "{verb}"
            );
        }
    }
}
