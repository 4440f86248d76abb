//! The parameter services of ROS, and `/parameter_events`.

use std::rc::Rc;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::mailbox::Room;
use super::opener::{self, Call, Opener};
use super::outlet::Outlet;
use super::{Events, Readers};
use crate::msg::cdr;
use crate::msg::parameters::ParameterEvent;
use crate::node::middleware::OpenError;
use crate::node::parameters::{
    self, Calls, EVENTS, MOST_CALLS, ParameterService, Parameters, Serves, Setter, Tells,
};
use crate::node::transport::SendError;

/// Requests that may wait, and their bytes.
const ROOM: Room = Room { messages: MOST_CALLS, bytes: 4 << 20 };

/// Opens the services and starts answering.
pub(super) fn serve(
    opener: &Opener,
    readers: &mut Readers,
    parameters: &Rc<Parameters>,
    events: &Events,
) -> Result<(), OpenError> {
    let changes = Outlet::open(opener, EVENTS)?;
    let setter = Setter { parameters: Rc::clone(parameters), changes, events: events.clone() };
    parameters::serve(&mut Opening { opener, readers, events }, setter)
}

impl Tells for Outlet {
    async fn tell(&self, change: ParameterEvent) -> Result<(), SendError> {
        let mut bytes = Vec::new();
        self.send(cdr::write(&mut bytes, &change).map(|()| bytes))
    }
}

struct Opening<'a> {
    opener: &'a Opener,
    readers: &'a mut Readers,
    events: &'a Events,
}

impl<Q: DeserializeOwned + 'static, A: Serialize + 'static> Serves<Q, A> for Opening<'_> {
    fn serve(
        &mut self,
        service: ParameterService,
        answer: impl AsyncFn(Q) -> A + 'static,
    ) -> Result<(), OpenError> {
        let calls = self.opener.serve(service.named(), ROOM)?;
        let served = Served { calls, events: self.events.clone() };
        self.readers.spawn_local(parameters::answer_all(service, served, answer));
        Ok(())
    }
}

struct Served {
    calls: opener::Calls,
    events: Events,
}

impl<Q: DeserializeOwned, A: Serialize> Calls<Q, A> for Served {
    type Caller = Call;

    async fn take(&self) -> Option<(Call, Q)> {
        self.calls.take(&self.events).await
    }

    async fn answer(&self, call: Call, response: A) -> Result<(), SendError> {
        call.answer(&response)
    }
}
