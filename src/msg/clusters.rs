//! `cfodi_msgs`: surface clusters as a planner reads them.
//!
//! Fields that are not known, as some never are in mode `paper`, carry the value that `SurfaceCluster.msg` documents.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use super::ros::{Header, Plane, Point, Point32, Polygon, Pose, Quaternion, Time, Vector3};
use crate::engine::{ChangedCluster, Cluster, ClusterId, ClusterState, Snapshot, Stamp, Update};

/// `cfodi_msgs/SurfaceCluster`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "documented in msg/SurfaceCluster.msg")]
pub struct SurfaceCluster {
    pub id: u64,
    pub revision: u32,
    pub state: u8,
    pub surface_class: u8,
    pub class_confidence: f32,
    pub merged_from: Vec<u64>,
    pub first_seen: Time,
    pub last_seen: Time,
    pub plane: Plane,
    pub pose: Pose,
    pub size: Vector3,
    pub centroid: Point,
    pub point_covariance: [f64; 9],
    pub plane_covariance: [f64; 9],
    pub rms_error: f32,
    pub area: f32,
    pub voxel_count: u32,
    pub point_count: u64,
    pub boundary: Polygon,
    pub holes: Vec<Polygon>,
}

/// `cfodi_msgs/SurfaceClusterArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "documented in msg/SurfaceClusterArray.msg")]
pub struct SurfaceClusterArray {
    pub header: Header,
    pub session_id: u64,
    pub sequence: u64,
    pub base_sequence: u64,
    pub kind: u8,
    pub clusters: Vec<SurfaceCluster>,
    pub removed: Vec<u64>,
    pub unclustered_voxels: u32,
}

impl SurfaceCluster {
    /// `state`: too small to be relied on.
    pub const STATE_TENTATIVE: u8 = 0;
    /// `state`: still growing.
    pub const STATE_ACTIVE: u8 = 1;
    /// `state`: not grown for `expansion_interval` scans.
    pub const STATE_COMPLETE: u8 = 2;
}

/// Names of a map that stand in every message about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Session {
    /// New at start, reset and when the clock jumps back.
    pub id: u64,
    /// The fixed frame.
    pub frame_id: String,
}

/// Which map it is: that of a session after so many scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct MapVersion {
    /// As in [`Session::id`].
    pub session: u64,
    /// Scans in it, with those of before where it was resumed.
    pub sequence: u64,
}

impl Session {
    pub(super) fn header(&self, stamp: Option<Stamp>) -> Header {
        Header { stamp: stamp.unwrap_or_default().into(), frame_id: self.frame_id.clone() }
    }
}

impl SurfaceClusterArray {
    /// `kind`: all clusters; what is absent is gone.
    pub const SNAPSHOT: u8 = 0;
    /// `kind`: the changed clusters, and the ids that are gone.
    pub const DELTA: u8 = 1;

    /// The whole map.
    pub fn snapshot(session: &Session, snapshot: &Snapshot) -> Self {
        Self {
            header: session.header(snapshot.stamp),
            session_id: session.id,
            sequence: snapshot.sequence,
            base_sequence: 0,
            kind: Self::SNAPSHOT,
            clusters: snapshot.clusters.iter().map(SurfaceCluster::from).collect(),
            removed: Vec::new(),
            unclustered_voxels: snapshot.unclustered_voxels,
        }
    }

    /// What one scan changed.
    pub fn delta(session: &Session, update: &Update) -> Self {
        let changed = |changed: &ChangedCluster| SurfaceCluster {
            merged_from: changed.merged_from.iter().map(|id| id.get()).collect(),
            ..SurfaceCluster::from(&changed.cluster)
        };
        Self {
            header: session.header(Some(update.stamp)),
            session_id: session.id,
            sequence: update.sequence,
            base_sequence: update.sequence - 1,
            kind: Self::DELTA,
            clusters: update.changed.iter().map(changed).collect(),
            removed: update.removed.iter().map(|id: &ClusterId| id.get()).collect(),
            unclustered_voxels: update.unclustered_voxels,
        }
    }
}

impl From<&Cluster> for SurfaceCluster {
    fn from(cluster: &Cluster) -> Self {
        let n = cluster.normal;
        Self {
            id: cluster.id.get(),
            revision: cluster.revision,
            state: match cluster.state {
                ClusterState::Tentative => Self::STATE_TENTATIVE,
                ClusterState::Active => Self::STATE_ACTIVE,
                ClusterState::Complete => Self::STATE_COMPLETE,
            },
            surface_class: cluster.class.number(),
            class_confidence: cluster.class_confidence,
            merged_from: Vec::new(),
            first_seen: cluster.first_seen.into(),
            last_seen: cluster.last_seen.into(),
            plane: Plane { coef: [n.x, n.y, n.z, cluster.offset] },
            pose: pose(cluster),
            size: Vector3 { x: cluster.size.x, y: cluster.size.y, z: cluster.size.z },
            centroid: point(&cluster.centroid),
            point_covariance: row_major(&cluster.covariance),
            plane_covariance: cluster.plane_covariance.as_ref().map_or([f64::NAN; 9], row_major),
            rms_error: cluster.rms_error as f32,
            area: cluster.area.map_or(f32::NAN, |area| area as f32),
            voxel_count: cluster.voxel_count,
            point_count: cluster.point_count,
            boundary: polygon(&cluster.boundary),
            holes: cluster.holes.iter().map(|hole| polygon(hole)).collect(),
        }
    }
}

pub(super) fn polygon(points: &[nalgebra::Point3<f64>]) -> Polygon {
    let point = |p: &nalgebra::Point3<f64>| Point32 { x: p.x as f32, y: p.y as f32, z: p.z as f32 };
    Polygon { points: points.iter().map(point).collect() }
}

pub(super) fn pose(cluster: &Cluster) -> Pose {
    let turn = cluster.pose.rotation.coords;
    Pose {
        position: point(&cluster.pose.translation.vector.into()),
        orientation: Quaternion { x: turn.x, y: turn.y, z: turn.z, w: turn.w },
    }
}

pub(super) fn point(point: &nalgebra::Point3<f64>) -> Point {
    Point { x: point.x, y: point.y, z: point.z }
}

fn row_major(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|i| matrix[(i / 3, i % 3)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::{Engine, Isometry3, Params, Points, Scan, SurfaceClass};

    #[test]
    fn plane_pose_size_and_centroid_fit_together() {
        // 2 m by 1 m, a centimetre apart, at z = 2.5 m, seen from z = 2 m: the normal points down.
        let points = (0..20_000).map(|i| [(i % 200) as f32 * 0.01, (i / 200) as f32 * 0.01, 0.5]).collect();
        let scan = Scan {
            stamp: Stamp::from_nanos(1_500_000_000),
            fixed_from_sensor: Isometry3::translation(5.0, 0.0, 2.0),
            points: Points::F32(points),
        };
        let mut engine = Engine::new(Params::paper());
        let session = Session { id: 7, frame_id: "odom".into() };
        let delta = SurfaceClusterArray::delta(&session, &engine.insert(&scan));
        assert_eq!((delta.session_id, delta.sequence, delta.base_sequence), (7, 1, 0));
        assert_eq!(delta.header.stamp, Time { sec: 1, nanosec: 500_000_000 });
        let [cluster] = &delta.clusters[..] else { panic!("{} clusters", delta.clusters.len()) };
        let [a, b, c, d] = cluster.plane.coef;
        assert!((c + 1.0).abs() < 1e-9 && (d - 2.5).abs() < 1e-6);
        let at = |p: Point| a * p.x + b * p.y + c * p.z + d;
        assert!(at(cluster.centroid).abs() < 1e-9 && at(cluster.pose.position).abs() < 1e-6);
        assert!((cluster.size.x - 2.0).abs() < 0.09 && (cluster.size.y - 1.0).abs() < 0.09);
        assert!(cluster.size.z < 1e-6 && cluster.rms_error < 1e-6);
        assert_eq!((cluster.surface_class, cluster.class_confidence), (SurfaceClass::Unknown.number(), 0.0));
        assert!(cluster.area.is_nan() && cluster.plane_covariance.iter().all(|c| c.is_nan()));
    }

    #[test]
    fn a_delta_names_the_clusters_that_are_gone_and_those_that_each_has_taken_in() {
        let point = |i: u16| [f32::from(i % 50) * 0.02, f32::from(i / 50) * 0.02, 0.5];
        let scan = Scan {
            stamp: Stamp::from_nanos(1),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F32((0..2500).map(point).collect()),
        };
        let mut update = Engine::new(Params::paper()).insert(&scan);
        let gone = [2, 5].map(|number| ClusterId::new(number).unwrap()).to_vec();
        assert_eq!(update.changed.len(), 1);
        (update.changed[0].merged_from, update.removed) = (gone.clone(), gone);
        let delta = SurfaceClusterArray::delta(&Session { id: 7, frame_id: "odom".into() }, &update);
        assert_eq!((&delta.clusters[0].merged_from[..], &delta.removed[..]), (&[2, 5][..], &[2, 5][..]));
    }

    #[test]
    fn a_map_without_scans_is_an_empty_snapshot_at_time_zero() {
        let session = Session { id: 7, frame_id: "odom".into() };
        let empty = SurfaceClusterArray::snapshot(&session, &Engine::new(Params::paper()).snapshot());
        assert_eq!((empty.sequence, empty.clusters.len(), empty.header.stamp), (0, 0, Time::default()));
    }
}
