//! Channels of a result for messages of the input: each as it was offered, but for static transforms of which that is not known.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use mcap::Writer;
use mcap::write::NoSeek;

use super::decode::is_transforms;
use super::qos::{in_words, offered};
use super::write::schema;
use crate::msg::heard::TF_STATIC;
use crate::msg::topic::Qos;
use crate::msg::types::{CAMERA_INFO, TRANSFORMS};

/// How a channel was offered, in its metadata.
pub(super) const OFFERED: &str = "offered_qos_profiles";

/// How static transforms are offered, which a listener asks for: a player takes what it is not told for volatile. All messages of a
/// recording come from this one publisher, and none of its publishers' may push out that of another.
const STATIC: Qos = TF_STATIC.qos;

/// One for all channels of the input that say the same of their messages: a recording in several files has one in each.
#[derive(Default)]
pub(super) struct Copies(Vec<(Arc<mcap::Channel<'static>>, u16)>);

impl Copies {
    /// The channel of the result for messages of this one.
    pub(super) fn of<W: Write>(
        &mut self,
        input: &Arc<mcap::Channel<'static>>,
        writer: &mut Writer<NoSeek<W>>,
    ) -> io::Result<u16> {
        let known = self.0.iter().find(|(known, _)| Arc::ptr_eq(known, input));
        let known = known.or_else(|| self.0.iter().find(|(known, _)| are_alike(known, input)));
        if let Some((_, id)) = known {
            return Ok(*id);
        }
        let id = open(writer, input)?;
        self.0.push((Arc::clone(input), id));
        Ok(id)
    }
}

/// Whether what reads messages of one channel reads those of the other.
fn are_alike(a: &mcap::Channel<'_>, b: &mcap::Channel<'_>) -> bool {
    let are_defined_alike = match (&a.schema, &b.schema) {
        (Some(a), Some(b)) => (&a.name, &a.encoding, &a.data) == (&b.name, &b.encoding, &b.data),
        (a, b) => a.is_none() && b.is_none(),
    };
    are_defined_alike && a.topic == b.topic && a.message_encoding == b.message_encoding
}

/// Whether transforms on a topic of this name hold for all time.
fn is_static(topic: &str) -> bool {
    topic.rsplit('/').next() == Some("tf_static")
}

/// A channel like that of the input. Transforms and intrinsics get the definitions of ROS 2, whose layout theirs is: what
/// has come from ROS 1 still carries other names, which readers refuse.
fn open<W: Write>(writer: &mut Writer<NoSeek<W>>, input: &mcap::Channel<'static>) -> io::Result<u16> {
    let name = input.schema.as_ref().map_or("", |schema| schema.name.as_str());
    let known =
        if is_transforms(name) { Some(TRANSFORMS) } else { Some(name).filter(|name| *name == CAMERA_INFO) };
    let schema = match (known, &input.schema) {
        (Some(known), _) => schema(writer, known)?,
        (None, Some(own)) => {
            writer.add_schema(&own.name, &own.encoding, &own.data).map_err(io::Error::other)?
        }
        (None, None) => 0,
    };
    let mut metadata: BTreeMap<_, _> = input
        .metadata
        .iter()
        .map(|(key, value)| {
            let value = if key == OFFERED { in_words(value) } else { value.clone() };
            (key.clone(), value)
        })
        .collect();
    let is_unknown = metadata.get(OFFERED).is_none_or(|profiles| ["", "[]"].contains(&profiles.trim()));
    if is_unknown && is_transforms(name) && is_static(&input.topic) {
        metadata.insert(OFFERED.to_owned(), offered(STATIC));
    }
    writer.add_channel(schema, &input.topic, &input.message_encoding, &metadata).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::super::write::writer;
    use super::*;

    /// How a channel of this topic and type is offered in the result.
    fn copied(topic: &str, type_name: &str, profiles: Option<&str>) -> Option<String> {
        let schema = mcap::Schema {
            id: 1,
            name: type_name.to_owned(),
            encoding: "ros2msg".to_owned(),
            data: Cow::Borrowed(&[]),
        };
        let input = mcap::Channel {
            id: 1,
            topic: topic.to_owned(),
            schema: Some(Arc::new(schema)),
            message_encoding: "cdr".to_owned(),
            metadata: profiles.map(|text| (OFFERED.to_owned(), text.to_owned())).into_iter().collect(),
        };
        let mut result = writer(Vec::new(), "a test").unwrap();
        open(&mut result, &input).unwrap();
        result.finish().unwrap();
        let summary = mcap::Summary::read(&result.into_inner().into_inner()).unwrap().unwrap();
        summary.channels.values().next().unwrap().metadata.get(OFFERED).cloned()
    }

    #[test]
    fn static_transforms_are_offered_to_late_listeners_where_the_bag_does_not_say_how_they_were() {
        for topic in ["/tf_static", "tf_static", "/robot1/tf_static"] {
            for type_name in [TRANSFORMS, "tf/msg/tfMessage"] {
                for none in [None, Some(""), Some("[]"), Some("\n")] {
                    assert_eq!(copied(topic, type_name, none), Some(offered(STATIC)), "{topic} {none:?}");
                }
            }
        }
        let known = offered(Qos::latched(1));
        assert_eq!(copied("/tf_static", TRANSFORMS, Some(&known)), Some(known));
        assert_eq!(copied("/tf", TRANSFORMS, None), None);
        assert_eq!(copied("/tf_static", "std_msgs/msg/String", Some("")), Some(String::new()));
    }
}
