//! Layouts of real drivers, the filter's rules, and every refusal.

mod camera;
#[cfg(feature = "bag")]
mod compressed;
mod depth;
mod hostile;
mod pinhole;
mod properties;

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::{CdrDeserializer, to_vec};
use serde::de::DeserializeSeed;

use super::*;
use crate::msg::ros::{Header, PointField, Time};

const KINECT: CloudFilter = CloudFilter::DEFAULT;
const OPTICAL_FRAME: &str = "camera_depth_optical_frame";
const NAN: f64 = f64::NAN;

/// How a test writes its points.
#[derive(Clone, Debug)]
struct Form {
    /// Name, offset and datatype of each field.
    fields: Vec<(&'static str, u32, u8)>,
    point_step: u32,
    row_padding: u32,
    is_bigendian: bool,
}

impl Form {
    fn xyz(point_step: u32) -> Self {
        let fields = vec![("x", 0, 7), ("y", 4, 7), ("z", 8, 7)];
        Self { fields, point_step, row_padding: 0, is_bigendian: false }
    }

    fn message(&self, frame_id: &str, height: u32, points: &[[f64; 3]]) -> PointCloud2 {
        let width = points.len() as u32 / height.max(1);
        let row_step = width * self.point_step + self.row_padding;
        // What lies between the coordinates must not matter, so it is neither zero nor a number.
        let mut data = vec![0xff; (height * row_step) as usize];
        for (index, point) in points.iter().enumerate().take((height * width) as usize) {
            let (row, column) = (index / width as usize, index % width as usize);
            let start = row * row_step as usize + column * self.point_step as usize;
            self.write(&mut data[start..start + self.point_step as usize], *point);
        }
        PointCloud2 {
            header: header(frame_id),
            height,
            width,
            fields: self.fields.iter().map(|&(name, at, kind)| PointField::single(name, at, kind)).collect(),
            is_bigendian: self.is_bigendian,
            point_step: self.point_step,
            row_step,
            data,
            all_finite: false,
        }
    }

    fn write(&self, bytes: &mut [u8], point: [f64; 3]) {
        for &(name, offset, datatype) in &self.fields {
            let Some(axis) = ["x", "y", "z"].iter().position(|&axis| axis == name) else { continue };
            let mut value = match datatype {
                PointField::FLOAT32 => (point[axis] as f32).to_le_bytes().to_vec(),
                _ => point[axis].to_le_bytes().to_vec(),
            };
            if self.is_bigendian {
                value.reverse();
            }
            bytes[offset as usize..offset as usize + value.len()].copy_from_slice(&value);
        }
    }
}

fn header(frame_id: &str) -> Header {
    Header { stamp: Time { sec: 12, nanosec: 500_000_000 }, frame_id: frame_id.to_owned() }
}

/// What a live subscription asks of a seed.
fn subscribed(filter: CloudFilter) -> impl for<'de> DeserializeSeed<'de, Value = Decoded> + Clone {
    CloudSeed::new(filter)
}

/// By the route of a live subscription: rustdds hands its `CdrDeserializer` to the seed.
fn by_seed(cdr: &[u8], filter: CloudFilter) -> cdr_encoding::Result<Decoded> {
    subscribed(filter).deserialize(&mut CdrDeserializer::<LittleEndian>::new(cdr))
}

fn by_big_endian_seed(cdr: &[u8], filter: CloudFilter) -> cdr_encoding::Result<Decoded> {
    subscribed(filter).deserialize(&mut CdrDeserializer::<BigEndian>::new(cdr))
}

fn cdr(message: &PointCloud2) -> Vec<u8> {
    to_vec::<_, LittleEndian>(message).unwrap()
}

/// Decodes by every way in and holds them equal.
fn taken(message: &PointCloud2, filter: &CloudFilter) -> Decoded {
    let owned = decode(message, filter);
    assert_eq!(by_seed(&cdr(message), *filter).unwrap(), owned);
    let big_endian = to_vec::<_, BigEndian>(message).unwrap();
    assert_eq!(by_big_endian_seed(&big_endian, *filter).unwrap(), owned);
    owned
}

fn wide(points: &Points) -> Vec<[f64; 3]> {
    match points {
        Points::F32(points) | Points::Ended { points, .. } => {
            points.iter().map(|point| point.map(f64::from)).collect()
        }
        Points::F64(points) => points.clone(),
        Points::Depths(depths) => depths.list().iter().map(|point| point.map(f64::from)).collect(),
    }
}

#[test]
fn every_driver_layout_gives_the_same_points() {
    let xyz = vec![("x", 0, 7), ("y", 4, 7), ("z", 8, 7)];
    let with = |extra: &[(&'static str, u32, u8)]| [xyz.clone(), extra.to_vec()].concat();
    let form = |fields, point_step| Form { fields, point_step, row_padding: 0, is_bigendian: false };
    let doubles = vec![("x", 0, 8), ("y", 8, 8), ("z", 16, 8)];
    let table = [
        ("packed xyz", form(xyz.clone(), 12)),
        ("depth_image_proc xyz, Azure Kinect depth", form(xyz.clone(), 16)),
        ("Orbbec colour", form(with(&[("rgb", 16, 7)]), 20)),
        ("depth_image_proc xyzrgb, Azure Kinect colour", form(with(&[("rgb", 16, 7)]), 32)),
        ("double precision", form(doubles.clone(), 24)),
        ("mixed precision", form(vec![("x", 0, 7), ("y", 4, 8), ("z", 12, 7)], 16)),
        ("any order, unaligned", form(vec![("rgb", 0, 6), ("z", 5, 7), ("x", 9, 7), ("y", 13, 7)], 17)),
        ("row padding", Form { row_padding: 13, ..form(xyz.clone(), 16) }),
        ("big endian", Form { is_bigendian: true, ..form(xyz.clone(), 16) }),
        ("big endian doubles", Form { is_bigendian: true, ..form(doubles, 32) }),
    ];
    let sent =
        [[0.5, -0.25, 1.5], [NAN, NAN, NAN], [0.0; 3], [1.0, 0.5, 2.0], [0.0, 0.0, 6.5], [-1.0, 0.75, 3.0]];
    for (name, form) in table {
        for height in [1, 2] {
            let cloud = taken(&form.message(OPTICAL_FRAME, height, &sent), &KINECT).unwrap();
            assert_eq!(wide(&cloud.points), [sent[0], sent[3], sent[5]], "{name}, {height} rows");
            assert_eq!((cloud.total, cloud.invalid, cloud.out_of_range), (6, 2, 1), "{name}");
            if let Points::Ended { ends, .. } = &cloud.points {
                assert_eq!(ends, &[[0.0, 0.0, 6.5]], "{name}");
            }
            let double = form.fields.iter().any(|&(_, _, datatype)| datatype == PointField::FLOAT64);
            assert_eq!(matches!(cloud.points, Points::F64(_)), double, "{name}");
            assert_eq!(matches!(cloud.points, Points::Ended { .. }), !double, "{name}");
        }
    }
}

#[test]
fn stamp_and_frame_come_from_the_header_without_leading_slashes() {
    let read = |name| by_seed(&cdr(&Form::xyz(16).message(name, 1, &[[1.0; 3]])), KINECT).unwrap();
    let cloud = read("/robot/camera_link").unwrap();
    assert_eq!(cloud.stamp, Stamp::from_nanos(12_500_000_000));
    assert_eq!(cloud.frame_id, "robot/camera_link");
    assert_eq!(read("//"), Err(CloudError::EmptyFrameId));
}

#[test]
fn a_frame_is_optical_by_its_name_unless_told_otherwise() {
    let optical = |name| Optical::Auto.of_frame(name);
    assert!(
        optical("camera_depth_optical_frame") && optical("kinect_depth") && optical("robot/kinect_depth")
    );
    assert!(!optical("camera_link") && !optical("not_kinect_depth") && !optical("optical_frame_mount"));
    assert!(Optical::Yes.of_frame("base_link") && !Optical::No.of_frame("kinect_depth"));
}

#[test]
fn behind_the_optical_plane_is_invalid_and_below_the_base_is_not() {
    let points = [[1.0, 0.0, -0.5], [1.0, 0.0, 0.0], [1.0, 0.0, 0.5]];
    let optical = taken(&Form::xyz(16).message("kinect_depth", 1, &points), &KINECT).unwrap();
    assert_eq!((wide(&optical.points), optical.invalid), (vec![points[2]], 2));
    let base = taken(&Form::xyz(16).message("base_link", 1, &points), &KINECT).unwrap();
    assert_eq!((wide(&base.points), base.invalid), (points.to_vec(), 0));
}

#[test]
fn range_is_inclusive_of_depth_in_an_optical_frame_and_of_distance_elsewhere() {
    let filter = CloudFilter { min_range: 1.0, max_range: 5.0, ..KINECT };
    let sent = [[3.0, 4.0, 0.0], [3.0, 4.0, 0.01], [9.0, 0.0, 5.0], [0.0, 0.5, 1.0], [0.01, 0.01, 0.99]];
    let base = taken(&Form::xyz(12).message("base_link", 1, &sent), &filter).unwrap();
    assert_eq!(base.out_of_range, 3);
    let (points, ends) = (vec![[3.0, 4.0, 0.0], [0.0, 0.5, 1.0]], vec![[3.0, 4.0, 0.01], [9.0, 0.0, 5.0]]);
    assert_eq!(base.points, Points::Ended { points, ends });
    let optical = taken(&Form::xyz(12).message(OPTICAL_FRAME, 1, &sent), &filter).unwrap();
    assert_eq!((optical.invalid, optical.out_of_range), (1, 2));
    assert_eq!(optical.points, Points::F32(vec![[9.0, 0.0, 5.0], [0.0, 0.5, 1.0]]));
}

#[test]
fn a_limit_that_f32_cannot_hold_is_compared_in_f64() {
    // 0.4_f32 is 0.4000000059..., just above the limit; 0.1_f32 lies above 0.1 likewise.
    let at_limit = Form::xyz(12).message(OPTICAL_FRAME, 1, &[[0.0, 0.0, 0.4]]);
    assert_eq!(taken(&at_limit, &KINECT).unwrap().points.len(), 1);
    let below = CloudFilter { min_range: 0.05, max_range: 0.1, ..KINECT };
    let beyond = Form::xyz(12).message(OPTICAL_FRAME, 1, &[[0.0, 0.0, 0.1]]);
    assert_eq!(taken(&beyond, &below).unwrap().out_of_range, 1);
}

#[test]
fn a_message_without_points_is_an_empty_scan() {
    let mut empty = Form::xyz(16).message(OPTICAL_FRAME, 1, &[]);
    for (height, width) in [(0, 0), (0, 640), (480, 0), (1, 0)] {
        (empty.height, empty.width) = (height, width);
        let cloud = taken(&empty, &KINECT).unwrap();
        assert_eq!((cloud.points.len(), cloud.total), (0, 0));
    }
    let bare = PointCloud2 { header: header("base_link"), ..PointCloud2::default() };
    assert!(taken(&bare, &KINECT).unwrap().points.is_empty());
}

#[test]
fn the_sender_s_claim_of_density_changes_nothing() {
    let mut message = Form::xyz(16).message(OPTICAL_FRAME, 1, &[[NAN, 0.0, 1.0], [0.0, 0.0, 1.0]]);
    let honest = taken(&message, &KINECT);
    message.all_finite = true;
    assert_eq!(taken(&message, &KINECT), honest);
}

/// A good message of two points, changed.
fn refused(change: impl FnOnce(&mut PointCloud2)) -> CloudError {
    let mut message = Form::xyz(16).message(OPTICAL_FRAME, 2, &[[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]);
    change(&mut message);
    taken(&message, &KINECT).unwrap_err()
}

#[test]
fn a_header_without_time_or_frame_is_refused() {
    let bad_stamp = CloudError::BadStamp { nanosec: 1_000_000_000 };
    assert_eq!(refused(|m| m.header.stamp.nanosec = 1_000_000_000), bad_stamp);
    assert_eq!(refused(|m| m.header.frame_id.clear()), CloudError::EmptyFrameId);
}

#[test]
fn a_field_that_cannot_be_read_is_refused_by_name() {
    let missing = CloudError::MissingField { field: "y", present: "x, Y, z".to_owned() };
    assert_eq!(refused(|m| m.fields[1].name = "Y".to_owned()), missing);
    let twice = CloudError::DuplicateField { field: "x", times: 2 };
    assert_eq!(refused(|m| m.fields.push(PointField::single("x", 12, 7))), twice);
    let integer = CloudError::FieldType { field: "z", datatype: 5 };
    assert_eq!(refused(|m| m.fields[2].datatype = 5), integer);
    let outside = CloudError::FieldOutsidePoint { field: "z", end: 17, point_step: 16 };
    assert_eq!(refused(|m| m.fields[2].offset = 13), outside);
    let far = CloudError::FieldOutsidePoint { field: "x", end: u64::from(u32::MAX) + 8, point_step: 16 };
    assert_eq!(refused(|m| m.fields[0] = PointField::single("x", u32::MAX, 8)), far);
    let many = CloudError::TooManyFields { fields: 65, max: 64 };
    assert_eq!(refused(|m| m.fields.extend(vec![PointField::default(); 62])), many);
}

#[test]
fn names_from_outside_are_escaped_and_shortened_in_errors() {
    let error = refused(|m| m.fields[0].name = format!("\n{}", "x".repeat(1000)));
    let CloudError::MissingField { present, .. } = error else { panic!("{error:?}") };
    assert!(present.starts_with("\\nxxx") && present.len() < 50, "{present}");
}

#[test]
fn steps_and_sizes_that_do_not_fit_the_data_are_refused_with_the_numbers() {
    assert_eq!(refused(|m| m.point_step = 0), CloudError::ZeroPointStep);
    assert_eq!(refused(|m| m.row_step = 15), CloudError::ShortRowStep { row_step: 15, needed: 16 });
    assert_eq!(refused(|m| m.data.truncate(31)), CloudError::ShortData { needed: 32, got: 31 });
    let points = u64::from(u32::MAX) * u64::from(u32::MAX);
    let huge = refused(|m| (m.height, m.width) = (u32::MAX, u32::MAX));
    assert_eq!(huge, CloudError::TooManyPoints { points, max: 4_000_000 });
    let long_rows = refused(|m| m.row_step = u32::MAX);
    assert_eq!(long_rows, CloudError::ShortData { needed: u64::from(u32::MAX) * 2, got: 32 });
    let wide = refused(|m| (m.width, m.point_step) = (2_000_000, u32::MAX));
    assert_eq!(wide, CloudError::ShortRowStep { row_step: 16, needed: u64::from(u32::MAX) * 2_000_000 });
}

#[test]
fn a_single_row_needs_no_step_and_all_its_points() {
    let points = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]];
    let message = Form::xyz(16).message("camera", 1, &points);
    for row_step in [0, 31, 32, 33, u32::MAX] {
        let cloud = taken(&PointCloud2 { row_step, ..message.clone() }, &KINECT).unwrap();
        assert_eq!(cloud, taken(&message, &KINECT).unwrap(), "{row_step}");
        let short = PointCloud2 { row_step, data: message.data[..31].to_vec(), ..message.clone() };
        assert_eq!(taken(&short, &KINECT).unwrap_err(), CloudError::ShortData { needed: 32, got: 31 });
    }
}

#[test]
fn every_refusal_has_its_own_reason() {
    let reasons = [
        CloudError::BadStamp { nanosec: 1 },
        CloudError::EmptyFrameId,
        CloudError::TooManyPoints { points: 1, max: 1 },
        CloudError::TooManyFields { fields: 1, max: 1 },
        CloudError::MissingField { field: "x", present: String::new() },
        CloudError::DuplicateField { field: "x", times: 2 },
        CloudError::FieldType { field: "x", datatype: 1 },
        CloudError::FieldOutsidePoint { field: "x", end: 1, point_step: 1 },
        CloudError::ZeroPointStep,
        CloudError::ShortRowStep { row_step: 1, needed: 1 },
        CloudError::ShortData { needed: 1, got: 1 },
        CloudError::BadIntrinsics { fx: 0.0, fy: 1.0, cx: 0.0, cy: 0.0 },
        CloudError::NoStamp,
        CloudError::NoCameraInfo,
        CloudError::ImageSize { width: 1, height: 1, camera_width: 2, camera_height: 2 },
        CloudError::UnknownEncoding { encoding: String::new() },
        CloudError::UnknownFormat { format: String::new() },
        CloudError::ShortStep { step: 1, needed: 2 },
        CloudError::ShortHeader { needed: 12, got: 0 },
        CloudError::PngKind { format: String::new(), kind: String::new() },
        CloudError::Png(String::new()),
        CloudError::Undecodable(String::new()),
    ]
    .map(|error| error.reason().key);
    let distinct: std::collections::BTreeSet<_> = reasons.into_iter().collect();
    assert_eq!(distinct.len(), reasons.len());
    assert!(reasons.iter().all(|reason| reason.chars().all(|c| c.is_ascii_lowercase() || c == '_')));
}

#[test]
fn a_cut_message_is_an_error_of_the_deserializer_at_every_length() {
    let whole = cdr(&Form::xyz(16).message(OPTICAL_FRAME, 1, &[[0.0, 0.0, 1.0]]));
    assert!(by_seed(&whole, KINECT).unwrap().is_ok());
    for length in 0..whole.len() {
        assert!(by_seed(&whole[..length], KINECT).is_err(), "{length} of {} bytes", whole.len());
    }
}

#[test]
fn an_absurd_count_of_fields_ends_with_the_data() {
    let mut bytes = cdr(&Form::xyz(16).message("f", 1, &[[0.0, 0.0, 1.0]]));
    // Stamp 8, string length 4, "f\0", padding 2, height and width 8: the count stands at byte 24.
    assert_eq!(bytes[24..28], [3, 0, 0, 0]);
    bytes[24..28].copy_from_slice(&u32::MAX.to_le_bytes());
    let mut is_refused = false;
    let memory = allocation_counter::measure(|| is_refused = by_seed(&bytes, KINECT).is_err());
    assert!(is_refused && memory.bytes_max < 1 << 20, "{} bytes", memory.bytes_max);
}

#[test]
fn an_optical_frame_is_no_fixed_frame_by_its_name() {
    for name in ["camera_depth_optical_frame", "/robot/left_optical", "kinect_depth", "robot/kinect_depth"] {
        assert!(z_is_not_up(name).is_some_and(|line| line.contains(name)), "{name}");
    }
    for name in ["odom", "camera_depth_frame", "optical_table", "optical"] {
        assert_eq!(z_is_not_up(name), None);
    }
}
