//! A cloud, or a depth image, straight from its serialised form: the points are converted where they lie in the receive buffer.
//!
//! `sensor_msgs/PointCloud2` is read in the order of its `.msg` file, which is all that CDR needs.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};

use super::layout::{Description, MAX_FIELDS};
use super::{Camera, CloudFilter, Decoded, cloud_from};
use crate::msg::ros::{Header, PointField};

const FIELDS: &[&str] =
    &["header", "height", "width", "fields", "is_bigendian", "point_step", "row_step", "data", "is_dense"];

/// Reads one serialised `sensor_msgs/PointCloud2` and gives what [`decode`](super::decode) gives, without a copy.
///
/// What is wrong inside a readable message comes as a [`CloudError`](super::CloudError) in the value; a message that cannot be read to
/// its end comes as the deserializer's own error.
#[derive(Clone, Copy, Debug)]
pub struct CloudSeed {
    filter: CloudFilter,
}

impl CloudSeed {
    /// A seed that takes in what `filter` lets through.
    pub fn new(filter: CloudFilter) -> Self {
        Self { filter }
    }
}

impl<'de> DeserializeSeed<'de> for CloudSeed {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_struct("PointCloud2", FIELDS, self)
    }
}

impl<'de> Visitor<'de> for CloudSeed {
    type Value = Decoded;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sensor_msgs/PointCloud2")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
        let header: Header = next(&mut seq)?;
        let height = next(&mut seq)?;
        let width = next(&mut seq)?;
        let fields: Fields = next(&mut seq)?;
        let description = Description {
            header: &header,
            height,
            width,
            fields: &fields.first,
            field_count: fields.count,
            is_bigendian: next(&mut seq)?,
            point_step: next(&mut seq)?,
            row_step: next(&mut seq)?,
        };
        let cloud = lent(&mut seq, |data| cloud_from(&description, data, &self.filter))?;
        // `is_dense` is not relied on, yet a message without it was cut.
        let _all_finite: bool = next(&mut seq)?;
        Ok(cloud)
    }
}

/// A message that holds a depth image.
pub(super) trait DepthImage {
    /// Its type in `sensor_msgs`.
    const NAME: &str;
    /// Its fields, in the order in which [`Self::read`] takes them.
    const FIELDS: &[&str];

    /// The valid points in range of an image that is read field by field.
    fn read<'de, A: SeqAccess<'de>>(
        seq: A,
        camera: &Camera,
        filter: &CloudFilter,
    ) -> Result<Decoded, A::Error>;
}

/// Reads one serialised depth image, a `sensor_msgs/Image` or a `sensor_msgs/CompressedImage`, without a copy.
///
/// What is wrong inside a readable message comes as a [`CloudError`](super::CloudError) in the value; a message that cannot be read to
/// its end comes as the deserializer's own error.
#[derive(Debug)]
pub struct ImageSeed<M> {
    camera: Camera,
    filter: CloudFilter,
    message: PhantomData<fn() -> M>,
}

impl<M> ImageSeed<M> {
    /// A seed for images of `camera` that takes in what `filter` lets through.
    pub fn new(camera: Camera, filter: CloudFilter) -> Self {
        Self { camera, filter, message: PhantomData }
    }
}

impl<M> Clone for ImageSeed<M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for ImageSeed<M> {}

impl<'de, M: DepthImage> DeserializeSeed<'de> for ImageSeed<M> {
    type Value = Decoded;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_struct(M::NAME, M::FIELDS, self)
    }
}

impl<'de, M: DepthImage> Visitor<'de> for ImageSeed<M> {
    type Value = Decoded;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a sensor_msgs/{}", M::NAME)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Self::Value, A::Error> {
        M::read(seq, &self.camera, &self.filter)
    }
}

/// The next field of a message.
pub(super) fn next<'de, T: Deserialize<'de>, A: SeqAccess<'de>>(seq: &mut A) -> Result<T, A::Error> {
    seq.next_element()?.ok_or_else(cut)
}

/// What `convert` makes of the next field, `data`, which is not copied.
pub(super) fn lent<'de, T, A: SeqAccess<'de>>(
    seq: &mut A,
    convert: impl FnOnce(&[u8]) -> T,
) -> Result<T, A::Error> {
    seq.next_element_seed(Lent(convert))?.ok_or_else(cut)
}

fn cut<E: Error>() -> E {
    E::custom("the message ends before its last field")
}

/// The first [`MAX_FIELDS`] fields and the number of all: a hostile count costs reading, not memory.
struct Fields {
    first: Vec<PointField>,
    count: usize,
}

impl<'de> Deserialize<'de> for Fields {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(FieldsVisitor)
    }
}

struct FieldsVisitor;

impl<'de> Visitor<'de> for FieldsVisitor {
    type Value = Fields;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sequence of sensor_msgs/PointField")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Fields, A::Error> {
        let mut fields = Fields { first: Vec::new(), count: 0 };
        while let Some(field) = seq.next_element()? {
            fields.count += 1;
            if fields.first.len() < MAX_FIELDS {
                fields.first.push(field);
            }
        }
        Ok(fields)
    }
}

/// Gives the bytes of `data` to a function while the deserializer lends them.
struct Lent<F>(F);

impl<'de, T, F: FnOnce(&[u8]) -> T> DeserializeSeed<'de> for Lent<F> {
    type Value = T;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<T, D::Error> {
        deserializer.deserialize_bytes(self)
    }
}

impl<'de, T, F: FnOnce(&[u8]) -> T> Visitor<'de> for Lent<F> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the bytes of the data")
    }

    fn visit_borrowed_bytes<E: Error>(self, data: &'de [u8]) -> Result<T, E> {
        self.visit_bytes(data)
    }

    fn visit_bytes<E: Error>(self, data: &[u8]) -> Result<T, E> {
        Ok(self.0(data))
    }
}
