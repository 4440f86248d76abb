//! What a node saves, and what is answered of it.

use nalgebra::Isometry3;

use super::*;
use crate::engine::Scan;

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
        let is_saved =
            || store::read(&path).is_ok_and(|saved| saved.map.sequence() == counts.borrow().taken_in);
        for scan in 1..3 {
            until("the map of a scan", || counts.borrow().taken_in >= scan && is_saved()).await;
            let mut seen = vec![file()];
            for _ in 0..50 {
                tokio::time::sleep(TICK).await;
                seen.push(file());
            }
            seen.dedup();
            // One that was asked for while that one was written follows it, however slow the disk is.
            assert!(seen.len() <= 2 && !seen.contains(&None), "scan {scan}: {seen:?}");
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

/// A bag in a loop that is shorter than `snapshot_period`.
#[test]
fn each_map_that_a_jump_ends_is_kept_as_it_was_then() {
    let folder = tempfile::tempdir().unwrap();
    let in_folder = |name: &str| folder.path().join(name);
    let path = Value::Text(in_folder("map").display().to_string());
    let config = Config::new([("snapshot_path".to_owned(), path)]).unwrap();
    let kept = in_folder("map.before-1");
    let events = vec![transform(at(0.0), true), cloud(at(100.0), "camera")];
    let (ended, counts, _) = node_until(&config, Fake::default(), events, move |events, counts| async move {
        for (taken_in, next) in [(1, 50.0), (2, 50.1), (3, 20.0)] {
            // Only one map that a jump has ended is on its way.
            let is_kept = || taken_in == 1 || kept.exists();
            until("a map that is kept", || counts.borrow().taken_in >= taken_in && is_kept()).await;
            events.try_send(cloud(at(next), "camera")).unwrap();
        }
        until("the last scan", || counts.borrow().taken_in == 4).await;
    });
    ended.unwrap();
    assert_eq!(counts.taken_in, 4);
    let scans = ["map", "map.before-1", "map.before-2", "map.before-3"]
        .map(|name| store::read(&in_folder(name)).ok().map(|saved| saved.map.sequence()));
    assert_eq!(scans, [Some(1), Some(1), Some(2), None]);
}

/// Runs a node that saves in this folder on these events, until all calls are answered.
fn all_answered(folder: &std::path::Path, events: Vec<Event<()>>) -> Ran {
    let transport = Rc::new(Fake::default());
    let seen = Rc::clone(&transport);
    let calls = events.iter().filter(|event| matches!(event, Event::Call(..))).count();
    node_until(&saving_in(folder), transport, events, |_, _| async move {
        until("an answer to every call", || seen.replies.borrow().len() == calls).await;
    })
}

#[test]
fn a_reset_has_failed_where_the_map_that_was_saved_cannot_be_written_over() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("map.part")).unwrap();
    let (ended, _, transport) = all_answered(folder.path(), vec![Event::Call(Service::Reset, ())]);
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
    let (ended, _, transport) = all_answered(folder.path(), scan.into_iter().chain(calls).collect());
    ended.unwrap();
    let replies = transport.replies.borrow();
    let [save, reset] = &replies[..] else { panic!("{replies:?}") };
    assert!(reset.success && reset.message.ends_with(" begins with an empty map"), "{reset:?}");
    let words =
        if save.success { "1 scan saved, " } else { " has begun meanwhile, before the map of session " };
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
        for _ in 0..=crate::node::live::calls_for_map::MOST_CALLS {
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
    let (version, read) = (store::VERSION + 1, store::VERSION);
    let expected = format!("{} is of version {version}; this program reads version {read}", path.display());
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
    store::write(&path, "map", Engine::new(config.engine).freeze()).unwrap();
    let error = begin(&config, true).unwrap_err().to_string();
    assert!(error.contains("made with fixed_frame map, now it is odom"), "{error}");
    let mut paper = Engine::new(Params::paper());
    let (stamp, points) = (at(10.0), Points::F32(Vec::new()));
    paper.insert(&Scan { stamp, fixed_from_sensor: Isometry3::identity(), points });
    store::write(&path, "odom", paper.freeze()).unwrap();
    let error = begin(&config, true).unwrap_err().to_string();
    assert!(error.contains("made with mode paper, now it is consistent"), "{error}");
    assert_eq!(names(), ["map", "map.lock", "map.refused-1"]);
    begin(&config, false).unwrap();
    assert_eq!(names(), ["map.before-1", "map.lock", "map.refused-1"]);
    let nowhere = Value::Text(folder.path().join("none/map").display().to_string());
    let nowhere = Config::new([("snapshot_path".to_owned(), nowhere)]).unwrap();
    assert!(begin(&nowhere, false).unwrap_err().to_string().contains("a folder that exists"));
    let home = Config::new([("snapshot_path".to_owned(), Value::Text("~/map.cfodi".to_owned()))]).unwrap();
    let error = begin(&home, false).unwrap_err().to_string();
    assert!(error.ends_with("a folder that exists, and `~` is not expanded here"), "{error}");
    let error = begin(&Config::new([]).unwrap(), true).unwrap_err().to_string();
    assert_eq!(error, "--resume needs the parameter snapshot_path: the file of the map");
}
