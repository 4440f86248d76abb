//! The live node on a middleware made of channels.

mod changes;
mod ending;
mod hostile;
mod intake;
mod lines;
mod reports;
mod saving;
mod taken_in;
mod transforms;

use std::os::unix::fs::MetadataExt as _;

use tokio::runtime::Builder;
use tokio::sync::oneshot;
use tokio::task::LocalSet;
use tracing_subscriber::layer::SubscriberExt as _;

use super::session::new_session;
use super::*;
use crate::cloud::{Cloud, CloudError};
use crate::config::Value;
use crate::engine::{Params, Points, Stamp};
use crate::msg::ros::{Header, Quaternion, Transform, TransformStamped, TriggerResponse, Vector3};
use crate::msg::sent;
use crate::node::counts::{ENGINE_DIED, TRANSFORM_TIMEOUT};
use crate::node::fake::Fake;
use crate::node::publish::{Make, messages};
use crate::node::resume::begin;
use crate::node::rosout::listen;
use crate::node::transport::{Form, NetworkState, Source};
use crate::store;
use crate::worker::Output;

/// How long a test waits for what must come: less than the longest `tf_timeout`.
const PATIENCE: Duration = Duration::from_secs(50);

/// With [`deadly`] steps the engine's thread panics over a scan of this stamp.
const DEADLY: Stamp = Stamp::from_nanos(13_131_313_131_313);

fn deadly() -> Steps {
    let send = |outputs: &mpsc::Sender<Output>, output| {
        let is_deadly = matches!(&output, Output::Scan { update, .. } if update.stamp == DEADLY);
        assert!(!is_deadly, "a panic for the test");
        drop(outputs.blocking_send(output));
    };
    Steps { send, ..Steps::default() }
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
    Event::Transforms { message: TfMessage { transforms: vec![transform] }, is_static, publisher: None }
}

/// How a node ended, what it counted, and its middleware.
type Ran = (Result<(), LiveError>, Counts, Rc<Fake>);

/// Waits until this holds. What does not come in time fails the test: at the node's end it might come after all.
async fn until(what: &str, holds: impl Fn() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        tokio::time::sleep(TICK).await;
    }
}

/// Runs a node on these events until `taken_in` scans are in and it is known where every other one went; with 0 it ends at once.
fn node(transport: Fake, events: Vec<Event<()>>, taken_in: u64) -> Ran {
    node_with(&Config::new([]).unwrap(), transport, events, taken_in)
}

fn node_with(config: &Config, transport: Fake, events: Vec<Event<()>>, taken_in: u64) -> Ran {
    node_by(Steps::default(), config, transport, events, taken_in)
}

fn node_by(steps: Steps, config: &Config, transport: Fake, events: Vec<Event<()>>, taken_in: u64) -> Ran {
    node_by_until(steps, config, transport, events, move |events, counts| async move {
        // Whichever scan the node has not heard of yet is still in the channel.
        let is_settled = |counts: &Counts| {
            let known = counts.taken_in + counts.replaced + counts.skipped.values().sum::<u64>();
            counts.taken_in >= taken_in && known == counts.received && has_heard_all(&events)
        };
        until("all is settled", || taken_in == 0 || is_settled(&counts.borrow())).await;
    })
}

fn has_heard_all(events: &mpsc::Sender<Event<()>>) -> bool {
    events.capacity() == events.max_capacity()
}

/// Runs a node on these events until `stop` resolves, which may send more and see what was counted.
fn node_until<Stop: Future<Output = ()>>(
    config: &Config,
    transport: impl Into<Rc<Fake>>,
    events: Vec<Event<()>>,
    stop: impl FnOnce(mpsc::Sender<Event<()>>, Rc<RefCell<Counts>>) -> Stop,
) -> Ran {
    node_by_until(Steps::default(), config, transport, events, stop)
}

fn node_by_until<Stop: Future<Output = ()>>(
    steps: Steps,
    config: &Config,
    transport: impl Into<Rc<Fake>>,
    events: Vec<Event<()>>,
    stop: impl FnOnce(mpsc::Sender<Event<()>>, Rc<RefCell<Counts>>) -> Stop,
) -> Ran {
    let counts = Rc::new(RefCell::new(Counts::default()));
    let transport = transport.into();
    let (sender, receiver) = mpsc::channel(100);
    events.into_iter().for_each(|event| sender.try_send(event).unwrap());
    let enough = stop(sender.clone(), Rc::clone(&counts));
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let (engine, _lock) = begin(config, config.snapshot_path.is_some()).unwrap();
    let outlets = Outlets { transport: Rc::clone(&transport), recorder: None };
    let start = Start { engine, outlets, events: receiver, counts: Rc::clone(&counts), lines: listen().1 };
    let live = run_by(steps, config, start, enough, std::future::pending());
    let ended = LocalSet::new().block_on(&runtime, live);
    drop(sender);
    (ended.map(drop), counts.borrow().clone(), transport)
}

/// How many clouds were skipped, by the keys of the reasons.
fn by_key(counts: Counts) -> Vec<(&'static str, u64)> {
    counts.skipped.into_iter().map(|(reason, number)| (reason.key, number)).collect()
}

/// What the log says meanwhile: levels and lines.
fn heard<T>(run: impl FnOnce() -> T) -> (T, Vec<(u8, String)>) {
    let (listener, mut lines) = listen();
    let ran = tracing::subscriber::with_default(tracing_subscriber::registry().with(listener), run);
    (ran, std::iter::from_fn(|| lines.0.try_recv().ok()).map(|line| (line.level, line.msg)).collect())
}

/// Saves its map as `map` in this folder, every 0.1 s.
fn saving_in(folder: &std::path::Path) -> Config {
    let path = Value::Text(folder.join("map").display().to_string());
    let given = [("snapshot_path", path), ("snapshot_period", Value::Double(0.1))];
    Config::new(given.map(|(name, value)| (name.to_owned(), value))).unwrap()
}

/// Runs a node on these events until it has reported.
fn node_that_reports(config: &Config, transport: Fake, events: Vec<Event<()>>) -> Ran {
    let transport = Rc::new(transport);
    let seen = Rc::clone(&transport);
    node_until(config, transport, events, |_, _| async move {
        until("a report", || !seen.reports.borrow().is_empty()).await;
    })
}

/// The middleware of a node that had these events, with nothing set.
fn reported(transport: Fake, events: Vec<Event<()>>) -> Rc<Fake> {
    let (ended, _, transport) = node_that_reports(&Config::new([]).unwrap(), transport, events);
    ended.unwrap();
    transport
}

/// Lets clouds wait long enough for a busy machine.
fn patient() -> Config {
    Config::new([("tf_timeout".to_owned(), Value::Double(2.0))]).unwrap()
}

#[test]
fn a_cloud_waits_for_its_transform_and_one_without_is_skipped_with_its_reason() {
    let events = vec![cloud(at(10.0), "camera"), cloud(at(10.0), "nowhere"), transform(at(10.0), false)];
    let (ended, counts, transport) = node_with(&patient(), Fake::default(), events, 1);
    ended.unwrap();
    assert_eq!((counts.received, counts.taken_in), (2, 1));
    assert_eq!(counts.skipped.get(&TRANSFORM_TIMEOUT), Some(&1));
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
            until("the scan", || counts.borrow().taken_in == 1).await;
        });
    ended.unwrap();
    assert_eq!((counts.taken_in, counts.skipped.len()), (1, 0));
}

fn late(seconds: f64) -> Event<()> {
    let Event::Transforms { message, .. } = transform(at(seconds), false) else { unreachable!() };
    Event::LateTransforms(message)
}

/// Clouds of a lap may come before its first `/clock`.
#[test]
fn a_cloud_that_came_by_the_clock_of_the_lap_before_is_given_up_in_time() {
    let mut events = vec![Event::Clock(at(100.0)), transform(at(100.0), false), cloud(at(100.0), "camera")];
    events.extend([cloud(at(0.1), "camera"), cloud(at(0.15), "nowhere"), transform(at(0.1), false)]);
    let (_, counts, _) = node(Fake::default(), events, 1);
    assert_eq!((counts.received, counts.skipped.get(&TRANSFORM_TIMEOUT)), (3, Some(&1)));
}

#[test]
fn a_transform_that_was_overtaken_counts_unless_it_would_be_a_jump_back() {
    let events = vec![transform(at(10.0), false), late(5.0), late(9.5), cloud(at(9.8), "camera")];
    assert_eq!(node(Fake::default(), events, 1).1.taken_in, 1);
}

#[test]
fn a_transform_of_the_lap_before_that_comes_late_does_not_count() {
    let mut events = vec![transform(at(100.0), false), transform(at(0.0), false), late(99.99)];
    events.extend([transform(at(0.1), false), cloud(at(0.05), "camera")]);
    let ((_, counts, _), said) = heard(|| node(Fake::default(), events, 1));
    assert_eq!((counts.taken_in, counts.skipped.len()), (1, 0));
    assert!(!said.iter().any(|(_, line)| line.contains("to and fro")), "{said:?}");
}

#[test]
fn three_scans_that_a_late_transform_releases_are_all_taken_in() {
    let clouds = [10.0, 10.033, 10.066].map(|seconds| cloud(at(seconds), "camera"));
    let mut events: Vec<_> = clouds.into_iter().collect();
    events.extend([transform(at(9.9), false), transform(at(10.1), false)]);
    let (_, counts, _) = node_with(&patient(), Fake::default(), events, 3);
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
    assert_eq!((counts.taken_in, counts.skipped.get(&TRANSFORM_TIMEOUT)), (2, Some(&1)));
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
    let config = Config::new([]).unwrap();
    let (ended, counts, _) = node_by(deadly(), &config, Fake::default(), events.collect(), u64::MAX);
    let error = ended.unwrap_err().to_string();
    assert!(
        error.starts_with("the engine's thread has died: ") && error.contains("a panic for the test"),
        "{error}"
    );
    assert_eq!((counts.received, counts.taken_in, counts.skipped.get(&ENGINE_DIED)), (4, 1, Some(&3)));
}

#[test]
fn a_panic_in_making_messages_ends_the_node_with_its_words_and_the_map_is_saved_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let events = || vec![transform(at(0.0), true), cloud(at(10.0), "camera")];
    // Of the empty map there are messages.
    let make: Make = |session, map, markers, twins| {
        assert!(map.sequence == 0, "a panic for the test");
        messages(session, map, markers, twins)
    };
    let steps = Steps { make, ..Steps::default() };
    // It is found while the node runs, or with the last map.
    for taken_in in [u64::MAX, 1] {
        let config = saving_in(folder.path());
        let (ran, said) = heard(|| node_by(steps, &config, Fake::default(), events(), taken_in));
        let (ended, counts, _) = ran;
        assert_eq!(ended.unwrap_err().to_string(), "the node is mute: a panic for the test");
        assert_eq!((counts.received, counts.taken_in), (1, 1));
        let line = "the messages of a map could not be made: a panic for the test";
        assert_eq!(said.iter().filter(|(_, said)| said == line).count(), 1, "{said:?}");
        let path = folder.path().join("map");
        assert_eq!(store::read(&path).unwrap().map.sequence(), 1);
        std::fs::remove_file(path).unwrap();
    }
}

#[test]
fn a_panic_in_sending_a_report_ends_the_node_with_its_words() {
    let transport = Fake { deadly: Some(sent::DIAGNOSTICS.name), ..Fake::default() };
    let (ended, _, _) = node(transport, Vec::new(), u64::MAX);
    assert_eq!(ended.unwrap_err().to_string(), "the node is mute: a panic for the test");
}

#[test]
fn a_reader_that_has_ended_ends_the_node_with_an_error() {
    let (sender, receiver) = oneshot::channel();
    let transport = Fake { failure: RefCell::new(Some(receiver)), ..Fake::default() };
    sender.send("reading /points has ended".to_owned()).unwrap();
    let (ended, _, _) = node(transport, Vec::new(), u64::MAX);
    assert_eq!(ended.unwrap_err().to_string(), "the node is deaf: reading /points has ended");
}

#[test]
fn when_the_network_was_joined_anew_the_map_goes_out_at_once_for_late_readers() {
    let seldom = Config::new([("publish_rate".to_owned(), Value::Double(0.01))]).unwrap();
    let transport = Rc::new(Fake::default());
    let sent = Rc::clone(&transport);
    let (ended, _, _) = node_until(&seldom, transport, Vec::new(), |events, _| async move {
        for map in 1..=2 {
            until("a map", || sent.maps() >= map).await;
            assert_eq!(sent.maps(), map);
            events.try_send(Event::Joined).unwrap();
        }
    });
    ended.unwrap();
}

#[test]
fn the_empty_map_of_a_session_that_begins_goes_out_at_once() {
    let seldom = Config::new([("publish_rate".to_owned(), Value::Double(0.01))]).unwrap();
    let causes =
        [vec![Event::Call(Service::Reset, ())], vec![Event::Clock(at(100.0)), Event::Clock(at(10.0))]];
    for cause in causes {
        let transport = Rc::new(Fake::default());
        let sent = Rc::clone(&transport);
        let (ended, _, _) = node_until(&seldom, transport, Vec::new(), |events, _| async move {
            until("the first map", || sent.maps() == 1).await;
            cause.into_iter().for_each(|event| events.try_send(event).unwrap());
            until("that of the session", || sent.maps() == 2).await;
        });
        ended.unwrap();
    }
}
