//! Who comes late is sent no map of a session that has ended.
//!
//! A history of RustDDS 0.15.1 outgrows its depth: what newer messages have replaced is forgotten every 6 s only, and where nobody
//! reads the topic not before there are as many as [`super::open`] keeps; nothing makes it do so sooner. A late reader is sent all
//! of it, the oldest first. So the latched topics of the map are opened anew with the first map of a session: those who read them
//! find them again in some milliseconds, with that map. Within a session it is left at that: to open topics anew costs
//! discovery, and older maps of the same one mislead nobody who takes the last.

use std::time::{Duration, Instant};

use super::Network;
use crate::msg::clusters::SurfaceClusterArray;
use crate::node::transport::SendError;

/// Two publishers on one topic begin a session with every other scan: the topics are not opened anew with each.
const REST: Duration = Duration::from_secs(1);

/// Of which session the maps are that the latched topics hold.
#[derive(Debug, Default)]
pub(super) struct Sessions {
    /// That of the newest map.
    newest: Option<u64>,
    /// Whether they hold maps of an ended one.
    are_stale: bool,
    /// When they were to be opened anew last.
    due: Option<Instant>,
}

impl Sessions {
    /// Notes a map that is to be sent; says whether the topics are to be opened anew for it.
    fn note(&mut self, session: u64, now: Instant) -> bool {
        self.are_stale |= self.newest.replace(session).is_some_and(|before| before != session);
        let has_rested = self.due.is_none_or(|due| now.duration_since(due) >= REST);
        let is_due = self.are_stale && has_rested;
        if is_due {
            self.due = Some(now);
        }
        is_due
    }

    /// Notes that they hold nothing.
    fn opened(&mut self) {
        self.are_stale = false;
    }
}

impl Network {
    pub(super) async fn send_map(&self, map: SurfaceClusterArray) -> Result<(), SendError> {
        let is_due = self.sessions.borrow_mut().note(map.session_id, Instant::now());
        // Where the middleware is held it would hold whoever asks it for a topic.
        let opened = if is_due && self.answers().await { self.forget_maps() } else { Ok(()) };
        // Those who read the topic want the map in any case.
        self.send(&self.clusters, map).await.and(opened)
    }

    fn forget_maps(&self) -> Result<(), SendError> {
        let node = &mut self.node.borrow_mut();
        self.clusters.open_anew(node)?;
        self.markers.open_anew(node)?;
        if let Some(detections) = &self.detections {
            detections.open_anew(node)?;
        }
        self.reopened.set(self.reopened.get() + 2 + u32::from(self.detections.is_some()));
        self.sessions.borrow_mut().opened();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Says of maps of these sessions, at these milliseconds, whether topics are to be opened anew; they then are, if they can be.
    fn due<const N: usize>(maps: [(u64, u64); N], can_be: bool) -> [bool; N] {
        let (mut sessions, start) = (Sessions::default(), Instant::now());
        maps.map(|(session, at)| {
            let is_due = sessions.note(session, start + Duration::from_millis(at));
            if is_due && can_be {
                sessions.opened();
            }
            is_due
        })
    }

    #[test]
    fn topics_are_opened_anew_with_the_first_map_of_a_session() {
        let maps = [(1, 0), (1, 500), (2, 600), (2, 2000), (3, 2500), (3, 3000), (3, 9000)];
        assert_eq!(due(maps, true), [false, false, true, false, true, false, false]);
    }

    #[test]
    fn sessions_that_alternate_open_topics_anew_once_in_a_while_and_what_was_left_is_made_up_for() {
        let maps = [(1, 0), (2, 30), (3, 60), (4, 90), (4, 1020), (4, 1030), (4, 5000)];
        assert_eq!(due(maps, true), [false, true, false, false, false, true, false]);
    }

    #[test]
    fn topics_that_could_not_be_opened_are_tried_again() {
        let maps = [(1, 0), (2, 30), (2, 500), (2, 1030), (2, 1500), (2, 2030)];
        assert_eq!(due(maps, false), [false, true, false, true, false, true]);
    }
}
