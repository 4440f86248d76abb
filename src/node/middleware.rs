//! What a process does with a middleware.

use std::future::Future;
use std::net::Ipv4Addr;

use thiserror::Error;
use tokio::sync::mpsc::{Receiver, Sender};

use super::places::without_places;
use super::transport::{Event, Transport};
use crate::args::security::{Security, SecurityError};
use crate::args::{ArgsError, Setup};
use crate::config::Value;

/// The middleware refused something.
#[derive(Debug, Error)]
pub enum OpenError {
    /// With what it was asked for, and its own words.
    #[error("cannot open {what}: {text}")]
    Open {
        /// A topic, service or the participant.
        what: String,
        /// The middleware's words.
        text: String,
    },
    /// A message cannot be read.
    #[error("cannot read the map: {text}")]
    Read {
        /// The middleware's words.
        text: String,
    },
    /// An address that cannot be used.
    #[error("network_interfaces has {address}: {text}")]
    Interface {
        /// As given.
        address: Ipv4Addr,
        /// Why not.
        text: String,
    },
    /// A name that cannot be resolved.
    #[error(transparent)]
    Name(#[from] ArgsError),
    /// A variable of the environment that the middleware cannot be opened by.
    #[error("{name} is {value:?}: {text}")]
    Variable {
        /// The variable.
        name: &'static str,
        /// As given.
        value: String,
        /// What is wrong.
        text: String,
    },
    /// DDS Security was asked for and cannot be had; no socket was opened.
    #[error(transparent)]
    Security(#[from] SecurityError),
}

impl OpenError {
    /// Says that `what` cannot be opened, for a reason of the middleware.
    pub(super) fn opening<E: ToString>(what: &str) -> impl FnOnce(E) -> Self {
        move |error| Self::Open { what: what.to_owned(), text: without_places(&error.to_string()) }
    }
}

/// Events that wait for the node; a cloud that finds no place waits in the middleware, over Zenoh in its mailbox.
pub(super) const EVENTS: usize = 16;

/// A transport as it was opened: with what others in this process add events by, and where they come out.
pub type Opened<T> = (T, Adding<T>, Receiver<Event<<T as Transport>::Request>>);

/// Adds events to those of a transport.
pub type Adding<T> = Sender<Event<<T as Transport>::Request>>;

/// A transport that a process opens and leaves.
pub trait Middleware: Transport<Request: Send> + Sized {
    /// For a person.
    const NAME: &str;

    /// Checks what can be known before anything is opened, and says what the node does about security over this middleware.
    ///
    /// # Errors
    /// When the node must not open a socket, or could not be opened as it is set up.
    fn check(setup: &Setup) -> Result<Security, OpenError>;

    /// Says in the log what the system gives it, before it is opened.
    fn say_system(setup: &Setup);

    /// Opens the node and starts reading; call it inside a [`tokio::task::LocalSet`].
    ///
    /// # Errors
    /// When the middleware refuses something, with what it was.
    fn open(setup: &Setup, security: Security) -> impl Future<Output = Result<Opened<Self>, OpenError>>;

    /// The parameters that have other values by now than those that the node of `setup` began with.
    fn changed(&self, setup: &Setup) -> Vec<(String, Value)>;

    /// Whether the middleware still does anything; where it does not, [`Self::close`] does not return.
    fn answers(&self) -> impl Future<Output = bool>;

    /// Takes the node off the network. Call what this returns once the [`tokio::task::LocalSet`] has been dropped: readers sign off
    /// at what must still be there, and who tells peers of the end must be the last.
    fn close(self) -> impl Future<Output = impl FnOnce()>;
}
