//! `cfodi run`: the live node beside a robot's driver.

use cfodi::node::Setup;

use super::{live_node, signalled};

pub(crate) fn run(setup: &Setup) -> anyhow::Result<()> {
    live_node(setup, |_| Ok(()), signalled()).map(drop)
}
