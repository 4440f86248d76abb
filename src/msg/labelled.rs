//! The dense voxels as a labelled `sensor_msgs/PointCloud2`: for those who plan on points.

use super::clusters::Session;
use super::ros::{PointCloud2, PointField};
use crate::engine::{DenseVoxel, Snapshot};

/// Most points of one message; what is beyond is left out and must be said.
pub const MAX_LABELLED: usize = 1_000_000;

const STEP: u32 = 32;

/// All dense voxel centres, by ascending key: `x y z normal_x normal_y normal_z curvature` (FLOAT32) and `label` (UINT32,
/// cluster id, 0 = in no cluster). Normals and curvature are NaN where there is none.
pub fn labelled_points(session: &Session, snapshot: &Snapshot) -> PointCloud2 {
    let voxels = &snapshot.voxels[..snapshot.voxels.len().min(MAX_LABELLED)];
    let mut data = Vec::with_capacity(voxels.len() * STEP as usize);
    voxels.iter().for_each(|voxel| data.extend(point(voxel)));
    let floats = ["x", "y", "z", "normal_x", "normal_y", "normal_z", "curvature"];
    let mut fields: Vec<_> =
        (0..).zip(floats).map(|(i, name)| PointField::single(name, 4 * i, PointField::FLOAT32)).collect();
    fields.push(PointField::single("label", 28, PointField::UINT32));
    PointCloud2 {
        header: session.header(snapshot.stamp),
        height: 1,
        width: voxels.len() as u32,
        fields,
        is_bigendian: false,
        point_step: STEP,
        row_step: STEP * voxels.len() as u32,
        data,
        all_finite: voxels.iter().all(|voxel| voxel.normal.is_some()),
    }
}

/// A sentence where some of so many dense voxels are left out.
pub(super) fn left_out(voxels: usize) -> Option<String> {
    let sentence = || format!("~/points_labelled shows the first {MAX_LABELLED} of {voxels} dense voxels");
    (voxels > MAX_LABELLED).then(sentence)
}

fn point(voxel: &DenseVoxel) -> [u8; STEP as usize] {
    let [nx, ny, nz] = voxel.normal.map_or([f64::NAN; 3], |normal| [normal.x, normal.y, normal.z]);
    let centre = voxel.centre;
    let floats = [centre.x, centre.y, centre.z, nx, ny, nz, f64::from(voxel.curvature)];
    let mut bytes = [0; STEP as usize];
    for (slot, value) in bytes.chunks_exact_mut(4).zip(floats) {
        slot.copy_from_slice(&(value as f32).to_le_bytes());
    }
    // A label has 32 bits: ids beyond them would take years of new clusters in one session.
    let label = voxel.cluster.map_or(0, |id| id.get() as u32);
    bytes[28..].copy_from_slice(&label.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::*;
    use crate::engine::{ClusterId, VoxelKey};

    #[test]
    fn what_is_left_out_is_said() {
        assert_eq!(left_out(MAX_LABELLED), None);
        let sentence = left_out(MAX_LABELLED + 1).unwrap();
        assert_eq!(sentence, "~/points_labelled shows the first 1000000 of 1000001 dense voxels");
    }

    #[test]
    fn a_voxel_lies_where_its_fields_say() {
        let voxel = DenseVoxel {
            key: VoxelKey::new(0, 0, 0).unwrap(),
            count: 20,
            centre: Point3::new(1.0, 2.0, 3.0),
            normal: Some(Vector3::z_axis()),
            curvature: 0.25,
            cluster: ClusterId::new(77),
        };
        let bare = DenseVoxel { normal: None, curvature: f32::NAN, cluster: None, ..voxel.clone() };
        let snapshot = Snapshot {
            sequence: 1,
            stamp: None,
            voxel_size: 0.08,
            clusters: Vec::new(),
            voxels: vec![voxel, bare],
            unclustered_voxels: 1,
        };
        let cloud = labelled_points(&Session { id: 1, frame_id: "map".into() }, &snapshot);
        assert_eq!((cloud.width, cloud.row_step, cloud.all_finite), (2, 64, false));
        let float = |at: usize| f32::from_le_bytes(cloud.data[at..at + 4].try_into().unwrap());
        let names: Vec<_> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["x", "y", "z", "normal_x", "normal_y", "normal_z", "curvature", "label"]);
        assert_eq!([0, 4, 8, 12, 16, 20, 24].map(float), [1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 0.25]);
        assert_eq!(cloud.data[28..32], 77u32.to_le_bytes());
        assert!(float(32 + 12).is_nan() && float(32 + 24).is_nan());
        assert_eq!(cloud.data[60..64], [0; 4]);
    }
}
