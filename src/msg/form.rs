//! In which forms a sensor's scans come, and which topics are a sensor's by type and name: the same for the live node and a bag.

use super::sent;
use super::types::{CLOUD, COMPRESSED_IMAGE, IMAGE};

/// In which form a sensor's scans come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `sensor_msgs/PointCloud2`.
    Points,
    /// `sensor_msgs/Image`, with a `CameraInfo` beside it.
    Depth,
    /// `sensor_msgs/CompressedImage` beside the images, with the same `CameraInfo`.
    CompressedDepth,
}

impl Form {
    /// All of them, the preferred one first.
    pub const ALL: [Self; 3] = [Self::Points, Self::Depth, Self::CompressedDepth];

    /// The type of its messages, as `sensor_msgs/msg/PointCloud2`.
    pub const fn type_name(self) -> &'static str {
        match self {
            Self::Points => CLOUD,
            Self::Depth => IMAGE,
            Self::CompressedDepth => COMPRESSED_IMAGE,
        }
    }

    /// The form of scans of this type; `None` of what is no scan.
    pub fn of_type(type_name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|form| form.type_name() == type_name)
    }

    /// Whether a topic in this form is taken for a sensor's where nobody has named it: an image is one of depth only when its name
    /// says so, and what a node made of clouds is no sensor's.
    pub fn is_of_sensor(self, topic: &str) -> bool {
        match self {
            Self::Points => !topic.ends_with(sent::LABELLED.name.trim_start_matches('~')),
            Self::Depth | Self::CompressedDepth => is_of_depth(topic),
        }
    }

    /// Where the intrinsics of images on this topic are looked for, the likelier first: on the `camera_info` beside the plain image,
    /// as `image_transport` has it, and on the one beside the topic itself. Of plain images the two are one.
    pub fn camera_infos_beside(self, image: &str) -> [String; 2] {
        let above = folder(image);
        // The name of a compressed image is that of the plain one and its transport.
        let above_plain = if self == Self::CompressedDepth { folder(above) } else { above };
        [above_plain, above].map(|above| format!("{above}/camera_info"))
    }
}

/// Whether a name says that its topic is a depth camera's.
pub fn is_of_depth(topic: &str) -> bool {
    topic.to_lowercase().contains("depth")
}

/// What a name stands below.
pub fn folder(topic: &str) -> &str {
    topic.rsplit_once('/').map_or("", |(folder, _)| folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_form_is_that_of_its_type() {
        for form in Form::ALL {
            assert_eq!(Form::of_type(form.type_name()), Some(form));
        }
        assert_eq!(Form::of_type("sensor_msgs/msg/CameraInfo"), None);
    }

    #[test]
    fn an_image_is_of_depth_by_its_name_and_a_cloud_that_a_node_made_is_of_no_sensor() {
        for form in [Form::Depth, Form::CompressedDepth] {
            assert!(form.is_of_sensor("/camera/Depth/image_raw"));
            assert!(!form.is_of_sensor("/camera/rgb/image_color"));
        }
        assert!(Form::Points.is_of_sensor("/points") && Form::Points.is_of_sensor("/points_labelled/raw"));
        assert!(!Form::Points.is_of_sensor("/other/cfodi/points_labelled"));
    }

    #[test]
    fn intrinsics_are_beside_the_plain_image() {
        let beside = |form: Form, image: &str| form.camera_infos_beside(image);
        assert_eq!(beside(Form::Depth, "/camera/depth/image_raw"), ["/camera/depth/camera_info"; 2]);
        assert_eq!(
            beside(Form::CompressedDepth, "/camera/depth/image_raw/compressedDepth"),
            ["/camera/depth/camera_info", "/camera/depth/image_raw/camera_info"]
        );
        assert_eq!(beside(Form::Depth, "/depth"), ["/camera_info"; 2]);
        assert_eq!(beside(Form::CompressedDepth, "depth"), ["/camera_info"; 2]);
    }
}
