//! The lines of the log, for `/rosout`: what stands on stderr is heard by those too who did not start the node.

use std::fmt::{Debug, Write as _};

use tokio::sync::mpsc;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::Context;

use super::clock::now;
use crate::msg::reports::Log;

/// Lines that may wait until they are sent; what finds no place stands on stderr alone.
const WAITING: usize = 256;

/// Listens to the log.
#[derive(Debug)]
pub struct Listener(mpsc::Sender<Log>);

/// The lines that were heard.
#[derive(Debug)]
pub struct Lines(pub(super) mpsc::Receiver<Log>);

/// A listener for the log of this process, and what it hears: the project's own lines, from information on.
pub fn listen() -> (Listener, Lines) {
    let (sender, receiver) = mpsc::channel(WAITING);
    (Listener(sender), Lines(receiver))
}

impl<S: Subscriber> Layer<S> for Listener {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let about = event.metadata();
        let level = match *about.level() {
            Level::ERROR => 40,
            Level::WARN => 30,
            Level::INFO => 20,
            _ => return,
        };
        if !about.target().starts_with("cfodi") {
            return;
        }
        let mut text = Text::default();
        event.record(&mut text);
        let log = Log {
            stamp: now().into(),
            level,
            msg: text.0,
            file: about.file().unwrap_or_default().to_owned(),
            line: about.line().unwrap_or_default(),
            ..Log::default()
        };
        drop(self.0.try_send(log));
    }
}

#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let written = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
        debug_assert!(written.is_ok(), "a text takes what is written");
    }
}

#[cfg(test)]
mod tests {
    use tracing::{debug, info, warn};
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;

    #[test]
    fn own_lines_from_information_on_are_heard_and_what_finds_no_place_is_not_waited_for() {
        let (listener, mut lines) = listen();
        tracing::subscriber::with_default(tracing_subscriber::registry().with(listener), || {
            info!("ready: {}", 7);
            debug!("not for others");
            warn!(target: "rustdds", "not ours");
            warn!("lost");
            (0..2 * WAITING).for_each(|_| info!("more"));
        });
        let heard: Vec<_> = std::iter::from_fn(|| lines.0.try_recv().ok()).collect();
        assert_eq!(heard.len(), WAITING);
        let told = |log: &Log| (log.level, log.msg.clone());
        assert_eq!(
            [told(&heard[0]), told(&heard[1])],
            [(20, "ready: 7".to_owned()), (30, "lost".to_owned())]
        );
        assert!(heard[0].file.ends_with("rosout.rs") && heard[0].stamp.sec > 0);
    }
}
