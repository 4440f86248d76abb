//! The map as `visualization_msgs/MarkerArray`, in the way RViz likes it.
//!
//! A marker's identity is (ns, id), and an id has 32 bits: cluster ids are mapped to slots, which are used again when
//! a cluster has gone. Markers are updated in place and deleted only when there is nothing more to show for them. A
//! viewer keeps only the newest message and may miss one, so deletions are said several times.

use std::collections::BTreeMap;

use super::clusters::{Session, point};
use super::ros::{ColorRgba, Header, Marker, MarkerArray, Point, Vector3};
use crate::engine::{Cluster, ClusterId, DenseVoxel, MIN_RELIABLE_VOXELS, Snapshot};
use crate::export::colour::cluster_colour;

/// Most cubes of one message: RViz chokes on more. What is beyond is left out and must be said.
pub const MAX_CUBES: usize = 20_000;

/// Namespaces of the markers: cubes and text a cluster, and all normals.
const CLUSTERS: &str = "clusters";
const IDS: &str = "ids";
const NORMALS: &str = "normals";

/// How many messages say a deletion.
const REPEATS: u8 = 5;

/// Keeps track of what a viewer has been shown.
#[derive(Debug, Default)]
pub struct Markers {
    slots: BTreeMap<ClusterId, i32>,
    /// Slots to use again, each with the number of messages that have said its deletion.
    free: BTreeMap<i32, u8>,
    /// Messages sent in this session; the first ones tell viewers to delete what was there before.
    sent: u8,
}

impl Markers {
    /// The markers of this map, and the deletions since the calls before.
    ///
    /// Each cluster has a `CUBE_LIST` in ns `clusters`, with its id as text, and one of 10 voxels or more its id as a
    /// visible text in ns `ids`; ns `normals` holds one `LINE_LIST` for all normals.
    pub fn update(&mut self, session: &Session, snapshot: &Snapshot) -> MarkerArray {
        let header = session.header(snapshot.stamp);
        let shown = &snapshot.voxels[..snapshot.voxels.len().min(MAX_CUBES)];
        let mut members = BTreeMap::<ClusterId, Vec<&DenseVoxel>>::new();
        for voxel in shown {
            if let Some(id) = voxel.cluster {
                members.entry(id).or_default().push(voxel);
            }
        }
        let mut markers = self.deletions(&header, &members);
        for cluster in &snapshot.clusters {
            let Some(voxels) = members.get(&cluster.id) else { continue };
            let slot = self.slot(cluster.id);
            markers.push(cubes(&header, slot, cluster, voxels, snapshot.voxel_size));
            if cluster.voxel_count >= MIN_RELIABLE_VOXELS {
                markers.push(text(&header, slot, cluster, snapshot.voxel_size));
            }
        }
        markers.push(normals(&header, shown, snapshot.voxel_size));
        MarkerArray { markers }
    }

    /// Begins anew, as after a reset: viewers are told to delete everything.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn deletions(&mut self, header: &Header, shown: &BTreeMap<ClusterId, Vec<&DenseVoxel>>) -> Vec<Marker> {
        let gone: Vec<_> = self.slots.keys().filter(|id| !shown.contains_key(id)).copied().collect();
        self.free.extend(gone.iter().filter_map(|id| self.slots.remove(id)).map(|slot| (slot, 0)));
        let mut deletions = Vec::new();
        if self.sent < REPEATS {
            self.sent += 1;
            deletions.push(Marker { header: header.clone(), action: Marker::DELETEALL, ..Marker::default() });
        }
        for (&slot, said) in self.free.iter_mut().filter(|(_, said)| **said < REPEATS) {
            *said += 1;
            deletions.extend([CLUSTERS, IDS].map(|ns| delete(header, ns, slot)));
        }
        deletions
    }

    fn slot(&mut self, id: ClusterId) -> i32 {
        let Self { slots, free, .. } = self;
        let unused = slots.len() + free.len();
        *slots.entry(id).or_insert_with(|| free.pop_first().map_or(unused as i32, |(slot, _)| slot))
    }
}

fn delete(header: &Header, ns: &str, slot: i32) -> Marker {
    Marker { action: Marker::DELETE, ..marker(header, ns, slot, 0) }
}

fn cubes(header: &Header, slot: i32, cluster: &Cluster, voxels: &[&DenseVoxel], voxel_size: f64) -> Marker {
    // A little smaller than a voxel, so that single cubes can be told apart.
    let edge = 0.9 * voxel_size;
    Marker {
        scale: Vector3 { x: edge, y: edge, z: edge },
        color: colour(Some(cluster.id)),
        points: voxels.iter().map(|voxel| point(&voxel.centre)).collect(),
        text: cluster.id.to_string(),
        ..marker(header, CLUSTERS, slot, Marker::CUBE_LIST)
    }
}

fn text(header: &Header, slot: i32, cluster: &Cluster, voxel_size: f64) -> Marker {
    let mut text = marker(header, IDS, slot, Marker::TEXT_VIEW_FACING);
    // In front of the surface, on the side it was seen from.
    text.pose.position = point(&(cluster.centroid + cluster.normal.into_inner() * (2.0 * voxel_size)));
    text.scale = Vector3 { x: 0.0, y: 0.0, z: 2.0 * voxel_size };
    text.color = ColorRgba { r: 1.0, g: 1.0, b: 1.0, a: 1.0 };
    text.text = cluster.id.to_string();
    text
}

fn normals(header: &Header, voxels: &[DenseVoxel], voxel_size: f64) -> Marker {
    let segment = |voxel: &DenseVoxel| {
        let tip = voxel.centre + voxel.normal?.into_inner() * voxel_size;
        Some([point(&voxel.centre), point(&tip)])
    };
    let points: Vec<Point> = voxels.iter().filter_map(segment).flatten().collect();
    if points.is_empty() {
        // A list without points is an error to viewers.
        return delete(header, NORMALS, 0);
    }
    Marker {
        scale: Vector3 { x: 0.05 * voxel_size, y: 0.0, z: 0.0 },
        color: ColorRgba { r: 1.0, g: 1.0, b: 1.0, a: 0.6 },
        points,
        ..marker(header, NORMALS, 0, Marker::LINE_LIST)
    }
}

fn marker(header: &Header, ns: &str, id: i32, kind: i32) -> Marker {
    Marker { header: header.clone(), ns: ns.to_owned(), id, kind, action: Marker::ADD, ..Marker::default() }
}

fn colour(id: Option<ClusterId>) -> ColorRgba {
    let [r, g, b] = cluster_colour(id).map(|c| f32::from(c) / 255.0);
    ColorRgba { r, g, b, a: 1.0 }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

    use super::*;
    use crate::engine::{ClusterState, Stamp, SurfaceClass, VoxelKey};

    fn snapshot(ids: &[u64]) -> Snapshot {
        let id = |id: &u64| ClusterId::new(*id).unwrap();
        let cluster = |id: ClusterId| Cluster {
            id,
            revision: 1,
            state: ClusterState::Active,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
            class: SurfaceClass::Floor,
            class_confidence: 1.0,
            normal: Vector3::z_axis(),
            offset: 0.0,
            plane_covariance: None,
            centroid: Point3::origin(),
            covariance: Matrix3::zeros(),
            rms_error: 0.0,
            area: Some(1.0),
            boundary: Vec::new(),
            holes: Vec::new(),
            pose: Isometry3::identity(),
            size: Vector3::zeros(),
            voxel_count: 12,
            point_count: 100,
        };
        let voxel = |id: ClusterId| DenseVoxel {
            key: VoxelKey::new(id.get() as i32, 0, 0).unwrap(),
            count: 20,
            centre: Point3::origin(),
            normal: Some(Vector3::z_axis()),
            curvature: 0.0,
            cluster: Some(id),
        };
        Snapshot {
            sequence: 1,
            stamp: None,
            voxel_size: 0.1,
            clusters: ids.iter().map(id).map(cluster).collect(),
            voxels: ids.iter().map(id).map(voxel).collect(),
            unclustered_voxels: 0,
        }
    }

    fn summary(markers: &MarkerArray) -> Vec<(String, i32, i32, String)> {
        markers.markers.iter().map(|m| (m.ns.clone(), m.id, m.action, m.text.clone())).collect()
    }

    #[test]
    fn slots_of_gone_clusters_are_deleted_and_used_again() {
        let session = Session { id: 1, frame_id: "odom".into() };
        let mut markers = Markers::default();
        let line = |ns: &str, id, action, text: &str| (ns.to_owned(), id, action, text.to_owned());
        let first = summary(&markers.update(&session, &snapshot(&[1, 1 << 40])));
        assert_eq!(first[0], line("", 0, Marker::DELETEALL, ""));
        assert!(first.contains(&line("clusters", 1, Marker::ADD, "1099511627776")));
        let gone = [line("clusters", 0, Marker::DELETE, ""), line("ids", 0, Marker::DELETE, "")];
        for _ in 0..REPEATS {
            let next = summary(&markers.update(&session, &snapshot(&[1 << 40])));
            assert!(gone.iter().all(|deletion| next.contains(deletion)));
        }
        let later = summary(&markers.update(&session, &snapshot(&[1 << 40])));
        assert!(later.iter().all(|(_, _, action, _)| *action == Marker::ADD));
        let again = summary(&markers.update(&session, &snapshot(&[9, 1 << 40])));
        assert!(again.contains(&line("clusters", 0, Marker::ADD, "9")));
        assert!(again.contains(&line("clusters", 1, Marker::ADD, "1099511627776")));
        markers.reset();
        assert_eq!(summary(&markers.update(&session, &snapshot(&[])))[0].2, Marker::DELETEALL);
    }

    #[test]
    fn what_has_nothing_to_show_is_deleted_and_not_sent_empty() {
        let session = Session { id: 1, frame_id: "odom".into() };
        let markers = Markers::default().update(&session, &snapshot(&[]));
        assert!(markers.markers.iter().all(|marker| marker.action != Marker::ADD));
    }
}
