//! [`Transport`] over Zenoh, by the conventions of `rmw_zenoh`. The only module that imports `zenoh`.
//!
//! Zenoh's threads put what they receive into bounded mailboxes and never wait; tasks on the node's thread take it out, decode
//! it and hand events to one bounded channel. The Zenoh of `ros2_client` 0.12.1 is not used: it knows the hashes of no type
//! that the node sends, so that no reader of `rmw_zenoh` would match, keeps nothing for late readers and asks nobody for what
//! it missed, waits in Zenoh's threads where a queue is full, and brings every transport that Zenoh has.

mod answers;
mod config;
mod discards;
mod graph;
mod latched;
mod mailbox;
mod names;
mod opener;
mod outlet;
mod parameters;
mod read;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::Builder;
use std::time::{Duration, Instant};

use tokio::sync::{Notify, mpsc};
use tokio::time::{sleep, timeout};
use tracing::{info, warn};
use zenoh::config::WhatAmI;
use zenoh::pubsub::Subscriber;
use zenoh::session::TransportEvent;
use zenoh::{Config, Session, Wait as _};

use self::answers::Answers;
use self::graph::Graph;
pub use self::opener::Call;
use self::opener::Opener;
use self::outlet::Outlet;
use super::middleware::{Adding, EVENTS, Middleware, OpenError, Opened};
use super::own_thread::on_own_thread;
use super::parameters::Parameters;
use super::places::without_places;
use super::readers::{self, Readers};
use super::seeds::Scans;
use super::transport::{DISCOVERY, Input, NetworkState, SendError, SensorTopics, Service, Source, Transport};
use crate::args::Setup;
use crate::args::security::Security;
use crate::bag::TransformTopics;
use crate::config::Value;
use crate::msg::outgoing::Outgoing;
use crate::msg::ros::TriggerResponse;

/// Time between two looks for a router where there is none at the start, and at whether the session is open; and until Zenoh itself
/// knows what it has told.
const LOOK: Duration = Duration::from_secs(1);

/// Adds events to those of the network.
type Events = Adding<Zenoh>;

/// Runs what waits for Zenoh on a thread of its own: within a runtime of one thread Zenoh panics where it is waited for. Where the
/// system gives no thread that is the error; of the last of a session, which waits again when it is dropped, it ends the process.
async fn wait_for<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, OpenError> {
    let thread = Builder::new().name("cfodi-zenoh".to_owned());
    on_own_thread(thread, work).await.map_err(OpenError::opening("Zenoh"))
}

/// The node on Zenoh.
pub struct Zenoh {
    // Fields are dropped in this order; the session is closed by `close` alone.
    outlets: BTreeMap<&'static str, Outlet>,
    readers: tokio::sync::Mutex<Readers>,
    graph: Graph,
    _graph_reader: Subscriber<()>,
    _opener: Rc<Opener>,
    answers: Answers,
    /// A router has come or gone.
    router_news: Arc<Notify>,
    /// There was a router, and now there is none.
    lacks_router: Cell<bool>,
    /// When it came back last, or the session was opened.
    found_router: Cell<Instant>,
    /// It was said at the start that there is none.
    said_no_router: bool,
    session: Session,
    parameters: Rc<Parameters>,
    inputs: Vec<SensorTopics>,
    transforms: TransformTopics,
    /// What was heard of each of these.
    scans: Vec<Scans>,
    /// Fully qualified.
    name: String,
}

impl Zenoh {
    /// The node's ends on a session.
    fn on(
        session: &Session,
        setup: &Setup,
        said_no_router: bool,
        events: &Events,
    ) -> Result<Self, OpenError> {
        let parameters = Rc::new(Parameters::of(setup));
        let answers = Answers::start()?;
        let opener = Rc::new(Opener::new(setup, session, answers.clone())?);
        let graph = Graph::default();
        let outlets = outlet::open(&opener)?;
        let inputs = setup.sensor_topics()?;
        let scans = vec![Scans::default(); inputs.len()];
        let mut readers = read::listen(&opener, &graph, &parameters, &scans, events)?;
        parameters::serve(&opener, &mut readers, &parameters, events)?;
        Ok(Self {
            outlets,
            readers: tokio::sync::Mutex::new(readers),
            _graph_reader: graph.read(session, setup, opener.node().clone())?,
            graph,
            _opener: opener,
            answers,
            router_news: router_news(session)?,
            lacks_router: Cell::new(false),
            found_router: Cell::new(Instant::now()),
            said_no_router,
            session: session.clone(),
            parameters,
            inputs,
            transforms: setup.transform_topics()?,
            scans,
            name: setup.fully_qualified_name(),
        })
    }

    /// Resolves when the session is closed; says meanwhile when a router is found and lost.
    async fn closed(&self) -> String {
        let mut has_router = self.said_no_router.then_some(false);
        loop {
            match routers(&self.session).await {
                Ok(0) if has_router == Some(true) => {
                    self.lacks_router.set(true);
                    warn!("the Zenoh router has gone; it is connected to again when it is there");
                    has_router = Some(false);
                }
                Ok(0) => has_router = Some(false),
                Ok(_) => {
                    if self.lacks_router.replace(false) {
                        self.found_router.set(Instant::now());
                    }
                    if has_router == Some(false) {
                        info!("a Zenoh router is there");
                    }
                    has_router = Some(true);
                }
                Err(error) => return error.to_string(),
            }
            while timeout(LOOK, self.router_news.notified()).await.is_err() {
                if self.session.is_closed() {
                    return "the Zenoh session is closed".to_owned();
                }
            }
            sleep(LOOK).await;
        }
    }
}

/// Tells when a router has come or gone. How many there are then is asked for: of one that comes while this begins Zenoh may tell twice,
/// or that it has gone first.
fn router_news(session: &Session) -> Result<Arc<Notify>, OpenError> {
    let news = Arc::new(Notify::new());
    let told = Arc::clone(&news);
    let tell = move |event: TransportEvent| {
        if event.transport().whatami() == WhatAmI::Router {
            told.notify_one();
        }
    };
    let (info, what) = (session.info(), "the news of routers");
    info.transport_events_listener().callback(tell).background().wait().map_err(OpenError::opening(what))?;
    Ok(news)
}

/// How many routers the session is connected to.
async fn routers(session: &Session) -> Result<usize, OpenError> {
    let session = session.clone();
    wait_for(move || session.info().routers_zid().wait().count()).await
}

fn say_no_router() {
    warn!(
        "no Zenoh router is there yet, and without one others are not found: ros2 run rmw_zenoh_cpp rmw_zenohd"
    );
}

/// Opens a session, and says where that takes long: a client waits for its router. Whether it has said so.
async fn open_session(config: Config) -> Result<(Session, bool), OpenError> {
    let open = wait_for(move || zenoh::open(config).wait().map_err(OpenError::opening("a Zenoh session")));
    let mut open = pin!(open);
    if let Ok(opened) = timeout(LOOK, &mut open).await {
        return Ok((opened??, false));
    }
    warn!(
        "the Zenoh session is not open yet: a client waits for its router (ros2 run rmw_zenoh_cpp rmw_zenohd)"
    );
    Ok((open.await??, true))
}

/// Looks for a router `looks` times at most, and says where there is none; whether it has said so.
async fn find_router(session: &Session, looks: u64) -> Result<bool, OpenError> {
    for look in 0..looks {
        if look > 0 {
            sleep(LOOK).await;
        }
        if routers(session).await? > 0 {
            return Ok(look > 0);
        }
        if look % 10 == 0 {
            say_no_router();
        }
    }
    Ok(looks > 0)
}

/// Closes a session, however many ends it had.
async fn close(session: Session) {
    let closed = wait_for(move || {
        let closed = session.close().wait();
        drop(session);
        closed.map_err(|error| without_places(&error.to_string()))
    });
    if let Ok(Err(text)) | Err(OpenError::Open { text, .. }) = closed.await {
        warn!("the Zenoh session could not be closed: {text}");
    }
}

impl Middleware for Zenoh {
    const NAME: &str = "Zenoh";

    fn check(setup: &Setup) -> Result<Security, OpenError> {
        config::of_process()?;
        config::router_checks()?;
        Ok(setup.security_over_zenoh()?)
    }

    fn say_system(_: &Setup) {}

    async fn open(setup: &Setup, _: Security) -> Result<Opened<Self>, OpenError> {
        let (config, looks) = (config::of_process()?, config::router_checks()?);
        let (session, said_while_opening) = open_session(config).await?;
        let (events, receiver) = mpsc::channel(EVENTS);
        let found = find_router(&session, looks.unwrap_or(0)).await;
        let said_no_router = found.map(|said| said || said_while_opening);
        match said_no_router.and_then(|said| Self::on(&session, setup, said, &events)) {
            Ok(node) => {
                // Not the last one: dropping that waits.
                drop(session);
                Ok((node, events, receiver))
            }
            Err(error) => {
                close(session).await;
                Err(error)
            }
        }
    }

    fn changed(&self, setup: &Setup) -> Vec<(String, Value)> {
        self.parameters.other_than(&setup.parameters)
    }

    async fn answers(&self) -> bool {
        true
    }

    async fn close(self) -> impl FnOnce() {
        self.readers.lock().await.shutdown().await;
        self.answers.done().await;
        let session = self.session.clone();
        drop(self);
        close(session).await;
        || {}
    }
}

impl Transport for Zenoh {
    type Request = Call;

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        let Some(outlet) = self.outlets.get(message.topic().name) else { return Ok(()) };
        let mut bytes = Vec::new();
        outlet.send(message.write(&mut bytes).map(|()| bytes))
    }

    async fn answer(&self, _: Service, call: Call, response: TriggerResponse) -> Result<(), SendError> {
        call.answer(&response)
    }

    fn inputs(&self) -> &[SensorTopics] {
        &self.inputs
    }

    fn transform_topics(&self) -> &TransformTopics {
        &self.transforms
    }

    fn chosen(&self, Input { sensor, form }: Input) {
        self.scans[sensor].chosen.set(Some(form));
    }

    fn losses(&self) -> &'static str {
        "the node was busy, or the link is slow"
    }

    fn silences(&self) -> &'static str {
        "or its messages do not come through"
    }

    fn sources(&self) -> Vec<Source> {
        self.graph.sources()
    }

    fn knows_all_sources(&self) -> bool {
        !self.lacks_router.get() && self.found_router.get().elapsed() >= DISCOVERY
    }

    fn node_name(&self) -> &str {
        &self.name
    }

    fn network_state(&self) -> NetworkState {
        let without_router = self.lacks_router.get();
        NetworkState { namesakes: self.graph.namesakes(), without_router, ..NetworkState::default() }
    }

    async fn failed(&self) -> String {
        tokio::select! {
            reason = readers::ended(&self.readers) => reason,
            reason = self.closed() => reason,
            reason = self.answers.ended() => reason,
            reason = outlet::ended(&self.outlets) => reason,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;

    use super::*;

    fn configured(pairs: &[(&str, &str)]) -> Config {
        let mut config = Config::default();
        config.insert_json5("scouting/multicast/enabled", "false").unwrap();
        pairs.iter().for_each(|(key, value)| config.insert_json5(key, value).unwrap());
        config
    }

    #[tokio::test]
    async fn a_client_ends_without_its_router_or_waits_for_it_and_says_so() {
        let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let there = format!(r#"["tcp/{free}"]"#);
        let client = |timeout_ms| {
            let pairs =
                [("mode", r#""client""#), ("connect/endpoints", &there), ("connect/timeout_ms", timeout_ms)];
            open_session(configured(&pairs))
        };
        let error = client("0").await.unwrap_err().to_string();
        assert!(error.contains("Unable to connect") && !error.contains(".rs"), "{error}");
        let router = configured(&[("mode", r#""router""#), ("listen/endpoints", &there)]);
        let late = async {
            sleep(2 * LOOK).await;
            wait_for(move || zenoh::open(router).wait().unwrap()).await.unwrap()
        };
        let (opened, router) = tokio::join!(client("-1"), late);
        let (session, said_no_router) = opened.unwrap();
        assert!(said_no_router);
        assert_eq!(routers(&session).await.unwrap(), 1);
        close(session).await;
        close(router).await;
    }
}
