//! The live node: joins clouds with their transforms, hands scans to the worker, answers calls.

use std::cell::RefCell;
use std::future::Future;
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use thiserror::Error;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use tracing::{debug, info, warn};

use super::counts::Counts;
use super::publish::{Ended, publish};
use super::throttle::Throttle;
use super::transport::{Event, Source, Transport};
use crate::cloud::{Cloud, CloudError};
use crate::config::Config;
use crate::engine::{Scan, Snapshot, Stamp};
use crate::msg::ros::{TfMessage, TriggerResponse};
use crate::tf::{Frames, Inserted, JUMP_BACK, Waited, WaitingQueue};
use crate::worker::{Output, Worker};

/// Clouds that wait for their transform: about a quarter of a second of them.
const WAITING: usize = 8;

/// Outputs of the worker that wait to be sent; when full, the worker waits too, and newer scans replace older ones.
const OUTPUTS: usize = 64;

/// How long nobody may publish on `points` before the topics of the graph are listed.
const LONELY: Duration = Duration::from_secs(3);

/// Time between two looks at clouds whose transform does not come.
const TICK: Duration = Duration::from_millis(20);

/// The node has to end.
#[derive(Debug, Error)]
pub enum LiveError {
    /// The engine's thread could not be started.
    #[error("cannot start the engine's thread: {0}")]
    Start(std::io::Error),
    /// The engine's thread has ended by itself.
    #[error("the engine's thread has died: {0}")]
    Died(String),
    /// The middleware has stopped giving events.
    #[error("the middleware has stopped")]
    Deaf,
}

/// Runs the node until `shutdown` resolves and returns the map of that moment; `counts` says where every cloud went.
///
/// # Errors
/// When the engine's thread dies or the middleware stops.
pub async fn run<T: Transport>(
    config: &Config,
    transport: Rc<T>,
    mut events: mpsc::Receiver<Event<T::Request>>,
    counts: Rc<RefCell<Counts>>,
    shutdown: impl Future<Output = ()>,
) -> Result<Arc<Snapshot>, LiveError> {
    let (outputs, receiver) = mpsc::channel::<Output>(OUTPUTS);
    let sink = move |output| drop(outputs.blocking_send(output));
    let session = new_session(0);
    let worker = Worker::start(config.engine, session, sink).map_err(LiveError::Start)?;
    let publishing = publish(Rc::clone(&transport), receiver, Rc::clone(&counts), config.fixed_frame.clone());
    let mut publishing = tokio::task::spawn_local(publishing);
    let mut live = Live::new(config, transport, worker, session, counts);
    let mut tick = interval(TICK);
    let mut snapshots = interval(config.publish_period);
    let mut shutdown = pin!(shutdown);
    loop {
        tokio::select! {
            () = &mut shutdown => return live.finish(publishing).await,
            ended = &mut publishing => return Err(death(ended.ok())),
            event = events.recv() => live.event(event.ok_or(LiveError::Deaf)?).await,
            _ = tick.tick() => live.tick(),
            _ = snapshots.tick() => live.worker.request_snapshot(),
        }
    }
}

fn death(ended: Option<Ended>) -> LiveError {
    LiveError::Died(ended.and_then(|ended| ended.died).unwrap_or_else(|| "it has ended".to_owned()))
}

fn interval(period: Duration) -> tokio::time::Interval {
    let mut interval = tokio::time::interval(period);
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    interval
}

/// A session id that was not used before: the time of day in ns, or one more than the one before.
fn new_session(before: u64) -> u64 {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(since_epoch.as_nanos()).unwrap_or(u64::MAX).max(before + 1)
}

struct Live<T> {
    transport: Rc<T>,
    worker: Worker,
    frames: Frames,
    waiting: WaitingQueue<Cloud>,
    counts: Rc<RefCell<Counts>>,
    throttle: Throttle,
    session: u64,
    /// Newest stamp of a cloud in this session, and of the simulated clock.
    newest_cloud: Option<Stamp>,
    newest_clock: Option<Stamp>,
    fixed_frame: String,
    tf_timeout: Duration,
    start: Instant,
    /// Since when nobody has published on `points`, or the list was written last.
    lonely_since: Option<Instant>,
}

impl<T: Transport> Live<T> {
    fn new(
        config: &Config,
        transport: Rc<T>,
        worker: Worker,
        session: u64,
        counts: Rc<RefCell<Counts>>,
    ) -> Self {
        let start = Instant::now();
        Self {
            transport,
            worker,
            frames: Frames::new(),
            waiting: WaitingQueue::new(WAITING),
            counts,
            throttle: Throttle::default(),
            session,
            newest_cloud: None,
            newest_clock: None,
            fixed_frame: config.fixed_frame.clone(),
            tf_timeout: config.tf_timeout,
            start,
            lonely_since: Some(start),
        }
    }

    async fn event(&mut self, event: Event<T::Request>) {
        match event {
            Event::Cloud(cloud) => self.cloud(cloud),
            Event::Lost(number) => self.lost(number),
            Event::Transforms { message, is_static } => self.transforms(&message, is_static),
            Event::Clock(stamp) => self.clock(stamp),
            Event::Reset(request) => self.reset(request).await,
            Event::Garbled { topic, text } => self.warn(topic, format_args!("a message on {topic}: {text}")),
        }
    }

    fn cloud(&mut self, cloud: Result<Cloud, CloudError>) {
        self.lonely_since = None;
        self.counts.borrow_mut().received += 1;
        match cloud {
            Ok(cloud) => {
                if jumped_back(&mut self.newest_cloud, cloud.stamp) {
                    self.frames.forget_after(cloud.stamp);
                    self.begin_session("the stamps of the clouds have jumped back");
                    self.newest_cloud = Some(cloud.stamp);
                }
                let (stamp, frame) = (cloud.stamp, cloud.frame_id.clone());
                if let Some(pushed_out) = self.waiting.push(cloud, stamp, frame, self.start.elapsed()) {
                    self.skip(&pushed_out, "waiting_queue_full");
                }
                self.submit_ready();
            }
            Err(error) => {
                self.counts.borrow_mut().skip(error.reason());
                self.warn(error.reason(), format_args!("a cloud was skipped: {error}"));
            }
        }
    }

    fn lost(&mut self, number: u64) {
        self.counts.borrow_mut().lost += number;
        let total = self.counts.borrow().lost;
        self.warn("lost", format_args!("{total} clouds were sent and never arrived (see receive_buffer)"));
    }

    fn transforms(&mut self, message: &TfMessage, is_static: bool) {
        for transform in &message.transforms {
            match self.frames.insert(transform, is_static) {
                Ok(Inserted::Stored) => {}
                Ok(other) => self.warn("tf", format_args!("{}: {other:?}", transform.child_frame_id)),
                Err(error) => self.warn(error.reason(), format_args!("a transform was refused: {error}")),
            }
        }
        self.submit_ready();
    }

    fn clock(&mut self, stamp: Stamp) {
        if jumped_back(&mut self.newest_clock, stamp) {
            self.frames.forget_after(stamp);
            self.begin_session("/clock has jumped back");
            self.newest_clock = Some(stamp);
        }
    }

    async fn reset(&mut self, request: T::Request) {
        self.begin_session("~/reset was called");
        let message = format!("session {} begins with an empty map", self.session);
        let response = TriggerResponse { success: true, message };
        if let Err(failure) = self.transport.answer_reset(request, response).await {
            self.warn("reset", format_args!("~/reset could not be answered: {failure}"));
        }
    }

    fn submit_ready(&mut self) {
        let Self { frames, fixed_frame, waiting, .. } = self;
        let ready = waiting.take_ready(|sensor, stamp| frames.lookup(fixed_frame, sensor, stamp));
        for (cloud, fixed_from_sensor) in ready {
            let scan = Scan { stamp: cloud.stamp, fixed_from_sensor, points: cloud.points };
            if self.worker.submit(scan) {
                self.counts.borrow_mut().replaced += 1;
                self.warn(
                    "replaced",
                    format_args!("the engine is slower than the sensor: a scan was replaced"),
                );
            }
        }
    }

    fn tick(&mut self) {
        for waited in self.waiting.take_expired(self.start.elapsed(), self.tf_timeout) {
            self.skip(&waited, "transform_timeout");
        }
        self.look_for_publishers(Instant::now());
    }

    fn skip(&mut self, waited: &Waited<Cloud>, reason: &'static str) {
        self.counts.borrow_mut().skip(reason);
        let why = waited.last_error.as_ref().map_or_else(String::new, ToString::to_string);
        let known = self.frames.frame_names();
        let (shown, more) = (&known[..known.len().min(20)], known.len().saturating_sub(20));
        let line = format!(
            "a cloud was skipped after {:.2} s without a transform from `{}` to `{}`: {why}; frames seen: {shown:?} \
             and {more} more (choose with -p fixed_frame:=...)",
            waited.waited.as_secs_f64(),
            waited.frame_id,
            self.fixed_frame,
        );
        self.warn(reason, format_args!("{line}"));
    }

    fn begin_session(&mut self, why: &str) {
        self.session = new_session(self.session);
        let waiting = self.waiting.take_all(self.start.elapsed()).len() + self.worker.reset(self.session);
        (0..waiting).for_each(|_| self.counts.borrow_mut().skip("session_ended"));
        self.newest_cloud = None;
        info!("{why}: session {} begins with an empty map", self.session);
        self.worker.request_snapshot();
    }

    /// Says what there is to listen to, when nobody publishes on `points`.
    fn look_for_publishers(&mut self, now: Instant) {
        let Some(since) = self.lonely_since else { return };
        if now.duration_since(since) < LONELY {
            return;
        }
        let topic = self.transport.points_topic().to_owned();
        let sources = self.transport.sources();
        if sources.iter().any(|source| source.topic == topic) {
            self.lonely_since = None;
            return;
        }
        // Said again only after a long while: the list may have grown.
        self.lonely_since = Some(now + 10 * LONELY);
        warn!("nobody publishes on {topic}; {}", choices(&sources));
    }

    fn warn(&mut self, kind: &'static str, line: std::fmt::Arguments<'_>) {
        if self.throttle.allows(kind, Instant::now()) {
            warn!("{line}");
        } else {
            debug!("{line}");
        }
    }

    /// Lets the worker take in what waits, and everything be sent; the last thing sent is the whole map.
    async fn finish(mut self, publishing: JoinHandle<Ended>) -> Result<Arc<Snapshot>, LiveError> {
        let waiting = self.waiting.take_all(self.start.elapsed());
        waiting.iter().for_each(|_| self.counts.borrow_mut().skip("shutdown"));
        let Self { worker, .. } = self;
        worker.request_snapshot();
        // The worker may wait for a place among the outputs, which this thread empties.
        drop(tokio::task::spawn_blocking(move || drop(worker)).await);
        match publishing.await {
            Ok(Ended { map: Some(map), died: None }) => Ok(map),
            ended => Err(death(ended.ok())),
        }
    }
}

/// Keeps `newest` and tells whether `stamp` lies more than [`JUMP_BACK`] before it.
fn jumped_back(newest: &mut Option<Stamp>, stamp: Stamp) -> bool {
    let jumped = newest.is_some_and(|newest| newest.seconds_since(stamp) > JUMP_BACK);
    *newest = Some(newest.map_or(stamp, |newest| newest.max(stamp)));
    jumped
}

/// What could be listened to, with the exact words that do it.
fn choices(sources: &[Source]) -> String {
    let of_type = |kind: &str| -> Vec<&str> {
        sources.iter().filter(|source| source.type_name == kind).map(|source| source.topic.as_str()).collect()
    };
    let clouds = of_type("sensor_msgs/msg/PointCloud2");
    let images = of_type("sensor_msgs/msg/Image");
    let mut text = if clouds.is_empty() {
        "there is no PointCloud2 on the network".to_owned()
    } else {
        let lines: Vec<_> = clouds.iter().map(|topic| format!("-r points:={topic}")).collect();
        format!("PointCloud2 topics: use {}", lines.join(" or "))
    };
    if !images.is_empty() {
        // Depth images are no input yet; their driver's depth_image_proc makes clouds of them.
        text.push_str("; Image topics (depth_image_proc makes clouds of depth images): ");
        text.push_str(&images.join(", "));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_topics_has_the_exact_remapping() {
        let source = |topic: &str, kind: &str| Source {
            topic: topic.to_owned(),
            type_name: format!("sensor_msgs/msg/{kind}"),
        };
        let sources = [source("/a/points", "PointCloud2"), source("/b", "Image"), source("/c", "CameraInfo")];
        let text = choices(&sources);
        assert!(text.contains("-r points:=/a/points") && text.contains("/b") && !text.contains("/c"));
        assert!(choices(&[]).contains("no PointCloud2"));
    }

    #[test]
    fn a_small_step_back_is_no_jump() {
        let mut newest = None;
        let at = |seconds: f64| Stamp::from_nanos((seconds * 1e9) as i64);
        assert!(!jumped_back(&mut newest, at(10.0)));
        assert!(!jumped_back(&mut newest, at(9.1)));
        assert!(jumped_back(&mut newest, at(8.9)));
        assert!(!jumped_back(&mut newest, at(11.0)));
    }
}
