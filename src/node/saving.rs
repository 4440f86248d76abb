//! Maps on their way into a file, on a thread of its own: a slow disk holds up neither the engine nor the network.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tracing::{Level, debug, warn};

use super::resume::remove_oldest;
use super::throttle::{Throttle, say};
use super::transport::Service;
use crate::engine::SavedMap;
use crate::msg::ros::TriggerResponse;
use crate::store::{self, StoreError, Stored};

/// A map that has been written, or why it was not.
pub(super) type Written = Result<InFile, StoreError>;

/// A map in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InFile {
    pub(super) session: u64,
    /// Scans in it.
    pub(super) sequence: u64,
    pub(super) bytes: u64,
}

/// What the thread that writes is told.
#[derive(Debug)]
enum Task {
    /// Write the map of a session, in place of the one before; `is_last` where a jump has ended it, and nobody waits for that.
    Write { session: u64, map: Box<SavedMap>, is_last: bool },
    /// Give the file a second name before a map of this session or a later one takes its place: nobody has asked for the old
    /// map to be given up. Maps of earlier sessions that are still on their way are written first, and it is they that are
    /// kept.
    Keep { before: u64 },
}

/// Most that waits for the thread. [`Saving`] lets one map be under way, a jump adds one, and the node's end asks for one more;
/// before, between and after them a [`Task::Keep`] has its place.
const PLACES: usize = 7;

/// The way to the thread that writes. Nobody waits here, however long the disk does not answer.
#[derive(Debug)]
pub(super) struct Saver {
    tasks: SyncSender<Task>,
    /// The newest task is a [`Task::Keep`].
    keeps: Cell<bool>,
    /// The last map of a session is on its way.
    ends: Arc<AtomicBool>,
}

impl Saver {
    /// Has the map of a session written, in place of the one before.
    pub(super) fn write(&self, session: u64, map: Box<SavedMap>) {
        self.send(Task::Write { session, map, is_last: false });
        self.keeps.set(false);
    }

    /// Has the map written that a jump has ended a session with, and kept. While one such is on its way another is given up, and
    /// what is in the file of its session is kept instead: a clock that jumps for ever is faster than any disk.
    pub(super) fn end(&self, session: u64, map: Box<SavedMap>) {
        if !self.ends.swap(true, Ordering::Relaxed) {
            let is_sent = self.send(Task::Write { session, map, is_last: true });
            self.ends.store(is_sent, Ordering::Relaxed);
            self.keeps.set(false);
        }
        self.keep(session + 1);
    }

    /// Has the file kept under another name before the map of a session takes its place. Where no map was sent since this was
    /// asked for last, there is nothing more to keep: a clock that jumps for ever piles nothing up before a disk that does not
    /// answer.
    fn keep(&self, before: u64) {
        if !self.keeps.replace(true) {
            self.send(Task::Keep { before });
        }
    }

    /// Whether the task waits now.
    fn send(&self, task: Task) -> bool {
        match self.tasks.try_send(task) {
            Ok(()) => true,
            // Where that thread has died, the node learns so by itself.
            Err(TrySendError::Disconnected(_)) => false,
            Err(TrySendError::Full(_)) => {
                warn!("the disk does not answer: {PLACES} tasks wait for it, and one more is given up");
                false
            }
        }
    }
}

fn queue() -> (Saver, Receiver<Task>) {
    let (tasks, waiting) = sync_channel(PLACES);
    (Saver { tasks, keeps: Cell::default(), ends: Arc::default() }, waiting)
}

/// Starts the thread `cfodi-saver`, which does what it is sent, one after the other, and ends when the senders are gone.
///
/// # Errors
/// When the system gives no thread.
pub(super) fn start(path: PathBuf, frame_id: String) -> std::io::Result<(Saver, UnboundedReceiver<Written>)> {
    let (saver, waiting) = queue();
    let (written, results) = unbounded_channel();
    let ends = Arc::clone(&saver.ends);
    std::thread::Builder::new().name("cfodi-saver".to_owned()).spawn(move || {
        let mut keeping = Keeping::default();
        for task in waiting {
            match task {
                Task::Keep { before } => keeping.before.push(before),
                Task::Write { session, map, is_last } => {
                    let sequence = map.sequence();
                    let stored = Stored { frame_id: frame_id.clone(), map: *map };
                    let result = keeping.keep(&path, session).and_then(|()| store::write(&path, &stored));
                    let result = result.map(|bytes| InFile { session, sequence, bytes });
                    if is_last {
                        keeping.say_last(&result);
                        ends.store(false, Ordering::Relaxed);
                    } else if written.send(result).is_err() {
                        return;
                    }
                }
            }
        }
    })?;
    Ok((saver, results))
}

/// What is kept of files that are written over: of a robot whose clock jumps for ever as many as [`remove_oldest`] leaves.
#[derive(Debug, Default)]
struct Keeping {
    /// The file is to be kept before a map of one of these sessions, or of a later one, takes its place.
    before: Vec<u64>,
    throttle: Throttle,
}

impl Keeping {
    /// Keeps the file where it is to be kept, for a map of this session is about to take its place.
    ///
    /// # Errors
    /// When it cannot be kept; it is then still to be, and must not be written over.
    fn keep(&mut self, path: &Path, session: u64) -> Result<(), StoreError> {
        let is_due = self.before.extract_if(.., |before| session >= *before).count() > 0;
        if !is_due {
            return Ok(());
        }
        match store::keep_aside(path, "before") {
            Ok(None) => {}
            Ok(Some(name)) => {
                self.say("kept", &[format!("the map that was saved is kept as {}", name.display())]);
                self.say("removed", &remove_oldest(path, "before"));
            }
            Err(error) => {
                self.before.push(session);
                return Err(StoreError::NotKept { path: path.to_owned(), error });
            }
        }
        Ok(())
    }

    /// Says how it went with a map that a jump has ended a session with.
    fn say_last(&mut self, written: &Written) {
        if let Err(error) = written {
            self.say("not_saved", &[format!("the map that a jump has ended was not saved: {error}")]);
        }
    }

    fn say(&mut self, kind: &'static str, lines: &[String]) {
        if lines.is_empty() {
            return;
        }
        let level = self.throttle.level(kind, Level::WARN);
        lines.iter().for_each(|line| say(level, line));
    }
}

/// Most calls that wait for the next map, where a disk does not answer.
pub(super) const MOST_CALLS: usize = 64;

/// Who waits for a map to be written. At most one is under way, so that none piles up before a slow disk.
#[derive(Debug)]
pub(super) struct Saving<Request> {
    is_under_way: bool,
    /// Another was asked for since.
    is_due: bool,
    /// Calls that the map under way answers.
    asked: Vec<Request>,
    /// Calls that came after it was asked for.
    waiting: Vec<Request>,
}

impl<Request> Default for Saving<Request> {
    fn default() -> Self {
        Self { is_under_way: false, is_due: false, asked: Vec::new(), waiting: Vec::new() }
    }
}

impl<Request> Saving<Request> {
    /// Whether no more calls may wait.
    pub(super) fn is_full(&self) -> bool {
        self.waiting.len() >= MOST_CALLS
    }

    /// Lets a call wait for the map of the node's end.
    pub(super) fn wait(&mut self, call: Request) {
        self.waiting.push(call);
    }

    /// Whether a map is to be asked for now; `call` waits for it, or for the next one.
    pub(super) fn begin(&mut self, call: Option<Request>) -> bool {
        let begins = !std::mem::replace(&mut self.is_under_way, true);
        let calls = if begins { &mut self.asked } else { &mut self.waiting };
        calls.extend(call);
        self.is_due |= !begins;
        begins
    }

    /// The calls that are answered by a map that has been written; whether the next is to be asked for.
    pub(super) fn end(&mut self) -> (Vec<Request>, bool) {
        let answered = std::mem::replace(&mut self.asked, std::mem::take(&mut self.waiting));
        self.is_under_way = std::mem::take(&mut self.is_due);
        (answered, self.is_under_way)
    }

    /// All that wait.
    pub(super) fn into_calls(self) -> impl Iterator<Item = Request> {
        self.asked.into_iter().chain(self.waiting)
    }
}

/// A call that is answered when a map has been written, or was not.
#[derive(Debug)]
pub(super) struct Call<Request> {
    pub(super) service: Service,
    /// The session whose map it is about: that of its time, or the one that it began.
    pub(super) session: u64,
    pub(super) request: Request,
}

impl<Request> Call<Request> {
    /// What the caller is told.
    pub(super) fn response(&self, written: &Written) -> TriggerResponse {
        let (success, message) = match (self.service, written) {
            (Service::Save, Ok(map)) if map.session != self.session => {
                let (new, old) = (map.session, self.session);
                (
                    false,
                    format!("session {new} has begun meanwhile, before the map of session {old} was saved"),
                )
            }
            (Service::Save, Ok(InFile { sequence: scans, bytes, .. })) => {
                (true, format!("{scans} scans saved, {bytes} bytes"))
            }
            (Service::Save, Err(error)) => (false, error.to_string()),
            // A later session gives up what was saved as well.
            (Service::Reset, Ok(_)) => (true, begun(self.session)),
            (Service::Reset, Err(error)) => {
                (false, format!("{}; the map that was saved may come back: {error}", begun(self.session)))
            }
        };
        TriggerResponse { success, message }
    }
}

/// What is said of a session that begins.
pub(super) fn begun(session: u64) -> String {
    format!("session {session} begins with an empty map")
}

/// Says how a map was written that nobody has called for.
pub(super) fn log(written: &Written) {
    match written {
        Ok(InFile { sequence: scans, bytes, .. }) => debug!("map of {scans} scans saved, {bytes} bytes"),
        Err(error) => warn!("the map was not saved: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;
    use crate::engine::{Engine, Params, Points, Scan, Stamp};
    use crate::node::rosout::listen;

    #[test]
    fn before_a_disk_that_does_not_answer_three_maps_wait_and_three_tasks_to_keep() {
        let (saver, waiting) = queue();
        let map = || Box::new(Engine::new(Params::default()).save());
        let jumps = |from: u64| (from..from + 1000).for_each(|session| saver.end(session, map()));
        for session in [1, 2000, 4000] {
            saver.write(session, map());
            jumps(session);
        }
        // Nothing sends more; if it did, it would not wait.
        (0..1000).for_each(|_| saver.write(1, map()));
        let kind = |task| match task {
            Task::Write { is_last: false, .. } => "map",
            Task::Write { is_last: true, .. } => "last map",
            Task::Keep { .. } => "keep",
        };
        let tasks = || waiting.try_iter().map(kind).collect::<Vec<_>>();
        assert_eq!(tasks(), ["map", "last map", "keep", "map", "keep", "map", "keep"]);
        saver.ends.store(false, Ordering::Relaxed);
        jumps(6000);
        assert_eq!(tasks(), ["last map", "keep"], "there is room again");
    }

    fn map_of(scans: u64) -> SavedMap {
        let mut engine = Engine::new(Params::default());
        let (stamp, points) = (Stamp::default(), Points::F32(Vec::new()));
        let scan = Scan { stamp, fixed_from_sensor: Isometry3::identity(), points };
        (0..scans).for_each(|_| drop(engine.insert(&scan)));
        engine.save()
    }

    #[test]
    fn the_map_that_a_jump_ends_is_kept_and_where_the_one_before_is_still_on_its_way_what_was_saved() {
        for is_on_its_way in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let (saver, mut results) = start(folder.path().join("map"), "map".to_owned()).unwrap();
            let mut written = || results.blocking_recv().unwrap().unwrap().sequence;
            saver.write(1, Box::new(map_of(5)));
            saver.end(1, Box::new(map_of(7)));
            saver.write(2, Box::new(map_of(1)));
            assert_eq!([written(), written()], [5, 1], "nobody is told of the last one");
            saver.ends.store(is_on_its_way, Ordering::Relaxed);
            saver.end(2, Box::new(map_of(3)));
            saver.write(3, Box::new(map_of(2)));
            assert_eq!(written(), 2);
            let read = |name: &str| store::read(&folder.path().join(name)).ok();
            let scans = ["map", "map.before-1", "map.before-2"]
                .map(|name| read(name).map(|stored| stored.map.sequence()));
            assert_eq!(scans, [Some(2), Some(7), Some(if is_on_its_way { 1 } else { 3 })]);
        }
    }

    /// A disk that is full.
    #[test]
    fn a_map_that_no_other_takes_the_place_of_is_kept_once_at_jumps_without_end() {
        let folder = tempfile::tempdir().unwrap();
        let (saver, mut results) = start(folder.path().join("map"), "map".to_owned()).unwrap();
        saver.write(1, Box::new(map_of(7)));
        results.blocking_recv().unwrap().unwrap();
        let in_the_way = folder.path().join("map.part");
        std::fs::create_dir(&in_the_way).unwrap();
        for session in 1..30 {
            saver.end(session, Box::new(map_of(2)));
            saver.write(session + 1, Box::new(map_of(1)));
            assert!(results.blocking_recv().unwrap().is_err());
        }
        std::fs::remove_dir(in_the_way).unwrap();
        let mut names: Vec<_> = folder.path().read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["map", "map.before-1"]);
        let kept = store::read(&folder.path().join("map.before-1")).unwrap();
        assert_eq!(kept.map.sequence(), 7);
    }

    #[test]
    fn of_jumps_without_end_the_newest_maps_are_kept_and_the_largest() {
        let folder = tempfile::tempdir().unwrap();
        let (saver, mut results) = start(folder.path().join("map"), "map".to_owned()).unwrap();
        let mut large = Engine::new(Params::default());
        let points = Points::F32((0..1000u16).map(|i| [f32::from(i), 0.0, 1.0]).collect());
        large.insert(&Scan { stamp: Stamp::default(), fixed_from_sensor: Isometry3::identity(), points });
        saver.write(1, Box::new(large.save()));
        results.blocking_recv().unwrap().unwrap();
        for session in 2..30 {
            saver.keep(session);
            saver.write(session, Box::new(map_of(session)));
            results.blocking_recv().unwrap().unwrap();
        }
        let read = |number: u64| store::read(&folder.path().join(format!("map.before-{number}"))).ok();
        let scans: Vec<_> = (1..30).filter_map(read).map(|stored| stored.map.sequence()).collect();
        assert_eq!(scans, [1, 21, 22, 23, 24, 25, 26, 27, 28]);
    }

    #[test]
    fn of_jumps_without_end_what_is_kept_and_what_is_removed_is_said_once_in_a_while() {
        let folder = tempfile::tempdir().unwrap();
        let [path, part] = ["map", "map.part"].map(|name| folder.path().join(name));
        let (listener, mut lines) = listen();
        let mut keeping = Keeping::default();
        tracing::subscriber::with_default(tracing_subscriber::registry().with(listener), || {
            for session in 1..12 {
                std::fs::write(&part, "x".repeat(session)).unwrap();
                std::fs::rename(&part, &path).unwrap();
                keeping.before.push(session as u64);
                keeping.keep(&path, session as u64).unwrap();
            }
        });
        let said: Vec<_> = std::iter::from_fn(|| lines.0.try_recv().ok()).map(|line| line.msg).collect();
        let name = |number| format!("{}.before-{number}", path.display());
        let removed = "is removed: of its kind the newest 8 and the largest are kept";
        assert_eq!(
            said,
            [format!("the map that was saved is kept as {}", name(1)), format!("{} {removed}", name(1))]
        );
    }

    #[test]
    fn a_map_that_cannot_be_kept_at_a_jump_is_not_written_over_until_it_can() {
        let folder = tempfile::tempdir().unwrap();
        let [path, kept, in_the_way] =
            ["map", "map.before-1", "map.before-4294967295"].map(|name| folder.path().join(name));
        let scans = |path: &Path| store::read(path).ok().map(|stored| stored.map.sequence());
        // No number is left above its own.
        std::fs::write(&in_the_way, "").unwrap();
        let (saver, mut results) = start(path.clone(), "map".to_owned()).unwrap();
        let mut write = |session, scans| {
            saver.write(session, Box::new(map_of(scans)));
            results.blocking_recv().unwrap()
        };
        write(1, 7).unwrap();
        saver.keep(2);
        for scans_since in [1, 2] {
            let refused = call(Service::Save, 2).response(&write(2, scans_since));
            let reason = format!("{} stays, for it cannot be kept beside the map", path.display());
            assert!(!refused.success && refused.message.starts_with(&reason), "{refused:?}");
            assert_eq!(scans(&path), Some(7), "the only map from before the jump is gone");
        }
        std::fs::remove_file(in_the_way).unwrap();
        write(2, 3).unwrap();
        assert_eq!((scans(&path), scans(&kept)), (Some(3), Some(7)));
    }

    fn call(service: Service, session: u64) -> Call<()> {
        Call { service, session, request: () }
    }

    #[test]
    fn a_call_to_save_that_another_session_overtakes_has_failed_and_a_reset_that_one_overtakes_has_not() {
        let saved = |session| Ok(InFile { session, sequence: 4, bytes: 99 });
        let told = |service, written| {
            let TriggerResponse { success, message } = call(service, 5).response(&written);
            (success, message)
        };
        assert_eq!(told(Service::Save, saved(5)), (true, "4 scans saved, 99 bytes".to_owned()));
        let overtaken = "session 7 has begun meanwhile, before the map of session 5 was saved";
        assert_eq!(told(Service::Save, saved(7)), (false, overtaken.to_owned()));
        let begins = "session 5 begins with an empty map";
        assert_eq!(
            [5, 7].map(|session| told(Service::Reset, saved(session))),
            [5, 7].map(|_| (true, begins.to_owned()))
        );
        let refused = || Err(StoreError::InUse { path: "map".into() });
        let reason = "map is in use by another process";
        assert_eq!(told(Service::Save, refused()), (false, reason.to_owned()));
        let stays = format!("{begins}; the map that was saved may come back: {reason}");
        assert_eq!(told(Service::Reset, refused()), (false, stays));
    }

    #[test]
    fn jumps_without_end_before_a_map_that_cannot_be_kept_pile_nothing_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map");
        std::fs::write(folder.path().join("map.before-4294967295"), "").unwrap();
        std::fs::write(&path, "").unwrap();
        let mut keeping = Keeping::default();
        for session in 0..1000 {
            keeping.before.push(session);
            assert!(keeping.keep(&path, session).is_err());
        }
        assert_eq!(keeping.before, [999]);
    }

    #[test]
    fn where_a_disk_does_not_answer_calls_are_bounded() {
        let mut saving = Saving::default();
        let taken = (0..1000)
            .filter(|&call| {
                !saving.is_full() && {
                    saving.begin(Some(call));
                    true
                }
            })
            .count();
        assert_eq!(taken, 1 + MOST_CALLS);
    }

    #[test]
    fn what_is_asked_for_while_a_map_is_written_gets_the_next_one_called_for_or_not() {
        let mut saving = Saving::default();
        assert!(saving.begin(Some(1)) && !saving.begin(Some(2)) && !saving.begin(None));
        assert_eq!(saving.end(), (vec![1], true));
        assert_eq!(saving.end(), (vec![2], false));
        assert!(saving.begin(None), "a reset, say");
        assert!(!saving.begin(None), "and one more, which is in the map under way or not");
        assert_eq!(saving.end(), (vec![], true));
        assert_eq!(saving.end(), (vec![], false));
        assert!(saving.begin(Some(3)) && !saving.begin(Some(4)));
        saving.wait(5);
        assert!(saving.into_calls().eq([3, 4, 5]));
    }
}
