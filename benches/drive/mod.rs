//! A drive as messages: the cabinet recording where there is one (`CFODI_DATA`), the simulated room otherwise.

use cfodi::engine::{Isometry3, Stamp};
use cfodi::msg::ros::PointCloud2;
use cfodi::sim::{Drive, Scene};

use crate::support;

/// Clouds with the sensor's poses, and what they are called.
pub(crate) fn drive() -> (&'static str, Vec<(PointCloud2, Isometry3<f64>)>) {
    if let Some(recording) = support::recording("tum_fr3_cabinet58", "benches on the cabinet recording") {
        let rows = recording.rows().iter();
        return ("cabinet", rows.map(|row| (recording.message(row), row.map_from_optical)).collect());
    }
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(0));
    ("room", (0..60).map(|i| (drive.step(10 * i).cloud, drive.fixed_from_optical(10 * i))).collect())
}
