//! Maps on their way, before disks that do not answer, are full, or have no name left.

use nalgebra::Isometry3;
use tracing_subscriber::layer::SubscriberExt as _;

use super::*;
use crate::engine::{Engine, Params, Points, Scan, Stamp};
use crate::node::rosout::listen;

#[test]
fn before_a_disk_that_does_not_answer_three_maps_wait_and_three_tasks_to_keep() {
    let (saver, waiting) = queue();
    let map = || Arc::new(Engine::new(Params::default()).freeze());
    let jumps = |from: u64| (from..from + 1000).for_each(|session| saver.end(session, map()));
    for session in [1, 2000, 4000] {
        saver.write(session, map());
        jumps(session);
    }
    // Nothing sends more; if it did, it would not wait.
    (0..1000).for_each(|_| saver.write(1, map()));
    let kind = |task| match task {
        Task::Write { last: None, .. } => "map",
        Task::Write { last: Some(_), .. } => "last map",
        Task::Keep { .. } => "keep",
    };
    let tasks = || waiting.try_iter().map(kind).collect::<Vec<_>>();
    assert_eq!(tasks(), ["map", "last map", "keep", "map", "keep", "map", "keep"]);
    jumps(6000);
    assert_eq!(tasks(), ["last map", "keep"], "there is room again");
}

#[test]
fn a_last_map_that_found_no_place_or_is_done_with_holds_up_none_that_comes_later() {
    let (saver, waiting) = queue();
    let last_maps = || {
        let is_last = |task: &Task| matches!(task, Task::Write { last: Some(_), .. });
        waiting.try_iter().filter(is_last).count()
    };
    (0..PLACES).for_each(|_| saver.write(1, Arc::new(map_of(0))));
    saver.end(1, Arc::new(map_of(0)));
    assert_eq!(last_maps(), 0);
    for session in 2..5 {
        saver.end(session, Arc::new(map_of(0)));
        assert_eq!(last_maps(), 1, "session {session}");
    }
}

#[test]
fn a_file_that_was_to_be_kept_while_no_task_had_a_place_is_kept_when_one_has() {
    let (saver, waiting) = queue();
    (0..PLACES).for_each(|_| saver.write(1, Arc::new(map_of(0))));
    saver.keep(2);
    assert!(waiting.try_iter().all(|task| matches!(task, Task::Write { .. })));
    saver.keep(3);
    assert!(matches!(waiting.try_recv(), Ok(Task::Keep { before: 3 })));
}

fn map_of(scans: u64) -> Frozen {
    let mut engine = Engine::new(Params::default());
    let (stamp, points) = (Stamp::default(), Points::F32(Vec::new()));
    let scan = Scan { stamp, fixed_from_sensor: Isometry3::identity(), points };
    (0..scans).for_each(|_| drop(engine.insert(&scan)));
    engine.freeze()
}

#[test]
fn the_map_that_a_jump_ends_is_kept_and_where_the_one_before_is_still_on_its_way_what_was_saved() {
    for is_on_its_way in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        // Where the first saving is under way, it ends when it may, and has failed then.
        let ((may_end, ends), mut waits) = (sync_channel::<()>(0), is_on_its_way);
        let write = move |path: &Path, frame_id: &str, map: Arc<Frozen>| {
            if !std::mem::take(&mut waits) {
                return store::write(path, frame_id, map);
            }
            ends.recv().unwrap();
            Err(StoreError::InUse { path: path.to_owned() })
        };
        let (saver, mut results) = start_on(folder.path().join("map"), "map".to_owned(), write).unwrap();
        let mut written = || results.blocking_recv().unwrap().ok().map(|file| file.version.sequence);
        saver.write(1, Arc::new(map_of(5)));
        saver.end(1, Arc::new(map_of(7)));
        saver.write(2, Arc::new(map_of(1)));
        let first = if is_on_its_way { None } else { Some([written(), written()]) };
        saver.end(2, Arc::new(map_of(3)));
        saver.write(3, Arc::new(map_of(2)));
        let first = first.unwrap_or_else(|| {
            may_end.send(()).unwrap();
            [written(), written()]
        });
        let of_5 = if is_on_its_way { None } else { Some(5) };
        assert_eq!(first, [of_5, Some(1)], "nobody is told of the last one");
        assert_eq!(written(), Some(2));
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
    saver.write(1, Arc::new(map_of(7)));
    results.blocking_recv().unwrap().unwrap();
    let in_the_way = folder.path().join("map.part");
    std::fs::create_dir(&in_the_way).unwrap();
    for session in 1..30 {
        saver.end(session, Arc::new(map_of(2)));
        saver.write(session + 1, Arc::new(map_of(1)));
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
    saver.write(1, Arc::new(large.freeze()));
    results.blocking_recv().unwrap().unwrap();
    for session in 2..30 {
        saver.keep(session);
        saver.write(session, Arc::new(map_of(session)));
        results.blocking_recv().unwrap().unwrap();
    }
    let read = |number: u64| store::read(&folder.path().join(format!("map.before-{number}"))).ok();
    let scans: Vec<_> = (1..30).filter_map(read).map(|stored| stored.map.sequence()).collect();
    assert_eq!(scans, [1, 21, 22, 23, 24, 25, 26, 27, 28]);
}

/// A bag that is played in a loop while the driver sends nothing.
#[test]
fn sessions_that_take_in_no_scan_are_not_kept_at_a_jump_and_push_out_no_map_that_is() {
    let folder = tempfile::tempdir().unwrap();
    let (saver, mut results) = start(folder.path().join("map"), "map".to_owned()).unwrap();
    let mut lap = |session, scans| {
        saver.write(session, Arc::new(map_of(scans)));
        results.blocking_recv().unwrap().unwrap();
        saver.end(session, Arc::new(map_of(scans)));
    };
    (1..30).for_each(|session| lap(session, if session <= 2 { session } else { 0 }));
    lap(30, 3);
    let scans = |name: &str| store::read(&folder.path().join(name)).ok().map(|stored| stored.map.sequence());
    let kept = ["map", "map.before-1", "map.before-2", "map.before-3"].map(scans);
    assert_eq!(kept, [Some(3), Some(1), Some(2), None]);
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
        saver.write(session, Arc::new(map_of(scans)));
        results.blocking_recv().unwrap()
    };
    write(1, 7).unwrap();
    saver.keep(2);
    for scans_since in [1, 2] {
        let refused = write(2, scans_since).unwrap_err().to_string();
        let reason = format!("{} stays, for it cannot be kept beside the map", path.display());
        assert!(refused.starts_with(&reason), "{refused}");
        assert_eq!(scans(&path), Some(7), "the only map from before the jump is gone");
    }
    std::fs::remove_file(in_the_way).unwrap();
    write(2, 3).unwrap();
    assert_eq!((scans(&path), scans(&kept)), (Some(3), Some(7)));
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
