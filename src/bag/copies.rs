//! Channels of a result for messages of the input.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;

use mcap::Writer;
use mcap::write::NoSeek;

use super::decode::is_transforms;
use super::qos::in_words;
use super::write::schema;
use crate::msg::types::{CAMERA_INFO, TRANSFORMS};

/// How a channel was offered, in its metadata.
const OFFERED: &str = "offered_qos_profiles";

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
    let metadata: BTreeMap<_, _> = input
        .metadata
        .iter()
        .map(|(key, value)| {
            let value = if key == OFFERED { in_words(value) } else { value.clone() };
            (key.clone(), value)
        })
        .collect();
    writer.add_channel(schema, &input.topic, &input.message_encoding, &metadata).map_err(io::Error::other)
}
