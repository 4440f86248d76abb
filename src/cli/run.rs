//! `cfodi run`: the live node beside a robot's driver.

use cfodi::node::Setup;
use cfodi::node::process::live_node;

pub(crate) fn run(setup: &Setup) -> anyhow::Result<()> {
    live_node(setup, None, |_| Ok(()), || false)?;
    Ok(())
}
