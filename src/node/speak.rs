//! Sends what the node says of itself: lines of its log to `/rosout`, reports to `/diagnostics`, and these to a recorder too.

use std::rc::Rc;
use std::time::Instant;

use tokio::sync::mpsc;
use tracing::error;

use super::publish::Outlets;
use super::rosout::Lines;
use super::throttle::Throttle;
use super::transport::Transport;
use crate::msg::outgoing::Outgoing;
use crate::msg::reports::{DiagnosticArray, Log};

/// Sends until no more reports come, then the lines that still wait.
pub(super) async fn speak(
    Outlets { transport, recorder }: Outlets<impl Transport>,
    mut reports: mpsc::Receiver<DiagnosticArray>,
    Lines(mut lines): Lines,
) {
    let logger = transport.node_name().trim_start_matches('/').replace('/', ".");
    let mut voice = Voice { transport, throttle: Throttle::default() };
    let named = |log| Outgoing::Log(Log { name: logger.clone(), ..log });
    loop {
        tokio::select! {
            report = reports.recv() => match report {
                Some(report) => {
                    let report = Outgoing::Diagnostics(report);
                    if let Some(recorder) = &recorder {
                        recorder.outgoing(&report).await;
                    }
                    voice.send(report).await;
                }
                None => break,
            },
            Some(log) = lines.recv() => voice.send(named(log)).await,
        }
    }
    while let Ok(log) = lines.try_recv() {
        voice.send(named(log)).await;
    }
}

struct Voice<T> {
    transport: Rc<T>,
    throttle: Throttle,
}

impl<T: Transport> Voice<T> {
    async fn send(&mut self, message: Outgoing) {
        let topic = message.topic().name;
        if let Err(failure) = self.transport.publish(message).await
            && self.throttle.allows(topic, Instant::now())
        {
            error!("what the node says of itself could not be sent: {failure}");
        }
    }
}
