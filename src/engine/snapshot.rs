//! Immutable values that leave the engine: the clusters and dense voxels as they are after a scan.

use nalgebra::{Isometry3, Matrix3, Point3, UnitVector3, Vector3};

use serde::{Deserialize, Serialize};

use super::class::SurfaceClass;
use super::key::{ClusterId, VoxelKey};
use super::scan::Stamp;

/// How far a cluster can be relied on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ClusterState {
    /// Too small or too new to be relied on; in `paper`, fewer voxels than [`super::MIN_RELIABLE_VOXELS`].
    Tentative,
    /// Still considered for expansion (`paper`), or grown within the last `expansion_interval` scans.
    Active,
    /// Not grown for `expansion_interval` scans (the paper's "complete object"); in `consistent` it may grow again.
    Complete,
}

/// One cluster, global in the paper's words. Geometry is in the fixed frame, SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// Lasting id.
    pub id: ClusterId,
    /// 1 at creation, + 1 in every scan that changed this cluster.
    pub revision: u32,
    /// How far it can be relied on.
    pub state: ClusterState,
    /// Stamp of the scan that created it.
    pub first_seen: Stamp,
    /// Stamp of the newest scan that put a point into one of its voxels. In `consistent` into any block of 8 x 8 x 8 voxels that it
    /// reached into then, and without another change told anew only every 30 scans, in large maps every 60, 120, ...
    pub last_seen: Stamp,
    /// What it is to a robot; always unknown in `paper`.
    pub class: SurfaceClass,
    /// Probability that the class is right, 0 to 1, by uncertainties calibrated on the simulator.
    pub class_confidence: f32,
    /// The cluster's normal (Definition 5 in `paper`, that of the plane through its points in `consistent`), towards the
    /// side it was seen from.
    pub normal: UnitVector3<f64>,
    /// The plane's d (m): normal . x + d = 0.
    pub offset: f64,
    /// Covariance of the plane: turn about the pose's x, turn about its y, place along its z at its origin (rad^2, rad m,
    /// m^2); `None` where it is not known.
    pub plane_covariance: Option<Matrix3<f64>>,
    /// Mean of the members' centres (m); in `consistent` of the voxels in its patches, each by how well it is known: those beside a
    /// patch are in the counts, boundary and area alone.
    pub centroid: Point3<f64>,
    /// Covariance of the members: of their centres (`paper`), or of their points, weighed likewise (m^2).
    pub covariance: Matrix3<f64>,
    /// Root mean square distance of the same from the plane (m).
    pub rms_error: f64,
    /// What `rms_error` would be of nothing but the sensor's noise (m); `None` in `paper` and with [`super::NoiseModel::None`].
    pub noise: Option<f64>,
    /// Area of the boundary less its holes (m^2); `None` where it is not known. In `consistent` a cluster can lie in several
    /// parts: boundary, holes, area and box (but for its z) are of the largest alone, plane, centroid, `covariance`, `rms_error`
    /// and the counts of all.
    pub area: Option<f64>,
    /// The surface's edge on the plane (m), counter-clockwise seen from where the normal points; empty where it is not
    /// known.
    pub boundary: Vec<Point3<f64>>,
    /// Holes in it, clockwise.
    pub holes: Vec<Vec<Point3<f64>>>,
    /// Middle of the box around the members' centres (`paper`) or the boundary; +z = normal, +x = the long side.
    pub pose: Isometry3<f64>,
    /// Full extents of that box along the pose's axes (m); in `consistent` z is the thickness over which points that are spread
    /// evenly have the root mean square distance `rms_error`: some lie outside.
    pub size: Vector3<f64>,
    /// Number of member voxels.
    pub voxel_count: u32,
    /// Number of points in the member voxels. In `consistent` that when each was published last: points that tell nothing new of a voxel
    /// do not publish it again, so that this lags behind the sum of their [`DenseVoxel::count`], by any factor where the sensor
    /// stands still.
    pub point_count: u64,
}

#[cfg(test)]
impl Cluster {
    /// A rectangle for a test, of those full sides along the pose's x and y, seen from its +z.
    pub(crate) fn rectangle(id: u64, pose: Isometry3<f64>, sides: [f64; 2]) -> Self {
        let normal = UnitVector3::new_normalize(pose * Vector3::z());
        let corner = |[x, y]: [f64; 2]| pose * Point3::new(0.5 * x * sides[0], 0.5 * y * sides[1], 0.0);
        Self {
            id: ClusterId::new(id).unwrap(),
            revision: 1,
            state: ClusterState::Active,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
            class: SurfaceClass::Unknown,
            class_confidence: 0.0,
            normal,
            offset: -normal.dot(&pose.translation.vector),
            plane_covariance: None,
            centroid: Point3::from(pose.translation.vector),
            covariance: Matrix3::identity(),
            rms_error: 0.0,
            noise: None,
            area: Some(sides[0] * sides[1]),
            boundary: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(corner).to_vec(),
            holes: Vec::new(),
            pose,
            size: Vector3::new(sides[0], sides[1], 0.0),
            voxel_count: 100,
            point_count: 2000,
        }
    }
}

/// One dense voxel.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseVoxel {
    /// Its index.
    pub key: VoxelKey,
    /// Number of points counted in it, up to the newest scan.
    pub count: u32,
    /// Mean of its points (m), fixed frame; in `consistent` with a noise model weighed by how well each scan's are known.
    pub centre: Point3<f64>,
    /// Its normal (Definition 3 in `paper`; in `consistent` that of its patch, and of a voxel in none that of its neighbourhood),
    /// `None` where its neighbourhood spans no plane.
    pub normal: Option<UnitVector3<f64>>,
    /// Smallest eigenvalue over the sum, of the covariance whose fit gave the normal: 0 (flat) to 1/3; NaN without a normal.
    pub curvature: f32,
    /// The cluster it belongs to.
    pub cluster: Option<ClusterId>,
}

/// The whole map after a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    /// Number of scans taken in so far.
    pub sequence: u64,
    /// Newest stamp taken in; `None` before the first scan.
    pub stamp: Option<Stamp>,
    /// Edge of a voxel (m).
    pub voxel_size: f64,
    /// The clusters by ascending id.
    pub clusters: Vec<Cluster>,
    /// The dense voxels by ascending key.
    pub voxels: Vec<DenseVoxel>,
    /// Dense voxels that belong to no cluster.
    pub unclustered_voxels: u32,
}

/// Area from which on a cluster says how far points are off it (m^2).
const TELLING: f64 = 1.0;

impl Snapshot {
    /// How far points are off their surfaces beyond what noise explains (m): half of the area of all surfaces from 1 m^2 on has less.
    /// 0 with exact poses and a sensor without bias; `None` where there are none such, or their noise is not known.
    pub fn beyond_noise(&self) -> Option<f64> {
        let telling = self.clusters.iter().filter_map(|cluster| {
            let area = cluster.area.filter(|area| *area >= TELLING)?;
            Some((cluster.rms_error.powi(2) - cluster.noise?.powi(2), area))
        });
        let mut telling: Vec<_> = telling.collect();
        telling.sort_by(|a, b| a.0.total_cmp(&b.0));
        let half = 0.5 * telling.iter().map(|(_, area)| area).sum::<f64>();
        let mut below = 0.0;
        let median = telling.into_iter().find(|(_, area)| {
            below += area;
            below >= half
        });
        median.map(|(variance, _)| variance.max(0.0).sqrt())
    }
}

/// What one scan did to the map.
#[derive(Clone, Debug, PartialEq)]
pub struct Update {
    /// Number of scans taken in, this one included.
    pub sequence: u64,
    /// Newest stamp taken in.
    pub stamp: Stamp,
    /// Every cluster that this scan changed, by ascending id, as it is now.
    pub changed: Vec<ChangedCluster>,
    /// Ids that are gone, ascending.
    pub removed: Vec<ClusterId>,
    /// Voxels that became dense in this scan.
    pub newly_dense: u32,
    /// Points that lay beyond the grid's reach and were left out.
    pub points_beyond_grid: u32,
    /// Dense voxels that belong to no cluster.
    pub unclustered_voxels: u32,
}

/// A cluster as a scan left it.
#[derive(Clone, Debug, PartialEq)]
pub struct ChangedCluster {
    /// The cluster.
    pub cluster: Cluster,
    /// Ids that it took in during this scan, ascending.
    pub merged_from: Vec<ClusterId>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of that area (m^2), whose points are off it by that much beyond their noise (m).
    fn off(by: f64, area: f64) -> Cluster {
        let rms_error = 0.01_f64.hypot(by);
        let square = Cluster::rectangle(1, Isometry3::identity(), [area.sqrt(); 2]);
        Cluster { rms_error, noise: Some(0.01), ..square }
    }

    fn beyond_noise(clusters: &[Cluster]) -> Option<f64> {
        let (clusters, voxels) = (clusters.to_vec(), Vec::new());
        Snapshot { sequence: 1, stamp: None, voxel_size: 0.08, clusters, voxels, unclustered_voxels: 0 }
            .beyond_noise()
    }

    #[test]
    fn points_are_off_their_surfaces_by_what_half_of_the_area_has() {
        let is = |clusters: &[Cluster], metres: f64| {
            let found = beyond_noise(clusters).unwrap();
            assert!((found - metres).abs() < 1e-9, "{found}");
        };
        // Two small ones count as much as one of their area, and one below 1 m^2 not at all.
        is(&[off(0.0, 5.0), off(0.02, 3.0), off(0.03, 3.0)], 0.02);
        is(&[off(0.0, 5.0), off(0.02, 2.0), off(0.03, 2.0), off(0.5, 0.9)], 0.0);
    }

    #[test]
    fn where_noise_is_not_known_nothing_is_said_and_points_off_by_less_than_it_are_not_off() {
        assert_eq!(beyond_noise(&[Cluster { noise: None, ..off(0.1, 9.0) }, off(0.1, 0.9)]), None);
        assert_eq!(beyond_noise(&[Cluster { noise: Some(0.2), ..off(0.1, 9.0) }]), Some(0.0));
    }

    #[test]
    fn a_dense_voxel_of_a_published_map_takes_the_bytes_that_the_documentation_says() {
        assert_eq!(size_of::<DenseVoxel>(), 88);
    }
}
