//! Why a message was refused.

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
    #[error("field `{field}` ends at byte {end} of a point of {point_step} bytes")]
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
    #[error("row_step is {row_step}, a row of points takes {needed} bytes")]
    ShortRowStep {
        /// `row_step`.
        row_step: u32,
        /// `width * point_step`.
        needed: u64,
    },
    /// Less data than the rows take.
    #[error("{got} bytes of data, the rows take {needed}")]
    ShortData {
        /// `height * row_step`.
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
    #[error("{got} bytes of data, the header of compressedDepth takes {needed}")]
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
    /// A short key to count refused messages by.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::BadStamp { .. } => "bad_stamp",
            Self::EmptyFrameId => "empty_frame_id",
            Self::LongFrameId { .. } => "long_frame_id",
            Self::TooManyPoints { .. } => "too_many_points",
            Self::TooManyFields { .. } => "too_many_fields",
            Self::MissingField { .. } => "missing_field",
            Self::DuplicateField { .. } => "duplicate_field",
            Self::FieldType { .. } => "field_type",
            Self::FieldOutsidePoint { .. } => "field_outside_point",
            Self::ZeroPointStep => "zero_point_step",
            Self::ShortRowStep { .. } => "short_row_step",
            Self::ShortData { .. } => "short_data",
            Self::BadIntrinsics { .. } => "bad_intrinsics",
            Self::NoStamp => "no_stamp",
            Self::NoCameraInfo => "no_camera_info",
            Self::ImageSize { .. } => "image_size",
            Self::UnknownEncoding { .. } => "unknown_encoding",
            Self::UnknownFormat { .. } => "unknown_format",
            Self::ShortStep { .. } => "short_step",
            Self::ShortHeader { .. } => "short_header",
            Self::PngKind { .. } => "png_kind",
            Self::Png(_) => "png",
            Self::Undecodable(_) => "undecodable",
        }
    }
}
