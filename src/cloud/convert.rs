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
enum Verdict {
    Kept,
    Invalid,
    OutOfRange,
}

/// Points that are kept together before they are added to the others.
const BATCH: usize = 256;

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
    #[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
    fn judge(&self, [x, y, z]: [f64; 3]) -> Verdict {
        let is_finite = x.is_finite() & y.is_finite() & z.is_finite();
        let at_origin = (x == 0.0) & (y == 0.0) & (z == 0.0);
        let is_valid = is_finite & !at_origin & (!self.optical | (z > 0.0));
        let range = if self.optical { z } else { (x * x + y * y + z * z).sqrt() };
        let is_in_range = (self.min_range <= range) & (range <= self.max_range);
        match (is_valid, is_in_range) {
            (false, _) => Verdict::Invalid,
            (true, false) => Verdict::OutOfRange,
            (true, true) => Verdict::Kept,
        }
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
    Some(pinhole::depths(layout, data, gate).unwrap_or_else(|| convert_list(layout, data, gate)))
}

/// The same as a list of points.
pub(super) fn convert_list(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    match (layout.is_at_front(), layout.point_step) {
        (true, 16) => list_of::<16>(layout, data, gate),
        (true, 32) => list_of::<32>(layout, data, gate),
        _ => {
            let [x, y, z] = layout.coordinates.map(|coordinate| coordinate.offset);
            let read = |point: &[u8]| [f32_at(point, x), f32_at(point, y), f32_at(point, z)];
            gather(layout.points(data).map(read), layout.len(), gate, Points::F32)
        }
    }
}

/// The same of points of N bytes, x, y and z first: what is known when it is compiled need not be asked of each point.
fn list_of<const N: usize>(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let points = layout.rows(data).flat_map(|row| row.as_chunks::<N>().0).map(front);
    gather(points, layout.len(), gate, Points::F32)
}

/// Any layout.
pub(super) fn convert_plain(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let read =
        |point: &[u8]| layout.coordinates.map(|coordinate| coordinate.read(point, layout.is_bigendian));
    let points = layout.points(data).map(read);
    if all_single(layout) {
        // Widened by `read`, so narrowing gives the sender's own bits back.
        let points = points.map(|point| point.map(|value| value as f32));
        gather(points, layout.len(), gate, Points::F32)
    } else {
        gather(points, layout.len(), gate, Points::F64)
    }
}

/// The first three numbers of a point; NaN, and so invalid, past its end.
#[inline(always)]
pub(super) fn front<const N: usize>(point: &[u8; N]) -> [f32; 3] {
    [0, 4, 8].map(|at| {
        let bytes = point.get(at..).and_then(|bytes| bytes.first_chunk());
        bytes.map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes))
    })
}

fn all_single(layout: &Layout) -> bool {
    layout.coordinates.iter().all(|coordinate| coordinate.precision == Precision::Single)
}

/// Takes `count` points, or fewer, through the gate.
#[inline(always)]
fn gather<T: Copy + Default + Into<f64>>(
    points: impl Iterator<Item = [T; 3]>,
    count: usize,
    gate: &Gate,
    wrap: impl Fn(Vec<[T; 3]>) -> Points,
) -> Converted {
    // The layout fits the data, so this is at most three times the message.
    let mut all = Vec::with_capacity(count);
    let (mut invalid, mut out_of_range) = (0, 0);
    let (mut batch, mut kept) = ([[T::default(); 3]; BATCH], 0);
    points.for_each(|point| {
        let verdict = gate.judge(point.map(Into::into));
        // Written without asking, and overwritten where it is not kept: a branch costs more.
        batch[kept] = point;
        kept += usize::from(verdict == Verdict::Kept);
        invalid += u32::from(verdict == Verdict::Invalid);
        out_of_range += u32::from(verdict == Verdict::OutOfRange);
        if kept == BATCH {
            all.extend_from_slice(&batch);
            kept = 0;
        }
    });
    all.extend_from_slice(&batch[..kept]);
    Converted { points: wrap(all), invalid, out_of_range }
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
