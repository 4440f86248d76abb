//! Compressed depth images: what `image_transport` writes, and PNGs that mean harm.

use png::{BitDepth, ColorType};
use proptest::prelude::*;

use super::camera::info;
use super::*;
use crate::msg::ros::CompressedImage;

const DEPTHS: [u16; 6] = [0, 500, 65535, 1234, 399, 6001];

fn camera(width: u32, height: u32) -> Camera {
    Camera::from_info(&info(width, height)).unwrap()
}

fn png_of(size: (u32, u32), color: ColorType, depth: BitDepth, bytes: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size.0, size.1);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    file
}

fn png16(width: u32, numbers: &[u16]) -> Vec<u8> {
    let bytes: Vec<_> = numbers.iter().flat_map(|number| number.to_be_bytes()).collect();
    png_of((width, numbers.len() as u32 / width), ColorType::Grayscale, BitDepth::Sixteen, &bytes)
}

/// The header of compressedDepth.
fn with_header(a: f32, b: f32, png: &[u8]) -> Vec<u8> {
    [&0_i32.to_le_bytes()[..], &a.to_le_bytes(), &b.to_le_bytes(), png].concat()
}

fn message(format: &str, data: Vec<u8>) -> CompressedImage {
    CompressedImage { header: header("anywhere"), format: format.to_owned(), data }
}

fn cdr_of(image: &CompressedImage) -> Vec<u8> {
    to_vec::<_, LittleEndian>(image).unwrap()
}

fn png_by_seed(cdr: &[u8], camera: Camera) -> cdr_encoding::Result<Decoded> {
    CompressedSeed::new(camera, KINECT).deserialize(&mut CdrDeserializer::<LittleEndian>::new(cdr))
}

/// Decodes by both ways in and holds them equal.
fn png_taken(image: &CompressedImage, camera: Camera) -> Decoded {
    let owned = decode_compressed(image, &camera, &KINECT);
    assert_eq!(png_by_seed(&cdr_of(image), camera).unwrap(), owned);
    owned
}

/// What the raw image of these numbers gives.
fn uncompressed(encoding: &str, data: Vec<u8>) -> Cloud {
    let image = crate::msg::ros::Image {
        header: header("anywhere"),
        height: 2,
        width: 3,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: data.len() as u32 / 2,
        data,
    };
    decode_depth(&image, &camera(3, 2), &KINECT).unwrap()
}

#[test]
fn every_format_of_millimetres_gives_the_points_of_the_raw_image() {
    let raw = uncompressed("16UC1", DEPTHS.iter().flat_map(|depth| depth.to_le_bytes()).collect());
    assert_eq!((raw.points.len(), raw.invalid, raw.out_of_range), (2, 2, 2));
    let png = png16(3, &DEPTHS);
    let behind_header =
        ["16UC1; compressedDepth", "16UC1; compressedDepth png", "mono16; compressedDepth png", "16UC1"];
    for format in behind_header {
        let image = message(format, with_header(0.0, 0.0, &png));
        assert_eq!(png_taken(&image, camera(3, 2)).as_ref(), Ok(&raw), "{format}");
    }
    for format in ["png", "16UC1; png compressed ", "mono16; png compressed mono16"] {
        assert_eq!(png_taken(&message(format, png.clone()), camera(3, 2)).as_ref(), Ok(&raw), "{format}");
    }
}

#[test]
fn inverse_depths_are_a_over_raw_less_b() {
    // The parameters of compressed_depth_image_transport: quantisation 100, farthest 10 m.
    let (a, b) = (100.0 * 101.0_f32, 1.0 - 100.0 * 101.0 / 10.0_f32);
    let metres = [0.5, 1.0, 2.0, 5.9, 0.3, 8.0_f32];
    let mut numbers = metres.map(|z| (a / z + b) as u16);
    numbers[2] = 0;
    let image = message("32FC1; compressedDepth png", with_header(a, b, &png16(3, &numbers)));
    let cloud = png_taken(&image, camera(3, 2)).unwrap();
    let sent = numbers.map(|number| if number == 0 { f32::NAN } else { a / (f32::from(number) - b) });
    let raw = uncompressed("32FC1", sent.iter().flat_map(|z| z.to_le_bytes()).collect());
    assert_eq!(cloud, raw);
    assert_eq!((cloud.points.len(), cloud.invalid, cloud.out_of_range), (3, 1, 2));
    for (point, z) in wide(&cloud.points).iter().zip([0.5, 1.0, 5.9]) {
        assert!((point[2] - z).abs() < 0.003 * z * z, "{} instead of {z}", point[2]);
    }
    for (a, b) in [(0.0, 0.0), (f32::NAN, 0.0), (-1.0, 0.0), (f32::INFINITY, f32::INFINITY)] {
        let image = message("32FC1; compressedDepth png", with_header(a, b, &png16(3, &numbers)));
        assert_eq!(png_taken(&image, camera(3, 2)).unwrap().invalid, 6);
    }
}

#[test]
fn what_is_no_png_of_16_bits_is_refused_with_its_format() {
    let png = png16(3, &DEPTHS);
    let formats = [
        "16UC1; compressedDepth rvl",
        "rgb8; jpeg compressed bgr8",
        "jpeg",
        "32FC1; png compressed ",
        "8UC1; compressedDepth",
        "",
    ];
    for format in formats {
        let refused = png_taken(&message(format, png.clone()), camera(3, 2)).unwrap_err();
        assert_eq!(refused, CloudError::UnknownFormat { format: format.to_owned() });
        assert!(refused.to_string().contains(format));
    }
    for (color, depth, bytes) in
        [(ColorType::Grayscale, BitDepth::Eight, 6), (ColorType::Rgb, BitDepth::Sixteen, 36)]
    {
        let other = png_of((3, 2), color, depth, &vec![7; bytes]);
        let refused = png_taken(&message("16UC1; png compressed", other), camera(3, 2)).unwrap_err();
        assert_eq!(refused.reason().key, "png_kind");
        assert!(refused.to_string().contains("16UC1; png compressed"), "{refused}");
    }
}

#[test]
fn a_png_is_compared_with_camera_and_bound_before_it_is_unpacked() {
    let claims = |width: u32, height: u32| {
        let mut png = png16(3, &DEPTHS);
        png[16..20].copy_from_slice(&width.to_be_bytes());
        png[20..24].copy_from_slice(&height.to_be_bytes());
        let sum = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&sum.to_be_bytes());
        message("png", png)
    };
    let (width, height) = (2_000_000_000, 2_000_000_000);
    let size = CloudError::ImageSize { width, height, camera_width: 3, camera_height: 2 };
    assert_eq!(png_taken(&claims(width, height), camera(3, 2)), Err(size));
    let huge = png_taken(&claims(width, height), camera(width, height));
    assert_eq!(huge.unwrap_err().reason().key, "too_many_points");
    // It is the camera's size, and its pixels end too early.
    assert_eq!(png_taken(&claims(3, 200), camera(3, 200)).unwrap_err().reason().key, "png");
}

/// The checksum of PNG, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    let step = |sum: u32, _| if sum & 1 == 1 { 0xedb8_8320 ^ (sum >> 1) } else { sum >> 1 };
    !bytes.iter().fold(u32::MAX, |sum, &byte| (0..8).fold(sum ^ u32::from(byte), step))
}

#[test]
fn a_cut_image_is_an_error_at_every_length() {
    let (camera, data) = (camera(3, 2), with_header(1.0, 0.0, &png16(3, &DEPTHS)));
    for length in 0..data.len() {
        let cut = message("32FC1; compressedDepth", data[..length].to_vec());
        let reason = png_taken(&cut, camera).map(drop).map_err(|error| error.reason().key);
        let expected = if length < 12 { "short_header" } else { "png" };
        // The last chunk says only that the file ends.
        assert!(reason == Err(expected) || length >= data.len() - 12, "{length}: {reason:?}");
    }
    let whole = cdr_of(&message("32FC1; compressedDepth", data));
    for length in 0..whole.len() {
        assert!(png_by_seed(&whole[..length], camera).is_err(), "{length} of {} bytes", whole.len());
    }
}

proptest! {
    #[test]
    fn random_bytes_never_panic_as_a_compressed_image(bytes in prop::collection::vec(any::<u8>(), 0..512)) {
        let _ = png_by_seed(&bytes, camera(3, 2));
        let _ = png_taken(&message("png", bytes), camera(3, 2));
    }

    #[test]
    fn a_damaged_png_never_panics_and_both_ways_in_agree(
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4), whole in any::<bool>(),
        format in prop::sample::select(vec!["png", "16UC1; compressedDepth png", "32FC1; compressedDepth png"]),
    ) {
        let mut png = png16(3, &DEPTHS);
        for (index, value) in damage {
            let at = index.index(png.len());
            png[at] = value;
        }
        if whole {
            // Past the checksums, where damage reaches the unpacking.
            let mut at = 8;
            while let Some(length) = png.get(at..).and_then(|chunk| chunk.first_chunk()) {
                let end = at.saturating_add(u32::from_be_bytes(*length) as usize).saturating_add(8);
                let Some(sum) = png.get(at + 4..end).map(crc32) else { break };
                let Some(place) = png.get_mut(end..end + 4) else { break };
                place.copy_from_slice(&sum.to_be_bytes());
                at = end + 4;
            }
        }
        let data = if format == "png" { png } else { with_header(10100.0, -1009.0, &png) };
        let _ = png_taken(&message(format, data), camera(3, 2));
    }
}

/// A chunk of a PNG.
fn chunk(kind: [u8; 4], data: &[u8]) -> Vec<u8> {
    let sum = crc32(&[&kind, data].concat());
    [&(data.len() as u32).to_be_bytes()[..], &kind, data, &sum.to_be_bytes()].concat()
}

#[test]
fn what_a_png_packs_beside_its_pixels_is_not_unpacked() {
    // Sixteen million zeros in some thousand bytes.
    let mut bomb = png_of((4096, 4096), ColorType::Grayscale, BitDepth::Eight, &vec![0; 1 << 24]);
    let start = bomb.windows(4).position(|kind| kind == b"IDAT").unwrap();
    let packed = bomb.split_off(start + 4);
    let good = png16(3, &DEPTHS);
    for (kind, head) in [(*b"zTXt", &b"k\0\0"[..]), (*b"iCCP", b"k\0\0"), (*b"iTXt", b"k\0\x01\0\0\0")] {
        let extra = chunk(kind, &[head, &packed[..]].concat());
        // Behind IHDR, which ends at byte 33.
        let image = message("png", [&good[..33], &extra.repeat(50), &good[33..]].concat());
        let mut told = Err("png");
        let memory = allocation_counter::measure(|| {
            told =
                png_taken(&image, camera(3, 2)).map(|cloud| cloud.total).map_err(|error| error.reason().key);
        });
        assert!(told == Ok(6) || told == Err("png"), "{told:?}");
        // The message, a copy of it, and no sixteen million.
        assert!(memory.bytes_max < 3 << 20, "{} bytes", memory.bytes_max);
    }
}

#[test]
fn an_image_that_unpacks_to_more_than_its_camera_s_is_cut_to_it_or_refused() {
    let mut png = png16(3, &DEPTHS.repeat(1000));
    png[20..24].copy_from_slice(&2_u32.to_be_bytes());
    let sum = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&sum.to_be_bytes());
    let told = png_taken(&message("png", png), camera(3, 2)).map(|cloud| cloud.total);
    assert!(told == Ok(6) || told.as_ref().is_err_and(|error| error.reason().key == "png"), "{told:?}");
}
