//! Depth images with their camera: raw ones, and compressed ones in every format that is announced.

use byteorder::LittleEndian;
use cdr_encoding::{CdrDeserializer, from_bytes};
use cfodi::cloud::{
    Camera, Cloud, CloudError, CloudFilter, CompressedSeed, DepthSeed, decode_compressed, decode_depth,
};
use cfodi::msg::ros::{CameraInfo, CompressedImage, Header, Image, Time};
use serde::de::DeserializeSeed as _;

use super::bytes::Bytes;
use super::cloud::check;

const FILTER: CloudFilter = CloudFilter { max_points: 1 << 16, ..CloudFilter::DEFAULT };

/// The announcements of compressed images; of the last ones none is read.
const FORMATS: [&str; 8] = [
    "16UC1; compressedDepth png",
    "32FC1; compressedDepth png",
    "16UC1; compressedDepth",
    "16UC1; png compressed ",
    "png",
    "16UC1; compressedDepth rvl",
    "32FC1; compressedDepth rvl",
    "jpeg",
];

/// First the camera, then the image.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    let Some(camera) = camera(&mut bytes) else { return };
    match bytes.below(4) {
        0 => raw_cdr(bytes.rest(), camera),
        1 => compressed_cdr(bytes.rest(), camera),
        2 => raw_pixels(bytes, camera),
        _ => compressed_pixels(bytes, camera),
    }
}

fn header() -> Header {
    Header { stamp: Time { sec: 1, nanosec: 2 }, frame_id: "camera".to_owned() }
}

/// A small camera of usual numbers, or any that a serialised `CameraInfo` holds.
fn camera(bytes: &mut Bytes<'_>) -> Option<Camera> {
    let length = usize::from(bytes.byte());
    if length > 16 {
        let (info, _) = from_bytes::<CameraInfo, LittleEndian>(bytes.take(2 * length)).ok()?;
        return Camera::from_info(&info).ok();
    }
    let (width, height) = (u32::from(bytes.below(16)), u32::from(bytes.below(16)));
    let k = [500.0, 0.0, 5.0, 0.0, 500.0, 5.0, 0.0, 0.0, 1.0];
    Camera::from_info(&CameraInfo { width, height, k, ..CameraInfo::default() }).ok()
}

fn raw_cdr(cdr: &[u8], camera: Camera) {
    let seeded = DepthSeed::new(camera, FILTER).deserialize(&mut CdrDeserializer::<LittleEndian>::new(cdr));
    let owned =
        from_bytes::<Image, LittleEndian>(cdr).map(|(image, _)| decode_depth(&image, &camera, &FILTER));
    agree(seeded, owned, cdr.len());
}

fn compressed_cdr(cdr: &[u8], camera: Camera) {
    let seeded =
        CompressedSeed::new(camera, FILTER).deserialize(&mut CdrDeserializer::<LittleEndian>::new(cdr));
    let owned = from_bytes::<CompressedImage, LittleEndian>(cdr);
    agree(seeded, owned.map(|(image, _)| decode_compressed(&image, &camera, &FILTER)), 1 << 16);
}

type Decoded = Result<Cloud, CloudError>;

fn agree(seeded: cdr_encoding::Result<Decoded>, owned: cdr_encoding::Result<Decoded>, bytes: usize) {
    match (seeded, owned) {
        (Ok(seeded), Ok(owned)) => {
            assert_eq!(seeded, owned);
            check(seeded, &FILTER, bytes);
        }
        (Err(_), Err(_)) => {}
        (seeded, owned) => panic!("{seeded:?}, but {owned:?}"),
    }
}

/// Of the camera's size, so that every pixel is looked at.
fn raw_pixels(mut bytes: Bytes<'_>, camera: Camera) {
    let encoding = bytes.one_of(&["16UC1", "32FC1", "mono16"]);
    let pixel = if encoding == "32FC1" { 4 } else { 2 };
    let step = camera.width().saturating_mul(pixel).saturating_add(u32::from(bytes.below(4)));
    let image = Image {
        header: header(),
        height: camera.height(),
        width: camera.width(),
        encoding: encoding.to_owned(),
        is_bigendian: bytes.below(2),
        step,
        data: bytes.rest().to_vec(),
    };
    check(decode_depth(&image, &camera, &FILTER), &FILTER, image.data.len());
}

fn compressed_pixels(mut bytes: Bytes<'_>, camera: Camera) {
    let format = bytes.one_of(&FORMATS).to_owned();
    let image = CompressedImage { header: header(), format, data: bytes.rest().to_vec() };
    check(decode_compressed(&image, &camera, &FILTER), &FILTER, 1 << 16);
}
