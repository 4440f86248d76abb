//! From the points of a cloud to a list of those to be kept: read, judge, keep. `depth` and `pinhole` have loops of their own, and
//! judge depths as it is done here.

use pulp::{Simd, WithSimd};

use super::CloudFilter;
use super::layout::{Coordinate, Layout, Precision};
use super::pinhole;
use crate::engine::Points;
use crate::engine::arch::arch;

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

/// Farthest end of a ray (m): what is beyond was measured by no sensor, or in another unit.
const FARTHEST_END: f32 = 100.0;

/// Points that are judged together.
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

    /// Whether a point is the end of a ray, too far away to be kept.
    fn is_far(&self, point: [f64; 3]) -> bool {
        let (is_valid, is_in_range) = self.judge(point);
        let [x, y, z] = point;
        let range = if self.optical { z } else { (x * x + y * y + z * z).sqrt() };
        is_valid && !is_in_range && is_end(range, self.max_range)
    }

    /// Whether a point is one, and whether it is in range if so. A sensor marks "no measurement" as NaN or as the origin; in
    /// an optical frame nothing lies at or behind z = 0.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
    fn judge(&self, [x, y, z]: [f64; 3]) -> (bool, bool) {
        let is_finite = x.is_finite() & y.is_finite() & z.is_finite();
        let at_origin = (x == 0.0) & (y == 0.0) & (z == 0.0);
        let is_valid = is_finite & !at_origin & (!self.optical | (z > 0.0));
        let range = if self.optical { z } else { (x * x + y * y + z * z).sqrt() };
        (is_valid, (self.min_range <= range) & (range <= self.max_range))
    }
}

/// Whether a measurement that is `range` away is the end of a ray beyond what is kept.
#[inline(always)]
fn is_end<T: Copy + PartialOrd + From<f32>>(range: T, farthest: T) -> bool {
    (range > farthest) & (range <= FARTHEST_END.into())
}

/// A depth as [`Depths`](crate::engine::Depths) has it, and whether it was measured, and kept: itself where it is kept, its
/// negative at the end of a ray beyond, infinity elsewhere.
#[inline(always)]
#[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
pub(super) fn judged(depth: f32, [nearest, farthest]: [f32; 2]) -> (f32, bool, bool) {
    let is_measured = (depth > 0.0) & (depth < f32::INFINITY);
    let is_kept = is_measured & (depth >= nearest) & (depth <= farthest);
    let other = if is_measured & is_end(depth, farthest) { -depth } else { f32::INFINITY };
    (if is_kept { depth } else { other }, is_measured, is_kept)
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

/// A cloud in little-endian single precision as a list of points.
pub(super) fn convert_list(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    match (layout.is_at_front(), layout.point_step) {
        (true, 16) => list_of::<16>(layout, data, gate),
        (true, 32) => list_of::<32>(layout, data, gate),
        _ => {
            let [x, y, z] = layout.coordinates.map(|coordinate| coordinate.offset);
            let read = |point: &[u8]| [f32_at(point, x), f32_at(point, y), f32_at(point, z)];
            gather(layout.points(data).map(|row| row.map(read)), layout.len(), gate, (single, true))
        }
    }
}

/// A list of points from points of N bytes, x, y and z first: what is known when it is compiled need not be asked of each point.
fn list_of<const N: usize>(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let rows = layout.rows(data).map(|row| row.as_chunks::<N>().0.iter().map(front));
    gather(rows, layout.len(), gate, (single, true))
}

fn single(points: Vec<[f32; 3]>, ends: Vec<[f32; 3]>) -> Points {
    if ends.is_empty() { Points::F32(points) } else { Points::Ended { points, ends } }
}

/// Without the ends of rays: clouds in double precision are of frames far away, whose origin is not where the sensor stood.
fn double(points: Vec<[f64; 3]>, _: Vec<[f64; 3]>) -> Points {
    Points::F64(points)
}

/// Any layout.
pub(super) fn convert_plain(layout: &Layout, data: &[u8], gate: &Gate) -> Converted {
    let read =
        |point: &[u8]| layout.coordinates.map(|coordinate| coordinate.read(point, layout.is_bigendian));
    let rows = layout.points(data);
    if all_single(layout) {
        // Widened by `read`, so narrowing gives the sender's own bits back.
        let narrow = |point: &[u8]| read(point).map(|value| value as f32);
        gather(rows.map(|row| row.map(narrow)), layout.len(), gate, (single, true))
    } else {
        gather(rows.map(|row| row.map(read)), layout.len(), gate, (double, false))
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

/// Takes rows of `count` points in all, or fewer, through the gate.
fn gather<T: Copy + Default + Into<f64>, R: Iterator<Item = [T; 3]>>(
    rows: impl Iterator<Item = R>,
    count: usize,
    gate: &Gate,
    (wrap, keeps_ends): (impl Fn(Vec<[T; 3]>, Vec<[T; 3]>) -> Points, bool),
) -> Converted {
    // The layout fits the data, so each list is at most three times the message.
    let kept = Vec::with_capacity(count);
    let most_ends = if keeps_ends { count } else { 0 };
    let chosen = [[T::default(); 3]; BATCH];
    let gathered = Gathered { gate, most_ends, chosen, kept, far: Vec::new(), invalid: 0, out_of_range: 0 };
    let gathered = arch().dispatch(Gathering { rows, gathered });
    let Gathered { kept, far, invalid, out_of_range, .. } = gathered;
    Converted { points: wrap(kept, far), invalid, out_of_range }
}

/// Points on their way through the gate, in code for the processor at hand.
struct Gathering<'a, I, T> {
    rows: I,
    gathered: Gathered<'a, T>,
}

impl<'a, I, R, T> WithSimd for Gathering<'a, I, T>
where
    I: Iterator<Item = R>,
    R: Iterator<Item = [T; 3]>,
    T: Copy + Default + Into<f64>,
{
    type Output = Gathered<'a, T>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Gathered<'a, T> {
        let mut gathered = self.gathered;
        let (mut batch, mut count) = ([[T::default(); BATCH]; 3], 0);
        // Loops, for what is handed to an iterator's method is not compiled for the processor at hand. Of a cloud of one column
        // many rows make a batch.
        for mut row in self.rows {
            loop {
                let [xs, ys, zs] = batch.each_mut().map(|axis| axis[count..].iter_mut());
                for (((x, y), z), point) in xs.zip(ys).zip(zs).zip(&mut row) {
                    [*x, *y, *z] = point;
                    count += 1;
                }
                if count < BATCH {
                    break;
                }
                gathered.judge(&batch, std::mem::take(&mut count));
            }
        }
        gathered.judge(&batch, count);
        gathered
    }
}

struct Gathered<'a, T> {
    gate: &'a Gate,
    /// 0 where the ends of rays are of no use.
    most_ends: usize,
    /// Those that a batch is found to keep, at its front.
    chosen: [[T; 3]; BATCH],
    kept: Vec<[T; 3]>,
    far: Vec<[T; 3]>,
    invalid: u32,
    out_of_range: u32,
}

impl<T: Copy + Default + Into<f64>> Gathered<'_, T> {
    /// Takes over those of the first `count` points of a batch that are to be kept.
    #[inline(always)]
    fn judge(&mut self, [xs, ys, zs]: &[[T; BATCH]; 3], count: usize) {
        let mut keeps = [0_u32; BATCH];
        let (mut valid, mut all) = (0, 0);
        for i in 0..count.min(BATCH) {
            let (is_valid, is_in_range) = self.gate.judge([xs[i], ys[i], zs[i]].map(Into::into));
            keeps[i] = u32::from(is_valid & is_in_range);
            valid += u32::from(is_valid);
            all += keeps[i];
        }
        let mut next = 0;
        for i in 0..count.min(BATCH) {
            // Written without asking, and overwritten where it is not kept: a branch costs more.
            self.chosen[next] = [xs[i], ys[i], zs[i]];
            next += keeps[i] as usize;
        }
        self.kept.extend_from_slice(&self.chosen[..next]);
        self.invalid += count as u32 - valid;
        self.out_of_range += valid - all;
        if valid > all && self.most_ends > 0 {
            self.far.reserve_exact(self.most_ends - self.far.len());
            let points = (0..count.min(BATCH)).map(|i| [xs[i], ys[i], zs[i]]);
            self.far.extend(points.filter(|point| self.gate.is_far(point.map(Into::into))));
        }
    }
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
