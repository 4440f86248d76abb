//! Lists of nodes as they are saved.

use std::fmt;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::NodeId;

/// Lists of nodes, written as a list of lists and held end to end: an empty one is a single byte of a file, and takes 4 of
/// memory, where a `Vec` takes 24. What a file claims is in memory before it is checked.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct NodeLists {
    nodes: Vec<NodeId>,
    /// Where each list ends in `nodes`.
    ends: Vec<u32>,
}

impl NodeLists {
    pub(crate) const fn len(&self) -> usize {
        self.ends.len()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &[NodeId]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.nodes[start as usize..end as usize])
    }

    fn push(&mut self, nodes: impl IntoIterator<Item = NodeId>) {
        self.nodes.extend(nodes);
        self.ends.push(self.nodes.len() as u32);
    }
}

impl<L: IntoIterator<Item = NodeId>> FromIterator<L> for NodeLists {
    fn from_iter<I: IntoIterator<Item = L>>(lists: I) -> Self {
        let mut all = Self::default();
        lists.into_iter().for_each(|nodes| all.push(nodes));
        all
    }
}

impl Serialize for NodeLists {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl<'de> Deserialize<'de> for NodeLists {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = NodeLists;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("lists of nodes")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut lists: A) -> Result<NodeLists, A::Error> {
        let mut read = NodeLists::default();
        while let Some(nodes) = lists.next_element::<Vec<NodeId>>()? {
            read.push(nodes);
            if u32::try_from(read.nodes.len()).is_err() {
                return Err(A::Error::custom("more nodes than have numbers"));
            }
        }
        Ok(read)
    }
}
