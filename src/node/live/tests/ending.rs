//! The node's end while its disk takes its time.

use std::sync::Mutex;

use super::*;
use crate::engine::Scan;
use crate::msg::clusters::MapVersion;
use crate::node::live::calls::{LastFile, given_up, last_written};
use crate::node::publish::Ended;
use crate::node::saving::InFile;
use crate::reason::SHUTDOWN;

#[test]
fn calls_that_still_wait_at_the_end_are_told_that_nothing_was_done_or_of_the_last_map() {
    let folder = tempfile::tempdir().unwrap();
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let nothing = (false, "the node ends, and nothing was done".to_owned());
    for (config, at_once) in [(Config::new([]).unwrap(), 2), (saving_in(folder.path()), 1)] {
        let closing = runtime.block_on(async {
            let closing = reports::by_hand(&config, Fake::default()).0.close().1;
            for service in [Service::Reset, Service::Save] {
                closing.put_away(Event::Call(service, ())).await;
            }
            closing
        });
        assert_eq!(replies(&closing.transport), vec![nothing.clone(); at_once]);
        let waiting = closing.calls_for_map.take().into_iter().flat_map(CallsForMap::into_calls);
        assert_eq!(waiting.count(), 2 - at_once);
    }
}

/// A disk that takes its time, until both have been called.
#[test]
fn calls_that_come_while_the_node_ends_are_answered_too() {
    let folder = tempfile::tempdir().unwrap();
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let (ended, replies) = LocalSet::new().block_on(&runtime, async {
        let (live, _reported) = reports::by_hand(&saving_in(folder.path()), Fake::default());
        let transport = Rc::clone(&live.transport);
        let ((events, receiver), (writes, written)) = (mpsc::channel(2), mpsc::unbounded_channel());
        let ended = Ended { map: Some(map()), died: None };
        let publishing = tokio::task::spawn_local(std::future::ready(ended));
        let beside = Beside { publishing, muted: mpsc::channel(1).1, written: Some(written) };
        let asked = std::future::ready(());
        let call = async {
            tokio::time::sleep(TICK).await;
            for service in [Service::Save, Service::Reset] {
                events.send(Event::Call(service, ())).await.unwrap();
            }
            until("an answer", || !transport.replies.borrow().is_empty()).await;
            writes.send(Ok(in_file(1))).unwrap();
            drop(writes);
        };
        let mut speaking = tokio::task::spawn_local(std::future::pending());
        let run = live.run(receiver, beside, &mut speaking, asked, Some(file(std::future::pending())));
        let (ended, ()) = tokio::join!(run, call);
        (ended, replies(&transport))
    });
    let nothing = (false, "the node ends, and nothing was done".to_owned());
    assert_eq!(replies, [nothing, (true, "4 scans saved, 99 bytes".to_owned())]);
    ended.unwrap();
}

#[test]
fn a_cloud_that_was_handed_over_and_not_heard_before_the_end_is_counted() {
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let counts = runtime.block_on(async {
        let closing = reports::by_hand(&Config::new([]).unwrap(), Fake::default()).0.close().1;
        closing.put_away(Event::Handed(Form::Points.of(0), Box::default())).await;
        closing.counts.take()
    });
    assert_eq!((counts.received, counts.skipped.get(&SHUTDOWN)), (1, Some(&1)));
}

/// The map that a node ends with.
fn map() -> Arc<Snapshot> {
    Arc::new(Engine::new(Params::paper()).snapshot())
}

fn file<GivenUp>(given_up: GivenUp) -> LastFile<GivenUp> {
    LastFile { path: "map".into(), given_up }
}

/// Nobody gives up the map.
fn kept() -> impl Future<Output = StoreError> {
    given_up(Some(file(std::future::pending())))
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
    let last = async {
        last_written(
            Ok(map()),
            written,
            &RefCell::new(Some(calls)),
            &transport,
            pin!(given_up(Some(file(async {})))),
        )
        .await
    };
    let (ended, said) = heard(|| runtime.block_on(last));
    assert!(begun.elapsed() >= Duration::from_secs(2), "it was given up before it was said");
    let words = "the map is being written to map: one more signal ends the node without it";
    assert_eq!(said, [(30, words.to_owned())]);
    let lost = "map stays as it was saved last, for a signal came while the new map was written";
    assert_eq!(ended.unwrap_err().to_string(), format!("the map was not saved at the end: {lost}"));
    let replies = transport.replies.take();
    assert!(replies.len() == 1 && !replies[0].success && replies[0].message == lost, "{replies:?}");
}

/// A map of this session, as it was written.
const fn in_file(session: u64) -> InFile {
    InFile { version: MapVersion { session, sequence: 4 }, bytes: 99 }
}

/// What calls are told at the end, to save in session 1, to reset, and to save in session 2, where these are the results: a map
/// of the session, or none.
async fn told(results: [Option<u64>; 2]) -> Vec<(bool, String)> {
    let (sender, written) = mpsc::unbounded_channel();
    for session in results {
        let in_use = || StoreError::InUse { path: "map".into() };
        let result = session.map(in_file).ok_or_else(in_use);
        sender.send(result).unwrap();
    }
    drop(sender);
    let call = |service, session| Call { service, session, request: () };
    let mut calls = CallsForMap::default();
    assert!(calls.begin(Some(call(Service::Save, 1))), "none was under way");
    assert!(!calls.begin(Some(call(Service::Reset, 2))), "one is");
    calls.wait(call(Service::Save, 2));
    let transport = Fake::default();
    let ended = last_written(Ok(map()), written, &RefCell::new(Some(calls)), &transport, pin!(kept())).await;
    assert_eq!(ended.is_ok(), results[1].is_some(), "{ended:?}");
    replies(&transport)
}

fn replies(transport: &Fake) -> Vec<(bool, String)> {
    let replies = transport.replies.take();
    replies.into_iter().map(|TriggerResponse { success, message }| (success, message)).collect()
}

/// What a call to save and one to reset are told where the node ends so, and of its maps nothing more is heard but this.
async fn told_without_a_map(
    ended: Result<Arc<Snapshot>, LiveError>,
    written: Option<InFile>,
) -> (String, Vec<(bool, String)>) {
    let (sender, results) = mpsc::unbounded_channel();
    written.into_iter().for_each(|written| sender.send(Ok(written)).unwrap());
    drop(sender);
    let mut calls = CallsForMap::default();
    for service in [Service::Save, Service::Reset] {
        calls.begin(Some(Call { service, session: 2, request: () }));
    }
    let transport = Fake::default();
    let ended = last_written(ended, results, &RefCell::new(Some(calls)), &transport, pin!(kept())).await;
    (ended.unwrap_err().to_string(), replies(&transport))
}

#[tokio::test]
async fn calls_that_wait_for_a_map_are_told_where_its_thread_or_the_engine_has_died() {
    let begun = "session 2 begins with an empty map; the map that was saved may come back: ";
    let died = || Err(LiveError::Died("no room".to_owned()));
    for (ended, reason) in [
        (Ok(map()), "the thread that saves the map has died"),
        (died(), "the engine's thread has died: no room"),
    ] {
        let told = [reason.to_owned(), format!("{begun}{reason}")].map(|message| (false, message));
        assert_eq!(told_without_a_map(ended, None).await, (reason.to_owned(), told.to_vec()));
    }
    let on_its_way = in_file(2);
    let (reason, told) = told_without_a_map(died(), Some(on_its_way)).await;
    let saved = (true, "4 scans saved, 99 bytes".to_owned());
    assert_eq!(told, [saved, (false, format!("{begun}{reason}"))]);
}

#[test]
fn a_call_to_save_that_the_engine_s_death_overtakes_is_told_so() {
    let folder = tempfile::tempdir().unwrap();
    let events = vec![
        transform(at(0.0), true),
        cloud(DEADLY, "camera"),
        Event::Call(Service::Save, ()),
        Event::Call(Service::Save, ()),
    ];
    let config = saving_in(folder.path());
    let (ended, _, transport) = node_by(deadly(), &config, Fake::default(), events, u64::MAX);
    let reason = ended.unwrap_err().to_string();
    assert!(reason.contains("a panic for the test"), "{reason}");
    assert_eq!(replies(&transport), vec![(false, reason); 2]);
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

/// Where the runtime has no thread free for what is done aside, and the engine takes its scans meanwhile.
#[test]
fn the_last_map_has_all_scans_that_were_waiting_when_the_node_ends() {
    const SCANS: u64 = 5;
    let (outputs, mut taken) = mpsc::unbounded_channel();
    let ((go_on, held), (tell, told)) = (std::sync::mpsc::channel::<()>(), std::sync::mpsc::channel());
    let held = std::sync::Arc::new(Mutex::new(held));
    let sink = move |output| {
        let sequence = if let Output::Scan { update, .. } = &output { update.sequence } else { 0 };
        drop(outputs.send(output));
        if sequence == 1 {
            _ = held.lock().unwrap().recv();
        }
        if sequence == SCANS {
            _ = tell.send(());
        }
    };
    let config = Config::new([]).unwrap();
    let worker = Worker::start(Engine::new(config.engine), 1, SCANS as usize, sink).unwrap();
    for number in 0..SCANS {
        let (stamp, points) = (at(10.0 + number as f64), crate::engine::Points::F32(Vec::new()));
        let scan = Scan { stamp, fixed_from_sensor: crate::engine::Isometry3::identity(), points };
        assert_eq!(worker.submit(0, scan), None);
    }
    let runtime = Builder::new_current_thread().max_blocking_threads(1).enable_time().build().unwrap();
    let ended = LocalSet::new().block_on(&runtime, async {
        let busy = tokio::task::spawn_blocking(move || told.recv_timeout(PATIENCE).is_ok());
        assert!(matches!(taken.recv().await, Some(Output::Scan { .. })));
        let publishing = tokio::task::spawn_local(async move {
            let mut ended = Ended::default();
            while let Some(output) = taken.recv().await {
                if let Output::Snapshot { snapshot, .. } = output {
                    ended.map = Some(snapshot);
                }
            }
            ended
        });
        let (reports, _reported) = mpsc::channel(1);
        let live = Live::new(&config, Rc::new(Fake::default()), worker, 1, Seen::default(), reports);
        let no_file: Option<(_, LastFile<std::future::Pending<()>>)> = None;
        let (worker, closing) = live.close();
        // The end is asked for before the engine goes on.
        let finish = closing.finish(worker, publishing, no_file);
        let (ended, ()) = tokio::join!(finish, async move { drop(go_on) });
        assert!(busy.await.unwrap(), "the engine has taken in all before");
        ended
    });
    assert_eq!(ended.unwrap().sequence, SCANS);
}

/// A recorder whose disk does not answer: what is published waits, and the engine with it.
#[test]
fn a_node_that_cannot_publish_any_more_ends_without_its_map_when_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let (ended, said) = heard(|| {
        runtime.block_on(async {
            let (mut live, _reported) = reports::by_hand(&saving_in(folder.path()), Fake::default());
            let waits = |_| loop {
                std::thread::park();
            };
            live.worker = Worker::start(Engine::new(Params::paper()), 1, 1, waits).unwrap();
            let (worker, closing) = live.close();
            closing.put_away(Event::Call(Service::Save, ())).await;
            closing.counts.borrow_mut().received = 3;
            let (_writes, written) = mpsc::unbounded_channel();
            let written = Some((written, file(async {})));
            let ended = closing.finish(worker, std::future::pending(), written).await;
            (ended.unwrap_err().to_string(), replies(&closing.transport), closing.counts.take())
        })
    });
    let (ended, replies, counts) = ended;
    let words = "the map is being written to map: one more signal ends the node without it";
    assert_eq!(said, [(30, words.to_owned())]);
    let lost = "the map was not saved at the end: map stays as it was saved last, for a signal came while the new map was written";
    assert_eq!((ended, replies), (lost.to_owned(), vec![(false, lost.to_owned())]));
    assert_eq!(counts.skipped.get(&SHUTDOWN), Some(&3));
}

#[test]
fn a_panic_of_what_speaks_while_the_last_map_is_saved_is_an_error_beside_none_of_another_kind() {
    let runtime = Builder::new_current_thread().enable_time().build().unwrap();
    let speaking = || runtime.spawn(async { panic!("a panic for the test") });
    let alone = runtime.block_on(last_words(speaking(), Ok(())));
    assert!(matches!(&alone, Err(LiveError::Mute(why)) if why.contains("a panic for the test")), "{alone:?}");
    let died = runtime.block_on(last_words(speaking(), Err::<(), _>(LiveError::SaverDied)));
    assert!(matches!(died, Err(LiveError::SaverDied)), "{died:?}");
    let well = runtime.block_on(last_words(runtime.spawn(async {}), Ok(())));
    assert!(well.is_ok(), "{well:?}");
}
