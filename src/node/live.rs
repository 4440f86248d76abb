//! The live node: joins clouds (those that depth images became too) with their transforms, hands scans to the worker,
//! answers calls.

mod beside;
mod calls;
mod calls_for_map;
mod change;
mod clocks;
mod diagnosis;
mod ending;
mod intake;
mod report;
mod rivals;
mod saving_figures;
mod say;
mod session;

use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use thiserror::Error;
use tokio::sync::mpsc;
use tokio::task::{JoinError, JoinHandle};

use self::beside::{Beside, Steps};
use self::calls::{LastFile, next};
use self::calls_for_map::{Call, CallsForMap};
use self::change::{Timers, interval};
use self::clocks::Clocks;
use self::diagnosis::Diagnosis;
use self::ending::mute;
use self::intake::Intake;
use self::rivals::Rivals;
use self::session::{Cause, new_session};
use super::counts::Counts;
use super::heard::PublisherId;
use super::publish::{Ended, Outlets, Seen};
use super::rosout::Lines;
use super::speak::speak;
use super::throttle::{Lasting, Throttle};
use super::transport::{Event, Input, Service, Transport};
use crate::cloud::{CloudFilter, Decoded, decode};
use crate::config::Config;
use crate::count::count_of;
use crate::engine::{Engine, Snapshot};
use crate::join::{GivenUp, Join, Joined, Jump};
use crate::msg::reports::DiagnosticArray;
use crate::msg::ros::{TfMessage, TransformStamped};
use crate::store::StoreError;
use crate::tf::Inserted;
use crate::worker::Worker;

/// Clouds that may wait at most, of all sensors together, whatever `tf_timeout` is.
const MOST_PLACES: usize = 64;

/// Clouds that may wait for their transform, and scans that may wait for the engine, for one message may release them all:
/// as many as Kinects send within `tf_timeout`, and at least eight of each, but of all sensors together no more than memory has room for.
fn places(config: &Config) -> usize {
    let of_each = (config.tf_timeout.as_secs_f64() * 30.0) as usize + 2;
    (of_each.max(8) * config.sensors.len()).min(MOST_PLACES)
}

/// How long no cloud may come before it is said why, and how long until it is said again.
const QUIET: Duration = Duration::from_secs(3);
const QUIET_AGAIN: Duration = Duration::from_secs(30);

/// Time between two looks at clouds whose transform does not come.
const TICK: Duration = Duration::from_millis(20);

/// Time between two reports.
const REPORTS: Duration = Duration::from_secs(1);

/// Reports that may wait to be sent.
const WAITING_REPORTS: usize = 2;

/// How long the last lines of the log have for going out.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// The node has to end.
#[derive(Debug, Error)]
pub enum LiveError {
    /// A thread could not be started.
    #[error("cannot start {thread}: {error}")]
    Start {
        /// Which.
        thread: &'static str,
        /// The system's words.
        error: std::io::Error,
    },
    /// The engine's thread has ended by itself.
    #[error("the engine's thread has died: {0}")]
    Died(String),
    /// The node cannot hear any more.
    #[error("the node is deaf: {0}")]
    Deaf(String),
    /// What it has to say cannot be made or sent any more.
    #[error("the node is mute: {0}")]
    Mute(String),
    /// The thread that writes maps has ended by itself.
    #[error("the thread that saves the map has died")]
    SaverDied,
    /// The map of the node's end is lost.
    #[error("the map was not saved at the end: {0}")]
    NotSaved(StoreError),
}

/// What a node is run with.
#[derive(Debug)]
pub(super) struct Start<T: Transport> {
    /// With the map that it begins with.
    pub(super) engine: Engine,
    /// Where what it has to say goes.
    pub(super) outlets: Outlets<T>,
    /// What it hears.
    pub(super) events: mpsc::Receiver<Event<T::Request>>,
    /// Where every cloud goes.
    pub(super) counts: Rc<RefCell<Counts>>,
    /// Those of the log, for `/rosout`.
    pub(super) lines: Lines,
}

/// Runs a node until `shutdown` resolves and returns the map of that moment, which is saved where `snapshot_path` says. Where that
/// takes long it is given up when `given_up` resolves, which is not asked before.
///
/// # Errors
/// When the engine's thread dies, the messages of a map cannot be made, the middleware stops, or the last map cannot be saved or is
/// given up.
pub(super) async fn run<T: Transport>(
    config: &Config,
    start: Start<T>,
    shutdown: impl Future<Output = ()>,
    given_up: impl Future<Output = ()>,
) -> Result<Arc<Snapshot>, LiveError> {
    run_by(Steps::default(), config, start, shutdown, given_up).await
}

async fn run_by<T: Transport>(
    steps: Steps,
    config: &Config,
    start: Start<T>,
    shutdown: impl Future<Output = ()>,
    given_up: impl Future<Output = ()>,
) -> Result<Arc<Snapshot>, LiveError> {
    let Start { engine, outlets, events, counts, lines } = start;
    let (reports, receiver) = mpsc::channel(WAITING_REPORTS);
    let mut speaking = tokio::task::spawn_local(speak(outlets.clone(), receiver, lines));
    let seen = Seen { counts, vitals: Rc::default() };
    let (session, transport) = (new_session(0), Rc::clone(&outlets.transport));
    let ended = match Beside::start(config, engine, session, outlets, seen.clone(), steps) {
        Ok((worker, beside)) => {
            let live = Live::new(config, transport, worker, session, seen, reports.clone());
            let file = config.snapshot_path.clone().map(|path| LastFile { path, given_up });
            live.run(events, beside, &mut speaking, shutdown, file).await
        }
        Err(error) => Err(error),
    };
    drop(reports);
    last_words(speaking, ended).await
}

/// Waits for what speaks to end, whose panic is an error, too.
async fn last_words<T>(mut speaking: JoinHandle<()>, ended: Result<T, LiveError>) -> Result<T, LiveError> {
    // It may have ended while the node ran, whose error that is then; and it must not be asked again.
    if speaking.is_finished() && ended.is_err() {
        return ended;
    }
    match tokio::time::timeout(LAST_WORDS, &mut speaking).await {
        Ok(Ok(())) => ended,
        Ok(Err(error)) => ended.and(Err(mute(error))),
        Err(_) => {
            speaking.abort();
            drop(speaking.await);
            ended
        }
    }
}

/// Why a node stops.
enum Stop {
    /// Somebody wants it to, or what has ended says so itself.
    Asked,
    /// Publishing has ended, and so.
    Published(Result<Ended, JoinError>),
    Broken(LiveError),
}

struct Live<T: Transport> {
    transport: Rc<T>,
    worker: Worker,
    join: Join,
    timers: Timers,
    counts: Rc<RefCell<Counts>>,
    diagnosis: Diagnosis,
    rivals: Rivals,
    reports: mpsc::Sender<DiagnosticArray>,
    throttle: Throttle,
    lasting: Lasting,
    session: u64,
    clocks: Clocks,
    /// By sensor.
    intakes: Vec<Intake>,
    fixed_frame: String,
    /// Of clouds that are handed over.
    filter: CloudFilter,
    tf_timeout: Duration,
    /// `None` where the map is not saved.
    calls_for_map: Option<CallsForMap<Call<T::Request>>>,
}

impl<T: Transport> Live<T> {
    fn new(
        config: &Config,
        transport: Rc<T>,
        worker: Worker,
        session: u64,
        seen: Seen,
        reports: mpsc::Sender<DiagnosticArray>,
    ) -> Self {
        let start = Instant::now();
        let intakes = vec![Intake::new(start); transport.inputs().len()];
        let counts = Rc::clone(&seen.counts);
        let diagnosis = Diagnosis::new(config, transport.node_name(), seen, start);
        Self {
            transport,
            worker,
            join: Join::new(places(config)),
            timers: Timers::new(config),
            counts,
            diagnosis,
            rivals: Rivals::default(),
            reports,
            throttle: Throttle::default(),
            lasting: Lasting::default(),
            session,
            clocks: Clocks::new(start, config.use_sim_time),
            intakes,
            fixed_frame: config.fixed_frame.clone(),
            filter: config.filter,
            tf_timeout: config.tf_timeout,
            calls_for_map: config.snapshot_path.as_ref().map(|_| CallsForMap::default()),
        }
    }

    /// Until the node's end.
    async fn run(
        mut self,
        mut events: mpsc::Receiver<Event<T::Request>>,
        mut beside: Beside,
        speaking: &mut JoinHandle<()>,
        shutdown: impl Future<Output = ()>,
        file: Option<LastFile<impl Future<Output = ()>>>,
    ) -> Result<Arc<Snapshot>, LiveError> {
        let stop = self.listen(&mut events, &mut beside, speaking, shutdown).await;
        let Beside { publishing, mut muted, written } = beside;
        let (published, broken) = match stop {
            Stop::Asked => (None, None),
            Stop::Published(ended) => (Some(ended), None),
            Stop::Broken(error) => (None, Some(error)),
        };
        // Where it is given up it must not keep the node on the network.
        let giving_up = publishing.abort_handle();
        let publishing = async {
            match published {
                Some(ended) => ended,
                None => publishing.await,
            }
        };
        let (worker, closing) = self.close();
        let map = closing.finish_and_answer(worker, events, publishing, written.zip(file)).await;
        giving_up.abort();
        // The last map may have been the first of which no messages could be made.
        broken.or_else(|| muted.try_recv().ok().map(LiveError::Mute)).map_or(map, Err)
    }

    /// Takes in what is heard, and does what is due, until there is a reason to stop.
    async fn listen(
        &mut self,
        events: &mut mpsc::Receiver<Event<T::Request>>,
        Beside { publishing, muted, written }: &mut Beside,
        speaking: &mut JoinHandle<()>,
        shutdown: impl Future<Output = ()>,
    ) -> Stop {
        let transport = Rc::clone(&self.transport);
        let (mut shutdown, mut failed) = (pin!(shutdown), pin!(transport.failed()));
        let (mut reports, mut tick) = (interval(REPORTS), interval(TICK));
        reports.reset();
        loop {
            tokio::select! {
                () = &mut shutdown => return Stop::Asked,
                ended = &mut *publishing => return Stop::Published(ended),
                Some(why) = muted.recv() => return Stop::Broken(LiveError::Mute(why)),
                // Until the end there may always be another report.
                Err(error) = &mut *speaking => return Stop::Broken(mute(error)),
                reason = &mut failed => return Stop::Broken(LiveError::Deaf(reason)),
                event = events.recv() => match event {
                    Some(event) => self.event(event).await,
                    None => return Stop::Broken(LiveError::Deaf("no more events".to_owned())),
                },
                _ = tick.tick() => self.tick(),
                _ = self.timers.snapshots.tick() => self.worker.request_snapshot(),
                _ = self.timers.savings.tick(), if written.is_some() => self.save_what_changed(),
                _ = reports.tick() => self.report(),
                result = next(written) => match result {
                    Some(result) => self.written(&result).await,
                    // Of itself, or because the engine has: that the end finds.
                    None => return Stop::Asked,
                },
            }
        }
    }

    async fn event(&mut self, event: Event<T::Request>) {
        match event {
            Event::Cloud(input, cloud) => self.cloud(input, cloud),
            Event::Handed(input, cloud) => self.cloud(input, decode(&cloud, &self.filter)),
            Event::Lost(input, number) => self.lost(input, number),
            Event::Camera(sensor, camera, frame) => {
                self.camera(sensor, &camera);
                self.intakes[sensor].camera_frame = frame;
            }
            Event::Transforms { message, is_static, publisher } => {
                self.transforms(&message.transforms, is_static, publisher);
            }
            Event::LateTransforms(TfMessage { mut transforms }) => {
                transforms.retain(|transform| self.join.is_of_use(transform));
                self.transforms(&transforms, false, None);
            }
            Event::Clock(stamp) => self.clock(stamp),
            Event::Joined => self.worker.request_snapshot(),
            Event::Changed(config) => self.change(&config),
            Event::Call(Service::Reset, request) => self.reset(request).await,
            Event::Call(Service::Save, request) => self.save_for(request).await,
            Event::Garbled { topic, text } => {
                self.warn(topic.clone(), format_args!("a message on {topic}: {text}"));
            }
        }
    }

    /// Lets a cloud wait for its transform, or counts one that cannot be used.
    fn let_wait(&mut self, input: Input, cloud: Decoded) {
        self.counts.borrow_mut().received += 1;
        match cloud {
            Ok(cloud) => {
                self.look_at(input, &cloud);
                if let Some(pushed_out) = self.join.cloud(input.sensor, cloud, self.clocks.moment()) {
                    let longer_helps = self.join.places() < MOST_PLACES;
                    self.skip(&pushed_out, GivenUp::PushedOut { longer_helps });
                }
                self.submit_ready();
            }
            Err(error) => self.refuse(input, &error),
        }
    }

    fn transforms(
        &mut self,
        transforms: &[TransformStamped],
        is_static: bool,
        publisher: Option<PublisherId>,
    ) {
        for transform in transforms {
            match self.join.transform(transform, is_static) {
                Ok(inserted) => {
                    if let Some(publisher) = publisher.filter(|_| inserted == Inserted::Stored && !is_static)
                    {
                        self.look_for_rivals(publisher, transform, Instant::now());
                    }
                    self.say_inserted(&inserted, transform);
                }
                Err(error) => self.refuse_transform(&error),
            }
        }
        self.submit_ready();
    }

    fn submit_ready(&mut self) {
        for Joined { scan, sensor, at, jumped_back, .. } in self.join.ready(&self.fixed_frame) {
            let waited = self.clocks.moment().since(at);
            self.diagnosis.waited(waited);
            if let Some(Jump { seconds, given_up }) = jumped_back {
                self.count_ended(given_up);
                self.start_session(Cause::ScansJumped(seconds));
                // The clock of that lap comes next, and begins no session of its own.
                self.clocks.follow(scan.stamp);
            }
            if let Some(replaced) = self.worker.submit(sensor, scan) {
                self.note_replaced(replaced);
            }
        }
    }

    /// The scan that was handed over last has taken the place of an older one, of this sensor.
    fn note_replaced(&mut self, sensor: usize) {
        self.counts.borrow_mut().replaced += 1;
        let replaced = self.counts.borrow().replaced;
        let line =
            format!("the engine is slower than the sensor: {} replaced so far", count_of(replaced, "scan"));
        // The engine has others of it, and says itself that it is slow.
        self.intakes[sensor].period.given_up += 1;
        self.warn("replaced", format_args!("{line}"));
    }

    fn tick(&mut self) {
        for waited in self.join.expired(self.clocks.moment(), self.tf_timeout) {
            self.skip(&waited, GivenUp::TimedOut);
        }
        self.say_when_quiet(Instant::now());
        self.clocks.say(Instant::now());
    }
}

#[cfg(test)]
mod tests;
