//! The parameter services of ROS, and `/parameter_events`. Those of the library know no description, no range and no
//! parameter that is read-only.

use std::rc::Rc;

use ros2_client::{Message, RmwRequestId, Server};

use super::answering::Answering;
use super::outlet::Outlet;
use super::{Events, Opener, Readers};
use crate::msg::parameters::{
    DescribeResponse, GetResponse, ListRequest, ListResponse, Names, ParameterEvent, SetAtomicallyResponse,
    SetRequest, SetResponse, TypesResponse,
};
use crate::node::middleware::OpenError;
use crate::node::parameters::{
    self, Calls, EVENTS, MOST_CALLS, ParameterService, Parameters, Serves, Setter, Tells,
};
use crate::node::transport::{Event, SendError};

impl Message for Names {}
impl Message for ListRequest {}
impl Message for SetRequest {}
impl Message for GetResponse {}
impl Message for TypesResponse {}
impl Message for DescribeResponse {}
impl Message for ListResponse {}
impl Message for SetResponse {}
impl Message for SetAtomicallyResponse {}

/// Opens the services and starts answering.
pub(super) fn serve(
    opener: &mut Opener<'_>,
    readers: &mut Readers,
    parameters: &Rc<Parameters>,
    events: &Events,
) -> Result<(), OpenError> {
    let changes = Outlet::open(opener, EVENTS, EVENTS.qos.depth as i32)?;
    let setter = Setter { parameters: Rc::clone(parameters), changes, events: events.clone() };
    parameters::serve(&mut Opening { opener, readers, events }, setter)
}

impl Tells for Outlet<ParameterEvent> {
    async fn tell(&self, change: ParameterEvent) -> Result<(), SendError> {
        self.send(change).await?.map_or(Ok(()), |_| Err(self.refusal()))
    }
}

struct Opening<'a, 'b> {
    opener: &'a mut Opener<'b>,
    readers: &'a mut Readers,
    events: &'a Events,
}

impl<Q: Message + Clone + 'static, A: Message + Clone + 'static> Serves<Q, A> for Opening<'_, '_> {
    fn serve(
        &mut self,
        service: ParameterService,
        answer: impl AsyncFn(Q) -> A + 'static,
    ) -> Result<(), OpenError> {
        let (named, events) = (service.named(), self.events.clone());
        let answering = Answering::new(named.name, self.opener.server(named, MOST_CALLS)?);
        let served = Served { answering, events };
        self.readers.spawn_local(parameters::answer_all(service, served, answer));
        Ok(())
    }
}

struct Served<Q: Message, A: Message> {
    answering: Answering<Server<Q, A>>,
    events: Events,
}

impl<Q: Message + 'static, A: Message + Clone + 'static> Calls<Q, A> for Served<Q, A> {
    type Caller = RmwRequestId;

    async fn take(&self) -> Option<(RmwRequestId, Q)> {
        loop {
            match self.answering.server.async_receive_request().await {
                Ok(call) => return Some(call),
                Err(error) => {
                    let garbled =
                        Event::Garbled { topic: self.answering.name.into(), text: error.to_string() };
                    self.events.send(garbled).await.ok()?;
                }
            }
        }
    }

    async fn answer(&self, caller: RmwRequestId, response: A) -> Result<(), SendError> {
        self.answering.answer(caller, response).await
    }
}
