//! From the bytes of a `sensor_msgs/PointCloud2` or of a depth image to the valid points of one sensor message.
//!
//! Keeps true: every offset, step and size is compared with the data before a byte is read or memory is taken; what
//! a sender claims about its own points (`is_dense`) is not relied on. The points stay in the sensor's frame, in the
//! precision they came in (m). Costs one pass over the data and 4 bytes a pixel of a depth camera, 12 (24 in double
//! precision) a point of any other cloud.
//!
//! Two ways in, one conversion behind both: [`decode`] for a message in memory, [`CloudSeed`] for CDR bytes, which
//! borrows the points from the receive buffer, so that a cloud of several megabytes is never copied. Depth images have
//! the same two, [`decode_depth`] and [`DepthSeed`], and need a [`Camera`]; with the feature `bag` compressed ones have
//! `decode_compressed` and `CompressedSeed`.

mod camera;
#[cfg(feature = "bag")]
mod compressed;
mod convert;
mod depth;
mod error;
mod layout;
mod pinhole;
mod seed;

#[cfg(test)]
mod tests;

use crate::count::count_of;
use crate::engine::{Points, Stamp};
use crate::msg::ros::PointCloud2;

pub use camera::{Camera, distortion, is_rectified_by_name, other_frame};
#[cfg(feature = "bag")]
pub use compressed::{CompressedSeed, decode_compressed};
pub use depth::{DepthSeed, decode_depth};
pub use error::CloudError;
pub use layout::MAX_FIELDS;
pub use seed::{CloudSeed, ImageSeed};

use convert::{Converted, Gate, convert};
use layout::{Description, Layout};

/// The points of one message that are valid and in range, in the sensor's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// Time of acquisition.
    pub stamp: Stamp,
    /// The sensor's frame; not empty.
    pub frame_id: String,
    /// The points that passed the filter, in the order of the message, and where rays end that were measured beyond it, up to 100 m
    /// (m); finite.
    pub points: Points,
    /// Points in the message: `points.len() + invalid + out_of_range`.
    pub total: u32,
    /// Points without a measurement.
    pub invalid: u32,
    /// Measured points nearer than `min_range` or farther than `max_range`.
    pub out_of_range: u32,
}

/// The cloud of one message, or why it cannot be used.
pub type Decoded = Result<Cloud, CloudError>;

impl Cloud {
    /// What is to be said where it shows nothing, or next to nothing: an empty scan is a scan, and may be of a covered sensor.
    pub fn shows_nothing(&self) -> Option<String> {
        self.hardly_used().or_else(|| self.points.is_empty().then(|| "it has no points".to_owned()))
    }

    /// What is to be said where next to nothing of it is of use: its unit, frame or range may be others than assumed.
    pub fn hardly_used(&self) -> Option<String> {
        let Self { total, invalid, out_of_range, .. } = self;
        let used = self.points.len();
        let is_hardly = *total > 0 && used * 10 < *total as usize;
        is_hardly.then(|| {
            format!(
                "of {} only {used} can be used: {invalid} invalid, {out_of_range} out of range (see min_range, \
                 max_range, optical)",
                count_of(*total, "point")
            )
        })
    }
}

/// Which points of a message are taken in; the configuration checks the values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudFilter {
    /// Nearest range taken in (m), inclusive: depth z in an optical frame and of depth images, distance from the
    /// origin elsewhere.
    pub min_range: f64,
    /// Farthest range taken in (m), inclusive, measured like `min_range`.
    pub max_range: f64,
    /// Whether a cloud is in an optical frame; a depth image always is.
    pub optical: Optical,
    /// Most points or pixels of one message; more is refused before anything is read.
    pub max_points: u32,
}

impl CloudFilter {
    /// Those of a Kinect.
    pub const DEFAULT: Self =
        Self { min_range: 0.4, max_range: 6.0, optical: Optical::Auto, max_points: 4_000_000 };
}

impl Default for CloudFilter {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Whether a cloud's frame is optical: z forward, x right, y down (REP 103).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Optical {
    /// By the frame's name, see [`Optical::of_frame`].
    #[default]
    Auto,
    /// Always.
    Yes,
    /// Never.
    No,
}

impl Optical {
    /// Whether data in this frame is optical.
    ///
    /// `Auto` takes names that end in `_optical_frame`, as drivers name such frames, and `kinect_depth`, that of the Kinect v1 driver;
    /// a namespace before the name (`robot/kinect_depth`) does not matter. It does not take `_optical`, the suffix of REP 103, which
    /// the frame of a cloud seldom has.
    pub fn of_frame(self, frame_id: &str) -> bool {
        match self {
            Self::Yes => true,
            Self::No => false,
            Self::Auto => {
                frame_id.ends_with("_optical_frame") || frame_id.rsplit('/').next() == Some("kinect_depth")
            }
        }
    }
}

/// Whether a frame is optical by the name that a driver or REP 103 gives it.
pub fn is_optical_by_name(frame: &str) -> bool {
    frame.ends_with("_optical") || Optical::Auto.of_frame(frame)
}

/// What is to be said of a fixed frame that is an optical one by its name: classes of surfaces go by its z, which is to be up (REP
/// 103, 105), and there z looks ahead.
pub fn z_is_not_up(fixed_frame: &str) -> Option<String> {
    is_optical_by_name(fixed_frame).then(|| {
        format!(
            "the fixed frame `{fixed_frame}` is an optical one by its name, whose z looks ahead: classes of surfaces need one whose z \
             is up, and are wrong in it"
        )
    })
}

/// The valid points in range of a message in memory.
///
/// A message of zero height or width is a valid scan without points, whatever its fields say.
///
/// # Errors
///
/// A [`CloudError`] where the message contradicts itself or exceeds a bound; never [`CloudError::Undecodable`].
pub fn decode(message: &PointCloud2, filter: &CloudFilter) -> Decoded {
    cloud_from(&Description::of(message), &message.data, filter)
}

/// What both ways in come down to.
fn cloud_from(description: &Description<'_>, data: &[u8], filter: &CloudFilter) -> Decoded {
    let stamp = layout::stamp(description.header)?;
    let frame_id = layout::frame_id(description.header)?;
    let gate = Gate::new(filter, filter.optical.of_frame(frame_id));
    let converted = match Layout::check(description, data.len(), filter.max_points)? {
        Some(layout) => convert(&layout, data, &gate),
        None => Converted::default(),
    };
    Ok(Cloud::new(stamp, frame_id, converted))
}

impl Cloud {
    fn new(stamp: Stamp, frame_id: &str, converted: Converted) -> Self {
        let Converted { points, invalid, out_of_range } = converted;
        let total = points.len() as u32 + invalid + out_of_range;
        Self { stamp, frame_id: frame_id.to_owned(), points, total, invalid, out_of_range }
    }
}
