//! The parameter services of ROS, and `/parameter_events`. Those of the library know no description, no range and no
//! parameter that is read-only.

use std::borrow::Cow;
use std::rc::Rc;
use std::time::Instant;

use ros2_client::qos::Durability;
use ros2_client::{Message, Publisher, Server};
use tracing::warn;

use super::{Events, Opener, Readers, reliable_output};
use crate::msg::parameters::{
    DescribeResponse, GetResponse, ListRequest, ListResponse, Names, ParameterEvent, SetAtomicallyResponse,
    SetParametersResult, SetRequest, SetResponse, TypesResponse,
};
use crate::node::middleware::OpenError;
use crate::node::parameters::{EVENTS, Parameters, SERVICES};
use crate::node::throttle::Throttle;
use crate::node::transport::Event;

impl Message for Names {}
impl Message for ListRequest {}
impl Message for SetRequest {}
impl Message for GetResponse {}
impl Message for TypesResponse {}
impl Message for DescribeResponse {}
impl Message for ListResponse {}
impl Message for SetResponse {}
impl Message for SetAtomicallyResponse {}

/// Requests that may wait, as in ROS.
const DEPTH: usize = 1000;

/// Opens the services and starts answering.
pub(super) fn serve(
    opener: &mut Opener<'_>,
    readers: &mut Readers,
    parameters: &Rc<Parameters>,
    events: &Events,
) -> Result<(), OpenError> {
    let setter = Setter::open(opener, parameters, events)?;
    let [get, types, describe, list, set, set_atomically] = SERVICES;
    let here = || Rc::clone(parameters);
    let (a, b, c, d) = (here(), here(), here(), here());
    spawn(opener, readers, events, get, async move |asked| a.get(&asked))?;
    spawn(opener, readers, events, types, async move |asked| b.types(&asked))?;
    spawn(opener, readers, events, describe, async move |asked| c.describe(&asked))?;
    spawn(opener, readers, events, list, async move |asked| d.list(&asked))?;
    let each = setter.clone();
    spawn(opener, readers, events, set, async move |wanted: SetRequest| {
        let mut results = Vec::new();
        for parameter in wanted.parameters {
            tokio::task::yield_now().await;
            results.push(each.set(SetRequest { parameters: vec![parameter] }).await);
        }
        SetResponse { results }
    })?;
    spawn(opener, readers, events, set_atomically, async move |wanted| SetAtomicallyResponse {
        result: setter.set(wanted).await,
    })
}

/// Sets parameters and tells of it: the node, and whoever listens to [`EVENTS`].
#[derive(Clone)]
struct Setter {
    parameters: Rc<Parameters>,
    changes: Rc<Publisher<ParameterEvent>>,
    events: Events,
}

impl Setter {
    fn open(
        opener: &mut Opener<'_>,
        parameters: &Rc<Parameters>,
        events: &Events,
    ) -> Result<Self, OpenError> {
        let qos = reliable_output(DEPTH, Durability::Volatile, DEPTH as i32);
        let changes = opener.publisher((EVENTS, "rcl_interfaces", "ParameterEvent"), &qos)?;
        Ok(Self { parameters: Rc::clone(parameters), changes: Rc::new(changes), events: events.clone() })
    }

    async fn set(&self, wanted: SetRequest) -> SetParametersResult {
        let (result, change) = self.parameters.set_and_tell(wanted, &self.events).await;
        if let Some(change) = change
            && let Err(error) = self.changes.async_publish(change).await
        {
            warn!("a change of parameters could not be told on {EVENTS}: {error}");
        }
        result
    }
}

fn spawn<Q: Message + Clone + 'static, A: Message + 'static>(
    opener: &mut Opener<'_>,
    readers: &mut Readers,
    events: &Events,
    (name, kind): (&'static str, &str),
    answer: impl AsyncFn(Q) -> A + 'static,
) -> Result<(), OpenError> {
    let server = opener.server(name, ("rcl_interfaces", kind), DEPTH)?;
    readers.spawn_local(answer_all(name, server, answer, events.clone()));
    Ok(())
}

async fn answer_all<Q: Message + 'static, A: Message + 'static>(
    name: &'static str,
    server: Server<Q, A>,
    answer: impl AsyncFn(Q) -> A,
    events: Events,
) -> Cow<'static, str> {
    let mut throttle = Throttle::default();
    loop {
        match server.async_receive_request().await {
            Ok((caller, request)) => {
                // A flood of calls must not be all that is done.
                tokio::task::yield_now().await;
                let response = answer(request).await;
                if let Err(error) = server.async_send_response(caller, response).await
                    && throttle.allows(name, Instant::now())
                {
                    warn!("{name} could not be answered: {error}");
                }
            }
            Err(error) => {
                if events.send(Event::Garbled { topic: name.into(), text: error.to_string() }).await.is_err()
                {
                    return name.into();
                }
            }
        }
    }
}
