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

mod mailbox;
mod making;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use self::mailbox::{Beginning, Mailbox, Off};
use self::making::Making;
use crate::engine::{Engine, Frozen, Params, Scan, Snapshot, Stamp, Update};
use crate::thread::panic_text;

/// What the worker has to say.
#[derive(Clone, Debug)]
pub enum Output {
    /// A scan was taken in.
    Scan {
        /// The session it belongs to.
        session: u64,
        /// Its sensor, as it was handed over with it.
        sensor: usize,
        /// Its own stamp.
        stamp: Stamp,
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
    /// All of the map that a session has ended with, as asked for by [`Worker::reset_and_keep`], where there is anything in it.
    Ended {
        /// The session that has ended.
        session: u64,
        /// The map.
        map: Arc<Frozen>,
    },
    /// The engine has panicked; nothing more will come.
    Died(String),
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
    /// The pause after this snapshot, whether or not scans wait.
    pub fn rest(self) -> Duration {
        self.making.max(if self.freezing > SHORT { self.freezing * REST } else { Duration::ZERO })
    }

    /// The pause after it while scans wait.
    fn rest_before_scans(self) -> Duration {
        self.rest().max(self.freezing * REST)
    }
}

/// Handle to the worker thread; dropping it lets the thread take in what waits and end.
pub struct Worker {
    /// Scans that may wait.
    places: usize,
    mailbox: Arc<Mailbox>,
    thread: Option<JoinHandle<()>>,
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

    /// Hands over a scan of the sensor of this number; gives the sensor of the oldest of those that were still waiting, where it has
    /// replaced that.
    #[must_use = "a replaced scan is to be counted"]
    pub fn submit(&self, sensor: usize, scan: Scan) -> Option<usize> {
        self.mailbox.put(|pending| {
            pending.scans.push_back((sensor, scan));
            let is_full = pending.scans.len() > self.places;
            is_full.then(|| pending.scans.pop_front()).flatten().map(|(sensor, _)| sensor)
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
    pub fn reset_and_keep(&self, session: u64) -> usize {
        self.begin(session, true)
    }

    fn begin(&self, session: u64, keeps_map: bool) -> usize {
        self.mailbox.put(|pending| {
            // One that is still to begin has taken nothing in: it decides what becomes of the map.
            let keeps_map = pending.session.take().map_or(keeps_map, |before| before.keeps_map);
            pending.session = Some(Beginning { session, keeps_map });
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
    let work = Work { mailbox, engine, session, making: &mut making, sink: &mut sink };
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| work.all())) {
        // A snapshot that is being made still comes, and nothing after this. Whether it panics as well makes no difference.
        drop(catch_unwind(AssertUnwindSafe(|| making.finish())));
        sink(Output::Died(panic_text(&*panic)));
    }
}

/// The thread's work on the map of a session.
struct Work<'a, S> {
    mailbox: &'a Arc<Mailbox>,
    engine: Engine,
    session: u64,
    making: &'a mut Making,
    sink: &'a mut S,
}

impl<S: FnMut(Output) + Clone + Send + 'static> Work<'_, S> {
    /// Does what comes, until the end.
    fn all(mut self) {
        loop {
            let task = self.mailbox.take();
            if task.touches_map() {
                self.making.forget();
            }
            if let Some(beginning) = task.session {
                self.begin(beginning);
            }
            if let Some(params) = task.params {
                self.engine.tune(&params);
            }
            if let Some((sensor, scan)) = task.scan {
                self.take_in(sensor, &scan);
            }
            let makes = task.snapshot && !self.gives_again();
            self.give(makes, task.save);
            if task.stop {
                self.making.finish();
                return;
            }
        }
    }

    fn begin(&mut self, Beginning { session, keeps_map }: Beginning) {
        self.making.finish();
        self.mailbox.lock().off = None;
        let map = keeps_map.then(|| Arc::new(self.engine.freeze()));
        if let Some(map) = map.filter(|map| map.sequence() > 0) {
            (self.sink)(Output::Ended { session: self.session, map });
        }
        self.session = session;
        self.engine = Engine::new(*self.engine.params());
    }

    fn take_in(&mut self, sensor: usize, scan: &Scan) {
        let (session, start) = (self.session, Instant::now());
        let update = self.engine.insert(scan);
        let (stamp, points, took) = (scan.stamp, scan.points.len(), start.elapsed());
        (self.sink)(Output::Scan { session, sensor, stamp, points, update, took });
    }

    /// Waits for a snapshot that is being made; where there is one of the map as it is, that is given again.
    fn gives_again(&mut self) -> bool {
        self.making.finish();
        let Some((snapshot, took)) = self.making.newest() else { return false };
        (self.sink)(Output::Snapshot { session: self.session, snapshot, took });
        true
    }

    /// Has a snapshot made of the map, or gives the map to be saved, or both: it is frozen once.
    fn give(&mut self, makes: bool, saves: bool) {
        if !makes && !saves {
            return;
        }
        let (session, start) = (self.session, Instant::now());
        let map = Arc::new(self.engine.freeze());
        if makes {
            let frozen = (Arc::clone(&map), start.elapsed());
            self.mailbox.lock().off = Some(Off::Making);
            self.making.begin(self.mailbox, session, frozen, self.sink.clone());
        }
        if saves {
            (self.sink)(Output::Saved { session, map });
        }
    }
}

#[cfg(test)]
mod tests;
