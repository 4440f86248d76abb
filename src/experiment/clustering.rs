//! What a method has made of the dense voxels, and the measures of section V.B of it.

use std::collections::BTreeMap;

use nalgebra::UnitVector3;

use crate::engine::paper::statics::StaticMap;
use crate::engine::{ClusterId, MIN_RELIABLE_VOXELS, Snapshot, VoxelKey};
use crate::rand_index::adjusted_rand_index;

/// The dense voxels and their clusters, whatever method made them.
#[derive(Clone, Debug, Default)]
pub(super) struct Clustering {
    /// By ascending key.
    voxels: Vec<Member>,
    /// The normals of the clusters, by number.
    normals: BTreeMap<u64, UnitVector3<f64>>,
}

#[derive(Clone, Copy, Debug)]
struct Member {
    key: VoxelKey,
    normal: Option<UnitVector3<f64>>,
    cluster: Option<u64>,
}

impl Member {
    /// The number of its cluster, or its key where it is in none.
    fn label(&self) -> Result<u64, VoxelKey> {
        self.cluster.ok_or(self.key)
    }
}

/// How many clusters there are, and how well their normals are those of their members.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quality {
    /// Dense voxels, in a cluster or not.
    pub(super) dense_voxels: u32,
    /// Clusters.
    pub(super) clusters: u32,
    /// Those of [`MIN_RELIABLE_VOXELS`] or more.
    pub(super) large_clusters: u32,
    /// Those of one voxel.
    pub(super) single_clusters: u32,
    /// Voxels in clusters.
    pub(super) clustered_voxels: u32,
    /// Mean angle, over all voxels in clusters, between a voxel's normal and its cluster's (rad, 0 to pi/2: the sign of
    /// a normal does not count); `None` without a voxel in a cluster.
    pub(super) normal_error: Option<f64>,
}

impl Clustering {
    pub(super) fn quality(&self) -> Quality {
        let mut sizes = BTreeMap::<u64, u32>::new();
        let (mut sum, mut count) = (0.0, 0_u32);
        for voxel in &self.voxels {
            let Some(cluster) = voxel.cluster else { continue };
            *sizes.entry(cluster).or_default() += 1;
            if let (Some(own), Some(normal)) = (voxel.normal, self.normals.get(&cluster)) {
                sum += angle(&own, normal);
                count += 1;
            }
        }
        Quality {
            dense_voxels: self.voxels.len() as u32,
            clusters: sizes.len() as u32,
            large_clusters: sizes.values().filter(|&&size| size >= MIN_RELIABLE_VOXELS).count() as u32,
            single_clusters: sizes.values().filter(|&&size| size == 1).count() as u32,
            clustered_voxels: sizes.values().sum(),
            normal_error: (count > 0).then(|| sum / f64::from(count)),
        }
    }

    /// The dense voxels by ascending key, each with the number of its cluster; `None` = in no cluster.
    #[cfg(feature = "sim")]
    pub(super) fn labels(&self) -> impl Iterator<Item = (VoxelKey, Option<u64>)> {
        self.voxels.iter().map(|voxel| (voxel.key, voxel.cluster))
    }

    /// The adjusted Rand index over the voxels that are dense in both, each in no cluster being one by itself; `None` without any.
    pub(super) fn agreement(&self, other: &Self) -> Option<f64> {
        let in_other = |key| {
            let place = other.voxels.binary_search_by_key(&key, |voxel| voxel.key).ok()?;
            Some(other.voxels[place].label())
        };
        let pairs: Vec<_> =
            self.voxels.iter().filter_map(|voxel| Some((voxel.label(), in_other(voxel.key)?))).collect();
        (!pairs.is_empty()).then(|| adjusted_rand_index(&pairs))
    }
}

impl From<&Snapshot> for Clustering {
    fn from(snapshot: &Snapshot) -> Self {
        let voxels = snapshot.voxels.iter().map(|voxel| Member {
            key: voxel.key,
            normal: voxel.normal,
            cluster: voxel.cluster.map(ClusterId::get),
        });
        let normals = snapshot.clusters.iter().map(|cluster| (cluster.id.get(), cluster.normal));
        Self { voxels: voxels.collect(), normals: normals.collect() }
    }
}

impl From<&StaticMap> for Clustering {
    fn from(map: &StaticMap) -> Self {
        let voxels = map.voxels.iter().map(|voxel| Member {
            key: voxel.key,
            normal: voxel.normal,
            cluster: voxel.cluster.map(u64::from),
        });
        let normals = map.cluster_normals.iter().copied();
        Self { voxels: voxels.collect(), normals: (0..).zip(normals).collect() }
    }
}

/// The angle between two lines (rad), exact where it is small too: an arc cosine loses half the digits there.
fn angle(a: &UnitVector3<f64>, b: &UnitVector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// A unit vector in the plane y = 0, this far from +z (rad).
    fn tilted(angle: f64) -> UnitVector3<f64> {
        UnitVector3::new_unchecked(Vector3::new(angle.sin(), 0.0, angle.cos()))
    }

    fn clustering(voxels: &[(Option<f64>, Option<u64>)], normals: &[(u64, f64)]) -> Clustering {
        let member = |(x, &(tilt, cluster)): (i32, &(Option<f64>, _))| Member {
            key: VoxelKey::new(x, 0, 0).unwrap(),
            normal: tilt.map(tilted),
            cluster,
        };
        Clustering {
            voxels: (0..).zip(voxels).map(member).collect(),
            normals: normals.iter().map(|&(number, tilt)| (number, tilted(tilt))).collect(),
        }
    }

    #[test]
    fn the_normal_error_is_the_mean_angle_of_members_to_their_cluster() {
        // Cluster 7: 0.1, 0.3 and, turned round, 0.2 rad off; cluster 9: 0.4 rad off; two voxels in no cluster.
        let flipped = 0.2 + std::f64::consts::PI;
        let voxels = [
            (Some(0.1), Some(7)),
            (Some(-0.3), Some(7)),
            (Some(flipped), Some(7)),
            (Some(1.5), Some(9)),
            (None, None),
            (Some(1.0), None),
        ];
        let quality = clustering(&voxels, &[(7, 0.0), (9, 1.1)]).quality();
        assert_eq!((quality.dense_voxels, quality.clusters, quality.large_clusters), (6, 2, 0));
        let error = quality.normal_error.unwrap();
        assert!((error - (0.1 + 0.3 + 0.2 + 0.4) / 4.0).abs() < 1e-12, "{error}");
    }

    #[test]
    fn clusters_count_as_large_from_ten_voxels_on() {
        let of = |count| vec![(Some(0.0), Some(1)); count];
        assert_eq!(clustering(&of(9), &[(1, 0.0)]).quality().large_clusters, 0);
        assert_eq!(clustering(&of(10), &[(1, 0.0)]).quality().large_clusters, 1);
    }

    #[test]
    fn a_small_angle_keeps_its_digits() {
        assert!((angle(&tilted(0.0), &tilted(1e-9)) - 1e-9).abs() < 1e-20);
        let right = std::f64::consts::FRAC_PI_2;
        assert!((angle(&tilted(0.0), &tilted(right)) - right).abs() < 1e-12);
    }

    #[test]
    fn an_empty_map_has_no_error_and_no_agreement() {
        let empty = Clustering::default();
        assert_eq!(empty.quality(), Quality::default());
        assert_eq!(empty.agreement(&empty), None);
    }

    #[test]
    fn agreement_is_over_the_voxels_that_both_have() {
        let a = clustering(&[(None, Some(1)), (None, Some(1)), (None, Some(2)), (None, None)], &[]);
        let b = clustering(&[(None, Some(5)), (None, Some(5)), (None, Some(4))], &[]);
        assert_eq!(a.agreement(&b), Some(1.0));
    }

    #[test]
    fn what_is_in_no_cluster_is_nothing_to_agree_about() {
        let of = |cluster| {
            clustering(
                &[(None, Some(1)), (None, Some(cluster)), (None, None), (None, None), (None, None)],
                &[],
            )
        };
        assert_eq!(of(1).agreement(&of(2)), Some(0.0));
    }
}
