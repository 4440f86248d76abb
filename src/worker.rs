//! The named thread that owns the engine: newest scan in, immutable values out.
//!
//! The mailbox has few places: when it is full, a new scan replaces the oldest one, and the caller is told so, that it
//! can count it. One place would do for a sensor; but a transform that comes at 10 Hz releases three scans at once,
//! and all but one of them would be lost each time: there are as many places as scans may wait for a transform. The
//! engine waits for nothing but the sink that takes its outputs.
//!
//! Whoever wants all of the map gets it as it was frozen after a scan, which takes a moment: a snapshot is made of that on a
//! thread of its own, `cfodi-map`, and what is to be saved comes out frozen. Meanwhile no scan is taken in: where that would cost
//! scans, as in large maps of mode `paper`, it takes a tenth of the time at most, however often it is asked for; and what is made
//! of it takes half of a core at most ([`Took::rest`]). A map that has stayed as it was is neither frozen nor made again: the snapshot
//! before comes once more.

mod making;

use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use self::making::Making;
use crate::engine::{Engine, Frozen, Params, Scan, Snapshot, Update};
use crate::thread::panic_text;

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
        /// How long that took.
        took: Took,
    },
    /// All of the map, as asked for by [`Worker::request_save`].
    Saved {
        /// The session it belongs to.
        session: u64,
        /// The map.
        map: Arc<Frozen>,
    },
    /// All of the map that a session has ended with, as asked for by [`Worker::jump`], where there is anything in it.
    Ended {
        /// The session that has ended.
        session: u64,
        /// The map.
        map: Arc<Frozen>,
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

/// What a snapshot took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Took {
    /// In which the engine took in no scan.
    pub freezing: Duration,
    /// In which a thread beside the engine was busy.
    pub making: Duration,
}

/// How many times as long as the engine was held up the next snapshot is put off.
const REST: u32 = 9;
/// What the engine may be held up for a snapshot that need not be put off while no scan waits: one that comes meanwhile waits no
/// longer than for the next one.
const SHORT: Duration = Duration::from_millis(30);

impl Took {
    /// How long the next snapshot is put off, whoever waits.
    pub fn rest(self) -> Duration {
        self.making.max(if self.freezing > SHORT { self.freezing * REST } else { Duration::ZERO })
    }

    /// How long it is put off while scans wait.
    fn rest_before_scans(self) -> Duration {
        self.rest().max(self.freezing * REST)
    }
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
    off: Option<Off>,
    save: bool,
    stop: bool,
}

/// What puts a snapshot off.
#[derive(Clone, Copy)]
enum Off {
    /// One that is being made.
    Making,
    /// One that took long.
    Rest {
        until: Instant,
        /// While scans wait.
        until_before_scans: Instant,
    },
}

impl Off {
    fn after(took: Took) -> Self {
        let now = Instant::now();
        Self::Rest { until: now + took.rest(), until_before_scans: now + took.rest_before_scans() }
    }
}

impl Pending {
    /// How long a snapshot that is asked for is still put off, for ever while another is being made; `None` where none is. The last
    /// one is not.
    fn put_off(&self) -> Option<Duration> {
        let left = match self.off.filter(|_| self.snapshot && !self.stop)? {
            Off::Making => Duration::MAX,
            Off::Rest { until, until_before_scans } => {
                let until = if self.scans.is_empty() { until } else { until_before_scans };
                until.saturating_duration_since(Instant::now())
            }
        };
        Some(left).filter(|left| !left.is_zero())
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

impl Task {
    /// Whether the map may be another afterwards.
    const fn touches_map(&self) -> bool {
        self.session.is_some() || self.params.is_some() || self.scan.is_some()
    }
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
                Some(left) if left < Duration::MAX => {
                    let waited = self.filled.wait_timeout(pending, left);
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                _ => self.filled.wait(pending).unwrap_or_else(PoisonError::into_inner),
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
    fn rest(&self, took: Took) {
        self.put(|pending| pending.off = Some(Off::after(took)).filter(|_| pending.session.is_none()));
    }
}

impl Worker {
    /// Starts the thread `cfodi-engine` with the map of `engine` under the id `session`; at most `places` scans wait for
    /// it. `sink` is called on that thread, and with new snapshots on another, never with one of a session after outputs of the next.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(
        engine: Engine,
        session: u64,
        places: usize,
        sink: impl FnMut(Output) + Clone + Send + 'static,
    ) -> std::io::Result<Self> {
        let mailbox = Arc::new(Mailbox::default());
        let thread = Builder::new().name("cfodi-engine".to_owned()).spawn({
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
    /// while the one before is being made, and after it where that took long ([`Took::rest`]). Where nothing has come since that could
    /// have changed the map, it is the one before, with what that took.
    pub fn request_snapshot(&self) {
        self.mailbox.put(|pending| pending.snapshot = true);
    }

    /// Asks for all of the map, to save it: after the next scan where one waits, and after all scans when the worker is about to end.
    /// It is never put off, for who saves asks for one at a time and waits for it.
    pub fn request_save(&self) {
        self.mailbox.put(|pending| pending.save = true);
    }

    /// Ends the thread: it takes in the scans that wait, sends a snapshot and, with `save`, the frozen map, and stops. Dropping waits
    /// for that. All three are asked for in one step: of three, the engine could make the last map before the last scans are in.
    pub fn end(&self, save: bool) {
        self.mailbox.put(|pending| {
            pending.snapshot = true;
            pending.save |= save;
            pending.stop = true;
        });
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

    /// As [`Self::reset`], where nobody has asked for the map to be thrown away: it comes out as [`Output::Ended`], unless a reset
    /// that has not yet begun throws it away.
    #[must_use = "scans thrown away are to be counted"]
    pub fn jump(&self, session: u64) -> usize {
        self.begin(session, true)
    }

    fn begin(&self, session: u64, is_jump: bool) -> usize {
        self.mailbox.put(|pending| {
            // One that is still to begin has taken nothing in: it decides what becomes of the map.
            let is_jump = pending.session.take().map_or(is_jump, |before| before.is_jump);
            pending.session = Some(Beginning { session, is_jump });
            pending.off = pending.off.filter(|off| matches!(off, Off::Making));
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

fn guard(
    mailbox: &Arc<Mailbox>,
    engine: Engine,
    session: u64,
    mut sink: impl FnMut(Output) + Clone + Send + 'static,
) {
    let mut making = Making::default();
    let work = AssertUnwindSafe(|| work(mailbox, engine, session, &mut making, &mut sink));
    if let Err(panic) = catch_unwind(work) {
        // A snapshot that is being made still comes, and nothing after this. Whether it panics as well makes no difference.
        drop(catch_unwind(AssertUnwindSafe(|| making.finish())));
        sink(Output::Died(panic_text(&*panic)));
    }
}

fn work(
    mailbox: &Arc<Mailbox>,
    mut engine: Engine,
    mut session: u64,
    making: &mut Making,
    sink: &mut (impl FnMut(Output) + Clone + Send + 'static),
) {
    loop {
        let task = mailbox.take();
        if task.touches_map() {
            making.forget();
        }
        if let Some(Beginning { session: new, is_jump }) = task.session {
            making.finish();
            mailbox.lock().off = None;
            let map = is_jump.then(|| Arc::new(engine.freeze()));
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
        let mut makes = task.snapshot;
        if task.snapshot {
            making.finish();
            if let Some((snapshot, took)) = making.newest() {
                makes = false;
                sink(Output::Snapshot { session, snapshot, took });
            }
        }
        // Frozen once for both.
        let start = Instant::now();
        let map = (makes || task.save).then(|| Arc::new(engine.freeze()));
        let freezing = start.elapsed();
        if let Some(map) = map.clone().filter(|_| makes) {
            mailbox.lock().off = Some(Off::Making);
            making.begin(mailbox, session, (map, freezing), sink.clone());
        }
        if let Some(map) = map.filter(|_| task.save) {
            sink(Output::Saved { session, map });
        }
        if task.stop {
            making.finish();
            return;
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
