//! Why a cloud was refused.

/// Why a message gave no [`Cloud`](super::Cloud); each variant carries the numbers that contradict each other.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
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
    /// The bytes are no serialised `sensor_msgs/PointCloud2`, for instance a cut message.
    #[error("not a readable PointCloud2: {0}")]
    Undecodable(String),
}

impl CloudError {
    /// A short key to count refused clouds by.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::BadStamp { .. } => "bad_stamp",
            Self::EmptyFrameId => "empty_frame_id",
            Self::TooManyPoints { .. } => "too_many_points",
            Self::TooManyFields { .. } => "too_many_fields",
            Self::MissingField { .. } => "missing_field",
            Self::DuplicateField { .. } => "duplicate_field",
            Self::FieldType { .. } => "field_type",
            Self::FieldOutsidePoint { .. } => "field_outside_point",
            Self::ZeroPointStep => "zero_point_step",
            Self::ShortRowStep { .. } => "short_row_step",
            Self::ShortData { .. } => "short_data",
            Self::Undecodable(_) => "undecodable",
        }
    }
}
