//! Calls that were heard before the network was joined anew, and are answered after it. What is sent to a client that is not
//! found yet never gets there, and it would wait for ever.

use std::rc::Rc;
use std::time::Duration;

use ros2_client::{Gid, RmwRequestId};
use tokio::task::spawn_local;
use tokio::time::{sleep, timeout};
use tracing::info;

use super::{LOOK, Network, Sources};
use crate::msg::ros::TriggerResponse;
use crate::node::transport::Service;

/// How long it may take until a client is found again.
const PATIENCE: Duration = Duration::from_secs(10);

/// How long a client that is found has for finding the node.
const FINDS: Duration = Duration::from_secs(1);

/// What the DDS names of answers begin with.
const ANSWERS: &str = "rr/";

/// Bytes of a client's name that are of its process, however calls are written.
const PROCESS: usize = 8;

impl Network {
    /// Answers a call that was heard on the network before this one, once its client is found on this one.
    pub(in crate::node::dds) fn answer_once_found(
        &self,
        service: Service,
        caller: RmwRequestId,
        response: TriggerResponse,
    ) {
        let (triggers, sources) = (Rc::clone(self.triggers(service)), self.sources.clone());
        info!(
            "{} was called before the network was joined anew, and is answered once its client is found",
            triggers.name
        );
        spawn_local(async move {
            if comes(|| sources.know(caller), LOOK, PATIENCE).await {
                sleep(FINDS).await;
                triggers.answer_or_say(caller, response).await;
            } else {
                triggers.say_unanswered(&"its client was not found again");
            }
        });
    }
}

impl Sources {
    /// Whether the client of a call is found: something in its process reads answers.
    fn know(&self, caller: RmwRequestId) -> bool {
        // As in `Network::mismatches`.
        self.threads.live()
            && self.participant.discovered_readers().iter().any(|reader| {
                let reads = &reader.subscription_topic_data.topic_name;
                is_of(caller, reader.reader_proxy.remote_reader_guid.into(), reads)
            })
    }
}

/// Whether a reader is one of answers in the process of a client.
fn is_of(caller: RmwRequestId, reader: Gid, reads: &str) -> bool {
    let process = |gid: &Gid| gid.as_bytes()[..PROCESS].to_vec();
    reads.starts_with(ANSWERS) && process(&caller.writer_gid) == process(&reader)
}

/// Whether something comes in time; it is looked for now and then.
async fn comes(is_there: impl Fn() -> bool, pause: Duration, patience: Duration) -> bool {
    let coming = async {
        while !is_there() {
            sleep(pause).await;
        }
    };
    timeout(patience, coming).await.is_ok()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use rustdds::GUID;

    use super::*;

    fn gid(process: u8, entity: u8) -> Gid {
        let mut bytes = [0; 16];
        (bytes[PROCESS - 1], bytes[15]) = (process, entity);
        Gid::from(GUID::from_bytes(bytes))
    }

    #[test]
    fn a_client_is_found_by_a_reader_of_answers_in_its_process() {
        let caller = RmwRequestId { writer_gid: gid(7, 3), sequence_number: 1 };
        assert!(is_of(caller, gid(7, 4), "rr/cfodi/saveReply"));
        assert!(!is_of(caller, gid(8, 4), "rr/cfodi/saveReply") && !is_of(caller, gid(7, 4), "rt/tf"));
    }

    #[tokio::test]
    async fn who_is_not_found_in_time_is_waited_for_no_longer() {
        let (looks, pause) = (Cell::new(0), Duration::from_millis(1));
        let third = || looks.replace(looks.get() + 1) == 2;
        assert!(comes(third, pause, PATIENCE).await);
        assert_eq!(looks.get(), 3);
        assert!(!comes(|| false, pause, 20 * pause).await);
    }
}
