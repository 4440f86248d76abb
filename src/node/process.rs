//! The live node as a process: runtime, signals, socket buffer, and the last word about where every cloud went.

use std::cell::RefCell;
use std::future::Future;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use thiserror::Error;
use tokio::task::LocalSet;
use tracing::{info, warn};

use super::counts::Counts;
use super::inputs::reads;
use super::live::{self, LiveError, Start};
use super::middleware::{Adding, Middleware, OpenError};
use super::publish::Outlets;
use super::record::Recorder;
use super::resume::BeginError;
use super::rosout::Lines;
use super::transport::SensorTopics;
use crate::args::security::Security;
use crate::args::{ArgsError, RmwError, Setup};
use crate::config::Value;
use crate::engine::{Engine, Snapshot};
use crate::say::say;
use crate::signals::Signals;
use crate::stop::{self, Hold};

/// The process has to end with a failure.
#[derive(Debug, Error)]
pub enum ProcessError {
    /// The system gives no runtime.
    #[error("cannot start: {0}")]
    Runtime(std::io::Error),
    /// The network cannot be joined.
    #[error("cannot join the ROS network")]
    Network(#[from] OpenError),
    /// A name that cannot be resolved.
    #[error(transparent)]
    Name(#[from] ArgsError),
    /// The middleware that was asked for cannot be had.
    #[error(transparent)]
    Rmw(#[from] RmwError),
    /// What was saved cannot be begun with.
    #[error(transparent)]
    Begin(#[from] BeginError),
    /// The node failed.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// Nobody has asked for the node's end, and nothing but that of the process gives it ears again.
    #[error("the node is deaf: {why}")]
    Deaf {
        /// Why.
        why: String,
        /// Parameters that were set to other values since it began.
        changed: Vec<(String, Value)>,
    },
}

impl ProcessError {
    /// Whether it is wrong how the node was started: nothing was opened, and starting it again will not help.
    pub fn is_configuration(&self) -> bool {
        match self {
            Self::Begin(error) => error.is_configuration(),
            Self::Rmw(_) | Self::Name(_) => true,
            Self::Network(error) => {
                matches!(error, OpenError::Security(_) | OpenError::Name(_) | OpenError::Variable { .. })
            }
            _ => false,
        }
    }
}

fn say_ready(setup: &Setup, sensors: &[SensorTopics]) {
    let (node, domain) = (setup.fully_qualified_name(), setup.domain);
    let reads: Vec<_> = sensors.iter().map(reads).collect();
    info!("ready: {node} reads {}, in domain {domain}", reads.join("; "));
}

/// Time between the end of a deaf node and the next: what fails at once must not begin anew as fast as it can, for ever.
const PAUSE: Duration = Duration::from_secs(1);

fn say_security(middleware: &str, security: &Security) {
    match security {
        Security::Off => {}
        Security::Unsecured(why) => {
            warn!("{middleware} is not secured, which ROS_SECURITY_STRATEGY permits: {why}");
        }
        Security::Keys(enclave) => {
            info!(
                "{middleware} is secured with the keys in {} of enclave {}",
                enclave.folder.display(),
                enclave.name
            );
        }
    }
}

/// Runs the live node with the map of `engine` until a signal comes or `done` resolves, and returns its map; what it sends
/// of the map goes to `recorder` too, `lines` are those of its log; `begin` is called once it listens. A second signal ends the
/// process with status 1, unless the map is saved at that end: then it is given up.
///
/// # Errors
/// When the network cannot be joined, the node fails, or `begin` does.
pub fn live_node<T: Middleware, E: From<ProcessError>>(
    setup: &Setup,
    engine: Engine,
    recorder: Option<Recorder>,
    lines: Lines,
    begin: impl FnOnce(Adding<T>) -> Result<(), E>,
    done: impl Future<Output = ()>,
) -> Result<Arc<Snapshot>, E> {
    let security = T::check(setup).map_err(ProcessError::from)?;
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ProcessError::Runtime)?;
    let counts = Rc::new(RefCell::new(Counts::default()));
    let tasks = LocalSet::new();
    let ended = tasks.block_on(&runtime, async {
        T::say_system(setup);
        let opened = T::open(setup, security.clone()).await;
        let (transport, events, receiver) = opened.map_err(ProcessError::from)?;
        say_security(T::NAME, &security);
        let transport = Rc::new(transport);
        // Whoever reads that it is ready may end it at once.
        let (ends, signals) = (signals(), signals());
        // One more ends the process, whatever it then waits for; but while a map may be on its way into its file, that alone.
        let saving = setup.config().snapshot_path.as_ref().map(|_| Hold::new());
        stop::flag();
        say_ready(setup, transport.inputs());
        let lived = match begin(events) {
            Ok(()) => {
                let outlets = Outlets { transport: Rc::clone(&transport), recorder };
                let start = Start { engine, outlets, events: receiver, counts: Rc::clone(&counts), lines };
                Ok(live::run(setup.config(), start, ending(ends, done), asked_again()).await)
            }
            Err(error) => Err(error),
        };
        drop(saving);
        let changed = transport.changed(setup);
        let leaving = leave(transport).await;
        let map = match lived {
            Ok(Err(LiveError::Deaf(why))) => Err(deaf(why, changed, signals).await.into()),
            Ok(map) => map.map_err(|error| ProcessError::from(error).into()),
            Err(error) => Err(error),
        };
        Ok::<_, E>((map, leaving))
    });
    let map = ended.and_then(|(map, leaving)| {
        match leaving {
            Some(leave) => {
                drop(tasks);
                leave();
            }
            None => std::mem::forget(tasks),
        }
        map
    });
    say(format_args!("counts {}", counts.borrow()));
    map
}

/// Whether the process is to begin anew: not where it was asked to end meanwhile.
async fn deaf(why: String, changed: Vec<(String, Value)>, mut signals: Option<Signals>) -> ProcessError {
    match tokio::time::timeout(PAUSE, asked(&mut signals)).await {
        Ok(()) => LiveError::Deaf(why).into(),
        Err(_) => ProcessError::Deaf { why, changed },
    }
}

/// Takes the node off the network. A middleware that does not answer is left as it is, for good: it would be waited for.
async fn leave<T: Middleware>(transport: Rc<T>) -> Option<impl FnOnce()> {
    if !transport.answers().await {
        std::mem::forget(transport);
        return None;
    }
    Some(Rc::into_inner(transport)?.close().await)
}

/// The signals that end it; `None` where the system does not give them.
fn signals() -> Option<Signals> {
    let signals = Signals::new().ok();
    if signals.is_none() {
        warn!("signals cannot be caught: peers may see this node for a while after its end");
    }
    signals
}

/// Resolves at one of them.
async fn asked(signals: &mut Option<Signals>) {
    match signals {
        Some(signals) => signals.any().await,
        None => std::future::pending().await,
    }
}

/// Resolves at the first signal after this is asked for.
async fn asked_again() {
    asked(&mut signals()).await;
}

/// Resolves at a signal or with `done`.
async fn ending(mut signals: Option<Signals>, done: impl Future<Output = ()>) {
    tokio::select! {
        () = asked(&mut signals) => {}
        () = done => {}
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use tokio::sync::{mpsc, oneshot};

    use super::*;
    use crate::args::Environment;
    use crate::node::fake::Fake;
    use crate::node::middleware::Opened;
    use crate::node::rosout::listen;

    thread_local! {
        /// How many of these middlewares this thread has closed.
        static CLOSED: Cell<u32> = const { Cell::new(0) };
    }

    impl Middleware for Fake {
        const NAME: &str = "channels";

        fn check(_: &Setup) -> Result<Security, OpenError> {
            Ok(Security::Off)
        }

        fn say_system(_: &Setup) {}

        async fn open(_: &Setup, _: Security) -> Result<Opened<Self>, OpenError> {
            let (events, receiver) = mpsc::channel(1);
            Ok((Self::default(), events, receiver))
        }

        fn changed(&self, _: &Setup) -> Vec<(String, Value)> {
            Vec::new()
        }

        async fn answers(&self) -> bool {
            true
        }

        async fn close(self) -> impl FnOnce() {
            || CLOSED.set(CLOSED.get() + 1)
        }
    }

    /// A simulated robot that cannot be opened.
    #[test]
    fn a_node_leaves_the_network_where_what_begins_with_it_fails() {
        let (setup, _) = Setup::parse(&[], &Environment::default(), "cfodi").unwrap();
        let run = |begun: Result<(), LiveError>| {
            let engine = Engine::new(setup.config().engine);
            // Without its other end the node is deaf.
            let mut events = Vec::new();
            let begin = |adding| {
                events.push(adding);
                Ok(begun?)
            };
            live_node::<Fake, ProcessError>(&setup, engine, None, listen().1, begin, std::future::ready(()))
        };
        let failed = run(Err(LiveError::SaverDied));
        assert!(matches!(failed, Err(ProcessError::Live(LiveError::SaverDied))), "{failed:?}");
        assert_eq!(CLOSED.get(), 1);
        assert_eq!((run(Ok(())).unwrap().sequence, CLOSED.get()), (0, 2));
    }

    #[test]
    fn a_node_ends_when_it_is_done_and_looks_at_no_clock_for_that() {
        // It has no timers: whoever looked now and then would panic.
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let (done, told) = oneshot::channel::<()>();
        runtime.block_on(async {
            let telling = async {
                tokio::task::yield_now().await;
                drop(done);
            };
            tokio::join!(ending(None, async { drop(told.await) }), telling);
        });
    }
}
