//! `cfodi run`: the live node beside a robot's driver.

use cfodi::node::Setup;
use cfodi::node::dds::check_names;
use cfodi::node::process::{ProcessError, live_node};
use cfodi::node::resume::begin;
use clap::Args;

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Go on with the saved map: the file that the parameter `snapshot_path` names
    #[arg(long)]
    resume: bool,
}

pub(crate) fn run(setup: &Setup, options: &Options) -> anyhow::Result<()> {
    // Before a map is set aside for a node that cannot start.
    check_names(setup).map_err(ProcessError::from)?;
    setup.security().map_err(ProcessError::from)?;
    let (engine, _lock) = begin(&setup.config, options.resume).map_err(ProcessError::from)?;
    live_node(setup, engine, None, |_| Ok(()), || false)?;
    Ok(())
}
