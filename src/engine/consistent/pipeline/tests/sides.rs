//! Planes face the side that they were seen from.

use std::collections::BTreeMap;

use super::*;
use crate::engine::{ClusterId, Snapshot};

/// The least mean, over the voxels of a cluster with a normal, of the cosine between that and the cluster's.
fn least_agreement(snapshot: &Snapshot) -> f64 {
    let mut sums: BTreeMap<ClusterId, (f64, f64)> = BTreeMap::new();
    let normals: BTreeMap<_, _> =
        snapshot.clusters.iter().map(|cluster| (cluster.id, cluster.normal)).collect();
    for (id, normal) in snapshot.voxels.iter().filter_map(|voxel| voxel.cluster.zip(voxel.normal)) {
        let (sum, count) = sums.entry(id).or_default();
        (*sum, *count) = (*sum + normals[&id].dot(&normal), *count + 1.0);
    }
    sums.into_values().map(|(sum, count)| sum / count).fold(1.0, f64::min)
}

/// Seen at a grazing angle, as where somebody walks past, the directions towards the sensor lie in a surface's plane.
#[test]
fn a_plane_faces_the_side_that_its_patches_and_its_voxels_do() {
    let drive = Drive::new(Scene::named("moving").unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut engine = Consistent::new(Params::default());
    let mut decided = 0;
    for index in (40..80).step_by(6) {
        engine.insert(&drive.labelled_scan(index).scan);
        decided += engine.surfaces.check_sides();
        let least = least_agreement(&engine.snapshot());
        assert!(least > -0.9, "scan {index}: {least}");
    }
    assert!(decided > 0, "the directions towards the sensor say the same");
}
