//! The `cfodi` binary: one verb a file below `cli/`.
//!
//! Exit status: 0 when all went well, 1 when something failed or an input was not read in full, 2 for wrong arguments,
//! parameters or keys.

mod cli;

use std::process::ExitCode;

use cfodi::args::ArgsError;
use cfodi::export::WriteError;
use cfodi::line::one_line;
use cfodi::node::process::ProcessError;
use cfodi::replay::FeedError;
use cfodi::say::say;
use clap::{Parser, Subcommand};

use crate::cli::{demo, experiment, replay, run, simulate};

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
    /// The paper's figures and tables on a recording, CFODI beside STATIC; with --scene, scores against a simulator's truth
    #[command(after_help = ROS_ARGUMENTS)]
    Experiment(experiment::Options),
    /// The main job with nothing installed: a simulated robot drives, the live node clusters and publishes
    #[command(after_help = ROS_ARGUMENTS)]
    Demo(demo::Options),
    /// A simulated drive through a built-in scene as a bag, with the truth about its surfaces
    Simulate(simulate::Options),
}

fn main() -> ExitCode {
    let (setup, rest) = match cli::arguments().and_then(|args| Ok(cli::setup(&args)?)) {
        Ok(parsed) => parsed,
        Err(error) => {
            say(format_args!("cfodi: {}", one_line(&error.to_string())));
            return ExitCode::from(2);
        }
    };
    // Clap ends the program with status 2 and says what is wrong.
    let cli = Cli::parse_from(rest);
    let lines = cli::log::start(setup.log_level.as_deref(), setup.rosout);
    let done = match cli.verb {
        Verb::Run(options) => run::run(&setup, &options, lines).map(|()| ExitCode::SUCCESS),
        Verb::Replay(options) => replay::replay(&setup, &options),
        Verb::Experiment(options) => experiment::experiment(&setup, &options),
        Verb::Demo(options) => demo::demo(&setup, &options, lines).map(|()| ExitCode::SUCCESS),
        Verb::Simulate(options) => simulate::simulate(&setup, &options),
    };
    match done {
        Ok(status) => status,
        Err(error) => {
            say(format_args!("cfodi: {}", one_line(&format!("{error:#}"))));
            let is_configuration = error.is::<ArgsError>()
                || error.downcast_ref::<ProcessError>().is_some_and(ProcessError::is_configuration)
                || error.downcast_ref::<FeedError<WriteError>>().is_some_and(FeedError::is_wrong_argument);
            if is_configuration { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_arguments_do_not_contradict_each_other() {
        Cli::command().debug_assert();
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
