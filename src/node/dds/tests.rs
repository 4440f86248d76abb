//! The node and one that calls it, on this machine.

use ros2_client::{Client, Name, ServiceMapping, ServiceTypeName};
use tokio::sync::mpsc::Receiver;
use tokio::task::LocalSet;
use tokio::time::timeout;

use super::*;
use crate::args::Environment;
use crate::node::transport::Event;

/// How long a test waits for what must come.
const PATIENCE: Duration = Duration::from_secs(30);

/// In a domain where nobody else is, nor another run of the tests; its ports are above those that the system gives away.
fn setup() -> Setup {
    let domain = 215 + std::process::id() % 15;
    let environment = Environment { domain: Some(domain.to_string()), ..Environment::default() };
    Setup::parse(&[], &environment, "cfodi").unwrap().0
}

fn client(opener: &Opener<'_>) -> Client<TriggerRequest, TriggerResponse> {
    let (name, kind) = (Name::parse("/cfodi/save").unwrap(), ServiceTypeName::new("std_srvs", "Trigger"));
    let qos = || reliable(10, ros2_client::qos::Durability::Volatile);
    let mut node = opener.node.borrow_mut();
    node.create_client(ServiceMapping::Enhanced, &name, &kind, qos(), qos()).unwrap()
}

/// Calls until that is heard.
async fn heard(
    client: &Client<TriggerRequest, TriggerResponse>,
    events: &mut Receiver<Event<Caller>>,
) -> Caller {
    loop {
        client.async_send_request(TriggerRequest::default()).await.unwrap();
        let soon = Duration::from_millis(200);
        while let Ok(event) = timeout(soon, events.recv()).await {
            if let Some(Event::Call(Service::Save, caller)) = event {
                return caller;
            }
        }
    }
}

async fn call_and_join_anew() -> TriggerResponse {
    let setup = setup();
    let (dds, _, mut events) = Dds::open(&setup, Security::Off).await.unwrap();
    let other = setup.for_node("caller");
    let opener = Opener::new(&other, &Security::Off).unwrap();
    let client = client(&opener);
    let caller = heard(&client, &mut events).await;
    dds.join_anew("for a test").await.unwrap();
    let response = TriggerResponse { success: true, message: "saved".to_owned() };
    dds.answer(Service::Save, caller, response).await.unwrap();
    client.async_receive_response(caller.id).await.unwrap()
}

#[test]
fn a_call_from_before_the_network_was_joined_anew_is_answered() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
    let answered =
        LocalSet::new().block_on(&runtime, async { timeout(PATIENCE, call_and_join_anew()).await });
    assert_eq!(answered.unwrap().message, "saved");
}
