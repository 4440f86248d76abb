//! Clouds of a pinhole camera against the list of their points.

use proptest::prelude::*;

use super::*;
use crate::cloud::convert::{Converted, Gate, convert_fast, convert_list};
use crate::cloud::layout::{Description, Layout};
use crate::engine::between;

const WIDTH: u32 = 40;
const HEIGHT: u32 = 33;

/// What a driver makes of depths: each at its pixel, by `(u - cx) * z / f`.
fn cloud_of(depths: &[f32], step: u32) -> PointCloud2 {
    let point = |(i, &z): (usize, &f32)| {
        let (u, v) = ((i as u32 % WIDTH) as f32, (i as u32 / WIDTH) as f32);
        [(u - 19.5) * z / 33.0, (v - 15.0) * z / 31.0, z].map(f64::from)
    };
    let points: Vec<_> = depths.iter().enumerate().map(point).collect();
    Form::xyz(step).message(OPTICAL_FRAME, HEIGHT, &points)
}

/// By the way for any cloud and by the way for lists.
fn both(message: &PointCloud2) -> [Converted; 2] {
    let layout = Layout::check(&Description::of(message), message.data.len(), u32::MAX).unwrap().unwrap();
    let gate = Gate::new(&KINECT, true);
    [convert_fast(&layout, &message.data, &gate).unwrap(), convert_list(&layout, &message.data, &gate)]
}

fn depths() -> impl Strategy<Value = Vec<f32>> {
    let depth = prop_oneof![6 => between(0.4, 6.0), 1 => Just(f32::NAN), 1 => between(0.0, 0.4), 1 => between(6.0, 90.0)];
    prop::collection::vec(depth, (WIDTH * HEIGHT) as usize)
}

proptest! {
    #[test]
    fn depths_are_kept_where_they_say_all(depths in depths(), step in prop::sample::select(vec![12, 16, 20, 32])) {
        let [kept, list] = both(&cloud_of(&depths, step));
        let Points::Depths(image) = &kept.points else { return Err(TestCaseError::fail("not the depths of a camera")) };
        let ends: Vec<_> = image.ends().iter().map(|end| end[2]).collect();
        prop_assert_eq!(ends, depths.iter().copied().filter(|&depth| depth > 6.0).collect::<Vec<_>>());
        prop_assert_eq!((kept.invalid, kept.out_of_range), (list.invalid, list.out_of_range));
        let [kept, list] = [kept, list].map(|converted| wide(&converted.points));
        prop_assert_eq!(kept.len(), list.len());
        for (a, b) in kept.iter().zip(&list) {
            prop_assert_eq!(a[2], b[2]);
            prop_assert!((0..2).all(|i| (a[i] - b[i]).abs() <= 2e-6 * b[2]), "{a:?} {b:?}");
        }
    }

    #[test]
    fn a_point_beside_its_ray_makes_a_list(depths in depths(), index in any::<prop::sample::Index>(), off in -5.0..9.0_f64) {
        let mut message = cloud_of(&depths, 16);
        let measured: Vec<_> = (0..depths.len()).filter(|&i| depths[i] > 0.0).collect();
        let at = 16 * *index.get(&measured) + 4 * (index.index(2));
        let value = f32::from_le_bytes(message.data[at..at + 4].try_into().unwrap());
        // Each order of magnitude as often as any other.
        let moved = value + (6.0 * 10_f64.powf(off)) as f32;
        message.data[at..at + 4].copy_from_slice(&moved.to_le_bytes());
        let [any, list] = both(&message);
        // Far beyond the range a millimetre may lie within the tolerance.
        if depths[at / 16] < 6.0 {
            prop_assert_eq!(any, list);
        }
    }
}

#[test]
fn at_the_tolerance() {
    let message = |off: f32| {
        let mut message = cloud_of(&[2.0; (WIDTH * HEIGHT) as usize], 16);
        // Beside the axis, where a number is no more than a few nanometres off what it should be.
        let at = 16 * (15 * WIDTH + 20) as usize;
        let x = f32::from_le_bytes(message.data[at..at + 4].try_into().unwrap());
        message.data[at..at + 4].copy_from_slice(&(x + off).to_le_bytes());
        message
    };
    for off in [1e-6, -1e-6] {
        let [any, _] = both(&message(off));
        assert!(matches!(any.points, Points::Depths(_)), "{off} m");
    }
    for off in [4e-6, -4e-6] {
        let [any, list] = both(&message(off));
        assert_eq!(any, list, "{off} m");
    }
}

#[test]
fn few_points_and_frames_that_are_not_optical_make_lists() {
    let mut depths = vec![f32::NAN; (WIDTH * HEIGHT) as usize];
    depths[..9].fill(1.0);
    let [any, list] = both(&cloud_of(&depths, 16));
    assert_eq!((any, list.points.len()), (list.clone(), 9));
    let mut other = cloud_of(&vec![1.0; (WIDTH * HEIGHT) as usize], 16);
    other.header.frame_id = "base_link".to_owned();
    assert!(matches!(decode(&other, &KINECT).unwrap().points, Points::F32(_)));
}
