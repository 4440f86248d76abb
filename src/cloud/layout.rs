//! From what a message says about its points to a layout that is known to lie inside the data.

use std::slice::ChunksExact;

use super::CloudError;
use crate::engine::Stamp;
use crate::msg::ros::{Header, MAX_FRAME_ID_BYTES, PointCloud2, PointField};

/// Most fields of a point; drivers send 3 to 9.
pub const MAX_FIELDS: usize = 64;

/// Longest part of a name that goes into an error (characters).
const NAME_SHOWN: usize = 32;

/// All of a `sensor_msgs/PointCloud2` but its data, unchecked.
pub(super) struct Description<'a> {
    pub(super) header: &'a Header,
    pub(super) height: u32,
    pub(super) width: u32,
    /// The fields, or the first of them where there are more than [`MAX_FIELDS`].
    pub(super) fields: &'a [PointField],
    /// The number of fields in the message.
    pub(super) field_count: usize,
    pub(super) is_bigendian: bool,
    pub(super) point_step: u32,
    pub(super) row_step: u32,
}

/// The header's stamp.
pub(super) fn stamp(header: &Header) -> Result<Stamp, CloudError> {
    let time = header.stamp;
    time.stamp().ok_or(CloudError::BadStamp { nanosec: time.nanosec })
}

/// The header's frame: there, and not endless.
pub(super) fn frame_id(header: &Header) -> Result<&str, CloudError> {
    let name = header.frame_id.as_str();
    match name.len() {
        0 => Err(CloudError::EmptyFrameId),
        bytes if bytes > MAX_FRAME_ID_BYTES => {
            Err(CloudError::LongFrameId { bytes, max: MAX_FRAME_ID_BYTES })
        }
        _ => Ok(name),
    }
}

impl<'a> Description<'a> {
    /// That of a message in memory.
    pub(super) fn of(message: &'a PointCloud2) -> Self {
        Self {
            header: &message.header,
            height: message.height,
            width: message.width,
            fields: &message.fields,
            field_count: message.fields.len(),
            is_bigendian: message.is_bigendian,
            point_step: message.point_step,
            row_step: message.row_step,
        }
    }

    /// Where the coordinate `field` lies in a point.
    fn coordinate(&self, field: &'static str) -> Result<Coordinate, CloudError> {
        let mut found = self.fields.iter().filter(|candidate| candidate.name == field);
        let Some(first) = found.next() else {
            return Err(CloudError::MissingField { field, present: all_shown(self.fields) });
        };
        let others = found.count();
        if others > 0 {
            return Err(CloudError::DuplicateField { field, times: others + 1 });
        }
        let precision = match first.datatype {
            PointField::FLOAT32 => Precision::Single,
            PointField::FLOAT64 => Precision::Double,
            datatype => return Err(CloudError::FieldType { field, datatype }),
        };
        let end = u64::from(first.offset) + precision.bytes();
        if end > u64::from(self.point_step) {
            return Err(CloudError::FieldOutsidePoint { field, end, point_step: self.point_step });
        }
        Ok(Coordinate { offset: first.offset as usize, precision })
    }
}

/// A name for an error, escaped and shortened: it comes from outside and goes into a log.
pub(super) fn shown(name: &str) -> String {
    name.escape_debug().take(NAME_SHOWN).collect()
}

fn all_shown(fields: &[PointField]) -> String {
    let names: Vec<String> = fields.iter().map(|field| shown(&field.name)).collect();
    names.join(", ")
}

/// How a coordinate is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// FLOAT32.
    Single,
    /// FLOAT64.
    Double,
}

impl Precision {
    const fn bytes(self) -> u64 {
        match self {
            Self::Single => 4,
            Self::Double => 8,
        }
    }
}

/// A coordinate inside a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Coordinate {
    /// Bytes from the start of the point.
    pub(super) offset: usize,
    pub(super) precision: Precision,
}

/// A layout that fits its data: `height` rows of `row_step` bytes, the points in the first `row_bytes` of each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// x, y, z; each ends within `point_step`.
    pub(super) coordinates: [Coordinate; 3],
    pub(super) is_bigendian: bool,
    /// At least 4.
    pub(super) point_step: usize,
    /// A multiple of `point_step`, at most `row_step`.
    row_bytes: usize,
    row_step: usize,
    height: usize,
}

impl Layout {
    /// The layout of a message with `data_len` bytes of data, or `None` where it holds no point.
    pub(super) fn check(
        description: &Description<'_>,
        data_len: usize,
        max_points: u32,
    ) -> Result<Option<Self>, CloudError> {
        let &Description { height, width, point_step, row_step, field_count, .. } = description;
        if height == 0 || width == 0 {
            return Ok(None);
        }
        let points = u64::from(height) * u64::from(width);
        if points > u64::from(max_points) {
            return Err(CloudError::TooManyPoints { points, max: max_points });
        }
        if field_count > MAX_FIELDS {
            return Err(CloudError::TooManyFields { fields: field_count, max: MAX_FIELDS });
        }
        if point_step == 0 {
            return Err(CloudError::ZeroPointStep);
        }
        let coordinates =
            [description.coordinate("x")?, description.coordinate("y")?, description.coordinate("z")?];
        let row_bytes = u64::from(width) * u64::from(point_step);
        // Nothing follows a single row: drivers leave its step at 0.
        let step = if height == 1 { row_bytes } else { u64::from(row_step) };
        if step < row_bytes {
            return Err(CloudError::ShortRowStep { row_step, needed: row_bytes });
        }
        let needed = u64::from(height) * step;
        if (data_len as u64) < needed {
            return Err(CloudError::ShortData { needed, got: data_len });
        }
        Ok(Some(Self {
            coordinates,
            is_bigendian: description.is_bigendian,
            point_step: point_step as usize,
            row_bytes: row_bytes as usize,
            row_step: step as usize,
            height: height as usize,
        }))
    }

    /// Points in a row, and rows.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.row_bytes / self.point_step, self.height]
    }

    /// The number of points.
    pub(super) fn len(&self) -> usize {
        self.height * (self.row_bytes / self.point_step)
    }

    /// Whether x, y and z stand first in a point, in single precision.
    pub(super) fn is_at_front(&self) -> bool {
        let is_at = |(coordinate, at): (&Coordinate, usize)| {
            coordinate.offset == at && coordinate.precision == Precision::Single
        };
        self.coordinates.iter().zip([0, 4, 8]).all(is_at)
    }

    /// Of each row the bytes of its points.
    pub(super) fn points<'a>(&self, data: &'a [u8]) -> impl Iterator<Item = ChunksExact<'a, u8>> {
        let point_step = self.point_step;
        self.rows(data).map(move |row| row.chunks_exact(point_step))
    }

    /// The rows of `data` without their padding; each is a whole number of points.
    pub(super) fn rows<'a>(&self, data: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        let row_bytes = self.row_bytes;
        data.chunks_exact(self.row_step).take(self.height).map(move |row| &row[..row_bytes])
    }
}
