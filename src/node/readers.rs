//! The tasks that read, over whatever middleware.

use std::borrow::Cow;

use tokio::sync::Mutex;
use tokio::sync::mpsc::Sender;
use tokio::task::JoinSet;

use super::heard::NextScan;
use super::parameters::Parameters;
use super::seeds::CameraTopic;
use super::transport::{Event, Input};
use crate::msg::heard::CLOCK;
use crate::msg::ros::{CameraInfo, Clock};

/// Tasks that read; each ends with the name of what it read.
pub(super) type Readers = JoinSet<Cow<'static, str>>;

/// Resolves, with a reason, when something that reads has ended.
pub(super) async fn ended(readers: &Mutex<Readers>) -> String {
    match readers.lock().await.join_next().await {
        Some(Ok(topic)) => format!("reading {topic} has ended"),
        Some(Err(failure)) => failure.to_string(),
        None => "nothing reads".to_owned(),
    }
}

/// Most events of one scan.
const OF_SCAN: usize = 2;

/// Tells the node of a scan, where `takes` gives one: how many were lost before it, then the scan; whether the node is there to hear
/// of it. Nothing is taken before there are places: what was taken is told, whatever ends this task.
pub(super) async fn tell_scan<R>(
    events: &Sender<Event<R>>,
    input: Input,
    takes: impl FnOnce() -> Option<NextScan>,
) -> bool {
    let Ok(places) = events.reserve_many(OF_SCAN).await else { return false };
    let Some(NextScan { scan, lost_before }) = takes() else { return true };
    let lost = (lost_before > 0).then_some(Event::Lost(input, lost_before));
    let told = lost.into_iter().chain([Event::Cloud(input, scan)]);
    told.zip(places).for_each(|(event, place)| place.send(event));
    true
}

/// What a message on `/clock` says.
pub(super) fn clock_event<R>(clock: Clock, parameters: &Parameters) -> Event<R> {
    let Some(stamp) = clock.clock.stamp() else {
        let text = format!("{} ns in a second", clock.clock.nanosec);
        return Event::Garbled { topic: CLOCK.name.into(), text };
    };
    parameters.note_clock(stamp);
    Event::Clock(stamp)
}

/// Keeps the newest camera for the seeds and tells the node of one that differs from the one before; whether the node is there
/// to hear of it.
pub(super) async fn tell_camera<R>(
    events: &Sender<Event<R>>,
    topic: &CameraTopic,
    info: Result<CameraInfo, String>,
) -> bool {
    match topic.event(info) {
        Some(event) => events.send(event).await.is_ok(),
        None => true,
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::panic::resume_unwind;
    use std::time::Duration;

    use tokio::sync::mpsc::channel;
    use tokio::time::timeout;

    use super::super::seeds::LatestCamera;
    use super::super::transport::Form;
    use super::*;
    use crate::cloud::CloudError;
    use crate::engine::Stamp;

    #[tokio::test]
    async fn what_was_lost_is_told_before_the_scan_and_nothing_to_a_node_that_has_ended() {
        let (events, mut node) = channel::<Event<()>>(4);
        let input = Form::Points.of(1);
        let next = |lost_before| Some(NextScan { scan: Err(CloudError::NoCameraInfo), lost_before });
        assert!(tell_scan(&events, input, || next(0)).await);
        assert!(tell_scan(&events, input, || None).await);
        assert!(tell_scan(&events, input, || next(3)).await);
        assert!(matches!(node.try_recv(), Ok(Event::Cloud(from, _)) if from == input));
        assert!(matches!(node.try_recv(), Ok(Event::Lost(from, 3)) if from == input));
        assert!(matches!(node.try_recv(), Ok(Event::Cloud(..))) && node.try_recv().is_err());
        let infos = CameraTopic { sensor: 1, name: "/info".to_owned(), camera: LatestCamera::default() };
        assert!(tell_camera(&events, &infos, Err("cut".to_owned())).await);
        assert!(matches!(node.try_recv(), Ok(Event::Garbled { topic, .. }) if topic == "/info"));
        drop(node);
        assert!(!tell_scan(&events, input, || next(3)).await);
        assert!(!tell_camera(&events, &infos, Err("cut".to_owned())).await);
    }

    /// What is not taken shows as a gap in the numbers.
    #[tokio::test]
    async fn a_scan_that_waits_for_a_place_when_its_reader_is_stopped_was_not_taken() {
        let (events, mut node) = channel::<Event<()>>(2);
        events.try_send(Event::Clock(Stamp::default())).unwrap();
        let taken = Cell::new(false);
        let takes = || {
            taken.set(true);
            None
        };
        let telling = tell_scan(&events, Form::Points.of(0), takes);
        assert!(timeout(Duration::from_millis(20), telling).await.is_err() && !taken.get());
        assert!(
            node.try_recv().is_ok() && tell_scan(&events, Form::Points.of(0), takes).await && taken.get()
        );
    }

    #[tokio::test]
    async fn what_has_ended_is_named() {
        let readers = Mutex::new(Readers::new());
        assert_eq!(ended(&readers).await, "nothing reads");
        readers.lock().await.spawn(async { "/tf".into() });
        assert_eq!(ended(&readers).await, "reading /tf has ended");
        readers.lock().await.spawn(async { resume_unwind(Box::new("died")) });
        assert!(ended(&readers).await.contains("panic"));
    }
}
