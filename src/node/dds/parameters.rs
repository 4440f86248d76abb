//! The parameter services of ROS, and `/parameter_events`. Those of the library know no description, no range and no
//! parameter that is read-only.

use std::rc::Rc;

use ros2_client::{Message, Publisher, RmwRequestId, Server};

use super::{Events, Opener, Readers, reliable_output};
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
    let qos = reliable_output(EVENTS.qos, EVENTS.qos.depth as i32);
    let changes = Changes(opener.publisher(EVENTS.named(), &qos)?);
    let setter = Setter { parameters: Rc::clone(parameters), changes, events: events.clone() };
    parameters::serve(&mut Opening { opener, readers, events }, setter)
}

struct Changes(Publisher<ParameterEvent>);

impl Tells for Changes {
    async fn tell(&self, change: ParameterEvent) -> Result<(), SendError> {
        let told = self.0.async_publish(change).await;
        told.map_err(|error| SendError::refused(EVENTS.name, &error))
    }
}

struct Opening<'a, 'b> {
    opener: &'a mut Opener<'b>,
    readers: &'a mut Readers,
    events: &'a Events,
}

impl<Q: Message + Clone + 'static, A: Message + 'static> Serves<Q, A> for Opening<'_, '_> {
    fn serve(
        &mut self,
        service: ParameterService,
        answer: impl AsyncFn(Q) -> A + 'static,
    ) -> Result<(), OpenError> {
        let (named, events) = (service.named(), self.events.clone());
        let server = Served { name: named.name, server: self.opener.server(named, MOST_CALLS)?, events };
        self.readers.spawn_local(parameters::answer_all(service, server, answer));
        Ok(())
    }
}

struct Served<Q: Message, A: Message> {
    name: &'static str,
    server: Server<Q, A>,
    events: Events,
}

impl<Q: Message + 'static, A: Message + 'static> Calls<Q, A> for Served<Q, A> {
    type Caller = RmwRequestId;

    async fn take(&self) -> Option<(RmwRequestId, Q)> {
        loop {
            match self.server.async_receive_request().await {
                Ok(call) => return Some(call),
                Err(error) => {
                    let garbled = Event::Garbled { topic: self.name.into(), text: error.to_string() };
                    self.events.send(garbled).await.ok()?;
                }
            }
        }
    }

    async fn answer(&self, caller: RmwRequestId, response: A) -> Result<(), SendError> {
        let sent = self.server.async_send_response(caller, response).await;
        sent.map_err(|error| SendError::unanswered(self.name, &error))
    }
}
