//! The tasks that read, over whatever middleware.

use std::borrow::Cow;

use tokio::sync::Mutex;
use tokio::sync::mpsc::Sender;
use tokio::task::JoinSet;

use super::seeds::{Decoded, LatestCamera};
use super::transport::{Event, Input};
use crate::msg::ros::CameraInfo;

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

/// Tells the node how many scans were lost before this one, then the scan; whether the node is there to hear of it.
pub(super) async fn tell_scan<R>(
    events: &Sender<Event<R>>,
    input: Input,
    (scan, lost): (Decoded, u64),
) -> bool {
    if lost > 0 && events.send(Event::Lost(input, lost)).await.is_err() {
        return false;
    }
    events.send(Event::Cloud(input, scan)).await.is_ok()
}

/// Keeps the newest camera for the seeds and tells the node of one that differs from the one before; whether the node is there
/// to hear of it.
pub(super) async fn tell_camera<R>(
    events: &Sender<Event<R>>,
    (camera, sensor, topic): (&LatestCamera, usize, &str),
    info: Result<CameraInfo, String>,
) -> bool {
    match camera.event((sensor, topic), info) {
        Some(event) => events.send(event).await.is_ok(),
        None => true,
    }
}

#[cfg(test)]
mod tests {
    use std::panic::resume_unwind;

    use tokio::sync::mpsc::channel;

    use super::super::transport::Form;
    use super::*;
    use crate::cloud::CloudError;

    #[tokio::test]
    async fn what_was_lost_is_told_before_the_scan_and_nothing_to_a_node_that_has_ended() {
        let (events, mut node) = channel::<Event<()>>(4);
        let (input, scan) = (Form::Points.of(1), || Err(CloudError::NoCameraInfo));
        assert!(tell_scan(&events, input, (scan(), 0)).await);
        assert!(tell_scan(&events, input, (scan(), 3)).await);
        assert!(matches!(node.try_recv(), Ok(Event::Cloud(from, _)) if from == input));
        assert!(matches!(node.try_recv(), Ok(Event::Lost(from, 3)) if from == input));
        assert!(matches!(node.try_recv(), Ok(Event::Cloud(..))) && node.try_recv().is_err());
        let camera = LatestCamera::default();
        assert!(tell_camera(&events, (&camera, 1, "/info"), Err("cut".to_owned())).await);
        assert!(matches!(node.try_recv(), Ok(Event::Garbled { topic, .. }) if topic == "/info"));
        drop(node);
        assert!(
            !tell_scan(&events, input, (scan(), 3)).await && !tell_scan(&events, input, (scan(), 0)).await
        );
        assert!(!tell_camera(&events, (&camera, 1, "/info"), Err("cut".to_owned())).await);
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
