//! The node's end while its disk takes its time.

use std::fs::File;
use std::io::Read as _;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;

use tokio::time::{sleep, timeout};

use super::*;
use crate::node::live::calls::{LastFile, last_written};
use crate::node::saving::InFile;

/// A cloud whose map is longer than a pipe holds: about a voxel a point, and places in it that do not pack.
fn large_cloud(stamp: Stamp) -> Event<()> {
    let total = 32_000;
    let point = |i: u32| {
        let voxel = [i % 40, i / 40 % 40, i / 1600].map(|steps| f64::from(steps) * 0.08);
        let within = [0.754_878, 0.569_841, 0.438_579].map(|step: f64| (f64::from(i) * step).fract() * 0.08);
        std::array::from_fn(|axis| (0.5 + voxel[axis] + within[axis]) as f32)
    };
    let points = Points::F32((0..total).map(point).collect());
    let frame_id = "camera".to_owned();
    Event::Cloud(
        Form::Points.of(0),
        Ok(Cloud { stamp, frame_id, points, total, invalid: 0, out_of_range: 0 }),
    )
}

/// What was seen half a second after the node was told to end.
struct Seen {
    had_ended: bool,
    /// The file of the map.
    file: Vec<u8>,
    /// What was being written.
    under_way: Vec<u8>,
}

/// A disk that says when a map is being written under the name `part`, a pipe, and goes on with it only half a second after
/// the node was told to end.
fn slow_disk(
    part: PathBuf,
    opened: oneshot::Sender<()>,
    told: Receiver<()>,
    has_ended: Arc<AtomicBool>,
) -> thread::JoinHandle<Seen> {
    thread::spawn(move || {
        // It opens when the one who writes is there too, who then fills it and waits.
        let mut pipe = File::open(&part).unwrap();
        opened.send(()).unwrap();
        told.recv_timeout(PATIENCE).unwrap();
        thread::sleep(Duration::from_millis(500));
        let had_ended = has_ended.load(Ordering::SeqCst);
        let file = std::fs::read(part.with_extension("")).unwrap();
        let mut under_way = Vec::new();
        pipe.read_to_end(&mut under_way).unwrap();
        Seen { had_ended, file, under_way }
    })
}

/// A pipe cannot be synchronized: the saving under way fails once it has gone on, and leaves the name to that of the end.
#[test]
fn an_end_in_the_middle_of_a_saving_waits_for_it_and_saves_what_came_since() {
    let folder = tempfile::tempdir().unwrap();
    let [path, part] = ["map", "map.part"].map(|name| folder.path().join(name));
    let given = Value::Text(path.display().to_string());
    let config = Config::new([("snapshot_path".to_owned(), given)]).unwrap();
    let events = vec![transform(at(0.0), true), cloud(at(10.0), "camera")];
    node_with(&config, Fake::default(), events, 1).0.unwrap();
    let before = std::fs::read(&path).unwrap();
    assert!(Command::new("mkfifo").arg(&part).status().unwrap().success());
    let has_ended = Arc::new(AtomicBool::new(false));
    let ((opened, is_open), (tell, told)) = (oneshot::channel(), channel());
    let disk = slow_disk(part.clone(), opened, told, Arc::clone(&has_ended));
    let events = vec![transform(at(0.0), true), large_cloud(at(10.1)), Event::Call(Service::Save, ())];
    let stop = move |sender: mpsc::Sender<_>, counts: Rc<RefCell<Counts>>| async move {
        timeout(PATIENCE, is_open).await.unwrap().unwrap();
        sender.send(cloud(at(10.2), "camera")).await.unwrap();
        while counts.borrow().taken_in < 2 {
            sleep(TICK).await;
        }
        tell.send(()).unwrap();
    };
    let (ended, _, transport) = node_until(&config, Fake::default(), events, stop);
    has_ended.store(true, Ordering::SeqCst);
    ended.unwrap();
    let Seen { had_ended, file, under_way } = disk.join().unwrap();
    assert!(!had_ended, "it did not wait");
    assert!(file == before, "the file is not the one before");
    assert!(under_way.len() > 1 << 16, "{} bytes fit into a pipe", under_way.len());
    let scans = |stored: Stored| stored.map.sequence();
    assert_eq!(scans(store::unpack(&under_way).unwrap()), 2);
    assert_eq!(scans(store::read(&path).unwrap()), 3);
    assert!(!part.exists());
    let replies = transport.replies.borrow();
    assert!(replies.len() == 1 && replies[0].success, "{replies:?}");
}

#[test]
fn calls_that_still_wait_at_the_end_are_told_that_nothing_was_done_or_of_the_last_map() {
    let folder = tempfile::tempdir().unwrap();
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let nothing = (false, "the node ends, and nothing was done".to_owned());
    for (config, at_once) in [(Config::new([]).unwrap(), 2), (saving_in(folder.path()), 1)] {
        let live = runtime.block_on(async {
            let (mut live, _reported) = reports::by_hand(&config, Fake::default());
            for service in [Service::Reset, Service::Save] {
                live.put_away(Event::Call(service, ())).await;
            }
            live
        });
        let replies = live.transport.replies.take();
        let told: Vec<_> = replies.into_iter().map(|reply| (reply.success, reply.message)).collect();
        assert_eq!(told, vec![nothing.clone(); at_once]);
        let waiting =
            live.calls_for_map.into_iter().flat_map(CallsForMap::into_calls).map(|call| call.service);
        assert_eq!(waiting.count(), 2 - at_once);
    }
}

fn file<GivenUp>(given_up: GivenUp) -> LastFile<GivenUp> {
    LastFile { path: "map".into(), given_up }
}

/// A disk that does not answer: nothing of the map is heard.
#[test]
fn a_map_that_takes_long_at_the_end_is_told_of_and_given_up_when_that_is_asked_for() {
    let (_writes, written) = mpsc::unbounded_channel();
    let mut calls = CallsForMap::default();
    assert!(
        calls.begin(Some(Call { service: Service::Save, session: 1, request: () })),
        "none was under way"
    );
    let transport = Fake::default();
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let begun = Instant::now();
    let last = last_written(written, Some(calls), &transport, file(async {}));
    let (ended, said) = heard(|| runtime.block_on(last));
    assert!(begun.elapsed() >= Duration::from_secs(2), "it was given up before it was said");
    let words = "the map is being written to map: one more signal ends the node without it";
    assert_eq!(said, [(30, words.to_owned())]);
    let lost = "map stays as it was saved last, for a signal came while the new map was written";
    assert_eq!(ended.unwrap_err().to_string(), format!("the map was not saved at the end: {lost}"));
    let replies = transport.replies.take();
    assert!(replies.len() == 1 && !replies[0].success && replies[0].message == lost, "{replies:?}");
}

/// What calls are told at the end, to save in session 1, to reset, and to save in session 2, where these are the results: a map
/// of the session, or none.
async fn told(results: [Option<u64>; 2]) -> Vec<(bool, String)> {
    let (sender, written) = mpsc::unbounded_channel();
    for session in results {
        let in_use = || StoreError::InUse { path: "map".into() };
        let result = session.map(|session| InFile { session, sequence: 4, bytes: 99 }).ok_or_else(in_use);
        sender.send(result).unwrap();
    }
    drop(sender);
    let call = |service, session| Call { service, session, request: () };
    let mut calls = CallsForMap::default();
    assert!(calls.begin(Some(call(Service::Save, 1))), "none was under way");
    assert!(!calls.begin(Some(call(Service::Reset, 2))), "one is");
    calls.wait(call(Service::Save, 2));
    let transport = Fake::default();
    let ended = last_written(written, Some(calls), &transport, file(std::future::pending())).await;
    assert_eq!(ended.is_ok(), results[1].is_some(), "{ended:?}");
    let replies = transport.replies.take();
    replies.into_iter().map(|TriggerResponse { success, message }| (success, message)).collect()
}

#[tokio::test]
async fn at_the_end_a_call_is_told_of_the_map_that_it_asked_for_and_where_that_failed_of_the_last() {
    let saved = (true, "4 scans saved, 99 bytes".to_owned());
    let begun = (true, "session 2 begins with an empty map".to_owned());
    assert_eq!(told([Some(1), Some(2)]).await, [saved.clone(), begun.clone(), saved.clone()]);
    let overtaken = "session 2 has begun meanwhile, before the map of session 1 was saved";
    assert_eq!(told([None, Some(2)]).await, [(false, overtaken.to_owned()), begun.clone(), saved.clone()]);
    let reason = "map is in use by another process";
    let stays = format!("{}; the map that was saved may come back: {reason}", begun.1);
    assert_eq!(told([Some(1), None]).await, [saved, (false, stays), (false, reason.to_owned())]);
}
