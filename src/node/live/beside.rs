//! What works beside the node's loop: the engine's thread, the one that writes maps, and the task that publishes.

use tokio::sync::mpsc::{Receiver, Sender, UnboundedReceiver, channel};
use tokio::task::{JoinHandle, spawn_local};

use super::{LiveError, places};
use crate::config::Config;
use crate::engine::Engine;
use crate::node::publish::{Ended, Make, Outlets, Seen, messages, publish};
use crate::node::saving::{self, Written};
use crate::node::transport::Transport;
use crate::worker::{Output, Worker};

/// Outputs of the worker that wait to be sent; when full, the worker waits too, and newer scans replace older ones.
const OUTPUTS: usize = 64;

/// Steps of these that tests let panic.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    /// Gives on what the engine's thread has to say, on that thread.
    pub(super) send: fn(&Sender<Output>, Output),
    /// Makes the messages of a map.
    pub(super) make: Make,
}

impl Default for Steps {
    fn default() -> Self {
        Self { send: |outputs, output| drop(outputs.blocking_send(output)), make: messages }
    }
}

/// What is heard of them.
pub(super) struct Beside {
    pub(super) publishing: JoinHandle<Ended>,
    /// Why the messages of maps cannot be made any more.
    pub(super) muted: Receiver<String>,
    /// Maps that have been written, or were not; `None` where none are saved.
    pub(super) written: Option<UnboundedReceiver<Written>>,
}

impl Beside {
    /// Starts them, with the map of `engine`, which has this session.
    pub(super) fn start<T: Transport>(
        config: &Config,
        engine: Engine,
        session: u64,
        outlets: Outlets<T>,
        seen: Seen,
        Steps { send, make }: Steps,
    ) -> Result<(Worker, Self), LiveError> {
        let failed = |thread| move |error| LiveError::Start { thread, error };
        let (outputs, receiver) = channel::<Output>(OUTPUTS);
        let sink = move |output| send(&outputs, output);
        let worker = Worker::start(engine, session, places(config), sink);
        let worker = worker.map_err(failed("the engine's thread"))?;
        let start = |path| saving::start(path, config.fixed_frame.clone());
        let saver = config.snapshot_path.clone().map(start).transpose();
        let (saver, written) = saver.map_err(failed("the thread that saves the map"))?.unzip();
        let (broken, muted) = channel(1);
        let publishing = publish(outlets, receiver, seen, config.clone(), saver, broken, make);
        let publishing = spawn_local(publishing);
        Ok((worker, Self { publishing, muted, written }))
    }
}
