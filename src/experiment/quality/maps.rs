//! The maps that are scored, behind one trait.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::found::{Found, FoundCluster, FoundPlane};
use super::plane::Plane;
use crate::engine::consistent::Consistent;
use crate::engine::paper::Cfodi;
use crate::engine::paper::statics::StaticMap;
use crate::engine::{DenseVoxel, Params, Scan, Snapshot, VoxelKey, canonical};
use crate::experiment::clustering::Clustering;
use crate::experiment::method::Method;

/// A map that takes in scans and is asked at the end what it has found.
pub(super) trait ScoredMap {
    /// Takes in a scan.
    fn insert(&mut self, scan: &Scan);

    /// What each method that it is scored for has found, by the method's name.
    fn found(&self) -> Vec<(&'static str, Found)>;

    /// Whether its partition is what its definition gives from scratch; `None` for a method whose clusters follow from their history.
    fn is_as_from_scratch(&self) -> Option<bool> {
        None
    }
}

/// Empty maps of all methods, in the order of the table.
pub(super) fn scored_maps(params: &Params) -> Vec<Box<dyn ScoredMap>> {
    vec![Box::new(Cfodi::new(*params)), Box::new(Consistent::new(*params))]
}

impl ScoredMap for Consistent {
    fn insert(&mut self, scan: &Scan) {
        Self::insert(self, scan);
    }

    fn found(&self) -> Vec<(&'static str, Found)> {
        let snapshot = self.snapshot();
        let clusters = snapshot.clusters.iter().map(|cluster| {
            let plane = Plane::through(&cluster.centroid, &cluster.normal);
            let pose = cluster.pose;
            let certainty = cluster.plane_covariance.map(|covariance| FoundPlane { pose, covariance });
            let class = Some(cluster.class);
            let confidence = Some(f64::from(cluster.class_confidence));
            (cluster.id.get(), FoundCluster { plane, area: cluster.area, class, confidence, certainty })
        });
        let voxels = Clustering::from(&snapshot).labels().collect();
        vec![(Method::Consistent.name(), Found { voxels, clusters: clusters.collect() })]
    }

    fn is_as_from_scratch(&self) -> Option<bool> {
        Some(canonical(self.partition()) == canonical(self.scratch()))
    }
}

/// CFODI, and what STATIC makes of the same map when the last scan is in.
impl ScoredMap for Cfodi {
    fn insert(&mut self, scan: &Scan) {
        Self::insert(self, scan);
    }

    fn found(&self) -> Vec<(&'static str, Found)> {
        let snapshot = self.snapshot();
        let statics = found_by_static(&self.static_map(), &snapshot);
        vec![(Method::Cfodi.name(), found_by_cfodi(&snapshot)), (Method::Static.name(), statics)]
    }
}

/// A cluster's plane goes through its centroid.
fn found_by_cfodi(snapshot: &Snapshot) -> Found {
    let clusters = snapshot
        .clusters
        .iter()
        .map(|cluster| (cluster.id.get(), plane_alone(&cluster.centroid, &cluster.normal)));
    Found { voxels: Clustering::from(snapshot).labels().collect(), clusters: clusters.collect() }
}

/// A cluster's plane goes through the mean of its voxels' centres, which STATIC has in common with the engine. It faces the side from
/// which the engine has seen them: STATIC turns all normals towards the last scan's sensor, which may stand behind the wall by then.
fn found_by_static(map: &StaticMap, snapshot: &Snapshot) -> Found {
    let seen: BTreeMap<VoxelKey, &DenseVoxel> =
        snapshot.voxels.iter().map(|voxel| (voxel.key, voxel)).collect();
    let mut sums = vec![Sums::default(); map.cluster_normals.len()];
    for voxel in &map.voxels {
        if let Some((cluster, seen)) = voxel.cluster.zip(seen.get(&voxel.key)) {
            sums[cluster as usize].add(seen);
        }
    }
    let clusters = sums.iter().zip(&map.cluster_normals).map(|(sums, normal)| sums.plane(normal));
    Found { voxels: Clustering::from(map).labels().collect(), clusters: (0..).zip(clusters).collect() }
}

/// Sums over the voxels of a cluster, as the engine has seen them.
#[derive(Clone, Default)]
struct Sums {
    centres: Vector3<f64>,
    normals: Vector3<f64>,
    voxels: f64,
}

impl Sums {
    fn add(&mut self, voxel: &DenseVoxel) {
        self.centres += voxel.centre.coords;
        self.normals += voxel.normal.map_or_else(Vector3::zeros, |normal| *normal);
        self.voxels += 1.0;
    }

    /// The plane of this normal, or of its opposite.
    fn plane(&self, normal: &Vector3<f64>) -> FoundCluster {
        let facing = if normal.dot(&self.normals) < 0.0 { -normal } else { *normal };
        plane_alone(&Point3::from(self.centres / self.voxels), &facing)
    }
}

fn plane_alone(point: &Point3<f64>, normal: &Vector3<f64>) -> FoundCluster {
    FoundCluster {
        plane: Plane::through(point, normal),
        area: None,
        class: None,
        confidence: None,
        certainty: None,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::engine::{Points, Stamp};

    #[test]
    fn every_method_is_scored_once() {
        let maps = scored_maps(&Params::default());
        let found = maps.iter().flat_map(|map| map.found());
        let mut scored: Vec<_> = found.map(|(name, _)| name).collect();
        let mut all = Method::ALL.map(Method::name);
        scored.sort_unstable();
        all.sort_unstable();
        assert_eq!(scored, all);
    }

    #[test]
    fn both_find_the_floor_with_its_plane() {
        let points =
            (0..40_000).map(|i| [(i % 200) as f32 * 0.01 + 0.001, (i / 200) as f32 * 0.01 + 0.001, -0.99]);
        let fixed_from_sensor = Isometry3::translation(0.0, 0.0, 1.0);
        let (stamp, points) = (Stamp::from_nanos(1), Points::F32(points.collect()));
        let mut paper = scored_maps(&Params::default()).swap_remove(0);
        paper.insert(&Scan { stamp, fixed_from_sensor, points });
        // Towards a sensor that has gone below the floor STATIC turns it, though it was seen from above.
        let (stamp, below) = (Stamp::from_nanos(2), Isometry3::translation(0.0, 0.0, -3.0));
        paper.insert(&Scan { stamp, fixed_from_sensor: below, points: Points::F32(Vec::new()) });
        for (name, found) in paper.found() {
            assert_eq!((found.voxels.len(), found.clusters.len()), (625, 1), "{name}");
            let (number, floor) = found.clusters.first_key_value().unwrap();
            assert!(found.voxels.iter().all(|(_, cluster)| cluster.as_ref() == Some(number)), "{name}");
            assert!(
                floor.plane.normal.z > 0.999 && (floor.plane.offset + 0.01).abs() < 1e-4,
                "{name}: {floor:?}"
            );
        }
        let names: Vec<_> = paper.found().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["CFODI", "STATIC"]);
    }
}
