//! The paper's figures on a real Kinect recording: acceptance values, and the paper's conclusions on parameters.
#![cfg(feature = "bag")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod support;

use std::time::Duration;

use cfodi::engine::Params;
use cfodi::experiment::Experiment;

/// A column of the lines of `effects.csv` that vary this parameter, by ascending value.
fn column(effects: &str, parameter: &str, name: &str) -> Vec<f64> {
    let place = effects.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
    let lines = effects.lines().map(|line| line.split(',').collect::<Vec<_>>());
    lines.filter(|cells| cells[0] == parameter).map(|cells| cells[place].parse().unwrap()).collect()
}

#[test]
fn the_cabinet_gives_the_acceptance_values_and_bears_out_the_papers_conclusions() {
    let test = "the_cabinet_gives_the_acceptance_values_and_bears_out_the_papers_conclusions";
    let Some(recording) = support::recording("tum_fr3_cabinet58", test) else { return };
    let mut reads = 0;
    let clock = move || {
        reads += 1;
        Duration::from_millis(reads)
    };
    let mut experiment = Experiment::new(Params::paper(), clock);
    recording.scans(1).for_each(|scan| experiment.scan(&scan));
    let results = experiment.finish();

    let summary = results.summary();
    let [cfodi, consistent, statics] = [0, 1, 2].map(|method| &summary.methods[method]);
    assert_eq!((summary.scans, cfodi.dense_voxels_last), (58, Some(14_342)));
    assert_eq!((cfodi.clusters_last, cfodi.large_clusters_last), (Some(292), Some(32)));
    assert_eq!((statics.clusters_last, statics.large_clusters_last), (Some(252), Some(37)));
    assert!((cfodi.rand_index_to_static_last.unwrap() - 0.92).abs() < 0.0055);
    // "The error of CFODI is slightly higher than that of STATIC."
    let above = cfodi.normal_error_above_static_rad.unwrap();
    assert!((0.0..0.12).contains(&above), "{above} rad");

    // What mode `consistent` mends.
    assert!(10 * consistent.single_clusters_last.unwrap() <= cfodi.single_clusters_last.unwrap());
    assert!(consistent.share_in_clusters_last.unwrap() >= 0.9);
    assert!(consistent.normal_error_mean_rad.unwrap() < statics.normal_error_mean_rad.unwrap());

    let folder = tempfile::tempdir().unwrap();
    assert!(results.write(folder.path()).is_empty());
    let effects = std::fs::read_to_string(folder.path().join("effects.csv")).unwrap();
    let errors = column(&effects, "depth", "normal_error_rad");
    assert!(errors[0] > errors[3] && errors[3] > errors[7], "{errors:?}");
    let by_angle = column(&effects, "max_normal_angle", "clusters");
    assert!(by_angle.is_sorted_by(|a, b| a > b), "{by_angle:?}");
    let by_vicinity = column(&effects, "min_vicinity", "clusters");
    assert!(by_vicinity.is_sorted_by(|a, b| a < b), "{by_vicinity:?}");
}
