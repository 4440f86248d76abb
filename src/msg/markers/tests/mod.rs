//! Maps for the tests, and a viewer that does with messages what RViz does.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::*;
use crate::engine::{Cluster, ClusterId, ClusterState, DenseVoxel, Stamp, SurfaceClass, VoxelKey};

mod fill;
mod protocol;
mod shape;

fn session() -> Session {
    Session { id: 1, frame_id: "odom".into() }
}

/// A square of 1 m by 1 m with its middle at the origin, seen from above.
pub(in crate::msg) fn square(id: u64) -> Cluster {
    Cluster {
        class: SurfaceClass::Floor,
        class_confidence: 1.0,
        covariance: Matrix3::zeros(),
        voxel_count: 1,
        point_count: 100,
        ..Cluster::rectangle(id, Isometry3::identity(), [1.0, 1.0])
    }
}

/// A square as mode `paper` gives it: without outline, area and class.
fn heap(id: u64) -> Cluster {
    Cluster { boundary: Vec::new(), area: None, class: SurfaceClass::Unknown, ..square(id) }
}

fn voxel(x: i32, cluster: Option<u64>) -> DenseVoxel {
    DenseVoxel {
        key: VoxelKey::new(x, 0, 0).unwrap(),
        count: 20,
        centre: Point3::new(0.1 * f64::from(x), 0.0, 0.0),
        normal: Some(Vector3::z_axis()),
        curvature: 0.0,
        cluster: cluster.and_then(ClusterId::new),
    }
}

/// These clusters, by ascending id, with a voxel each, and voxels in none.
fn map(clusters: Vec<Cluster>, unclustered: u32) -> Snapshot {
    let mut voxels: Vec<_> =
        (0..).zip(&clusters).map(|(x, cluster)| voxel(x, Some(cluster.id.get()))).collect();
    voxels.extend((0..unclustered).map(|i| voxel(1000 + i as i32, None)));
    Snapshot { sequence: 1, stamp: None, voxel_size: 0.1, clusters, voxels, unclustered_voxels: unclustered }
}

/// What a viewer shows.
#[derive(Clone, Debug, Default, PartialEq)]
struct Viewer(BTreeMap<Identity, Marker>);

impl Viewer {
    fn of(message: &MarkerArray) -> Self {
        let mut viewer = Self::default();
        viewer.take(message);
        viewer
    }

    fn take(&mut self, message: &MarkerArray) {
        let mut said = BTreeSet::new();
        for marker in &message.markers {
            let identity = (marker.ns.clone(), marker.id);
            assert!(said.insert(identity.clone()), "{identity:?} is twice in a message");
            match marker.action {
                Marker::ADD => drop(self.0.insert(identity, marker.clone())),
                Marker::DELETE => drop(self.0.remove(&identity)),
                Marker::DELETEALL => self.0.clear(),
                action => panic!("action {action}"),
            }
        }
    }

    fn identities(&self) -> Vec<(&str, i32)> {
        self.0.keys().map(|(ns, id)| (ns.as_str(), *id)).collect()
    }

    fn get(&self, ns: &str, id: i32) -> &Marker {
        &self.0[&(ns.to_owned(), id)]
    }
}
