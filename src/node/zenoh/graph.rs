//! Who else is in the domain, by the tokens that `rmw_zenoh` and the node declare.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use zenoh::pubsub::Subscriber;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait as _};

use super::names::{self, NodeToken};
use crate::args::Setup;
use crate::node::middleware::OpenError;
use crate::node::transport::{Form, SensorTopics, Source};

/// Publishers of others that are remembered: anyone may declare as many as it likes.
const SOURCES: usize = 4096;

/// Nodes of one's own name that are remembered.
const NAMESAKES: usize = 1000;

/// What has been told so far; Zenoh's threads tell it.
#[derive(Clone, Default)]
pub(super) struct Graph(Arc<Mutex<Told>>);

#[derive(Default)]
struct Told {
    /// Publishers by their tokens' keys.
    sources: BTreeMap<String, Source>,
    /// Keys of other nodes of this node's name.
    namesakes: BTreeSet<String>,
}

impl Graph {
    /// Every topic that another publishes now, by name.
    pub(super) fn sources(&self) -> Vec<Source> {
        let mut sources: Vec<_> = self.told().sources.values().cloned().collect();
        sources.sort();
        sources.dedup();
        sources
    }

    /// How many other nodes have the name of this one.
    pub(super) fn namesakes(&self) -> usize {
        self.told().namesakes.len()
    }

    /// Hears of this node's domain until what this gives is dropped.
    pub(super) fn read(
        &self,
        session: &Session,
        setup: &Setup,
        node: NodeToken,
    ) -> Result<Subscriber<()>, OpenError> {
        let (graph, inputs) = (self.clone(), setup.sensor_topics()?);
        let note = move |sample: Sample| {
            let is_there = sample.kind() == SampleKind::Put;
            graph.told().note(sample.key_expr().as_str(), is_there, &node, &inputs);
        };
        let tokens = names::tokens(setup.domain);
        let declared = session.liveliness().declare_subscriber(tokens).history(true).callback(note).wait();
        declared.map_err(OpenError::opening("the graph"))
    }

    fn told(&self) -> MutexGuard<'_, Told> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Told {
    /// Notes that a token has come or gone.
    fn note(&mut self, key: &str, is_there: bool, node: &NodeToken, inputs: &[SensorTopics]) {
        if !is_there {
            self.sources.remove(key);
            self.namesakes.remove(key);
        } else if node.has_namesake(key) && self.namesakes.len() < NAMESAKES {
            self.namesakes.insert(key.to_owned());
        } else if !node.is_own(key)
            && let Some(source) = names::source(key)
            && has_room(self.sources.len(), reads(inputs, &source.topic))
        {
            self.sources.insert(key.to_owned(), source);
        }
    }
}

fn reads(inputs: &[SensorTopics], topic: &str) -> bool {
    let mut topics = inputs.iter().flat_map(|input| Form::ALL.map(|form| input.topic(form)));
    topics.any(|of| of == Some(topic))
}

/// Whether one more publisher is remembered: a flood of others must not hide those that the node waits for.
const fn has_room(remembered: usize, is_input: bool) -> bool {
    remembered < if is_input { 2 * SOURCES } else { SOURCES }
}

#[cfg(test)]
mod tests {
    use super::super::names::Kind;
    use super::*;
    use crate::msg::sent;

    fn node(id: &str) -> NodeToken {
        NodeToken { domain: 0, id: id.to_owned(), namespace: "/robot".to_owned(), name: "cfodi".to_owned() }
    }

    #[test]
    fn other_nodes_of_the_name_are_counted_while_they_are_there() {
        let (own, mut told) = (node("a1"), Told::default());
        let elsewhere = NodeToken { namespace: "/other".to_owned(), ..node("b2") };
        let mut note = |key: &str, is_there| {
            told.note(key, is_there, &own, &[]);
            told.namesakes.len()
        };
        assert_eq!(note(&own.key(), true), 0);
        assert_eq!(note(&elsewhere.key(), true), 0);
        assert_eq!(note(&node("b2").key(), true), 1);
        assert_eq!(note(&node("b2").key(), true), 1);
        assert_eq!(note(&node("c3").key(), true), 2);
        assert_eq!(note(&node("b2").key(), false), 1);
    }

    #[test]
    fn what_the_node_publishes_itself_is_no_source() {
        let (own, mut told) = (node("a1"), Told::default());
        for from in [node("a1"), node("b2")] {
            let key = from.key_of(3, Kind::Publisher, sent::LABELLED.named(), sent::LABELLED.qos);
            told.note(&key, true, &own, &[]);
        }
        assert_eq!(told.sources.len(), 1);
    }

    #[test]
    fn a_flood_of_publishers_hides_none_that_the_node_reads() {
        assert!(has_room(SOURCES - 1, false) && !has_room(SOURCES, false));
        assert!(has_room(SOURCES, true) && !has_room(2 * SOURCES, true));
    }
}
