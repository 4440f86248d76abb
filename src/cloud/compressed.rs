//! From a compressed depth image (`sensor_msgs/CompressedImage`) and its camera to points.
//!
//! What `image_transport` calls `compressedDepth` is a PNG behind twelve bytes: a number for the kind of compression
//! and two parameters a, b. A PNG of `16UC1` holds millimetres; a PNG of `32FC1` holds inverse depths,
//! z = a / (raw - b). What it calls `compressed` is a bare PNG. Two bytes a pixel are taken to unpack it, once its size is
//! known to be the camera's.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, DecodingError};
use serde::de::SeqAccess;

use super::depth::{Coding, Pixels, check_count};
use super::seed::{DepthImage, ImageSeed, lent, next};
use super::{Camera, Cloud, CloudError, CloudFilter, Decoded, layout};
use crate::msg::ros::{CompressedImage, Header};

/// Bytes before a compressedDepth image: i32 kind, f32 a, f32 b, in the order of the machines that ROS runs on.
const HEADER: usize = 12;

/// The valid points in range of a compressed depth image in memory.
///
/// # Errors
///
/// A [`CloudError`] where the image is no PNG of depths, is not the camera's, or exceeds a bound; never
/// [`CloudError::Undecodable`].
pub fn decode_compressed(image: &CompressedImage, camera: &Camera, filter: &CloudFilter) -> Decoded {
    cloud_from(&image.header, &image.format, &image.data, camera, filter)
}

/// Reads one serialised `sensor_msgs/CompressedImage` and gives what [`decode_compressed`] gives, without a copy.
pub type CompressedSeed = ImageSeed<CompressedImage>;

impl DepthImage for CompressedImage {
    const NAME: &str = "CompressedImage";
    const FIELDS: &[&str] = &["header", "format", "data"];

    fn read<'de, A: SeqAccess<'de>>(
        mut seq: A,
        camera: &Camera,
        filter: &CloudFilter,
    ) -> Result<Decoded, A::Error> {
        let header: Header = next(&mut seq)?;
        let format: String = next(&mut seq)?;
        lent(&mut seq, |data| cloud_from(&header, &format, data, camera, filter))
    }
}

/// What both ways in come down to.
fn cloud_from(header: &Header, format: &str, data: &[u8], camera: &Camera, filter: &CloudFilter) -> Decoded {
    let stamp = layout::stamp(header)?;
    let frame_id = layout::frame_id(header)?;
    let refused = || CloudError::UnknownFormat { format: layout::shown(format) };
    let (coding, png) = match Packing::of(format).ok_or_else(refused)? {
        Packing::Bare => (Coding::Millimetres, data),
        Packing::Millimetres => (Coding::Millimetres, split(data)?.1),
        Packing::Inverse => {
            let ([a, b], png) = split(data)?;
            (Coding::Inverse { a, b }, png)
        }
    };
    let (pixels, bytes) = unpack(png, coding, format, camera, filter.max_points)?;
    Ok(Cloud::new(stamp, frame_id, pixels.project(&bytes, camera, filter)?))
}

/// How a PNG holds depths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    /// Millimetres, without a header.
    Bare,
    /// Millimetres behind a header.
    Millimetres,
    /// Inverse depths, whose parameters stand in the header.
    Inverse,
}

impl Packing {
    /// What `format` announces, as `image_transport` and its older versions write it; `None` where it is not read.
    fn of(format: &str) -> Option<Self> {
        let (encoding, transport) = match format.split_once(';') {
            Some((encoding, transport)) => (encoding.trim(), transport.trim()),
            None if format.trim() == "png" => return Some(Self::Bare),
            None => (format.trim(), "compressedDepth"),
        };
        match (encoding, transport) {
            ("16UC1" | "mono16", "compressedDepth" | "compressedDepth png") => Some(Self::Millimetres),
            ("32FC1", "compressedDepth" | "compressedDepth png") => Some(Self::Inverse),
            ("16UC1" | "mono16", _) if transport.starts_with("png compressed") => Some(Self::Bare),
            _ => None,
        }
    }
}

/// The parameters a and b, and the PNG behind them.
fn split(data: &[u8]) -> Result<([f32; 2], &[u8]), CloudError> {
    let short = CloudError::ShortHeader { needed: HEADER, got: data.len() };
    let Some((header, png)) = data.split_first_chunk::<HEADER>() else { return Err(short) };
    let [_, _, _, _, a @ .., _, _, _, _] = *header;
    let [_, _, _, _, _, _, _, _, b @ ..] = *header;
    Ok(([f32::from_le_bytes(a), f32::from_le_bytes(b)], png))
}

/// The pixels of a PNG that is the camera's depth image; its size is known before memory is taken for them.
fn unpack(
    png: &[u8],
    coding: Coding,
    format: &str,
    camera: &Camera,
    max_points: u32,
) -> Result<(Pixels, Vec<u8>), CloudError> {
    let unreadable =
        |error: DecodingError| CloudError::Png(error.to_string().escape_debug().take(100).collect());
    let mut decoder = Decoder::new(Cursor::new(png));
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(unreadable)?;
    let (width, height) = (info.width, info.height);
    if (info.color_type, info.bit_depth) != (ColorType::Grayscale, BitDepth::Sixteen) {
        let kind = format!("{:?} in {:?} bits", info.color_type, info.bit_depth);
        return Err(CloudError::PngKind { format: layout::shown(format), kind });
    }
    check_count(width, height, camera, max_points)?;
    let mut reader = decoder.read_info().map_err(unreadable)?;
    if reader.info().is_animated() {
        return Err(CloudError::Png("it is animated".to_owned()));
    }
    // As large as `check_count` allows: the PNG's kind is known.
    let mut bytes = vec![0; reader.output_buffer_size().unwrap_or(0)];
    let step = reader.next_frame(&mut bytes).map_err(unreadable)?.line_size as u32;
    // The samples of a PNG are big-endian.
    Ok((Pixels { coding, is_bigendian: true, width, height, step }, bytes))
}
