//! From the bytes of a depth image (`sensor_msgs/Image`) and its camera to points.
//!
//! A depth image is in an optical frame (z forward, x right, y down) whatever its frame is called (REP 118), so the
//! range of a point is its z. Points are computed in single precision, as `depth_image_proc` does; the range of a
//! depth in millimetres is compared before it is rounded, so that 6000 mm is not beyond 6 m.

use std::sync::Arc;

use pulp::{Simd, WithSimd};
use serde::de::SeqAccess;

use super::convert::{Converted, Gate, judged};
use super::seed::{DepthImage, ImageSeed, lent, next};
use super::{Camera, Cloud, CloudError, CloudFilter, Decoded, layout};
use crate::engine::arch::arch;
use crate::engine::{Depths, Points};
use crate::msg::ros::{Header, Image};

/// The valid points in range of a depth image in memory.
///
/// Encodings are `16UC1` and `mono16` (mm; 0 and 65535 are invalid) and `32FC1` (m; what is not finite or not above 0
/// is invalid).
///
/// # Errors
///
/// A [`CloudError`] where the image contradicts itself or the camera, or exceeds a bound; never
/// [`CloudError::Undecodable`].
pub fn decode_depth(image: &Image, camera: &Camera, filter: &CloudFilter) -> Decoded {
    let description = Description {
        header: &image.header,
        height: image.height,
        width: image.width,
        encoding: &image.encoding,
        is_bigendian: image.is_bigendian != 0,
        step: image.step,
    };
    cloud_from(&description, &image.data, camera, filter)
}

/// Reads one serialised `sensor_msgs/Image` and gives what [`decode_depth`] gives, without a copy.
pub type DepthSeed = ImageSeed<Image>;

impl DepthImage for Image {
    const NAME: &str = "Image";
    const FIELDS: &[&str] = &["header", "height", "width", "encoding", "is_bigendian", "step", "data"];

    fn read<'de, A: SeqAccess<'de>>(
        mut seq: A,
        camera: &Camera,
        filter: &CloudFilter,
    ) -> Result<Decoded, A::Error> {
        let header: Header = next(&mut seq)?;
        let height = next(&mut seq)?;
        let width = next(&mut seq)?;
        let encoding: String = next(&mut seq)?;
        let description = Description {
            header: &header,
            height,
            width,
            encoding: &encoding,
            is_bigendian: next::<u8, _>(&mut seq)? != 0,
            step: next(&mut seq)?,
        };
        lent(&mut seq, |data| cloud_from(&description, data, camera, filter))
    }
}

/// All of a `sensor_msgs/Image` but its data, unchecked.
struct Description<'a> {
    header: &'a Header,
    height: u32,
    width: u32,
    encoding: &'a str,
    is_bigendian: bool,
    step: u32,
}

/// What both ways in come down to.
fn cloud_from(description: &Description<'_>, data: &[u8], camera: &Camera, filter: &CloudFilter) -> Decoded {
    let stamp = layout::stamp(description.header)?;
    let frame_id = layout::frame_id(description.header)?;
    let coding = match description.encoding {
        "16UC1" | "mono16" => Coding::Millimetres,
        "32FC1" => Coding::Metres,
        other => return Err(CloudError::UnknownEncoding { encoding: layout::shown(other) }),
    };
    let &Description { height, width, step, .. } = description;
    let pixels = Pixels { coding, is_bigendian: description.is_bigendian, width, height, step };
    Ok(Cloud::new(stamp, frame_id, pixels.project(data, camera, filter)?))
}

/// What the number in a pixel means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coding {
    /// 16 bits; 0 and 65535 are invalid.
    Millimetres,
    /// 32 bits, floating point (m).
    Metres,
    /// 16 bits, z = a / (number - b) (m); 0 is invalid.
    #[cfg_attr(not(feature = "bag"), expect(dead_code, reason = "compressed images only"))]
    Inverse { a: f32, b: f32 },
}

/// Millimetres in metres; NaN where there was no measurement (0 is told by its depth).
#[inline(always)]
fn from_millimetres(number: u16) -> f32 {
    if number == u16::MAX { f32::NAN } else { f32::from(number) * 0.001 }
}

#[inline(always)]
fn from_inverse(number: u16, a: f32, b: f32) -> f32 {
    if number == 0 { f32::NAN } else { a / (f32::from(number) - b) }
}

/// The depths in range: of whole millimetres those whose number is, before it is rounded to single precision.
fn range(coding: Coding, gate: &Gate) -> [f32; 2] {
    if coding != Coding::Millimetres {
        return gate.depths();
    }
    let is_kept = |number: &u16| gate.keeps(f64::from(*number) / 1000.0);
    let [first, last] = gate.range().map(|range| {
        let near = (range * 1000.0) as u16;
        near.saturating_sub(1).max(1)..=near.saturating_add(1).min(u16::MAX - 1)
    });
    [first.into_iter().find(is_kept), last.into_iter().rev().find(is_kept)]
        .map(|number| number.map_or(f32::NAN, from_millimetres))
}

/// How an image says its pixels lie, unchecked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixels {
    pub(super) coding: Coding,
    pub(super) is_bigendian: bool,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Bytes of a row.
    pub(super) step: u32,
}

impl Pixels {
    /// The points of an image that fits its data and the camera.
    pub(super) fn project(
        &self,
        data: &[u8],
        camera: &Camera,
        filter: &CloudFilter,
    ) -> Result<Converted, CloudError> {
        check_count(self.width, self.height, camera, filter.max_points)?;
        if self.width == 0 || self.height == 0 {
            return Ok(Converted::default());
        }
        let grid = Grid { row_bytes: self.check_bytes(data.len())?, step: self.step as usize, data };
        let mut range = range(self.coding, &Gate::new(filter, true));
        // Farther away x or y would be no number.
        range[1] = range[1].min(f32::MAX / camera.widest());
        let sight = Sight { camera, range, rows: self.height as usize };
        Ok(match (self.coding, self.is_bigendian) {
            (Coding::Millimetres, false) => sight.of(&grid, |b| from_millimetres(u16::from_le_bytes(b))),
            (Coding::Millimetres, true) => sight.of(&grid, |b| from_millimetres(u16::from_be_bytes(b))),
            (Coding::Metres, false) => sight.of(&grid, f32::from_le_bytes),
            (Coding::Metres, true) => sight.of(&grid, f32::from_be_bytes),
            (Coding::Inverse { a, b }, false) => {
                sight.of(&grid, |bytes| from_inverse(u16::from_le_bytes(bytes), a, b))
            }
            (Coding::Inverse { a, b }, true) => {
                sight.of(&grid, |bytes| from_inverse(u16::from_be_bytes(bytes), a, b))
            }
        })
    }

    /// The bytes of a row's pixels, once all rows are known to lie in the data.
    fn check_bytes(&self, data_len: usize) -> Result<usize, CloudError> {
        let pixel: u64 = if self.coding == Coding::Metres { 4 } else { 2 };
        let row_bytes = u64::from(self.width) * pixel;
        if u64::from(self.step) < row_bytes {
            return Err(CloudError::ShortStep { step: self.step, needed: row_bytes });
        }
        let needed = u64::from(self.height) * u64::from(self.step);
        if (data_len as u64) < needed {
            return Err(CloudError::ShortData { needed, got: data_len });
        }
        Ok(row_bytes as usize)
    }
}

/// Refuses an image that is not the camera's, or too large; nothing of it needs to have been read.
pub(super) fn check_count(
    width: u32,
    height: u32,
    camera: &Camera,
    max_points: u32,
) -> Result<(), CloudError> {
    camera.check_size(width, height)?;
    let points = u64::from(width) * u64::from(height);
    if points > u64::from(max_points) {
        return Err(CloudError::TooManyPoints { points, max: max_points });
    }
    Ok(())
}

/// Rows of `step` bytes, the pixels in the first `row_bytes` of each; they lie in the data.
struct Grid<'a> {
    row_bytes: usize,
    step: usize,
    data: &'a [u8],
}

/// Who looks, from where to where (m), and at how many rows.
struct Sight<'a> {
    camera: &'a Camera,
    range: [f32; 2],
    rows: usize,
}

impl Sight<'_> {
    /// Takes every pixel of N bytes through `read` and the gate.
    #[inline]
    fn of<const N: usize>(&self, grid: &Grid<'_>, read: impl Fn([u8; N]) -> f32) -> Converted {
        // The image fits its data, so this is at most twice the message.
        let mut depths = Vec::with_capacity(self.rows * (grid.row_bytes / N));
        let reading = Reading { sight: self, grid, read, depths: &mut depths };
        let [measured, kept] = arch().dispatch(reading);
        let invalid = depths.len() as u32 - measured;
        let depths = Depths::counted(Arc::new(self.camera.rays()), depths, kept as usize);
        debug_assert!(depths.is_some(), "the image has the camera's size");
        depths.map_or_else(Converted::default, |depths| Converted {
            points: Points::Depths(depths),
            invalid,
            out_of_range: measured - kept,
        })
    }
}

/// Pixels that are read together.
const BATCH: usize = 64;

/// All rows of an image, in code for the processor at hand.
struct Reading<'a, const N: usize, R: Fn([u8; N]) -> f32> {
    sight: &'a Sight<'a>,
    grid: &'a Grid<'a>,
    read: R,
    depths: &'a mut Vec<f32>,
}

impl<const N: usize, R: Fn([u8; N]) -> f32> WithSimd for Reading<'_, N, R> {
    /// How many were measured, and how many of them are in range.
    type Output = [u32; 2];

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> [u32; 2] {
        let (mut measured, mut kept) = (0, 0);
        let range = self.sight.range;
        for row in self.grid.data.chunks_exact(self.grid.step).take(self.sight.rows) {
            // A loop, for what is handed to an iterator's method is not compiled for the processor at hand.
            for pixels in row[..self.grid.row_bytes].as_chunks().0.chunks(BATCH) {
                let mut depths = [0.0; BATCH];
                for (bytes, place) in pixels.iter().zip(&mut depths) {
                    let (depth, is_measured, is_kept) = judged((self.read)(*bytes), range);
                    *place = depth;
                    measured += u32::from(is_measured);
                    kept += u32::from(is_kept);
                }
                self.depths.extend_from_slice(&depths[..pixels.len()]);
            }
        }
        [measured, kept]
    }
}
