//! Publishers and readers that have found each other and do not fit: DDS lets nothing pass, and neither side is told by ROS.

use rustdds::dds::qos::QosPolicyId;
use rustdds::policy::{Durability, Reliability};
use rustdds::{DomainParticipant, QosPolicies};

/// What the node's own ends offer and ask for, by topic.
#[derive(Default)]
pub(super) struct Ends {
    offered: Vec<(String, QosPolicies)>,
    /// A topic may have several readers: one that fits is enough.
    asked: Vec<(String, QosPolicies)>,
}

impl Ends {
    /// Notes a publisher of the topic of this DDS name.
    pub(super) fn publishes(&mut self, topic: String, offered: QosPolicies) {
        self.offered.push((topic, offered));
    }

    /// Notes a reader.
    pub(super) fn reads(&mut self, topic: String, asked: QosPolicies) {
        self.asked.push((topic, asked));
    }

    /// By topic what does not fit, each said once.
    pub(super) fn mismatches(&self, participant: &DomainParticipant) -> Vec<(String, String)> {
        let readers = participant.discovered_readers();
        let heard = readers.iter().map(|reader| &reader.subscription_topic_data);
        let unheard = heard.filter_map(|reader| self.of_reader(reader.topic_name(), &reader.qos()));
        let writers = participant.discovered_writers();
        let told = writers.iter().map(|writer| &writer.publication_topic_data);
        let silent = told.filter_map(|writer| self.of_writer(writer.topic_name(), &writer.qos()));
        let mut mismatches: Vec<_> = unheard.chain(silent).collect();
        mismatches.sort();
        mismatches.dedup();
        mismatches
    }

    fn of_reader(&self, topic: &str, asked: &QosPolicies) -> Option<(String, String)> {
        let (_, offered) = self.offered.iter().find(|(name, _)| name == topic)?;
        let policy = offered.compliance_failure_wrt(asked)?;
        let (offers, asks) = (words(policy, offered), words(policy, asked));
        Some((
            ros_name(topic),
            format!("a reader asks for {asks} and gets nothing, for {offers} is what is offered"),
        ))
    }

    fn of_writer(&self, topic: &str, offered: &QosPolicies) -> Option<(String, String)> {
        let mut asked = self.asked.iter().filter(|(name, _)| name == topic).peekable();
        let (_, first) = *asked.peek()?;
        let policy = offered.compliance_failure_wrt(first)?;
        if asked.any(|(_, asked)| offered.compliance_failure_wrt(asked).is_none()) {
            return None;
        }
        let (offers, asks) = (words(policy, offered), words(policy, first));
        Some((ros_name(topic), format!("a publisher offers {offers} and is not heard, for {asks} is needed")))
    }
}

/// `rt/tf_static` is `/tf_static` to ROS.
fn ros_name(topic: &str) -> String {
    format!("/{}", topic.strip_prefix("rt/").unwrap_or(topic))
}

fn words(policy: QosPolicyId, qos: &QosPolicies) -> String {
    let words = match policy {
        QosPolicyId::Durability => match qos.durability() {
            Some(Durability::TransientLocal) => "durability transient local",
            Some(Durability::Transient | Durability::Persistent) => "durability beyond the publisher's life",
            Some(Durability::Volatile) | None => "durability volatile",
        },
        QosPolicyId::Reliability => match qos.reliability() {
            Some(Reliability::Reliable { .. }) => "reliability reliable",
            Some(Reliability::BestEffort) | None => "reliability best effort",
        },
        other => return format!("another {other:?}"),
    };
    words.to_owned()
}

#[cfg(test)]
mod tests {
    use rustdds::QosPolicyBuilder;

    use super::*;

    fn qos(is_reliable: bool, durability: Durability) -> QosPolicies {
        let max_blocking_time = rustdds::Duration::from_millis(100);
        let reliability =
            if is_reliable { Reliability::Reliable { max_blocking_time } } else { Reliability::BestEffort };
        QosPolicyBuilder::new().reliability(reliability).durability(durability).build()
    }

    #[test]
    fn who_asks_for_more_than_is_offered_is_named_with_both() {
        let mut ends = Ends::default();
        ends.publishes("rt/cfodi/clusters_delta".to_owned(), qos(true, Durability::Volatile));
        let why = |asked| ends.of_reader("rt/cfodi/clusters_delta", &asked);
        assert_eq!(why(qos(true, Durability::Volatile)), None);
        assert_eq!(why(qos(false, Durability::Volatile)), None);
        let (topic, line) = why(qos(true, Durability::TransientLocal)).unwrap();
        assert_eq!(topic, "/cfodi/clusters_delta");
        assert_eq!(
            line,
            "a reader asks for durability transient local and gets nothing, for durability volatile is what is offered"
        );
        assert_eq!(ends.of_reader("rt/other", &qos(true, Durability::TransientLocal)), None);
    }

    #[test]
    fn one_reader_that_fits_a_publisher_is_enough() {
        let mut ends = Ends::default();
        ends.reads("rt/tf".to_owned(), qos(true, Durability::Volatile));
        let best_effort = qos(false, Durability::Volatile);
        let (_, line) = ends.of_writer("rt/tf", &best_effort).unwrap();
        assert_eq!(
            line,
            "a publisher offers reliability best effort and is not heard, for reliability reliable is needed"
        );
        ends.reads("rt/tf".to_owned(), best_effort.clone());
        assert_eq!(ends.of_writer("rt/tf", &best_effort), None);
    }
}
