//! `cfodi run`: the live node beside a robot's driver.

use std::process::ExitCode;

use cfodi::node::Setup;
use cfodi::node::process::live_node;
use cfodi::node::resume::begin;
use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Go on with the saved map: the file that the parameter `snapshot_path` names
    #[arg(long)]
    resume: bool,
}

pub(crate) fn run(setup: &Setup, options: &Options) -> anyhow::Result<ExitCode> {
    let engine = match begin(&setup.config, options.resume) {
        Ok(engine) => engine,
        Err(error) => {
            eprintln!("cfodi: {error}");
            return Ok(ExitCode::from(2));
        }
    };
    live_node(setup, engine, None, |_| Ok(()), || false)?;
    Ok(ExitCode::SUCCESS)
}
