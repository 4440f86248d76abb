//! From the worker's outputs to messages on the wire.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::Builder;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, watch};
use tokio::time::sleep_until;
use tracing::{error, warn};

use super::counts::Counts;
use super::own_thread::on_own_thread;
use super::record::Recorder;
use super::saving::Saver;
use super::throttle::Throttle;
use super::transport::{SendError, Transport};
use super::vitals::{MapSize, Vitals};
use crate::config::Config;
use crate::engine::{Snapshot, Stamp, Update};
use crate::msg::caps::Caps;
use crate::msg::clusters::{MapVersion, Session, SurfaceClusterArray};
use crate::msg::markers::Markers;
use crate::msg::outgoing::{Outgoing, of_map, polygons_of};
use crate::msg::twins::Twins;
use crate::reach::{Points, Reach};
use crate::worker::{Output, Took};

/// Between two polygons: nav2's collision monitor keeps the last five that it has not yet taken, and would have no others of
/// a map that comes at once.
const PAUSE: Duration = Duration::from_millis(10);

/// The polygons of one map are sent within this time; the next map waits until then.
const SPREAD: Duration = Duration::from_millis(250);

/// What is noted of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    /// Where every cloud went.
    pub(super) counts: Rc<RefCell<Counts>>,
    /// How the engine and its map are.
    pub(super) vitals: Rc<RefCell<Vitals>>,
}

/// Where messages go.
#[derive(Debug)]
pub(super) struct Outlets<T> {
    /// All of them.
    pub(super) transport: Rc<T>,
    /// What is sent of the map, and reports.
    pub(super) recorder: Option<Recorder>,
}

impl<T> Clone for Outlets<T> {
    fn clone(&self) -> Self {
        Self { transport: Rc::clone(&self.transport), recorder: self.recorder.clone() }
    }
}

/// How publishing ended.
#[derive(Debug, Default)]
pub(super) struct Ended {
    /// The newest map that came.
    pub(super) map: Option<Arc<Snapshot>>,
    /// What the worker died of.
    pub(super) died: Option<String>,
}

/// Publishes until the worker has ended or died. A map that waits for its readers holds up no delta, and is replaced by
/// the next one. Where no messages can be made of a map, `broken` is told why, and everything but maps goes on, so that the last
/// one can still be saved. `make` is [`messages`], but for tests.
pub(super) async fn publish(
    outlets: Outlets<impl Transport>,
    outputs: mpsc::Receiver<Output>,
    seen: Seen,
    config: Config,
    saver: Option<Saver>,
    broken: mpsc::Sender<String>,
    make: Make,
) -> Ended {
    let (newest, maps) = watch::channel(None);
    let reach = Reach::new(config.fixed_frame.clone(), config.engine.voxel_size());
    let wire = Wire { outlets, unsent: RefCell::default(), frame_id: config.fixed_frame };
    let publisher = Maps::new(config.twins, make);
    let taking = Taking::new(&wire, newest, seen, saver, reach);
    let (ended, ()) = tokio::join!(taking.all(outputs), publish_maps(maps, publisher, &wire, broken));
    ended
}

/// A map to publish.
#[derive(Clone, Debug)]
struct Newest {
    session: u64,
    snapshot: Arc<Snapshot>,
    /// Whether a scan of this session is in it: before the first it may be one that was saved.
    is_live: bool,
}

/// Takes what the worker has to say: deltas go out at once, maps to whoever publishes them.
struct Taking<'a, T> {
    wire: &'a Wire<T>,
    newest: watch::Sender<Option<Newest>>,
    seen: Seen,
    saver: Option<Saver>,
    beyond: Beyond,
    put_off: PutOff,
    /// The map of the newest session after the first scan that it has taken in.
    first: Option<MapVersion>,
    ended: Ended,
}

impl<'a, T: Transport> Taking<'a, T> {
    fn new(
        wire: &'a Wire<T>,
        newest: watch::Sender<Option<Newest>>,
        seen: Seen,
        saver: Option<Saver>,
        reach: Reach,
    ) -> Self {
        let (beyond, put_off, ended) = (Beyond::new(reach), PutOff::default(), Ended::default());
        Self { wire, newest, seen, saver, beyond, put_off, first: None, ended }
    }

    async fn all(mut self, mut outputs: mpsc::Receiver<Output>) -> Ended {
        while let Some(output) = outputs.recv().await {
            match output {
                Output::Scan { session, sensor, stamp, points, update, took } => {
                    let points =
                        Points { all: points as u64, beyond_grid: u64::from(update.points_beyond_grid) };
                    self.scan(session, (sensor, stamp), points, &update, took).await;
                }
                Output::Snapshot { session, snapshot, took } => self.snapshot(session, snapshot, took),
                Output::Saved { session, map } => {
                    if let Some(saver) = &self.saver {
                        saver.write(session, map);
                    }
                }
                Output::Ended { session, map } => {
                    if let Some(saver) = &self.saver {
                        saver.end(session, map);
                    }
                }
                Output::Died(text) => self.ended.died = Some(text),
            }
        }
        self.ended
    }

    async fn scan(
        &mut self,
        session: u64,
        of: (usize, Stamp),
        points: Points,
        update: &Update,
        took: Duration,
    ) {
        self.seen.counts.borrow_mut().taken_in += 1;
        let version = MapVersion { session, sequence: update.sequence };
        self.seen.vitals.borrow_mut().note_scan(version, of, took, points);
        self.first.take_if(|first| first.session != session);
        self.first.get_or_insert(version);
        if let Some(line) = self.beyond.line(session, points, Instant::now()) {
            warn!("{line}");
        }
        let delta = SurfaceClusterArray::delta(&self.wire.session(session), update);
        self.wire.send(Outgoing::Delta(delta)).await;
    }

    fn snapshot(&mut self, session: u64, snapshot: Arc<Snapshot>, took: Took) {
        if let Some(line) = self.put_off.line(session, snapshot.voxels.len(), took) {
            warn!("{line}");
        }
        self.seen.vitals.borrow_mut().note_snapshot(MapSize::of(session, &snapshot), took);
        let is_of_it = |first: MapVersion| first.session == session && first.sequence <= snapshot.sequence;
        let is_live = self.first.is_some_and(is_of_it);
        self.newest.send_replace(Some(Newest { session, snapshot: Arc::clone(&snapshot), is_live }));
        self.ended.map = Some(snapshot);
    }
}

async fn publish_maps(
    mut newest: watch::Receiver<Option<Newest>>,
    mut publisher: Maps,
    wire: &Wire<impl Transport>,
    broken: mpsc::Sender<String>,
) {
    while newest.changed().await.is_ok() {
        let map = newest.borrow_and_update().clone();
        if let Some(map) = map
            && let Err(why) = publisher.send(map, wire).await
        {
            error!("the messages of a map could not be made: {why}");
            // The first one is told, and there is no other.
            drop(broken.try_send(why));
            return;
        }
    }
}

/// Where messages go out.
struct Wire<T> {
    outlets: Outlets<T>,
    unsent: RefCell<Unsent>,
    frame_id: String,
}

/// Messages that could not be sent, by topic.
#[derive(Default)]
struct Unsent {
    counts: BTreeMap<&'static str, u64>,
    throttle: Throttle,
}

impl Unsent {
    fn note(&mut self, topic: &'static str, failure: &SendError) {
        let count = self.counts.entry(topic).or_default();
        *count += 1;
        if self.throttle.allows(topic, Instant::now()) {
            error!("a message could not be sent, {count} so far: {failure}");
        }
    }
}

impl<T: Transport> Wire<T> {
    fn session(&self, id: u64) -> Session {
        Session { id, frame_id: self.frame_id.clone() }
    }

    async fn send(&self, message: Outgoing) {
        let topic = message.topic().name;
        let Outlets { transport, recorder } = &self.outlets;
        if let Some(recorder) = recorder {
            recorder.outgoing(&message).await;
        }
        if let Err(failure) = transport.publish(message).await {
            self.unsent.borrow_mut().note(topic, &failure);
        }
    }
}

/// How long snapshots are put off, from which on it is said.
const LONG: Duration = Duration::from_secs(1);

/// Snapshots of a large map are put off, for they take long: said once a session.
#[derive(Debug, Default)]
struct PutOff {
    said: Option<u64>,
}

impl PutOff {
    fn line(&mut self, session: u64, dense_voxels: usize, took: Took) -> Option<String> {
        let rest = took.rest();
        if rest < LONG || self.said.replace(session) == Some(session) {
            return None;
        }
        let [freezing, making] = [took.freezing, took.making].map(|took| took.as_millis());
        let rest = rest.as_secs_f64();
        Some(format!(
            "a snapshot of {dense_voxels} dense voxels takes {making} ms, in {freezing} ms of which no scan is taken in: the next \
             begins {rest:.1} s after it at the earliest, whatever publish_rate says; clusters_delta comes with every scan"
        ))
    }
}

/// Points that lie beyond the grid are in no map: said once a session.
struct Beyond {
    reach: Reach,
    /// The session in which it was said last.
    said: Option<u64>,
    throttle: Throttle,
}

impl Beyond {
    fn new(reach: Reach) -> Self {
        Self { reach, said: None, throttle: Throttle::default() }
    }

    /// What is to be said of a scan now: sessions may begin with every other one.
    fn line(&mut self, session: u64, points: Points, now: Instant) -> Option<String> {
        let is_news = points.beyond_grid > 0 && self.said != Some(session);
        (is_news && self.throttle.allows("beyond_grid", now)).then(|| {
            self.said = Some(session);
            format!("of a scan {}", self.reach.line(points))
        })
    }
}

/// Makes the messages of a map, as [`messages`] does.
pub(super) type Make = fn(&Session, &Snapshot, &mut Markers, Twins) -> (Vec<Outgoing>, Vec<Outgoing>);

struct Maps {
    /// Of the newest map.
    session: u64,
    markers: Markers,
    /// What has been said in this session.
    caps: Caps,
    twins: Twins,
    /// The scan of the newest polygons. They go out once: nav2's collision monitor takes each that comes too old for a free way. The
    /// newest stamp would not do: where one sensor's is ahead, the scans of the others leave it as it is.
    outlined: u64,
    /// When the newest map came: the rate may be changed while the node runs.
    came: Option<tokio::time::Instant>,
    make: Make,
}

impl Maps {
    fn new(twins: Twins, make: Make) -> Self {
        let (markers, caps) = (Markers::default(), Caps::default());
        Self { session: 0, markers, caps, twins, outlined: 0, came: None, make }
    }

    /// # Errors
    /// What making its messages has panicked with.
    async fn send(&mut self, map: Newest, wire: &Wire<impl Transport>) -> Result<(), String> {
        let Newest { session, snapshot, is_live } = map;
        let now = tokio::time::Instant::now();
        let period = self.came.replace(now).map_or(SPREAD, |before| now - before);
        if std::mem::replace(&mut self.session, session) != session {
            self.outlined = 0;
        }
        for line in self.caps.reached(session, &snapshot) {
            warn!("{line}");
        }
        let is_newer = std::mem::replace(&mut self.outlined, snapshot.sequence) != snapshot.sequence;
        let twins = Twins { polygons: self.twins.polygons && is_live && is_newer, ..self.twins };
        let session = wire.session(session);
        let (make, mut markers) = (self.make, std::mem::take(&mut self.markers));
        // Those of a large map take a tenth of a second, in which the node hears nothing.
        let made = on_own_thread(Builder::new().name("cfodi-messages".to_owned()), move || {
            (make(&session, &snapshot, &mut markers, twins), markers)
        });
        let ((messages, polygons), markers) = made.await?;
        self.markers = markers;
        for message in messages {
            wire.send(message).await;
        }
        send_polygons(polygons, SPREAD.min(period / 2), wire).await;
        Ok(())
    }
}

/// The messages of a map but for its polygons, and these.
pub(super) fn messages(
    session: &Session,
    snapshot: &Snapshot,
    markers: &mut Markers,
    twins: Twins,
) -> (Vec<Outgoing>, Vec<Outgoing>) {
    (of_map(session, snapshot, markers, twins), polygons_of(session, snapshot, twins))
}

/// Sends the polygons of a map, evenly over this time where they are many.
async fn send_polygons(polygons: Vec<Outgoing>, spread: Duration, wire: &Wire<impl Transport>) {
    let pause = PAUSE.min(spread / u32::try_from(polygons.len().max(1)).unwrap_or(u32::MAX));
    let mut due = tokio::time::Instant::now();
    for polygon in polygons {
        sleep_until(due).await;
        wire.send(polygon).await;
        due += pause;
    }
}

#[cfg(test)]
mod tests;
