//! The messages of a step: an organised cloud as `depth_image_proc` publishes it, and where the robot stands.

use nalgebra::Isometry3;

use super::Drive;
use crate::engine::Stamp;
use crate::msg::ros::{
    Header, PointCloud2, PointField, Quaternion, TfMessage, Transform, TransformStamped, Vector3,
};
use crate::sim::kinect::{DepthImage, Kinect};
use crate::sim::robot::Robot;

/// The frame that stays.
pub const FIXED_FRAME: &str = "odom";
/// The robot's own frame.
pub const BASE_FRAME: &str = "base_link";
/// The camera's housing, x forward.
pub const CAMERA_FRAME: &str = "camera_link";
/// The frame of the points, z forward.
pub const OPTICAL_FRAME: &str = "camera_depth_optical_frame";

/// Bytes of a point: x, y and z as `depth_image_proc` lays them out, and the label in the four bytes it leaves unused.
const POINT_STEP: u32 = 16;

/// What is published at one step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time of both messages.
    pub stamp: Stamp,
    /// 640 x 480 points in [`OPTICAL_FRAME`], NaN where nothing was measured; `label` is that of the true surface, 0
    /// where nothing was measured.
    pub cloud: PointCloud2,
    /// `odom` -> `base_link`.
    pub tf: TfMessage,
}

impl Drive {
    /// The messages of a step.
    pub fn step(&self, index: u32) -> Step {
        let stamp = self.stamp(index);
        let image = self.image(index);
        let cloud = cloud_message(&self.kinect, &image, header(stamp, OPTICAL_FRAME));
        let base = self.told_base_pose(index);
        let transforms = vec![transform_message(stamp, FIXED_FRAME, BASE_FRAME, &base)];
        Step { stamp, cloud, tf: TfMessage { transforms } }
    }

    /// `base_link` -> `camera_link` -> `camera_depth_optical_frame`, for `/tf_static`.
    pub fn static_transforms(&self) -> TfMessage {
        let (camera, optical) = (self.robot.base_from_camera(), Robot::camera_from_optical());
        TfMessage {
            transforms: vec![
                transform_message(self.start, BASE_FRAME, CAMERA_FRAME, &camera),
                transform_message(self.start, CAMERA_FRAME, OPTICAL_FRAME, &optical),
            ],
        }
    }
}

fn header(stamp: Stamp, frame_id: &str) -> Header {
    Header { stamp: stamp.into(), frame_id: frame_id.to_owned() }
}

/// The points of an image as `depth_image_proc` publishes them.
fn cloud_message(kinect: &Kinect, image: &DepthImage, header: Header) -> PointCloud2 {
    let (width, height) = (image.width as u32, image.height as u32);
    let mut data = Vec::with_capacity(image.depths.len() * POINT_STEP as usize);
    for (point, label) in kinect.points(image) {
        let [x, y, z] = point.map(f32::to_le_bytes);
        data.extend_from_slice([x, y, z, label.to_le_bytes()].as_flattened());
    }
    let fields = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
    let fields = fields.map(|(name, offset)| PointField::single(name, offset, PointField::FLOAT32));
    let label = PointField::single("label", 12, PointField::UINT32);
    PointCloud2 {
        header,
        height,
        width,
        fields: fields.chain([label]).collect(),
        is_bigendian: false,
        point_step: POINT_STEP,
        row_step: width * POINT_STEP,
        data,
        all_finite: false,
    }
}

fn transform_message(
    stamp: Stamp,
    parent: &str,
    child: &str,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped {
    let (place, turn) = (parent_from_child.translation, parent_from_child.rotation);
    TransformStamped {
        header: header(stamp, parent),
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 { x: place.x, y: place.y, z: place.z },
            rotation: Quaternion { x: turn.i, y: turn.j, z: turn.k, w: turn.w },
        },
    }
}
