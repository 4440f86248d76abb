//! The map as files that other programs open: a PLY of the dense voxels, a picture of the room.
//!
//! Everything is written to an `io::Write`, and depends on the snapshot alone: the same map gives the same bytes.
//! [`write_whole`] puts such bytes into a file so that a reader finds either all of them or the file as it was before.

#[cfg(feature = "bag")]
mod canvas;
#[cfg(feature = "bag")]
mod cut;
#[cfg(feature = "bag")]
pub mod picture;
pub mod ply;
pub mod voxels;
pub mod whole;

#[cfg(feature = "bag")]
pub use picture::{Picture, View, draw, draw_alike};
pub use ply::write_ply;
pub use voxels::write_voxels;
pub use whole::{WholeFile, WriteError, left_behind, left_behind_in, write_whole};

#[cfg(test)]
mod testing {
    //! A small map with a floor, a wall and a voxel of neither.

    use nalgebra::{Point3, Vector3};

    use crate::engine::{ClusterId, DenseVoxel, Snapshot, VoxelKey};

    const VOXEL_SIZE: f64 = 0.1;

    pub(super) fn corner_of_a_room() -> Snapshot {
        let floor = (0..20).flat_map(|i| (0..20).map(move |j| voxel([i, j, 0], Some(Vector3::z()), 1)));
        let wall = (0..20).flat_map(|i| (1..15).map(move |k| voxel([i, 20, k], Some(-Vector3::y()), 2)));
        let mut voxels: Vec<DenseVoxel> = floor.chain(wall).chain([voxel([-3, 2, 1], None, 0)]).collect();
        voxels.sort_by_key(|voxel| voxel.key);
        let clusters = Vec::new();
        Snapshot { sequence: 1, stamp: None, voxel_size: VOXEL_SIZE, clusters, voxels, unclustered_voxels: 1 }
    }

    fn voxel(indices: [i32; 3], normal: Option<Vector3<f64>>, cluster: u64) -> DenseVoxel {
        let [ix, iy, iz] = indices;
        DenseVoxel {
            key: VoxelKey::new(ix, iy, iz).unwrap(),
            count: 20,
            centre: Point3::from(indices.map(|i| (f64::from(i) + 0.5) * VOXEL_SIZE)),
            normal: normal.map(nalgebra::UnitVector3::new_normalize),
            curvature: if normal.is_some() { 0.0 } else { f32::NAN },
            cluster: ClusterId::new(cluster),
        }
    }
}
