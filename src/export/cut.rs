//! Which dense voxels a picture shows: a room is looked into over its near walls and through its ceiling.
//!
//! A surface has a front, the side it was seen from, and is left out where it shows the viewer its back. Whether it does
//! is decided by the normal of the voxel and that of its cluster together, the latter counting twice: the first is unsure at
//! the rim of a wall, where in a corner it turns towards the other wall; the second alone says nothing of a surface that bends.
//! Voxels in no cluster, mostly rims, go with the ones around them.

use nalgebra::{UnitVector3, Vector3};
use rustc_hash::FxHashMap;

use super::picture::View;
use crate::engine::{ClusterId, DenseVoxel, Snapshot, VoxelKey};

/// Cosine up to which a surface beyond a right angle still counts as facing the viewer: normals are noisy.
const FACING: f64 = -0.1;
/// Voxels in no cluster go with those up to so many voxels away along each axis.
const AROUND: i32 = 2;

/// The voxels to draw, in the order of the snapshot.
pub(super) fn shown<'a>(
    snapshot: &'a Snapshot,
    view: &View,
    towards_viewer: &Vector3<f64>,
) -> Vec<&'a DenseVoxel> {
    let voxels = snapshot.voxels.iter();
    if !view.cut_away {
        return voxels.collect();
    }
    let facing = Facing::new(snapshot, towards_viewer);
    voxels.filter(|voxel| facing.is_front(voxel)).collect()
}

/// Knows of each voxel whether its front is towards the viewer.
struct Facing<'a> {
    towards_viewer: &'a Vector3<f64>,
    /// The answer for each voxel of a cluster.
    clustered: FxHashMap<VoxelKey, bool>,
}

impl<'a> Facing<'a> {
    fn new(snapshot: &Snapshot, towards_viewer: &'a Vector3<f64>) -> Self {
        let normals: FxHashMap<ClusterId, UnitVector3<f64>> =
            snapshot.clusters.iter().map(|cluster| (cluster.id, cluster.normal)).collect();
        let clustered = snapshot.voxels.iter().filter_map(|voxel| {
            let of_cluster = normals.get(&voxel.cluster?).copied();
            let normals = [of_cluster.or(voxel.normal), voxel.normal.or(of_cluster)];
            let cosines = normals.map(|normal| normal.map_or(0.0, |normal| normal.dot(towards_viewer)));
            Some((voxel.key, 2.0 * cosines[0] + cosines[1] >= 3.0 * FACING))
        });
        Self { towards_viewer, clustered: clustered.collect() }
    }

    fn is_front(&self, voxel: &DenseVoxel) -> bool {
        if let Some(&front) = self.clustered.get(&voxel.key) {
            return front;
        }
        let (fronts, backs) = self.votes_around(voxel.key);
        if fronts + backs > 0 {
            return fronts >= backs;
        }
        voxel.normal.is_none_or(|normal| normal.dot(self.towards_viewer) >= FACING)
    }

    /// How many voxels of clusters around this one show their front and their back.
    fn votes_around(&self, key: VoxelKey) -> (usize, usize) {
        let [ix, iy, iz] = key.indices();
        let span = |i: i32| i - AROUND..=i + AROUND;
        let around =
            span(ix).flat_map(|ix| span(iy).flat_map(move |iy| span(iz).map(move |iz| (ix, iy, iz))));
        let answers = around.filter_map(|(ix, iy, iz)| self.clustered.get(&VoxelKey::new(ix, iy, iz)?));
        answers.fold(
            (0, 0),
            |(fronts, backs), &front| {
                if front { (fronts + 1, backs) } else { (fronts, backs + 1) }
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    use super::*;
    use crate::engine::Cluster;
    use crate::export::testing::corner_of_a_room;

    /// The clusters of the voxels shown, each once; 0 for none.
    fn clusters_shown(snapshot: &Snapshot, view: &View, towards_viewer: [f64; 3]) -> Vec<u64> {
        let shown = shown(snapshot, view, &Vector3::from(towards_viewer).normalize());
        let mut clusters: Vec<_> =
            shown.iter().map(|voxel| voxel.cluster.map_or(0, ClusterId::get)).collect();
        clusters.sort_unstable();
        clusters.dedup();
        clusters
    }

    /// The voxel in no cluster is shown always: nothing is around it, and it has no normal.
    #[test]
    fn a_wall_seen_from_behind_is_left_out() {
        let (map, view) = (corner_of_a_room(), View::default());
        assert_eq!(clusters_shown(&map, &view, [0.0, -1.0, 1.0]), [0, 1, 2]);
        assert_eq!(clusters_shown(&map, &view, [0.0, 1.0, 1.0]), [0, 1]);
        assert_eq!(clusters_shown(&map, &view, [0.0, -1.0, -1.0]), [0, 2], "the floor from below");
    }

    #[test]
    fn the_rim_of_a_wall_seen_from_behind_is_left_out_where_its_normals_turn_into_the_corner() {
        let mut map = corner_of_a_room();
        let from_the_south = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2);
        let place = Translation3::new(1.0, 2.05, 0.8);
        map.clusters = vec![Cluster::rectangle(2, Isometry3::from_parts(place, from_the_south), [2.0, 1.4])];
        for voxel in map.voxels.iter_mut().filter(|voxel| voxel.key.indices()[..2] == [19, 20]) {
            voxel.normal = Some(UnitVector3::new_normalize(Vector3::new(-1.0, -1.0, 0.0)));
        }
        let view = View::default();
        assert_eq!(clusters_shown(&map, &view, [-0.66, 0.38, 0.64]), [0, 1]);
        let shown = shown(&map, &view, &Vector3::new(-0.66, -0.38, 0.64).normalize());
        assert_eq!(shown.len(), map.voxels.len(), "from the front");
    }

    #[test]
    fn a_view_without_cutting_shows_every_voxel() {
        let (map, view) = (corner_of_a_room(), View { cut_away: false, ..View::default() });
        assert_eq!(shown(&map, &view, &Vector3::y()).len(), map.voxels.len());
    }

    #[test]
    fn voxels_in_no_cluster_go_with_those_around_them() {
        let (mut map, view) = (corner_of_a_room(), View::default());
        // The top row of the wall: its normals point up, as at the rim of a real one.
        for voxel in map.voxels.iter_mut().filter(|voxel| voxel.key.indices()[2] == 14) {
            (voxel.cluster, voxel.normal) = (None, Some(Vector3::z_axis()));
        }
        let highest = |towards_viewer: Vector3<f64>| {
            let shown = shown(&map, &view, &towards_viewer.normalize());
            shown.iter().map(|voxel| voxel.key.indices()[2]).max()
        };
        assert_eq!(highest(Vector3::new(0.0, -1.0, 1.0)), Some(14));
        assert_eq!(highest(Vector3::new(0.0, 1.0, 1.0)), Some(1), "with the rest of the wall");
    }
}
