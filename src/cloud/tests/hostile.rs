//! Messages that nobody sends who means well: lengths beyond the buffer, numbers at their ends, chunks that unpack to more.

use proptest::prelude::*;

use super::camera::info;
use super::*;
use crate::msg::ros::{CameraInfo, RegionOfInterest};

/// Where the four bytes of a length stand in a serialised cloud of one field, and what they are the length of.
fn lengths(cdr: &[u8], message: &PointCloud2) -> Vec<usize> {
    let find = |bytes: &[u8]| cdr.windows(bytes.len()).position(|window| window == bytes).unwrap();
    let frame = [&(message.header.frame_id.len() as u32 + 1).to_le_bytes()[..], b"camera"].concat();
    let field = [&2_u32.to_le_bytes()[..], b"x\0"].concat();
    let data = [&(message.data.len() as u32).to_le_bytes()[..], &message.data[..8]].concat();
    vec![find(&frame), find(&field), find(&data)]
}

#[test]
fn a_length_beyond_the_buffer_ends_with_it_and_takes_no_memory() {
    let message = Form::xyz(16).message(OPTICAL_FRAME, 1, &[[1.5, 0.25, 1.0]; 4]);
    let good = cdr(&message);
    for at in lengths(&good, &message) {
        for length in [u32::MAX, u32::MAX - 3, 1 << 31, good.len() as u32] {
            let mut bytes = good.clone();
            bytes[at..at + 4].copy_from_slice(&length.to_le_bytes());
            let mut is_refused = false;
            let memory = allocation_counter::measure(|| is_refused = by_seed(&bytes, KINECT).is_err());
            assert!(is_refused, "{length} at {at}");
            assert!(memory.bytes_max < 1 << 20, "{length} at {at}: {} bytes", memory.bytes_max);
        }
    }
    assert!(by_seed(&good, KINECT).unwrap().is_ok());
}

#[test]
fn a_frame_of_a_megabyte_is_refused_by_its_length() {
    let long = refused(|m| m.header.frame_id = "x".repeat(1 << 20));
    assert_eq!(long, CloudError::LongFrameId { bytes: 1 << 20, max: 256 });
    assert!(long.to_string().len() < 100);
}

#[test]
fn a_frame_that_is_no_utf_8_is_an_error_of_the_deserializer() {
    let mut bytes = cdr(&Form::xyz(16).message("frame", 1, &[[1.0; 3]]));
    bytes[12..17].copy_from_slice(&[0xff, 0xfe, 0x80, 0xc0, 0xf5]);
    assert!(by_seed(&bytes, KINECT).is_err());
}

#[test]
fn stamps_of_every_second_on_the_wire_are_taken_as_they_are() {
    for (sec, nanosec) in [(i32::MIN, 0), (-1, 999_999_999), (0, 0), (i32::MAX, 999_999_999)] {
        let mut message = Form::xyz(16).message(OPTICAL_FRAME, 1, &[[0.0, 0.0, 1.0]]);
        message.header.stamp = Time { sec, nanosec };
        let stamp = taken(&message, &KINECT).unwrap().stamp;
        assert_eq!(stamp.nanos(), i64::from(sec) * 1_000_000_000 + i64::from(nanosec));
        assert_eq!(Time::from(stamp), message.header.stamp);
    }
    assert_eq!(refused(|m| m.header.stamp.nanosec = u32::MAX).reason().key, "bad_stamp");
}

#[test]
fn the_greatest_and_the_smallest_numbers_are_judged_like_any() {
    let (most, least) = (f64::from(f32::MAX), f64::from(f32::from_bits(1)));
    let points =
        [[most, most, most], [-most, 0.0, 0.0], [least, least, least], [0.0, least, 1.0], [most, 0.0, 1.0]];
    let base = taken(&Form::xyz(16).message("base_link", 1, &points), &KINECT).unwrap();
    assert_eq!((base.points.len(), base.invalid, base.out_of_range), (1, 0, 4));
    // Of an optical frame the depth alone counts: what lies beside it is for the grid to leave out, point by point.
    let optical = taken(&Form::xyz(16).message(OPTICAL_FRAME, 1, &points), &KINECT).unwrap();
    assert_eq!((optical.points.len(), optical.invalid, optical.out_of_range), (2, 1, 2));
    let double = Form { fields: vec![("x", 0, 8), ("y", 8, 8), ("z", 16, 8)], ..Form::xyz(24) };
    let ends = [[f64::MAX; 3], [f64::MIN_POSITIVE / 2.0, 0.0, 1.0], [1e200, 1e200, 0.5]];
    let cloud = taken(&double.message("base_link", 1, &ends), &KINECT).unwrap();
    assert_eq!((cloud.points.len(), cloud.invalid, cloud.out_of_range), (1, 0, 2));
}

#[test]
fn at_the_bound_of_points_a_cloud_is_taken_and_one_more_is_refused() {
    let filter = CloudFilter { max_points: 6, ..KINECT };
    let cloud = |points: usize| Form::xyz(12).message(OPTICAL_FRAME, 1, &vec![[0.0, 0.0, 1.0]; points]);
    assert_eq!(taken(&cloud(6), &filter).unwrap().total, 6);
    assert_eq!(taken(&cloud(7), &filter), Err(CloudError::TooManyPoints { points: 7, max: 6 }));
}

#[test]
fn fields_that_overlap_or_repeat_themselves_a_million_times_cost_nothing() {
    let mut message = Form::xyz(16).message(OPTICAL_FRAME, 1, &[[0.5, 0.5, 1.0]]);
    message.fields.iter_mut().for_each(|field| field.offset = 8);
    assert_eq!(wide(&taken(&message, &KINECT).unwrap().points), [[1.0; 3]]);
    message.fields.iter_mut().for_each(|field| field.count = u32::MAX);
    assert_eq!(taken(&message, &KINECT).unwrap().points.len(), 1);
}

fn any_info() -> impl Strategy<Value = CameraInfo> {
    let corners = prop::sample::select(vec![0, 1, 2, 640, i32::MAX as u32, u32::MAX - 1, u32::MAX]);
    let number = prop_oneof![corners, any::<u32>()];
    (prop::array::uniform8(number), any::<[f64; 9]>(), any::<[f64; 12]>()).prop_map(
        |([height, width, binning_x, binning_y, x_offset, y_offset, roi_height, roi_width], k, p)| {
            CameraInfo {
                height,
                width,
                binning_x,
                binning_y,
                roi: RegionOfInterest {
                    x_offset,
                    y_offset,
                    height: roi_height,
                    width: roi_width,
                    do_rectify: true,
                },
                k,
                p,
                ..info(1, 1)
            }
        },
    )
}

proptest! {
    #[test]
    fn no_region_binning_or_matrix_is_too_much_for_a_camera(info in any_info()) {
        if let Ok(camera) = Camera::from_info(&info) {
            prop_assert!(camera.width() <= info.width.max(info.roi.width));
            prop_assert!(camera.ray(0.0, 0.0).iter().all(|ray| ray.is_finite()));
        }
    }
}

#[test]
fn a_lens_of_a_million_numbers_is_a_distorted_one() {
    let lens = CameraInfo { d: vec![f64::NAN; 1_000_000], ..info(640, 480) };
    assert!(Camera::from_info(&lens).unwrap().is_distorted());
}

#[test]
fn a_camera_of_the_greatest_size_is_bounded_by_max_points() {
    let camera = Camera::from_info(&info(u32::MAX, u32::MAX)).unwrap();
    let image = crate::msg::ros::Image {
        header: header("f"),
        height: u32::MAX,
        width: u32::MAX,
        encoding: "16UC1".to_owned(),
        step: u32::MAX,
        ..Default::default()
    };
    assert_eq!(decode_depth(&image, &camera, &KINECT).unwrap_err().reason().key, "too_many_points");
}
