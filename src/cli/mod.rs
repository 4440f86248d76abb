//! The verbs of the command line, and what they share.

pub(crate) mod demo;
pub(crate) mod run;

use std::cell::RefCell;
use std::future::Future;
use std::io::{self, IsTerminal};
use std::rc::Rc;
use std::sync::Arc;

use anyhow::Context as _;
use cfodi::engine::Snapshot;
use cfodi::node::Setup;
use cfodi::node::args::ArgsError;
use cfodi::node::counts::Counts;
use cfodi::node::dds::{Dds, Events};
use cfodi::node::live;
use socket2::{Domain, Socket, Type};
use tokio::task::LocalSet;
use tracing::{info, warn};
use tracing_subscriber::EnvFilter;

/// Splits the ROS arguments off the command line and checks them.
pub(crate) fn setup(args: &[String]) -> Result<(Setup, Vec<String>), ArgsError> {
    let domain = std::env::var("ROS_DOMAIN_ID").ok();
    Setup::parse(args, domain.as_deref(), "cfodi")
}

/// Logs to stderr; `RUST_LOG` decides where it is set. The middleware's own chatter stays out below errors.
pub(crate) fn start_log(level: Option<&str>) {
    let level = match level {
        Some("fatal") => "error",
        Some(level) => level,
        None => "info",
    };
    let filter = EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| EnvFilter::new(format!("{level},rustdds=error,ros2_client=error")));
    let colours = io::stderr().is_terminal();
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_target(false).with_ansi(colours);
    log.with_writer(io::stderr).init();
}

/// Bytes of the receive buffer that the node's sockets have: the system cuts a larger wish short without a word, so a
/// socket is asked. (Linux reports twice what it has set.)
pub(crate) fn receive_buffer(setup: &Setup) -> usize {
    let wish = setup.config.receive_buffer;
    let got = Socket::new(Domain::IPV4, Type::DGRAM, None).and_then(|socket| {
        socket.set_recv_buffer_size(wish)?;
        socket.recv_buffer_size()
    });
    let twice = if cfg!(target_os = "linux") { 2 } else { 1 };
    // Where no socket can be had, opening the node says why.
    got.map_or(wish, |got| wish.min(got / twice))
}

fn say_receive_buffer(setup: &Setup) {
    let (wish, got) = (setup.config.receive_buffer, receive_buffer(setup));
    if got < wish {
        warn!(
            "socket receive buffer: {got} bytes instead of {wish}, too few for large clouds; raise it with: \
             sudo sysctl -w net.core.rmem_max={wish}"
        );
    } else {
        info!("socket receive buffer: {got} bytes");
    }
}

/// Runs the live node until `shutdown` resolves and returns its map; `begin` is called once it listens.
pub(crate) fn live_node(
    setup: &Setup,
    begin: impl FnOnce(Events) -> anyhow::Result<()>,
    shutdown: impl Future<Output = ()>,
) -> anyhow::Result<Arc<Snapshot>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let counts = Rc::new(RefCell::new(Counts::default()));
    let tasks = LocalSet::new();
    let ended = tasks.block_on(&runtime, async {
        say_receive_buffer(setup);
        let (dds, events, receiver) = Dds::open(setup).context("cannot join the ROS network")?;
        let dds = Rc::new(dds);
        let node = setup.fully_qualified_name();
        info!("ready: {node} reads {} in domain {}", setup.resolve("points")?, setup.domain);
        begin(events)?;
        let map = live::run(&setup.config, Rc::clone(&dds), receiver, Rc::clone(&counts), shutdown).await;
        let network = match Rc::into_inner(dds) {
            Some(dds) => Some(dds.close().await),
            None => None,
        };
        Ok::<_, anyhow::Error>((map?, network))
    });
    drop(tasks);
    let map = ended.map(|(map, network)| {
        drop(network);
        map
    });
    eprintln!("counts {}", counts.borrow());
    map
}

/// Resolves at SIGINT or SIGTERM.
pub(crate) async fn signalled() {
    use tokio::signal::unix::{SignalKind, signal};
    let (Ok(mut interrupt), Ok(mut terminate)) =
        (signal(SignalKind::interrupt()), signal(SignalKind::terminate()))
    else {
        warn!("signals cannot be caught: peers may see this node for a while after its end");
        return std::future::pending().await;
    };
    tokio::select! {
        _ = interrupt.recv() => {}
        _ = terminate.recv() => {}
    }
}
