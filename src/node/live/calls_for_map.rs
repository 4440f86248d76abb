//! Calls of services that wait for a map to be written, and what they are told.

use std::fmt::Display;

use crate::count::count_of;
use crate::msg::ros::TriggerResponse;
use crate::node::saving::{InFile, Written};
use crate::node::transport::Service;

/// Most calls that wait for the next map, where a disk does not answer.
pub(super) const MOST_CALLS: usize = 64;

/// Who waits for a map to be written. At most one is under way, so that none piles up before a slow disk.
#[derive(Debug)]
pub(super) struct CallsForMap<Request> {
    is_under_way: bool,
    /// Another was asked for since.
    is_due: bool,
    /// Calls that the map under way answers.
    asked: Vec<Request>,
    /// Calls that came after it was asked for.
    waiting: Vec<Request>,
}

impl<Request> Default for CallsForMap<Request> {
    fn default() -> Self {
        Self { is_under_way: false, is_due: false, asked: Vec::new(), waiting: Vec::new() }
    }
}

impl<Request> CallsForMap<Request> {
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
            (_, Err(error)) => return self.failure(error),
            (Service::Save, Ok(map)) if map.version.session != self.session => {
                let (new, old) = (map.version.session, self.session);
                (
                    false,
                    format!("session {new} has begun meanwhile, before the map of session {old} was saved"),
                )
            }
            (Service::Save, Ok(InFile { version, bytes })) => {
                (true, format!("{} saved, {bytes} bytes", count_of(version.sequence, "scan")))
            }
            // A later session gives up what was saved as well.
            (Service::Reset, Ok(_)) => (true, begun(self.session)),
        };
        TriggerResponse { success, message }
    }

    /// What the caller is told where no map has been written, for this reason.
    pub(super) fn failure(&self, reason: &impl Display) -> TriggerResponse {
        let message = match self.service {
            Service::Save => reason.to_string(),
            Service::Reset => {
                format!("{}; the map that was saved may come back: {reason}", begun(self.session))
            }
        };
        TriggerResponse { success: false, message }
    }
}

/// What is said of a session that begins.
pub(super) fn begun(session: u64) -> String {
    format!("session {session} begins with an empty map")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::clusters::MapVersion;
    use crate::store::StoreError;

    #[test]
    fn a_call_to_save_that_another_session_overtakes_has_failed_and_a_reset_that_one_overtakes_has_not() {
        let saved = |session| Ok(InFile { version: MapVersion { session, sequence: 4 }, bytes: 99 });
        let told = |service, written| {
            let TriggerResponse { success, message } =
                Call { service, session: 5, request: () }.response(&written);
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
    fn where_a_disk_does_not_answer_calls_are_bounded() {
        let mut calls = CallsForMap::default();
        let taken = (0..1000)
            .filter(|&call| {
                !calls.is_full() && {
                    calls.begin(Some(call));
                    true
                }
            })
            .count();
        assert_eq!(taken, 1 + MOST_CALLS);
    }

    #[test]
    fn what_is_asked_for_while_a_map_is_written_gets_the_next_one_called_for_or_not() {
        let mut calls = CallsForMap::default();
        assert!(calls.begin(Some(1)) && !calls.begin(Some(2)) && !calls.begin(None));
        assert_eq!(calls.end(), (vec![1], true));
        assert_eq!(calls.end(), (vec![2], false));
        assert!(calls.begin(None), "a reset, say");
        assert!(!calls.begin(None), "and one more, which is in the map under way or not");
        assert_eq!(calls.end(), (vec![], true));
        assert_eq!(calls.end(), (vec![], false));
        assert!(calls.begin(Some(3)) && !calls.begin(Some(4)));
        calls.wait(5);
        assert!(calls.into_calls().eq([3, 4, 5]));
    }
}
