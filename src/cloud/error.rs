//! Why a message was refused.

use crate::count::count_of;
use crate::reason::Reason;

/// Why a message gave no [`Cloud`](super::Cloud); each variant carries the numbers that contradict each other.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CloudError {
    /// The header's nanoseconds do not fit a second.
    #[error("header stamp has nanosec {nanosec}, must be below 1000000000")]
    BadStamp {
        /// `header.stamp.nanosec`.
        nanosec: u32,
    },
    /// The header names no frame.
    #[error("header frame_id is empty")]
    EmptyFrameId,
    /// The header's frame has a name that no driver gives.
    #[error("header frame_id has {bytes} bytes, at most {max} are taken")]
    LongFrameId {
        /// Its length.
        bytes: usize,
        /// The most.
        max: usize,
    },
    /// More points than the filter allows.
    #[error("{points} points, at most {max} are taken")]
    TooManyPoints {
        /// `height * width`.
        points: u64,
        /// `max_points` of the filter.
        max: u32,
    },
    /// More fields than any driver sends.
    #[error("{fields} fields, at most {max} are read")]
    TooManyFields {
        /// Number of fields.
        fields: usize,
        /// [`MAX_FIELDS`](super::MAX_FIELDS).
        max: usize,
    },
    /// No field of that name.
    #[error("no field `{field}` among [{present}]")]
    MissingField {
        /// `x`, `y` or `z`.
        field: &'static str,
        /// The names that are there, shortened.
        present: String,
    },
    /// Two fields of that name.
    #[error("field `{field}` occurs {times} times")]
    DuplicateField {
        /// `x`, `y` or `z`.
        field: &'static str,
        /// How often it occurs.
        times: usize,
    },
    /// A coordinate that is neither FLOAT32 (7) nor FLOAT64 (8).
    #[error("field `{field}` has datatype {datatype}, must be 7 (FLOAT32) or 8 (FLOAT64)")]
    FieldType {
        /// `x`, `y` or `z`.
        field: &'static str,
        /// Its `datatype`.
        datatype: u8,
    },
    /// A coordinate that lies partly outside its point.
    #[error("field `{field}` ends at byte {end} of a point of {}", count_of(*point_step, "byte"))]
    FieldOutsidePoint {
        /// `x`, `y` or `z`.
        field: &'static str,
        /// First byte after it, from the start of the point.
        end: u64,
        /// Bytes of a point.
        point_step: u32,
    },
    /// Points of no size.
    #[error("point_step is 0")]
    ZeroPointStep,
    /// Rows that do not hold their points.
    #[error("row_step is {row_step}, a row of points takes {}", count_of(*needed, "byte"))]
    ShortRowStep {
        /// `row_step`.
        row_step: u32,
        /// `width * point_step`.
        needed: u64,
    },
    /// Less data than the rows take.
    #[error("{} of data, the rows take {needed}", count_of(*got, "byte"))]
    ShortData {
        /// `height * row_step`; of a single row what its points take.
        needed: u64,
        /// Length of `data`.
        got: usize,
    },
    /// A `sensor_msgs/CameraInfo` that projects nothing.
    #[error(
        "camera_info has fx {fx}, fy {fy}, cx {cx}, cy {cy}; all must be finite, fx and fy above 0 and not so small that a pixel looks nowhere"
    )]
    BadIntrinsics {
        /// Focal length (px).
        fx: f64,
        /// Focal length (px).
        fy: f64,
        /// Principal point (px).
        cx: f64,
        /// Principal point (px).
        cy: f64,
    },
    /// A stamp of zero where the clock is the system's.
    #[error("its stamp is zero: the driver does not say when it was taken")]
    NoStamp,
    /// A depth image before the first `sensor_msgs/CameraInfo`.
    #[error("a depth image, and no camera_info has come yet")]
    NoCameraInfo,
    /// An image of another size than the camera's.
    #[error("an image of {width}x{height} pixels, by camera_info it must be {camera_width}x{camera_height}")]
    ImageSize {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Pixels in a row by `sensor_msgs/CameraInfo`, after region of interest and binning.
        camera_width: u32,
        /// Rows likewise.
        camera_height: u32,
    },
    /// Pixels that are no depth.
    #[error("encoding `{encoding}` is no depth image; 16UC1, mono16 and 32FC1 are read")]
    UnknownEncoding {
        /// `encoding`, shortened.
        encoding: String,
    },
    /// A compression that is not read.
    #[error(
        "compressed format `{format}` is not read; of depth images in PNG, `16UC1; compressedDepth png` is"
    )]
    UnknownFormat {
        /// `format`, shortened.
        format: String,
    },
    /// Rows that do not hold their pixels.
    #[error("step is {step}, a row of pixels takes {needed} bytes")]
    ShortStep {
        /// `step`.
        step: u32,
        /// `width` times the bytes of a pixel.
        needed: u64,
    },
    /// Too little data for what stands before a compressedDepth image.
    #[error("{} of data, the header of compressedDepth takes {needed}", count_of(*got, "byte"))]
    ShortHeader {
        /// Bytes of the header.
        needed: usize,
        /// Length of `data`.
        got: usize,
    },
    /// A PNG that is no depth image.
    #[error("format `{format}` holds a PNG of {kind}; a depth image has one channel of 16 bits")]
    PngKind {
        /// `format`, shortened.
        format: String,
        /// Bits and channels.
        kind: String,
    },
    /// A PNG that cannot be read.
    #[error("not a readable PNG: {0}")]
    Png(String),
    /// The bytes are no serialised message of their type, for instance a cut one.
    #[error("not a readable message: {0}")]
    Undecodable(String),
}

impl CloudError {
    /// What refused messages are counted by, with what that means.
    pub fn reason(&self) -> Reason {
        let (key, sentence) = match self {
            Self::BadStamp { .. } => {
                ("bad_stamp", "The nanoseconds of the header’s stamp do not fit a second.")
            }
            Self::EmptyFrameId => ("empty_frame_id", "The header names no frame."),
            Self::LongFrameId { .. } => ("long_frame_id", "The header’s frame has too long a name."),
            Self::TooManyPoints { .. } => ("too_many_points", "The cloud has more points than max_points."),
            Self::TooManyFields { .. } => {
                ("too_many_fields", "The cloud has more fields than any driver sends.")
            }
            Self::MissingField { .. } => ("missing_field", "The cloud has no x, y or z."),
            Self::DuplicateField { .. } => {
                ("duplicate_field", "A coordinate occurs twice in the cloud’s fields.")
            }
            Self::FieldType { .. } => ("field_type", "A coordinate is neither FLOAT32 nor FLOAT64."),
            Self::FieldOutsidePoint { .. } => {
                ("field_outside_point", "A coordinate lies partly outside its point.")
            }
            Self::ZeroPointStep => ("zero_point_step", "The points of the cloud have no size."),
            Self::ShortRowStep { .. } => {
                ("short_row_step", "The rows of the cloud are too short for their points.")
            }
            Self::ShortData { .. } => ("short_data", "The cloud has less data than its size says."),
            Self::BadIntrinsics { .. } => {
                ("bad_intrinsics", "The camera info has no usable focal length or principal point.")
            }
            Self::NoStamp => ("no_stamp", "The header’s stamp is zero."),
            Self::NoCameraInfo => ("no_camera_info", "No camera info came for the depth image."),
            Self::ImageSize { .. } => {
                ("image_size", "The image is of another size than its camera info says.")
            }
            Self::UnknownEncoding { .. } => ("unknown_encoding", "The image’s encoding is none of depth."),
            Self::UnknownFormat { .. } => ("unknown_format", "The compressed image’s format cannot be read."),
            Self::ShortStep { .. } => ("short_step", "The rows of the image are too short for their pixels."),
            Self::ShortHeader { .. } => {
                ("short_header", "The compressed depth image ends before its PNG begins.")
            }
            Self::PngKind { .. } => ("png_kind", "The PNG is no image of 16 bit greys."),
            Self::Png(_) => ("png", "The PNG of the depth image cannot be read."),
            Self::Undecodable(_) => ("undecodable", "The message cannot be read as what its topic says."),
        };
        Reason::new(key, sentence)
    }
}
