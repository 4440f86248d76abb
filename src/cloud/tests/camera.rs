//! Cameras: which numbers of a `CameraInfo` count, and which are refused.

use super::*;
use crate::msg::ros::{CameraInfo, RegionOfInterest};

/// A Kinect's `CameraInfo` at `width` x `height`, K and P alike.
pub(super) fn info(width: u32, height: u32) -> CameraInfo {
    let (fx, fy, cx, cy) = (525.0, 520.0, 319.5, 239.5);
    CameraInfo {
        header: header(OPTICAL_FRAME),
        height,
        width,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

/// What a pixel sees at a depth of 2 m.
fn sees(info: &CameraInfo, u: f32, v: f32) -> [f32; 3] {
    let [x, y] = Camera::from_info(info).unwrap().ray(u, v);
    [2.0 * x, 2.0 * y, 2.0]
}

#[test]
fn p_counts_and_k_where_p_is_not_set() {
    let mut both = info(640, 480);
    both.k = [1.0, 0.0, 2.0, 0.0, 3.0, 4.0, 0.0, 0.0, 1.0];
    assert_eq!(sees(&both, 844.5, 239.5), [2.0, 0.0, 2.0]);
    assert_eq!(sees(&both, 319.5, 759.5), [0.0, 2.0, 2.0]);
    both.p = [0.0; 12];
    assert_eq!(sees(&both, 3.0, 4.0), [2.0, 0.0, 2.0]);
    assert_eq!(sees(&both, 2.0, 7.0), [0.0, 2.0, 2.0]);
}

#[test]
fn the_region_of_interest_moves_the_principal_point_and_binning_scales_what_is_left() {
    let mut part = info(640, 480);
    part.roi = RegionOfInterest { x_offset: 100, y_offset: 40, width: 400, height: 300, do_rectify: false };
    (part.binning_x, part.binning_y) = (2, 4);
    let camera = Camera::from_info(&part).unwrap();
    assert_eq!((camera.width(), camera.height()), (200, 75));
    let whole = Camera::from_info(&info(640, 480)).unwrap();
    for (u, v) in [(0_u8, 0_u8), (7, 70), (199, 74)].map(|(u, v)| (f32::from(u), f32::from(v))) {
        let (binned, full) = (camera.ray(u, v), whole.ray(2.0 * u + 100.0, 4.0 * v + 40.0));
        assert!(binned.iter().zip(full).all(|(a, b)| (a - b).abs() < 1e-6), "{binned:?}, {full:?}");
    }
    part.roi = RegionOfInterest::default();
    let camera = Camera::from_info(&part).unwrap();
    assert_eq!((camera.width(), camera.height()), (320, 120));
}

#[test]
fn intrinsics_that_project_nothing_are_refused_with_their_numbers() {
    let refused = |change: fn(&mut CameraInfo)| {
        let mut bad = info(640, 480);
        change(&mut bad);
        Camera::from_info(&bad).unwrap_err()
    };
    let unset = refused(|info| (info.p, info.k) = ([0.0; 12], [0.0; 9]));
    assert_eq!(unset, CloudError::BadIntrinsics { fx: 0.0, fy: 0.0, cx: 0.0, cy: 0.0 });
    assert!(unset.to_string().contains("fx 0"));
    let changes: [fn(&mut CameraInfo); 6] = [
        |info| info.p[0] = -525.0,
        |info| info.p[0] = NAN,
        |info| info.p[5] = f64::INFINITY,
        |info| info.p[5] = 1e-60,
        |info| info.p[2] = NAN,
        |info| info.p[6] = 1e300,
    ];
    for change in changes {
        assert_eq!(refused(change).reason().key, "bad_intrinsics");
    }
}

#[test]
fn distortion_that_is_not_zero_is_told() {
    let mut lens = info(640, 480);
    assert!(!Camera::from_info(&lens).unwrap().is_distorted());
    lens.d[4] = -0.1;
    assert!(Camera::from_info(&lens).unwrap().is_distorted());
    lens.d.clear();
    assert!(!Camera::from_info(&lens).unwrap().is_distorted());
}
