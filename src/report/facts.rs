//! What a replay knows beside its story.

use std::collections::BTreeMap;

/// What the page says in words and numbers; all of it is shown as text, whatever it holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Name of the input.
    pub title: String,
    /// The frame in which the map lives.
    pub fixed_frame: String,
    /// Parameters as (name, value).
    pub parameters: Vec<(String, String)>,
    /// Scans that the engine took in.
    pub scans: u64,
    /// Messages that could not be used, by reason.
    pub skipped: BTreeMap<String, u64>,
    /// Points that all scans put into voxels.
    pub points: u64,
    /// What became of the others, by reason; empty where there are none.
    pub points_unused: String,
    /// Time that the replay took (s).
    pub wall_seconds: f64,
    /// Whole sentences that a reader must know, such as that the file is cut.
    pub notes: Vec<String>,
    /// Further figures.
    pub figures: Vec<Figure>,
}

/// A figure of the caller's.
///
/// The page shows it as an image, so that nothing in it can run, load or restyle the page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Figure {
    /// Heading.
    pub title: String,
    /// A whole SVG document.
    pub svg: String,
    /// What is to be seen.
    pub caption: String,
}

/// What a reason of a skipped message means; `None` for an unknown one.
pub(super) fn sentence(reason: &str) -> Option<&'static str> {
    let known = SENTENCES.binary_search_by_key(&reason, |&(known, _)| known).ok()?;
    Some(SENTENCES[known].1)
}

/// By ascending reason.
const SENTENCES: &[(&str, &str)] = &[
    ("after_jump", "The scan came after the jump back of the stamps at which this ends."),
    ("bad_intrinsics", "The camera info has no usable focal length or principal point."),
    ("bad_norm", "The rotation of a transform is no unit quaternion."),
    ("bad_stamp", "The nanoseconds of the header’s stamp do not fit a second."),
    ("cycle", "A transform would make a frame its own ancestor."),
    ("duplicate_field", "A coordinate occurs twice in the cloud’s fields."),
    ("empty_frame_id", "The header names no frame."),
    ("empty_name", "A transform names no frame."),
    ("field_outside_point", "A coordinate lies partly outside its point."),
    ("field_type", "A coordinate is neither FLOAT32 nor FLOAT64."),
    ("image_size", "The image is of another size than its camera info says."),
    ("long_frame_id", "The header’s frame has too long a name."),
    ("long_name", "A transform’s frame has too long a name."),
    ("missing_field", "The cloud has no x, y or z."),
    ("no_camera_info", "No camera info came for the depth image."),
    ("no_stamp", "The header’s stamp is zero."),
    ("non_finite", "A transform holds a number that is not finite."),
    ("other_input", "Another input of the same sensor had been taken."),
    ("png", "The PNG of the depth image cannot be read."),
    ("png_kind", "The PNG is no image of 16 bit greys."),
    ("refused", "A transform was refused by the buffer of transforms."),
    ("self_transform", "A transform leads from a frame to itself."),
    ("session_ended", "The stamps jumped back while the scan waited for its transform."),
    ("short_data", "The cloud has less data than its size says."),
    ("short_header", "The compressed depth image ends before its PNG begins."),
    ("short_row_step", "The rows of the cloud are too short for their points."),
    ("short_step", "The rows of the image are too short for their pixels."),
    ("shutdown", "The replay was stopped while the scan waited for its transform."),
    ("tf_not_connected", "No chain of transforms joins the sensor to the fixed frame."),
    ("tf_not_jumped_back", "The stamps jumped back, and the transforms did not."),
    ("tf_not_looked_up", "No transform was looked for before the end."),
    ("tf_numeric", "The transforms to the fixed frame cannot be put together."),
    ("tf_too_early", "The cloud is older than the oldest transform."),
    ("tf_too_late", "The cloud is newer than the newest transform."),
    ("tf_unknown_frame", "No transform names the sensor’s frame or the fixed frame."),
    ("too_many_fields", "The cloud has more fields than any driver sends."),
    ("too_many_frames", "The transforms name too many frames."),
    ("too_many_points", "The cloud has more points than max_points."),
    ("transform_timeout", "No transform to the fixed frame came within tf_timeout."),
    ("undecodable", "The message cannot be read as what its topic says."),
    ("unknown_encoding", "The image’s encoding is none of depth."),
    ("unknown_format", "The compressed image’s format cannot be read."),
    ("waiting_queue_full", "Too many clouds waited for their transforms."),
    ("zero_point_step", "The points of the cloud have no size."),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_in_order_so_that_each_is_found() {
        assert!(SENTENCES.is_sorted_by(|a, b| a.0 < b.0));
        for (reason, text) in SENTENCES {
            assert_eq!(sentence(reason), Some(*text));
        }
        assert_eq!(sentence("</script>"), None);
    }
}
