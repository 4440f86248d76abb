//! The named thread that owns the engine: newest scan in, immutable values out.
//!
//! The mailbox has few places: when it is full, a new scan replaces the oldest one, and the caller is told so, that it
//! can count it. One place would do for a sensor; but a transform that comes at 10 Hz releases three scans at once,
//! and all but one of them would be lost each time: there are as many places as scans may wait for a transform. The
//! engine waits for nothing but the sink that takes its outputs.
//!
//! A snapshot costs as much as the map is large, and while it is made no scan is taken in: where that would cost scans, snapshots
//! take a tenth of the time at most, however often they are asked for ([`rest_after`]).

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::engine::{Engine, Params, SavedMap, Scan, Snapshot, Update};

/// What the worker has to say.
#[derive(Clone, Debug)]
pub enum Output {
    /// A scan was taken in.
    Scan {
        /// The session it belongs to.
        session: u64,
        /// Its points.
        points: usize,
        /// What it changed.
        update: Update,
        /// How long the engine worked on it.
        took: Duration,
    },
    /// The map, as asked for by [`Worker::request_snapshot`].
    Snapshot {
        /// The session it belongs to.
        session: u64,
        /// The map.
        snapshot: Arc<Snapshot>,
        /// How long the engine worked on it.
        took: Duration,
    },
    /// All of the map, as asked for by [`Worker::request_save`].
    Saved {
        /// The session it belongs to.
        session: u64,
        /// The map.
        map: Box<SavedMap>,
    },
    /// All of the map that a session has ended with, as asked for by [`Worker::jump`], where there is anything in it.
    Ended {
        /// The session that has ended.
        session: u64,
        /// The map.
        map: Box<SavedMap>,
    },
    /// The engine has panicked; nothing more will come.
    Died(String),
}

/// A session to begin with an empty map.
struct Beginning {
    session: u64,
    /// The map that it ends is asked for.
    is_jump: bool,
}

/// How many times as long as a snapshot took the next one is put off.
const REST: u32 = 9;
/// What a snapshot may take that need not be put off while no scan waits: one that comes meanwhile waits no longer than for the
/// next one.
const SHORT: Duration = Duration::from_millis(30);

/// How long the next snapshot is put off after one that took so long.
pub fn rest_after(took: Duration) -> Duration {
    took * REST
}

/// What waits for the worker.
#[derive(Default)]
struct Pending {
    /// Before anything else.
    session: Option<Beginning>,
    /// What the engine is to go on with, before the next scan.
    params: Option<Params>,
    /// Oldest first.
    scans: VecDeque<Scan>,
    snapshot: bool,
    /// What puts the next snapshot off.
    rest: Option<Rest>,
    save: bool,
    stop: bool,
}

/// After a snapshot.
struct Rest {
    until: Instant,
    /// It only holds while scans wait.
    is_short: bool,
}

impl Pending {
    /// How long a snapshot that is asked for is still put off; `None` where none is. The last one is not.
    fn put_off(&self) -> Option<Duration> {
        let holds = |rest: &&Rest| self.snapshot && !self.stop && !(rest.is_short && self.scans.is_empty());
        let rest = self.rest.as_ref().filter(holds)?;
        Some(rest.until.saturating_duration_since(Instant::now())).filter(|left| !left.is_zero())
    }

    /// Whether there is nothing to do but a snapshot that is put off.
    fn is_idle(&self, is_put_off: bool) -> bool {
        let has_nothing = self.session.is_none() && self.params.is_none() && self.scans.is_empty();
        has_nothing && (is_put_off || !self.snapshot) && !self.save && !self.stop
    }
}

/// What the worker does next, in this order.
struct Task {
    session: Option<Beginning>,
    params: Option<Params>,
    scan: Option<Scan>,
    snapshot: bool,
    save: bool,
    stop: bool,
}

#[derive(Default)]
struct Mailbox {
    pending: Mutex<Pending>,
    filled: Condvar,
}

/// Handle to the worker thread; dropping it lets the thread take in what waits and end.
pub struct Worker {
    /// Scans that may wait.
    places: usize,
    mailbox: Arc<Mailbox>,
    thread: Option<JoinHandle<()>>,
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Pending> {
        // No change of the mailbox can panic on its way: a panic elsewhere leaves nothing half done.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put<T>(&self, change: impl FnOnce(&mut Pending) -> T) -> T {
        let result = change(&mut self.lock());
        self.filled.notify_one();
        result
    }

    fn take(&self) -> Task {
        let mut pending = self.lock();
        let mut put_off = pending.put_off();
        while pending.is_idle(put_off.is_some()) {
            pending = match put_off {
                Some(left) => {
                    let waited = self.filled.wait_timeout(pending, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.filled.wait(pending).unwrap_or_else(PoisonError::into_inner),
            };
            put_off = pending.put_off();
        }
        let scan = pending.scans.pop_front();
        // The end comes after all scans and with the whole map; a snapshot in between must not wait for a pause.
        let stop = pending.stop && pending.scans.is_empty();
        let is_time = stop || !pending.stop;
        let snapshot = is_time && put_off.is_none() && std::mem::take(&mut pending.snapshot);
        let save = is_time && std::mem::take(&mut pending.save);
        let (session, params) = (pending.session.take(), pending.params.take());
        Task { session, params, scan, snapshot, save, stop }
    }

    /// Puts the next snapshot off after one that took so long, but for that of a session which is to begin.
    fn rest(&self, took: Duration) {
        let rest = Rest { until: Instant::now() + rest_after(took), is_short: took <= SHORT };
        let mut pending = self.lock();
        pending.rest = Some(rest).filter(|_| pending.session.is_none());
    }
}

impl Worker {
    /// Starts the thread `cfodi-engine` with the map of `engine` under the id `session`; at most `places` scans wait for
    /// it, and `sink` is called on that thread.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(
        engine: Engine,
        session: u64,
        places: usize,
        sink: impl FnMut(Output) + Send + 'static,
    ) -> std::io::Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let thread = std::thread::Builder::new().name("cfodi-engine".to_owned()).spawn({
            let mailbox = Arc::clone(&mailbox);
            move || guard(&mailbox, engine, session, sink)
        })?;
        Ok(Self { places, mailbox, thread: Some(thread) })
    }

    /// Lets so many scans wait from now on; those that wait stay.
    pub const fn set_places(&mut self, places: usize) {
        self.places = places;
    }

    /// Hands over a scan; returns whether it replaced the oldest of those that were still waiting.
    #[must_use = "a replaced scan is to be counted"]
    pub fn submit(&self, scan: Scan) -> bool {
        self.mailbox.put(|pending| {
            pending.scans.push_back(scan);
            pending.scans.len() > self.places && pending.scans.pop_front().is_some()
        })
    }

    /// Asks for the map: after the next scan where one waits, and after all scans when the worker is about to end. It is put off
    /// where the one before took long ([`rest_after`]).
    pub fn request_snapshot(&self) {
        self.mailbox.put(|pending| pending.snapshot = true);
    }

    /// Asks for all of the map, to save it; when, as with [`Self::request_snapshot`].
    pub fn request_save(&self) {
        self.mailbox.put(|pending| pending.save = true);
    }

    /// Lets the engine go on by these parameters from the next scan on; see [`Engine::tune`].
    pub fn tune(&self, params: Params) {
        self.mailbox.put(|pending| pending.params = Some(params));
    }

    /// Begins a new session with an empty map; returns how many scans that were still waiting were thrown away.
    #[must_use = "scans thrown away are to be counted"]
    pub fn reset(&self, session: u64) -> usize {
        self.begin(session, false)
    }

    /// As [`Self::reset`], where nobody has asked for the map to be thrown away: it comes out as [`Output::Ended`].
    #[must_use = "scans thrown away are to be counted"]
    pub fn jump(&self, session: u64) -> usize {
        self.begin(session, true)
    }

    fn begin(&self, session: u64, is_jump: bool) -> usize {
        self.mailbox.put(|pending| {
            let is_jump = is_jump || pending.session.take().is_some_and(|before| before.is_jump);
            pending.session = Some(Beginning { session, is_jump });
            pending.rest = None;
            std::mem::take(&mut pending.scans).len()
        })
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.mailbox.put(|pending| pending.stop = true);
        if let Some(thread) = self.thread.take() {
            // A panic has been reported by the thread itself.
            drop(thread.join());
        }
    }
}

fn guard(mailbox: &Mailbox, engine: Engine, session: u64, mut sink: impl FnMut(Output)) {
    let work = AssertUnwindSafe(|| work(mailbox, engine, session, &mut sink));
    if let Err(panic) = catch_unwind(work) {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        sink(Output::Died(text.unwrap_or_else(|| "without a message".to_owned())));
    }
}

fn work(mailbox: &Mailbox, mut engine: Engine, mut session: u64, sink: &mut impl FnMut(Output)) {
    loop {
        let task = mailbox.take();
        if let Some(Beginning { session: new, is_jump }) = task.session {
            let map = is_jump.then(|| Box::new(engine.save()));
            if let Some(map) = map.filter(|map| map.sequence() > 0) {
                sink(Output::Ended { session, map });
            }
            session = new;
            engine = Engine::new(*engine.params());
        }
        if let Some(params) = task.params {
            engine.tune(&params);
        }
        if let Some(scan) = task.scan {
            #[cfg(test)]
            assert_ne!(scan.stamp, tests::DEADLY, "a panic for the test");
            let start = Instant::now();
            let update = engine.insert(&scan);
            sink(Output::Scan { session, points: scan.points.len(), update, took: start.elapsed() });
        }
        if task.snapshot {
            let start = Instant::now();
            let snapshot = Arc::new(engine.snapshot());
            let took = start.elapsed();
            mailbox.rest(took);
            sink(Output::Snapshot { session, snapshot, took });
        }
        if task.save {
            sink(Output::Saved { session, map: Box::new(engine.save()) });
        }
        if task.stop {
            return;
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::mpsc::{Receiver, channel};
    use std::time::Duration;

    use super::*;
    use crate::engine::{Isometry3, Params, Points, Stamp};

    /// The engine of a test panics at a scan of this stamp.
    pub(crate) const DEADLY: Stamp = Stamp::from_nanos(13_131_313_131_313);

    const PATIENCE: Duration = Duration::from_secs(60);

    fn scan(stamp: i64) -> Scan {
        Scan {
            stamp: Stamp::from_nanos(stamp),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F32(Vec::new()),
        }
    }

    /// Scans that may wait.
    const PLACES: usize = 8;

    fn engine() -> Engine {
        Engine::new(Params::paper())
    }

    fn started() -> (Worker, Receiver<Output>) {
        let (sender, receiver) = channel();
        (Worker::start(engine(), 1, PLACES, move |output| drop(sender.send(output))).unwrap(), receiver)
    }

    #[test]
    fn in_a_full_mailbox_the_oldest_scan_is_replaced_and_said_to_be() {
        let (entered, enter) = channel();
        let (leave, left) = channel::<()>();
        let (sender, receiver) = channel();
        let worker = Worker::start(engine(), 1, PLACES, move |output| {
            entered.send(()).unwrap();
            left.recv().unwrap();
            sender.send(output).unwrap();
        });
        let worker = worker.unwrap();
        assert!(!worker.submit(scan(1)));
        enter.recv_timeout(PATIENCE).unwrap();
        let places = PLACES as i64;
        assert!((2..2 + places).all(|stamp| !worker.submit(scan(stamp))));
        assert!(worker.submit(scan(2 + places)));
        (0..=places).for_each(|_| leave.send(()).unwrap());
        drop(worker);
        let stamps: Vec<_> = receiver
            .iter()
            .filter_map(|output| {
                if let Output::Scan { update, .. } = output { Some(update.stamp.nanos()) } else { None }
            })
            .collect();
        assert_eq!(stamps, [1].into_iter().chain(3..3 + places).collect::<Vec<_>>());
    }

    #[test]
    fn after_a_long_snapshot_the_next_is_put_off_and_after_a_short_one_only_while_scans_wait() {
        let after = |took: Duration, stop: bool, waiting: i64| {
            let mailbox = Mailbox::default();
            mailbox.rest(took);
            mailbox.put(|pending| {
                (pending.snapshot, pending.stop) = (true, stop);
                pending.scans.extend((0..waiting).map(scan));
                let is_put_off = pending.put_off().is_some();
                (is_put_off, pending.is_idle(is_put_off))
            })
        };
        let long = Duration::from_secs(60);
        assert_eq!([after(long, false, 0), after(long, false, 2)], [(true, true), (true, false)]);
        assert_eq!([after(SHORT, false, 0), after(SHORT, false, 2)], [(false, false), (true, false)]);
        assert_eq!(after(long, true, 0), (false, false), "the last one is not put off");
    }

    #[test]
    fn a_snapshot_that_was_put_off_comes_and_that_of_a_new_session_at_once() {
        let (worker, outputs) = started();
        worker.mailbox.rest(2 * SHORT);
        let begin = Instant::now();
        worker.request_snapshot();
        assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Snapshot { session: 1, .. }));
        assert!(begin.elapsed() > SHORT * REST);
        worker.mailbox.rest(100 * PATIENCE);
        assert_eq!(worker.reset(2), 0);
        worker.request_snapshot();
        assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Snapshot { session: 2, .. }));
    }

    #[test]
    fn a_reset_throws_the_map_away_and_begins_a_session() {
        let (worker, outputs) = started();
        assert!(!worker.submit(scan(1)));
        assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { session: 1, .. }));
        assert_eq!(worker.reset(9), 0);
        worker.request_snapshot();
        let Output::Snapshot { session, snapshot, .. } = outputs.recv_timeout(PATIENCE).unwrap() else {
            panic!()
        };
        assert_eq!((session, snapshot.sequence), (9, 0));
    }

    #[test]
    fn at_a_jump_the_map_comes_out_before_the_session_begins_unless_it_is_empty() {
        let (worker, outputs) = started();
        assert_eq!(worker.jump(2), 0);
        worker.request_snapshot();
        let first = outputs.recv_timeout(PATIENCE).unwrap();
        assert!(matches!(first, Output::Snapshot { session: 2, .. }), "{first:?}");
        assert!(!worker.submit(scan(1)));
        assert!(matches!(outputs.recv_timeout(PATIENCE).unwrap(), Output::Scan { session: 2, .. }));
        assert_eq!(worker.jump(3), 0);
        worker.request_save();
        drop(worker);
        let maps = outputs.iter().filter_map(|output| match output {
            Output::Ended { session, map } => Some(("ended", session, map.sequence())),
            Output::Saved { session, map } => Some(("saved", session, map.sequence())),
            _ => None,
        });
        assert_eq!(maps.collect::<Vec<_>>(), [("ended", 2, 1), ("saved", 3, 0)]);
    }

    #[test]
    fn a_saved_map_has_all_scans_that_were_waiting_when_the_worker_ends() {
        let (worker, outputs) = started();
        (1..=5).for_each(|stamp| assert!(!worker.submit(scan(stamp))));
        worker.request_save();
        drop(worker);
        let last = outputs.iter().filter_map(|output| {
            if let Output::Saved { session, map } = output { Some((session, map.sequence())) } else { None }
        });
        assert_eq!(last.last(), Some((1, 5)));
    }

    #[test]
    fn a_panic_on_the_thread_is_reported_and_not_silent() {
        let (sender, receiver) = channel();
        let worker = Worker::start(engine(), 1, PLACES, move |output| {
            assert!(!matches!(output, Output::Scan { .. }), "no room");
            drop(sender.send(output));
        });
        assert!(!worker.unwrap().submit(scan(1)));
        assert!(matches!(receiver.recv_timeout(PATIENCE).unwrap(), Output::Died(text) if text == "no room"));
    }
}
