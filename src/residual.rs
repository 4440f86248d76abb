//! What is said where points are off their surfaces by more than noise and what is known of the poses explain.

use crate::engine::Params;

/// What a sensor's bias, and poses that are taken as exact, make of it (m).
const EXACT: f64 = 0.01;

/// The part of what poses put points off by that shows: what is farthest off is in no patch of the surface.
const SHOWN: f64 = 0.8;

/// Of a map with these parameters whose points are so far off their surfaces beyond the sensor's noise
/// ([`crate::engine::Snapshot::beyond_noise`], m); `None` where `pose_sigma` explains it.
pub(crate) fn line(beyond_noise: f64, params: &Params) -> Option<String> {
    let told = params.pose_sigma();
    (beyond_noise > told + EXACT).then(|| {
        let whole_centimetres = |metres: f64| (metres * 100.0).round() / 100.0;
        let likely = whole_centimetres(beyond_noise / SHOWN);
        let larger = (likely > params.voxel_size())
            .then(|| format!(" with voxel_size:={} or more", whole_centimetres(1.5 * likely)));
        format!(
            "points are {:.0} mm off their surfaces beyond the sensor's noise (median by area), and pose_sigma is {told}: where poses \
             are off, surfaces come in pieces; pose_sigma:={likely}{} tells by how much, unless the sensor is noisier than its \
             noise_model",
            beyond_noise * 1e3,
            larger.unwrap_or_default()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_said_where_more_shows_than_is_told_and_how_much_to_tell() {
        let told = |pose_sigma| Params::default().with_pose_sigma(pose_sigma).unwrap();
        let said = |beyond_noise, pose_sigma| line(beyond_noise, &told(pose_sigma));
        assert_eq!([said(0.0, 0.0), said(0.009, 0.0), said(0.04, 0.04)], [None, None, None]);
        let begins = |line: Option<String>, with: &str| line.is_some_and(|line| line.contains(with));
        assert!(begins(said(0.034, 0.0), "points are 34 mm off"));
        assert!(begins(said(0.034, 0.0), "pose_sigma is 0: "));
        assert!(begins(said(0.034, 0.02), "pose_sigma:=0.04 tells"));
        // At most a voxel can be told.
        assert!(begins(said(0.11, 0.05), "pose_sigma:=0.14 with voxel_size:=0.21 or more tells"));
    }
}
