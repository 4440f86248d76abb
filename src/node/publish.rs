//! From the worker's outputs to messages on the wire.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::resume_unwind;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, watch};
use tokio::time::sleep_until;
use tracing::{error, warn};

use super::counts::Counts;
use super::record::Recorder;
use super::saving::Saver;
use super::throttle::Throttle;
use super::transport::{Outgoing, SendError, Transport};
use super::vitals::{MapSize, Points, Reach, Vitals};
use crate::config::Config;
use crate::engine::{Snapshot, Stamp};
use crate::msg::caps::Caps;
use crate::msg::clusters::{Session, SurfaceClusterArray};
use crate::msg::labelled::labelled_points;
use crate::msg::markers::Markers;
use crate::msg::twins::{PolygonInstanceStamped, Twins, detections, polygons};
use crate::worker::{Output, Took};

/// Between two polygons: nav2's collision monitor keeps the last five that it has not yet taken, and would have no others of
/// a map that comes at once.
const PAUSE: Duration = Duration::from_millis(10);

/// Over which the polygons of a map go out at most: what is newer waits behind them.
const SPREAD: Duration = Duration::from_millis(250);

/// Where every cloud went, and how the engine and its map are.
pub(super) type Seen = (Rc<RefCell<Counts>>, Rc<RefCell<Vitals>>);

/// Where messages go: over the middleware, and what is sent of the map into a recording too.
pub(super) type Outlets<T> = (Rc<T>, Option<Recorder>);

/// How publishing ended.
#[derive(Debug, Default)]
pub(super) struct Ended {
    /// The newest map that came.
    pub(super) map: Option<Arc<Snapshot>>,
    /// What the worker died of.
    pub(super) died: Option<String>,
}

/// Publishes until the worker has ended or died. A map that waits for its readers holds up no delta, and is replaced by
/// the next one.
pub(super) async fn publish(
    (transport, recorder): Outlets<impl Transport>,
    outputs: mpsc::Receiver<Output>,
    seen: Seen,
    config: Config,
    saver: Option<Saver>,
) -> Ended {
    let (newest, maps) = watch::channel(None);
    let beyond = Beyond::new(Reach::of(&config));
    let wire = Wire { transport, recorder, unsent: RefCell::default(), frame_id: config.fixed_frame };
    let publisher = Maps { twins: config.twins, ..Maps::default() };
    let (ended, ()) = tokio::join!(
        take(outputs, &wire, newest, seen, (saver, beyond)),
        publish_maps(maps, publisher, &wire)
    );
    ended
}

/// A map and its session.
type Newest = Option<(u64, Arc<Snapshot>)>;

async fn take(
    mut outputs: mpsc::Receiver<Output>,
    wire: &Wire<impl Transport>,
    newest: watch::Sender<Newest>,
    (counts, vitals): Seen,
    (saver, mut beyond): (Option<Saver>, Beyond),
) -> Ended {
    let (mut ended, mut put_off) = (Ended::default(), PutOff::default());
    while let Some(output) = outputs.recv().await {
        match output {
            Output::Scan { session, points, update, took } => {
                counts.borrow_mut().taken_in += 1;
                let points = Points { all: points as u64, beyond_grid: u64::from(update.points_beyond_grid) };
                vitals.borrow_mut().note(took, points);
                vitals.borrow_mut().newest = Some((session, update.sequence));
                if let Some(line) = beyond.line(session, points, Instant::now()) {
                    warn!("{line}");
                }
                wire.send(Outgoing::Delta(SurfaceClusterArray::delta(&wire.session(session), &update))).await;
            }
            Output::Snapshot { session, snapshot, took } => {
                if let Some(line) = put_off.line(session, snapshot.voxels.len(), took) {
                    warn!("{line}");
                }
                vitals.borrow_mut().snapshot_took = took;
                vitals.borrow_mut().map = Some(MapSize::of(session, &snapshot));
                vitals.borrow_mut().note_map(session, snapshot.sequence);
                newest.send_replace(Some((session, Arc::clone(&snapshot))));
                ended.map = Some(snapshot);
            }
            Output::Saved { session, map } => {
                if let Some(saver) = &saver {
                    saver.write(session, map);
                }
            }
            Output::Ended { session, map } => {
                if let Some(saver) = &saver {
                    saver.end(session, map);
                }
            }
            Output::Died(text) => ended.died = Some(text),
        }
    }
    ended
}

async fn publish_maps(mut newest: watch::Receiver<Newest>, mut publisher: Maps, wire: &Wire<impl Transport>) {
    while newest.changed().await.is_ok() {
        let map = newest.borrow_and_update().clone();
        if let Some((session, snapshot)) = map {
            publisher.send(session, &snapshot, wire).await;
        }
    }
}

/// Where messages go out.
struct Wire<T> {
    transport: Rc<T>,
    recorder: Option<Recorder>,
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
        let topic = message.topic();
        if let Some(recorder) = &self.recorder {
            recorder.outgoing(&message).await;
        }
        if let Err(failure) = self.transport.publish(message).await {
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

#[derive(Default)]
struct Maps {
    /// Of the newest map.
    session: u64,
    markers: Markers,
    /// What has been said in this session.
    caps: Caps,
    twins: Twins,
    /// Stamp of the newest polygons. They go out once: nav2's collision monitor takes each that comes too old for a free way.
    outlined: Option<Stamp>,
    /// When the newest map came: the rate may be changed while the node runs.
    came: Option<tokio::time::Instant>,
}

impl Maps {
    async fn send(&mut self, session: u64, snapshot: &Arc<Snapshot>, wire: &Wire<impl Transport>) {
        let now = tokio::time::Instant::now();
        let period = self.came.replace(now).map_or(SPREAD, |before| now - before);
        if std::mem::replace(&mut self.session, session) != session {
            self.markers.reset();
            self.caps = Caps::default();
            self.outlined = None;
        }
        for line in self.caps.reached(snapshot) {
            warn!("{line}");
        }
        let is_newer = std::mem::replace(&mut self.outlined, snapshot.stamp) != snapshot.stamp;
        let twins = Twins { polygons: self.twins.polygons && is_newer, ..self.twins };
        let (session, snapshot) = (wire.session(session), Arc::clone(snapshot));
        let mut markers = std::mem::take(&mut self.markers);
        // Those of a large map take a tenth of a second, in which the node hears nothing.
        let made = tokio::task::spawn_blocking(move || {
            let made = messages(&session, &snapshot, &mut markers, twins);
            (made, polygons_of(&session, &snapshot, twins), markers)
        });
        let (messages, polygons, markers) = match made.await {
            Ok(made) => made,
            Err(error) if error.is_panic() => resume_unwind(error.into_panic()),
            // The runtime ends.
            Err(_) => return,
        };
        self.markers = markers;
        for message in messages {
            wire.send(message).await;
        }
        send_polygons(polygons, SPREAD.min(period / 2), wire).await;
    }
}

/// The messages of a map but for its polygons, in the order in which they go out.
fn messages(session: &Session, snapshot: &Snapshot, markers: &mut Markers, twins: Twins) -> Vec<Outgoing> {
    let mut messages = vec![
        Outgoing::Clusters(SurfaceClusterArray::snapshot(session, snapshot)),
        Outgoing::Labelled(labelled_points(session, snapshot)),
        Outgoing::Markers(markers.update(session, snapshot)),
    ];
    messages.extend(twins.detections.then(|| Outgoing::Detections(detections(session, snapshot))));
    messages
}

fn polygons_of(session: &Session, snapshot: &Snapshot, twins: Twins) -> Vec<PolygonInstanceStamped> {
    if twins.polygons { polygons(session, snapshot).collect() } else { Vec::new() }
}

/// Sends the polygons of a map, evenly over this time where they are many.
async fn send_polygons(polygons: Vec<PolygonInstanceStamped>, spread: Duration, wire: &Wire<impl Transport>) {
    let pause = PAUSE.min(spread / u32::try_from(polygons.len().max(1)).unwrap_or(u32::MAX));
    let mut due = tokio::time::Instant::now();
    for polygon in polygons {
        sleep_until(due).await;
        wire.send(Outgoing::Polygon(polygon)).await;
        due += pause;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::sync::Semaphore;

    use super::*;
    use crate::engine::{self, Engine, Isometry3, Params, Scan};
    use crate::msg::ros::TriggerResponse;
    use crate::node::record::tests::{begun, recorded};
    use crate::node::transport::{NetworkState, SensorTopics, Service, Source};

    /// Maps wait for being let through; what is sent is kept, with its number.
    struct Slow {
        sent: RefCell<Vec<(&'static str, u64)>>,
        through: Semaphore,
    }

    impl Transport for Slow {
        type Request = ();

        async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
            let sent = match message {
                Outgoing::Delta(delta) => ("delta", delta.sequence),
                Outgoing::Clusters(map) => {
                    self.through.acquire().await.unwrap().forget();
                    ("map", map.sequence)
                }
                Outgoing::Polygon(polygon) => ("polygon", polygon.polygon.id.cast_unsigned()),
                _ => return Ok(()),
            };
            self.sent.borrow_mut().push(sent);
            Ok(())
        }

        async fn answer(&self, _: Service, (): (), _: TriggerResponse) -> Result<(), SendError> {
            Ok(())
        }

        fn inputs(&self) -> &[SensorTopics] {
            unreachable!("nothing is read")
        }

        fn losses(&self) -> &'static str {
            "see receive_buffer"
        }

        fn silences(&self) -> &'static str {
            "or it sends by shared memory only"
        }

        fn sources(&self) -> Vec<Source> {
            Vec::new()
        }

        fn node_name(&self) -> &'static str {
            "/cfodi"
        }

        fn network_state(&self) -> NetworkState {
            NetworkState::default()
        }

        async fn failed(&self) -> String {
            std::future::pending().await
        }
    }

    /// What a worker gives that takes in this many scans, with the map after each.
    fn outputs(scans: i64) -> Vec<Output> {
        let mut engine = Engine::new(Params::default());
        let mut outputs = Vec::new();
        for number in 0..scans {
            let update = engine.insert(&Scan {
                stamp: Stamp::from_nanos(1 + number),
                fixed_from_sensor: Isometry3::identity(),
                points: engine::Points::F32(vec![[0.0, 0.0, 1.0]; 20]),
            });
            let snapshot = Arc::new(engine.snapshot());
            outputs.extend([
                Output::Scan { session: 1, points: 20, update, took: Duration::ZERO },
                Output::Snapshot { session: 1, snapshot, took: Took::default() },
            ]);
        }
        outputs
    }

    #[test]
    fn that_snapshots_are_put_off_for_long_is_said_once_a_session() {
        let mut put_off = PutOff::default();
        let mut said = |session, [freezing, making]: [u64; 2]| {
            let [freezing, making] = [freezing, making].map(Duration::from_millis);
            put_off.line(session, 2_000_000, Took { freezing, making })
        };
        assert_eq!(said(1, [100, 900]), None);
        let line = said(1, [250, 900]).unwrap();
        assert!(line.contains("of 2000000 dense voxels takes 900 ms, in 250 ms of which"), "{line}");
        assert!(line.contains("2.2 s after"), "{line}");
        assert_eq!([said(1, [300, 0]), said(3, [20, 900])], [None, None]);
        assert!(said(2, [300, 0]).is_some() && said(3, [20, 1100]).is_some());
    }

    #[test]
    fn points_beyond_the_grid_are_said_once_a_session_and_once_in_a_while_where_sessions_alternate() {
        let mut beyond = Beyond::new(Reach::of(&Config::new([]).unwrap()));
        let (start, points) = (Instant::now(), Points { all: 20, beyond_grid: 1 });
        let mut says =
            |session, seconds| beyond.line(session, points, start + Duration::from_secs(seconds)).is_some();
        assert!(says(1, 0) && !says(1, 9) && says(2, 10));
        assert!((3..9).all(|session| !says(session, 11)), "sessions that alternate");
        assert!(says(9, 15) && !says(9, 30));
        assert!(
            beyond.line(10, Points { all: 20, beyond_grid: 0 }, start + Duration::from_secs(60)).is_none()
        );
    }

    #[tokio::test]
    async fn a_map_that_waits_holds_up_no_delta_and_is_followed_by_the_newest() {
        let slow = Rc::new(Slow { sent: RefCell::default(), through: Semaphore::new(0) });
        let (sender, receiver) = mpsc::channel(1);
        let config = Config::new([]).unwrap();
        let publishing = publish((Rc::clone(&slow), None), receiver, Seen::default(), config, None);
        let worker = async {
            for output in outputs(4) {
                sender.send(output).await.unwrap();
            }
            while sender.capacity() == 0 {
                tokio::task::yield_now().await;
            }
            drop(sender);
            assert_eq!(*slow.sent.borrow(), [1, 2, 3, 4].map(|number| ("delta", number)));
            slow.through.add_permits(4);
        };
        let (ended, ()) = tokio::join!(publishing, worker);
        assert_eq!(slow.sent.borrow()[4..], [("map", 1), ("map", 4)]);
        assert_eq!(ended.map.map(|map| map.sequence), Some(4));
    }

    #[tokio::test]
    async fn what_is_sent_of_the_map_is_recorded_too() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.mcap");
        let (record, recorder) = begun(&path);
        let slow = Rc::new(Slow { sent: RefCell::default(), through: Semaphore::new(1) });
        let (sender, receiver) = mpsc::channel(10);
        outputs(1).into_iter().for_each(|output| sender.try_send(output).unwrap());
        drop(sender);
        let config = Config::new([]).unwrap();
        publish((Rc::clone(&slow), Some(recorder)), receiver, Seen::default(), config, None).await;
        record.finish().unwrap();
        assert_eq!(*slow.sent.borrow(), [("delta", 1), ("map", 1)]);
        let mut topics = recorded(&path);
        topics.sort();
        let names = ["clusters", "clusters_delta", "markers", "points_labelled"];
        assert_eq!(topics, names.map(|name| format!("/cfodi/{name}")));
    }

    #[tokio::test]
    async fn the_polygons_of_a_map_go_out_once_and_one_of_no_cluster_among_them() {
        let slow = Rc::new(Slow { sent: RefCell::default(), through: Semaphore::new(6) });
        let wire = Wire {
            transport: Rc::clone(&slow),
            recorder: None,
            unsent: RefCell::default(),
            frame_id: "odom".to_owned(),
        };
        let mut publisher = Maps { twins: Twins { polygons: true, ..Twins::default() }, ..Maps::default() };
        let mut maps = vec![Arc::new(Engine::new(Params::default()).snapshot())];
        for output in outputs(2) {
            if let Output::Snapshot { snapshot, .. } = output {
                maps.push(snapshot);
            }
        }
        for (session, map) in [(1, 0), (1, 1), (1, 1), (1, 2), (1, 2), (2, 2)] {
            publisher.send(session, &maps[map], &wire).await;
        }
        let of_none = slow.sent.borrow().iter().filter(|sent| **sent == ("polygon", 0)).count();
        assert_eq!(of_none, 3, "with each map that is new: {:?}", slow.sent.borrow());
    }
}
