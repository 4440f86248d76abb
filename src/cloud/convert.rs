//! The one loop over the points: read, judge, keep.

use super::CloudFilter;
use super::layout::{Coordinate, Layout, Precision};
use super::pinhole;
use crate::engine::Points;

/// What a message came down to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Converted {
    pub(super) points: Points,
    pub(super) invalid: u32,
    pub(super) out_of_range: u32,
}

impl Default for Converted {
    fn default() -> Self {
        Self { points: Points::F32(Vec::new()), invalid: 0, out_of_range: 0 }
    }
}

/// What becomes of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Kept,
    Invalid,
    OutOfRange,
}

/// The filter, settled for the frame at hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gate {
    min_range: f64,
    max_range: f64,
    optical: bool,
}

impl Gate {
    pub(super) fn new(filter: &CloudFilter, optical: bool) -> Self {
        Self { min_range: filter.min_range, max_range: filter.max_range, optical }
    }

    pub(super) const fn is_optical(&self) -> bool {
        self.optical
    }

    /// The nearest and the farthest that it keeps (m).
    pub(super) const fn range(&self) -> [f64; 2] {
        [self.min_range, self.max_range]
    }

    /// The nearest and the farthest depth in single precision that it keeps.
    pub(super) fn depths(&self) -> [f32; 2] {
        let [nearest, farthest] = [self.min_range, self.max_range].map(|range| range as f32);
        [
            if f64::from(nearest) < self.min_range { nearest.next_up() } else { nearest },
            if f64::from(farthest) > self.max_range { farthest.next_down() } else { farthest },
        ]
    }

    /// Whether a measured depth is in range.
    pub(super) fn keeps(&self, depth: f64) -> bool {
        self.min_range <= depth && depth <= self.max_range
    }

    /// A sensor marks "no measurement" as NaN or as the origin; in an optical frame nothing lies at or behind z = 0.
    #[inline]
    pub(super) fn judge(&self, [x, y, z]: [f64; 3]) -> Verdict {
        let finite = x.is_finite() && y.is_finite() && z.is_finite();
        let at_origin = x == 0.0 && y == 0.0 && z == 0.0;
        if !finite || at_origin || (self.optical && z <= 0.0) {
            return Verdict::Invalid;
        }
        let range = if self.optical { z } else { (x * x + y * y + z * z).sqrt() };
        if self.min_range <= range && range <= self.max_range { Verdict::Kept } else { Verdict::OutOfRange }
    }
}

/// Converts by the fast path where it applies, else by the plain one.
pub(super) fn convert(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    convert_fast(layout, data, gate).unwrap_or_else(|| convert_plain(layout, data, gate))
}

/// Little-endian single precision, what every Kinect driver sends; `None` for any other layout.
pub(super) fn convert_fast(layout: &Layout, data: &[u8], gate: &Gate) -> Option<Converted> {
    if layout.is_bigendian || !all_single(layout) {
        return None;
    }
    pinhole::depths(layout, data, gate).or_else(|| Some(convert_list(layout, data, gate)))
}

/// The same as a list of points.
pub(super) fn convert_list(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let [x, y, z] = layout.coordinates.map(|coordinate| coordinate.offset);
    let gathered = gather(layout, data, gate, |point| [f32_at(point, x), f32_at(point, y), f32_at(point, z)]);
    gathered.into_converted(Points::F32)
}

/// Any layout.
pub(super) fn convert_plain(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let read =
        |point: &[u8]| layout.coordinates.map(|coordinate| coordinate.read(point, layout.is_bigendian));
    if all_single(layout) {
        // Widened by `read`, so narrowing gives the sender's own bits back.
        gather(layout, data, gate, |point| read(point).map(|value| value as f32)).into_converted(Points::F32)
    } else {
        gather(layout, data, gate, read).into_converted(Points::F64)
    }
}

fn all_single(layout: &Layout) -> bool {
    layout.coordinates.iter().all(|coordinate| coordinate.precision == Precision::Single)
}

/// [`Converted`] before its precision is forgotten.
pub(super) struct Gathered<T> {
    points: Vec<[T; 3]>,
    invalid: u32,
    out_of_range: u32,
}

impl<T> Gathered<T> {
    /// None yet, with room for `points`.
    pub(super) fn with_capacity(points: usize) -> Self {
        Self { points: Vec::with_capacity(points), invalid: 0, out_of_range: 0 }
    }

    #[inline]
    pub(super) fn take(&mut self, point: [T; 3], verdict: Verdict) {
        match verdict {
            Verdict::Kept => self.points.push(point),
            Verdict::Invalid => self.invalid += 1,
            Verdict::OutOfRange => self.out_of_range += 1,
        }
    }

    pub(super) fn into_converted(self, wrap: impl Fn(Vec<[T; 3]>) -> Points) -> Converted {
        Converted { points: wrap(self.points), invalid: self.invalid, out_of_range: self.out_of_range }
    }
}

/// Takes every point of `data` through `read` and the gate.
#[inline]
fn gather<T: Copy + Into<f64>>(
    layout: &Layout,
    data: &[u8],
    gate: &Gate,
    read: impl Fn(&[u8]) -> [T; 3],
) -> Gathered<T> {
    // The layout fits the data, so this is at most three times the message.
    let mut gathered = Gathered::with_capacity(layout.len());
    for row in layout.rows(data) {
        for bytes in row.chunks_exact(layout.point_step) {
            let point = read(bytes);
            gathered.take(point, gate.judge(point.map(Into::into)));
        }
    }
    gathered
}

impl Coordinate {
    /// The value in `point`, widened without loss.
    fn read(self, point: &[u8], is_bigendian: bool) -> f64 {
        match (self.precision, is_bigendian) {
            (Precision::Single, false) => bytes_at(point, self.offset).map(f32::from_le_bytes).map(f64::from),
            (Precision::Single, true) => bytes_at(point, self.offset).map(f32::from_be_bytes).map(f64::from),
            (Precision::Double, false) => bytes_at(point, self.offset).map(f64::from_le_bytes),
            (Precision::Double, true) => bytes_at(point, self.offset).map(f64::from_be_bytes),
        }
        .unwrap_or(f64::NAN)
    }
}

/// A little-endian `f32`; NaN, and so invalid, past the end, where no checked layout reaches.
#[inline]
fn f32_at(point: &[u8], offset: usize) -> f32 {
    bytes_at(point, offset).map_or(f32::NAN, f32::from_le_bytes)
}

#[inline]
fn bytes_at<const N: usize>(point: &[u8], offset: usize) -> Option<[u8; N]> {
    point.get(offset..)?.first_chunk().copied()
}
