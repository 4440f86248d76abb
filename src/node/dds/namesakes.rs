//! Other nodes of this node's name. ROS lets them be, and who calls one of them by its name reaches any.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::rc::Rc;

use futures::{StreamExt, pin_mut};
use ros2_client::Gid;
use ros2_client::entities_info::ParticipantEntitiesInfo;
use ros2_client::qos::Durability;
use rustdds::no_key::SimpleDataReaderCdr;
use rustdds::{DomainParticipant, GUID, RTPSEntity as _, TopicKind};

use super::reliable;
use crate::node::middleware::OpenError;

/// On which each participant tells of its nodes; no topic of ROS, and not renamed like those.
const TOPIC: &str = "ros_discovery_info";

/// What participants tell that may wait to be read.
const WAITING: usize = 100;

/// Participants to remember; any number can be made up.
const MOST: usize = 1000;

/// Participants with a node of this node's name.
#[derive(Debug, Default)]
pub(super) struct Namesakes {
    there: RefCell<BTreeSet<Gid>>,
    /// This node's own, one for each time that it has joined the network.
    own: RefCell<BTreeSet<Gid>>,
}

impl Namesakes {
    /// Opens the topic for a participant of this node.
    pub(super) fn open(
        &self,
        participant: &DomainParticipant,
    ) -> Result<SimpleDataReaderCdr<ParticipantEntitiesInfo>, OpenError> {
        self.own.borrow_mut().insert(participant.guid().into());
        let qos = (&reliable(WAITING, Durability::TransientLocal)).into();
        let kind = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_".to_owned();
        let topic = participant.create_topic(TOPIC.to_owned(), kind, &qos, TopicKind::NoKey);
        let subscriber = participant.create_subscriber(&qos).map_err(OpenError::opening(TOPIC))?;
        let topic = topic.map_err(OpenError::opening(TOPIC))?;
        subscriber.create_simple_datareader_no_key(&topic, Some(qos)).map_err(OpenError::opening(TOPIC))
    }

    /// How many there are among the participants of these writers: who was killed does not tell that it has gone. Who is not among
    /// them is forgotten only where there is no room for others: one that was out of reach for a while tells nothing anew.
    pub(super) fn among(&self, writers: impl Iterator<Item = GUID>) -> usize {
        let mut there = self.there.borrow_mut();
        if there.is_empty() {
            return 0;
        }
        let alive: BTreeSet<_> =
            writers.map(|writer| Gid::from(writer).as_bytes()[..PREFIX].to_vec()).collect();
        let is_alive = |participant: &Gid| alive.contains(&participant.as_bytes()[..PREFIX]);
        if there.len() >= MOST {
            there.retain(is_alive);
        }
        there.iter().filter(|participant| is_alive(participant)).count()
    }

    /// Takes in what a participant tells of its nodes.
    fn note(&self, name: &str, info: &ParticipantEntitiesInfo) {
        let (participant, mut there) = (info.gid(), self.there.borrow_mut());
        if !info.nodes().iter().any(|node| node.fully_qualified_name() == name) {
            there.remove(&participant);
        } else if there.len() < MOST && !self.own.borrow().contains(&participant) {
            there.insert(participant);
        }
    }
}

/// Bytes of a participant's name in the names of its readers and writers.
const PREFIX: usize = 12;

/// Reads what participants tell, until the node ends.
pub(super) async fn read(
    reader: SimpleDataReaderCdr<ParticipantEntitiesInfo>,
    namesakes: Rc<Namesakes>,
    name: String,
) -> Cow<'static, str> {
    let infos = reader.as_async_stream();
    pin_mut!(infos);
    while let Some(info) = infos.next().await {
        // What cannot be read tells of no node.
        if let Ok(info) = info {
            namesakes.note(&name, &info.into_value());
        }
    }
    TOPIC.into()
}

#[cfg(test)]
mod tests {
    use ros2_client::NodeName;
    use ros2_client::entities_info::NodeEntitiesInfo;

    use super::*;
    use crate::node::heard::tests;

    fn publisher(number: u32) -> Gid {
        tests::publisher(number).into()
    }

    fn info(participant: u32, names: &[&str]) -> ParticipantEntitiesInfo {
        let node = |name: &&str| NodeEntitiesInfo::new(NodeName::new("/robot", name).unwrap());
        ParticipantEntitiesInfo::new(publisher(participant), names.iter().map(node).collect())
    }

    #[test]
    fn a_namesake_is_counted_while_it_is_there_and_the_node_itself_is_none() {
        let namesakes = Namesakes::default();
        namesakes.own.borrow_mut().insert(publisher(1));
        let count = |there: &[u32]| namesakes.among(there.iter().map(|&number| publisher(number).into()));
        for heard in [info(1, &["cfodi"]), info(2, &["planner", "rviz"])] {
            namesakes.note("/robot/cfodi", &heard);
        }
        assert_eq!(count(&[1, 2]), 0);
        namesakes.note("/robot/cfodi", &info(3, &["planner", "cfodi"]));
        namesakes.note("/robot/cfodi", &info(3, &["planner", "cfodi"]));
        namesakes.note("/robot/cfodi", &info(4, &["cfodi"]));
        assert_eq!(count(&[1, 2, 3, 4]), 2);
        assert_eq!(count(&[1, 2, 3]), 1, "4 was killed");
        namesakes.note("/robot/cfodi", &info(3, &["planner"]));
        assert_eq!(count(&[1, 2, 3, 4]), 1);
    }

    #[test]
    fn ever_new_namesakes_are_not_remembered_without_end() {
        let namesakes = Namesakes::default();
        for number in 0..2 * MOST as u32 {
            namesakes.note("/robot/cfodi", &info(number, &["cfodi"]));
        }
        assert_eq!(namesakes.there.borrow().len(), MOST);
    }

    #[test]
    fn namesakes_that_were_killed_leave_room_for_others() {
        let namesakes = Namesakes::default();
        for number in 0..MOST as u32 {
            namesakes.note("/robot/cfodi", &info(number, &["cfodi"]));
        }
        assert_eq!(namesakes.among(std::iter::empty()), 0);
        let other = MOST as u32;
        namesakes.note("/robot/cfodi", &info(other, &["cfodi"]));
        assert_eq!(namesakes.among(std::iter::once(publisher(other).into())), 1);
    }
}
