//! The frame of a camera that stands still, where no transform says how it was mounted.
//!
//! What a surface is called goes by the fixed frame's z, which is up (REP 103, 105). In an optical frame z looks ahead, so a map
//! made there would have floors for walls.

use crate::msg::ros::{Header, Quaternion, Transform, TransformStamped, Vector3};
use crate::tf::check;

/// From the body frame of a camera (x ahead, y left, z up) to its optical frame (z ahead, x right, y down), as REP 103 has the
/// two; `None` where the names that this would take are none.
pub(super) fn body_of(optical: &str) -> Option<TransformStamped> {
    let transform = TransformStamped {
        header: Header { frame_id: name_of(optical), ..Header::default() },
        child_frame_id: optical.to_owned(),
        transform: Transform {
            translation: Vector3::default(),
            rotation: Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 },
        },
    };
    check(&transform, true).is_ok().then_some(transform)
}

/// As drivers name it beside the optical one: REP 103 adds `_optical` to its name.
fn name_of(optical: &str) -> String {
    let begin = |end| optical.strip_suffix(end).filter(|begin| !begin.is_empty());
    let of_driver = begin("_optical_frame").map(|begin| format!("{begin}_frame"));
    of_driver.or_else(|| begin("_optical").map(str::to_owned)).unwrap_or_else(|| format!("{optical}_body"))
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::engine::Stamp;
    use crate::tf::{Frames, MAX_NAME_BYTES};

    #[test]
    fn the_body_frame_is_called_as_drivers_call_it() {
        for (optical, body) in [
            ("camera_depth_optical_frame", "camera_depth_frame"),
            ("robot/left_optical", "robot/left"),
            ("kinect_depth", "kinect_depth_body"),
            ("_optical", "_optical_body"),
        ] {
            let transform = body_of(optical).unwrap();
            assert_eq!(
                (transform.header.frame_id.as_str(), transform.child_frame_id.as_str()),
                (body, optical)
            );
        }
        assert_eq!(body_of(&"k".repeat(MAX_NAME_BYTES)), None);
    }

    #[test]
    fn what_lies_ahead_of_the_lens_is_ahead_and_what_lies_below_is_below() {
        let mut frames = Frames::new();
        frames.insert(&body_of("a_optical").unwrap(), true).unwrap();
        let body = frames.lookup("a", "a_optical", Stamp::from_nanos(0)).unwrap();
        for (seen, there) in [
            ([0.0, 0.0, 2.0], [2.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]),
            ([0.0, 1.0, 0.0], [0.0, 0.0, -1.0]),
        ] {
            assert!((body * Point3::from(seen) - Point3::from(there)).norm() < 1e-12, "{seen:?}");
        }
    }
}
