//! How tables say by how much the poses of their runs were told wrong: not at all where these are exact.

use std::fmt::Write as _;

use crate::sim::PoseNoise;

/// What a score means where poses are wrong, after what it means else.
const MEANING: &str = "\
- **poses wrong by**: the standard deviations of each coordinate of the robot's place and about each of its axes. Points lie where the
  pose that is told puts them, and so do surfaces and their pieces: one may be several voxels thick, or in several layers where it was
  seen from poses that differ. Scored is then also what wrong poses have moved off its surface, up to 2 sigma of sensor and pose
  together. Planes and areas are held against where the surface truly is and what of it was truly to be seen. A voxel that a method
  has cleared because it looks through there now is scored as one in no cluster
";

/// After a heading.
pub(super) fn in_heading(noise: Option<PoseNoise>) -> String {
    noise.map_or_else(String::new, |noise| format!(", poses wrong by {noise}"))
}

/// After the words of a legend.
pub(super) fn in_legend(noise: Option<PoseNoise>) -> &'static str {
    if noise.is_some() { MEANING } else { "" }
}

/// A table for programs, with the noise in two more columns.
pub(super) fn in_csv(noise: Option<PoseNoise>, csv: String) -> String {
    let Some(PoseNoise { metres, radians }) = noise else { return csv };
    let (header, lines) = csv.split_once('\n').unwrap_or((&csv, ""));
    let mut text = format!("{header},pose_noise_m,pose_noise_rad\n");
    for line in lines.lines() {
        _ = writeln!(text, "{line},{metres},{radians}");
    }
    text
}
