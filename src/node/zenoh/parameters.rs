//! The parameter services of ROS, and `/parameter_events`.

use std::borrow::Cow;
use std::rc::Rc;
use std::time::Instant;

use serde::Serialize;
use serde::de::DeserializeOwned;
use tracing::warn;

use super::mailbox::Room;
use super::names::Qos;
use super::opener::{Calls, Opener};
use super::outlet::Outlet;
use super::{Events, Readers};
use crate::bag::cdr;
use crate::msg::parameters::{SetAtomicallyResponse, SetParametersResult, SetRequest, SetResponse};
use crate::node::middleware::OpenError;
use crate::node::parameters::{EVENTS, Parameters, SERVICES};
use crate::node::throttle::Throttle;

/// Requests that may wait, as in ROS, and their bytes.
const ROOM: Room = Room { messages: 1000, bytes: 4 << 20 };

/// Opens the services and starts answering.
pub(super) fn serve(
    opener: &Opener,
    readers: &mut Readers,
    parameters: &Rc<Parameters>,
    events: &Events,
) -> Result<(), OpenError> {
    let changes = (EVENTS, "rcl_interfaces/msg/ParameterEvent");
    let changes = Outlet::open(opener, changes, Qos { reliable: true, latched: false, depth: 1000 })?;
    let changes = Rc::new(changes);
    for (name, kind) in SERVICES {
        let calls = opener.serve((name, &format!("rcl_interfaces/srv/{kind}")), ROOM)?;
        let (here, changes) = (Rc::clone(parameters), Rc::clone(&changes));
        let setter = Setter { parameters: Rc::clone(parameters), changes, events: events.clone() };
        let events = events.clone();
        match kind {
            "GetParameters" => readers.spawn_local(answer(calls, events, async move |q| here.get(&q))),
            "GetParameterTypes" => readers.spawn_local(answer(calls, events, async move |q| here.types(&q))),
            "DescribeParameters" => {
                readers.spawn_local(answer(calls, events, async move |q| here.describe(&q)))
            }
            "ListParameters" => readers.spawn_local(answer(calls, events, async move |q| here.list(&q))),
            "SetParameters" => {
                readers.spawn_local(answer(calls, events, async move |q| setter.set_each(q).await))
            }
            _ => readers.spawn_local(answer(calls, events, async move |q| SetAtomicallyResponse {
                result: setter.set(q).await,
            })),
        };
    }
    Ok(())
}

/// Sets parameters and tells of it: the node, and whoever listens to [`EVENTS`].
struct Setter {
    parameters: Rc<Parameters>,
    changes: Rc<Outlet>,
    events: Events,
}

impl Setter {
    async fn set_each(&self, wanted: SetRequest) -> SetResponse {
        let mut results = Vec::new();
        for parameter in wanted.parameters {
            tokio::task::yield_now().await;
            results.push(self.set(SetRequest { parameters: vec![parameter] }).await);
        }
        SetResponse { results }
    }

    async fn set(&self, wanted: SetRequest) -> SetParametersResult {
        let (result, change) = self.parameters.set_and_tell(wanted, &self.events).await;
        if let Some(change) = change {
            let mut bytes = Vec::new();
            let written = cdr::write(&mut bytes, &change).map(|()| bytes);
            if let Err(error) = self.changes.send(written) {
                warn!("a change of parameters could not be told: {error}");
            }
        }
        result
    }
}

async fn answer<Q: DeserializeOwned, A: Serialize>(
    calls: Calls,
    events: Events,
    answer: impl AsyncFn(Q) -> A,
) -> Cow<'static, str> {
    let mut throttle = Throttle::default();
    while let Some((call, request)) = calls.take(&events).await {
        // A flood of calls must not be all that is done.
        tokio::task::yield_now().await;
        let response = answer(request).await;
        if let Err(error) = call.answer(&response)
            && throttle.allows(calls.name, Instant::now())
        {
            warn!("{} could not be answered: {error}", calls.name);
        }
    }
    calls.name.into()
}
