//! The live node on a middleware made of channels.

mod changes;
mod ending;
mod hostile;
mod intake;
mod lines;
mod reports;

use std::os::unix::fs::MetadataExt as _;

use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tokio::task::LocalSet;
use tracing_subscriber::layer::SubscriberExt as _;

use super::session::new_session;
use super::*;
use crate::config::Value;
use crate::engine::{Params, Points};
use crate::msg::clusters::SurfaceClusterArray;
use crate::msg::ros::{Header, Quaternion, Transform, TransformStamped, TriggerResponse, Vector3};
use crate::node::resume::begin;
use crate::node::rosout::listen;
use crate::node::transport::{
    DepthTopics, Form, NetworkState, Outgoing, SendError, SensorTopics, Source, TopicName,
};
use crate::store::{self, Stored};
use crate::worker::tests::DEADLY;

/// Keeps what is published; fails when told to.
struct Fake {
    inputs: Vec<SensorTopics>,
    sources: Vec<Source>,
    network: NetworkState,
    deltas: RefCell<Vec<SurfaceClusterArray>>,
    reports: RefCell<Vec<DiagnosticArray>>,
    replies: RefCell<Vec<TriggerResponse>>,
    failure: RefCell<Option<oneshot::Receiver<String>>>,
}

impl Default for Fake {
    fn default() -> Self {
        let name = |name: &str| TopicName { plain: name.to_owned(), resolved: format!("/{name}") };
        let inputs = vec![SensorTopics {
            name: "points".to_owned(),
            points: Some(name("points")),
            depth: Some(DepthTopics {
                image: name("depth/image"),
                camera_info: name("depth/camera_info"),
                compressed: "/depth/image/compressedDepth".to_owned(),
            }),
        }];
        Self {
            inputs,
            sources: Vec::new(),
            network: NetworkState::default(),
            deltas: RefCell::default(),
            reports: RefCell::default(),
            replies: RefCell::default(),
            failure: RefCell::default(),
        }
    }
}

impl Transport for Fake {
    type Request = ();

    async fn publish(&self, message: Outgoing) -> Result<(), SendError> {
        match message {
            Outgoing::Delta(delta) => self.deltas.borrow_mut().push(delta),
            Outgoing::Diagnostics(report) => self.reports.borrow_mut().push(report),
            _ => {}
        }
        Ok(())
    }

    async fn answer(&self, _: Service, (): (), response: TriggerResponse) -> Result<(), SendError> {
        self.replies.borrow_mut().push(response);
        Ok(())
    }

    fn inputs(&self) -> &[SensorTopics] {
        &self.inputs
    }

    fn sources(&self) -> Vec<Source> {
        self.sources.clone()
    }

    fn node_name(&self) -> &'static str {
        "/robot/cfodi"
    }

    fn network_state(&self) -> NetworkState {
        self.network.clone()
    }

    async fn failed(&self) -> String {
        let failure = self.failure.borrow_mut().take();
        match failure {
            Some(failure) => failure.await.unwrap(),
            None => std::future::pending().await,
        }
    }
}

fn at(seconds: f64) -> Stamp {
    Stamp::from_nanos((seconds * 1e9) as i64)
}

fn cloud(stamp: Stamp, frame_id: &str) -> Event<()> {
    let points = Points::F32(vec![[0.0, 0.0, 1.0]; 20]);
    let frame_id = frame_id.to_owned();
    Event::Cloud(
        Form::Points.of(0),
        Ok(Cloud { stamp, frame_id, points, total: 20, invalid: 0, out_of_range: 0 }),
    )
}

fn transform(stamp: Stamp, is_static: bool) -> Event<()> {
    let transform = TransformStamped {
        header: Header { stamp: stamp.into(), frame_id: "odom".to_owned() },
        child_frame_id: "camera".to_owned(),
        transform: Transform { translation: Vector3::default(), rotation: Quaternion::default() },
    };
    Event::Transforms { message: TfMessage { transforms: vec![transform] }, is_static }
}

/// How a node ended, what it counted, and its middleware.
type Ran = (Result<(), LiveError>, Counts, Rc<Fake>);

/// Runs a node on these events until `taken_in` scans are in, and a little longer; with 0 it ends at once.
fn node(transport: Fake, events: Vec<Event<()>>, taken_in: u64) -> Ran {
    node_with(&Config::new([]).unwrap(), transport, events, taken_in)
}

fn node_with(config: &Config, transport: Fake, events: Vec<Event<()>>, taken_in: u64) -> Ran {
    let patience = Instant::now();
    node_until(config, transport, events, move |_, counts| async move {
        while counts.borrow().taken_in < taken_in && patience.elapsed() < Duration::from_secs(60) {
            tokio::time::sleep(TICK).await;
        }
        if taken_in > 0 {
            tokio::time::sleep(Duration::from_millis(400)).await;
        }
    })
}

/// Runs a node on these events until `stop` resolves, which may send more and see what was counted.
fn node_until<Stop: Future<Output = ()>>(
    config: &Config,
    transport: Fake,
    events: Vec<Event<()>>,
    stop: impl FnOnce(mpsc::Sender<Event<()>>, Rc<RefCell<Counts>>) -> Stop,
) -> Ran {
    let counts = Rc::new(RefCell::new(Counts::default()));
    let transport = Rc::new(transport);
    let (sender, receiver) = mpsc::channel(100);
    events.into_iter().for_each(|event| sender.try_send(event).unwrap());
    let enough = stop(sender.clone(), Rc::clone(&counts));
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let (engine, _lock) = begin(config, config.snapshot_path.is_some()).unwrap();
    let live = run(config, engine, Rc::clone(&transport), receiver, Rc::clone(&counts), listen().1, enough);
    let ended = LocalSet::new().block_on(&runtime, live);
    drop(sender);
    (ended.map(drop), counts.borrow().clone(), transport)
}

/// What the log says meanwhile: levels and lines.
fn heard<T>(run: impl FnOnce() -> T) -> (T, Vec<(u8, String)>) {
    let (listener, mut lines) = listen();
    let ran = tracing::subscriber::with_default(tracing_subscriber::registry().with(listener), run);
    (ran, std::iter::from_fn(|| lines.0.try_recv().ok()).map(|line| (line.level, line.msg)).collect())
}

/// Runs a node on these events until it has reported.
fn reported(transport: Fake, events: Vec<Event<()>>) -> Rc<Fake> {
    let (ended, _, transport) = node_until(&Config::new([]).unwrap(), transport, events, |_, _| async {
        tokio::time::sleep(Duration::from_millis(1800)).await;
    });
    ended.unwrap();
    transport
}

#[test]
fn a_cloud_waits_for_its_transform_and_one_without_is_skipped_with_its_reason() {
    let events = vec![cloud(at(10.0), "camera"), cloud(at(10.0), "nowhere"), transform(at(10.0), false)];
    let (ended, counts, transport) = node(Fake::default(), events, 1);
    ended.unwrap();
    assert_eq!((counts.received, counts.taken_in), (2, 1));
    assert_eq!(counts.skipped.get("transform_timeout"), Some(&1));
    assert_eq!(transport.deltas.borrow().len(), 1);
}

#[test]
fn under_a_slow_clock_a_cloud_waits_by_that_clock() {
    let clock = |seconds: f64| Event::Clock(at(seconds));
    let events = vec![clock(10.0), cloud(at(10.0), "camera"), clock(10.01)];
    let (ended, counts, _) =
        node_until(&Config::new([]).unwrap(), Fake::default(), events, |events, counts| async move {
            // Three times as long as a cloud waits by the clock on the wall.
            tokio::time::sleep(Duration::from_millis(600)).await;
            events.try_send(transform(at(10.0), false)).unwrap();
            let patience = Instant::now();
            while counts.borrow().taken_in < 1 && patience.elapsed() < Duration::from_secs(60) {
                tokio::time::sleep(TICK).await;
            }
        });
    ended.unwrap();
    assert_eq!((counts.taken_in, counts.skipped.len()), (1, 0));
}

#[test]
fn a_transform_that_was_overtaken_counts_unless_it_would_be_a_jump_back() {
    let late = |seconds: f64| {
        let Event::Transforms { message, .. } = transform(at(seconds), false) else { unreachable!() };
        Event::LateTransforms(message)
    };
    let events = vec![transform(at(10.0), false), late(5.0), late(9.5), cloud(at(9.8), "camera")];
    assert_eq!(node(Fake::default(), events, 1).1.taken_in, 1);
}

#[test]
fn three_scans_that_a_late_transform_releases_are_all_taken_in() {
    let clouds = [10.0, 10.033, 10.066].map(|seconds| cloud(at(seconds), "camera"));
    let mut events: Vec<_> = clouds.into_iter().collect();
    events.extend([transform(at(9.9), false), transform(at(10.1), false)]);
    let (_, counts, _) = node(Fake::default(), events, 3);
    assert_eq!((counts.taken_in, counts.replaced), (3, 0));
}

#[test]
fn scans_have_as_many_places_as_tf_timeout_lets_wait_of_each_sensor_within_a_bound() {
    let places = |sensors: usize, timeout: f64| {
        let names = (0..sensors).map(|number| format!("s{number}")).collect();
        let given = [("sensors", Value::TextList(names)), ("tf_timeout", Value::Double(timeout))];
        places(&Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap())
    };
    assert_eq!([1, 2, 4, 16].map(|sensors| places(sensors, 0.2)), [8, 16, 32, 64]);
    assert_eq!([0.0, 1.0, 60.0].map(|timeout| places(1, timeout)), [8, 32, 64]);
}

#[test]
fn a_scan_that_jumps_back_begins_a_session_and_a_stray_stamp_without_transform_does_not() {
    let events = vec![
        transform(at(20.0), false),
        cloud(at(20.0), "camera"),
        cloud(at(1.0), "camera"),
        transform(at(20.1), false),
        cloud(at(20.1), "camera"),
    ];
    let (_, counts, transport) = node(Fake::default(), events, 2);
    assert_eq!((counts.taken_in, counts.skipped.get("transform_timeout")), (2, Some(&1)));
    assert_eq!(transport.deltas.borrow()[0].session_id, transport.deltas.borrow()[1].session_id);
    let events = vec![
        transform(at(0.0), true),
        cloud(at(20.0), "camera"),
        cloud(at(20.1), "camera"),
        Event::Call(Service::Reset, ()),
        cloud(at(20.2), "camera"),
        cloud(at(5.0), "camera"),
    ];
    let (_, _, transport) = node(Fake::default(), events, 1);
    let deltas = transport.deltas.borrow();
    let last = deltas.last().unwrap();
    assert_eq!((last.sequence, last.base_sequence), (1, 0));
    assert!(deltas.iter().all(|delta| delta.session_id <= last.session_id));
    assert!(transport.replies.borrow()[0].success);
}

#[test]
fn counts_close_when_the_node_ends_with_clouds_on_their_way() {
    let clouds = (0..40).map(|i| cloud(at(10.0 + f64::from(i) / 30.0), "camera"));
    let mut events: Vec<_> = [transform(at(0.0), true)].into_iter().chain(clouds).collect();
    events.push(Event::Lost(Form::Points.of(0), 3));
    let (_, counts, _) = node(Fake::default(), events, 0);
    let skipped: u64 = counts.skipped.values().sum();
    assert_eq!((counts.received, counts.lost), (40, 3));
    assert_eq!(counts.taken_in + counts.replaced + skipped, 40);
}

#[test]
fn a_panic_of_the_engine_ends_the_node_with_an_error_and_the_counts_close() {
    let clouds = (-1..3).map(|later| cloud(Stamp::from_nanos(DEADLY.nanos() + later), "camera"));
    let events = [transform(at(0.0), true)].into_iter().chain(clouds);
    let (ended, counts, _) = node(Fake::default(), events.collect(), u64::MAX);
    let error = ended.unwrap_err().to_string();
    assert!(
        error.starts_with("the engine's thread has died: ") && error.contains("a panic for the test"),
        "{error}"
    );
    assert_eq!((counts.received, counts.taken_in, counts.skipped.get("engine_died")), (4, 1, Some(&3)));
}

#[test]
fn a_reader_that_has_ended_ends_the_node_with_an_error() {
    let (sender, receiver) = oneshot::channel();
    let transport = Fake { failure: RefCell::new(Some(receiver)), ..Fake::default() };
    sender.send("reading /points has ended".to_owned()).unwrap();
    let (ended, _, _) = node(transport, Vec::new(), u64::MAX);
    assert_eq!(ended.unwrap_err().to_string(), "the node is deaf: reading /points has ended");
}

/// Saves its map as `map` in this folder, every 0.1 s.
fn saving_in(folder: &std::path::Path) -> Config {
    let path = Value::Text(folder.join("map").display().to_string());
    let given = [("snapshot_path", path), ("snapshot_period", Value::Double(0.1))];
    Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap()
}

#[test]
fn a_map_is_saved_when_asked_and_at_the_end_and_the_next_node_goes_on_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let config = saving_in(folder.path());
    for (scans, before) in [(3, 0), (2, 3)] {
        let clouds = (0..scans).map(|i| cloud(at(10.0 + i as f64 / 30.0), "camera"));
        let mut events: Vec<_> = [transform(at(0.0), true)].into_iter().chain(clouds).collect();
        events.push(Event::Call(Service::Save, ()));
        let (ended, _, transport) = node_with(&config, Fake::default(), events, scans);
        ended.unwrap();
        let first = &transport.deltas.borrow()[0];
        assert_eq!((first.base_sequence, first.sequence), (before, before + 1));
        let replies = transport.replies.borrow();
        assert!(replies.len() == 1 && replies[0].success, "{replies:?}");
        let stored = store::read(&folder.path().join("map")).unwrap();
        assert_eq!(stored.map.sequence(), before + scans);
    }
}

/// A robot at its dock, its driver off.
#[test]
fn a_map_that_no_scan_has_changed_is_not_written_again_before_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let (config, path) = (saving_in(folder.path()), folder.path().join("map"));
    let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera")];
    let (ended, _, _) = node_until(&config, Fake::default(), events, move |events, counts| async move {
        // Each map is a file of its own that takes the name of the one before.
        let file = || std::fs::metadata(&path).map(|file| (file.ino(), file.mtime(), file.mtime_nsec())).ok();
        let patience = Instant::now();
        let is_saved =
            || store::read(&path).is_ok_and(|saved| saved.map.sequence() == counts.borrow().taken_in);
        for scan in 1..3 {
            while (counts.borrow().taken_in < scan || !is_saved())
                && patience.elapsed() < Duration::from_secs(60)
            {
                tokio::time::sleep(TICK).await;
            }
            // One that was asked for while that one was written follows it.
            tokio::time::sleep(Duration::from_millis(500)).await;
            let saved = file();
            tokio::time::sleep(Duration::from_millis(500)).await;
            assert!(saved.is_some() && file() == saved, "scan {scan}");
            events.try_send(cloud(at(10.0 + scan as f64), "camera")).unwrap();
        }
    });
    ended.unwrap();
}

#[test]
fn a_jump_that_nobody_asked_for_keeps_the_file_of_the_map_that_it_ends_and_a_reset_does_not() {
    for (jump, kept) in [(cloud(at(10.0), "camera"), true), (Event::Call(Service::Reset, ()), false)] {
        let folder = tempfile::tempdir().unwrap();
        let config = saving_in(folder.path());
        let events = vec![transform(at(0.0), true), cloud(at(100.0), "camera")];
        node_with(&config, Fake::default(), events, 1).0.unwrap();
        let last = cloud(at(11.0), "camera");
        let events = vec![transform(at(0.0), true), cloud(at(100.1), "camera"), jump, last];
        let scans = if kept { 2 } else { 1 };
        node_with(&config, Fake::default(), events, scans).0.unwrap();
        let sequence =
            |name: &str| store::read(&folder.path().join(name)).ok().map(|saved| saved.map.sequence());
        assert_eq!(sequence("map"), Some(scans));
        // The scan before the jump may have been saved, or was still waiting.
        assert_eq!(sequence("map.before-1").is_some_and(|scans| scans >= 1), kept);
        assert!(!folder.path().join("map.before-2").exists());
    }
}

/// Runs a node that saves in this folder on these events, until it has taken all in and a little longer.
fn all_taken(folder: &std::path::Path, events: Vec<Event<()>>) -> Ran {
    node_until(&saving_in(folder), Fake::default(), events, |events, _| async move {
        let patience = Instant::now();
        while events.capacity() < events.max_capacity() && patience.elapsed() < Duration::from_secs(60) {
            tokio::time::sleep(TICK).await;
        }
        tokio::time::sleep(Duration::from_millis(400)).await;
    })
}

#[test]
fn a_reset_has_failed_where_the_map_that_was_saved_cannot_be_written_over() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("map.part")).unwrap();
    let (ended, _, transport) = all_taken(folder.path(), vec![Event::Call(Service::Reset, ())]);
    assert!(matches!(ended, Err(LiveError::NotSaved(_))), "{ended:?}");
    let replies = transport.replies.borrow();
    let words = "begins with an empty map; the map that was saved may come back: ";
    assert!(replies.len() == 1 && !replies[0].success && replies[0].message.contains(words), "{replies:?}");
}

#[test]
fn a_call_to_save_before_a_reset_has_saved_what_was_there_or_has_failed() {
    let folder = tempfile::tempdir().unwrap();
    let scan = [transform(at(0.0), true), cloud(at(10.0), "camera")];
    let calls = [Service::Save, Service::Reset].map(|service| Event::Call(service, ()));
    let (ended, _, transport) = all_taken(folder.path(), scan.into_iter().chain(calls).collect());
    ended.unwrap();
    let replies = transport.replies.borrow();
    let [save, reset] = &replies[..] else { panic!("{replies:?}") };
    assert!(reset.success && reset.message.ends_with(" begins with an empty map"), "{reset:?}");
    let words =
        if save.success { "1 scans saved, " } else { " has begun meanwhile, before the map of session " };
    assert!(save.message.contains(words), "{save:?}");
    assert_eq!(store::read(&folder.path().join("map")).unwrap().map.sequence(), 0);
}

/// Before a disk that does not answer.
#[test]
fn a_reset_that_no_more_may_wait_with_is_told_that_the_saved_map_is_not_waited_for() {
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    runtime.block_on(async {
        let (mut live, _reported) = reports::by_hand(&saving_in(folder.path()), Fake::default());
        for _ in 0..=saving::MOST_CALLS {
            live.event(Event::Call(Service::Save, ())).await;
        }
        assert!(live.transport.replies.borrow().is_empty(), "they wait");
        live.event(Event::Call(Service::Reset, ())).await;
        let words = format!(
            "session {} begins with an empty map; whether the saved one is forgotten is not waited for",
            live.session
        );
        let replies = live.transport.replies.borrow();
        assert!(replies.len() == 1 && !replies[0].success && replies[0].message == words, "{replies:?}");
    });
}

#[test]
fn without_a_file_a_call_to_save_is_told_so() {
    let events = vec![Event::Call(Service::Save, ()), transform(at(0.0), true), cloud(at(10.0), "camera")];
    let (_, _, transport) = node(Fake::default(), events, 1);
    let replies = transport.replies.borrow();
    assert_eq!(replies[0].message, "the parameter snapshot_path names no file");
    assert!(replies.len() == 1 && !replies[0].success);
}

#[test]
fn a_node_whose_last_map_cannot_be_saved_says_so_and_fails() {
    let folder = tempfile::tempdir().unwrap();
    let config = saving_in(folder.path());
    std::fs::create_dir(folder.path().join("map.part")).unwrap();
    let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera"), Event::Call(Service::Save, ())];
    let (ended, counts, transport) = node_with(&config, Fake::default(), events, 1);
    let error = ended.unwrap_err().to_string();
    assert!(error.starts_with("the map was not saved at the end: ") && error.contains("map: "), "{error}");
    assert_eq!(counts.taken_in, 1);
    let replies = transport.replies.borrow();
    assert!(replies.len() == 1 && !replies[0].success, "{replies:?}");
}

#[test]
fn a_map_of_a_newer_version_is_refused_with_its_reason_and_kept_aside_and_the_node_begins_empty() {
    let folder = tempfile::tempdir().unwrap();
    let [path, refused] = ["map", "map.refused-1"].map(|name| folder.path().join(name));
    let config = saving_in(folder.path());
    let run = || {
        let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera")];
        let (ended, _, transport) = node_with(&config, Fake::default(), events, 1);
        ended.unwrap();
        let first = &transport.deltas.borrow()[0];
        (first.base_sequence, first.sequence)
    };
    assert_eq!(run(), (0, 1));
    let mut newer = std::fs::read(&path).unwrap();
    newer[8] = store::VERSION as u8 + 1;
    std::fs::write(&path, &newer).unwrap();
    let reason = store::read(&path).unwrap_err().to_string();
    let (version, newest) = (store::VERSION + 1, store::VERSION);
    let expected = format!("{} is of version {version}; this program reads up to {newest}", path.display());
    assert_eq!(reason, expected);
    assert_eq!(run(), (0, 1), "it went on with a map that it cannot read");
    assert_eq!(std::fs::read(refused).unwrap(), newer);
    assert_eq!(store::read(&path).unwrap().map.sequence(), 1);
}

#[test]
fn what_cannot_be_resumed_is_kept_aside_and_what_contradicts_the_parameters_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map");
    let config = saving_in(folder.path());
    let names = || {
        let mut names: Vec<_> = folder.path().read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(begin(&config, true).unwrap().0.voxel_count(), 0, "nothing to resume is no failure");
    std::fs::write(&path, "damaged").unwrap();
    assert_eq!(begin(&config, true).unwrap().0.voxel_count(), 0);
    assert_eq!(names(), ["map.lock", "map.refused-1"]);
    let stored =
        |frame_id: &str, params| Stored { frame_id: frame_id.to_owned(), map: Engine::new(params).save() };
    store::write(&path, &stored("map", config.engine)).unwrap();
    let error = begin(&config, true).unwrap_err().to_string();
    assert!(error.contains("made with fixed_frame map, now it is odom"), "{error}");
    store::write(&path, &stored("odom", Params::paper())).unwrap();
    let error = begin(&config, true).unwrap_err().to_string();
    assert!(error.contains("made with mode paper, now it is consistent"), "{error}");
    assert_eq!(names(), ["map", "map.lock", "map.refused-1"]);
    begin(&config, false).unwrap();
    assert_eq!(names(), ["map.before-1", "map.lock", "map.refused-1"]);
    let nowhere = Value::Text(folder.path().join("none/map").display().to_string());
    let nowhere = Config::new([("snapshot_path".to_owned(), nowhere)]).unwrap();
    assert!(begin(&nowhere, false).unwrap_err().to_string().contains("a folder that exists"));
    let error = begin(&Config::new([]).unwrap(), true).unwrap_err().to_string();
    assert_eq!(error, "--resume needs the parameter snapshot_path: the file of the map");
}
