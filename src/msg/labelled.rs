//! The dense voxels as a labelled `sensor_msgs/PointCloud2`: for those who plan on points.

use super::clusters::Session;
use super::ros::{PointCloud2, PointField};
use crate::engine::{DenseVoxel, Snapshot};

/// Most points of one message; what is beyond is left out and must be said. Voxels in no cluster come first, for nothing else
/// tells of them; those of clusters fill what room is left.
pub const MAX_LABELLED: usize = 1_000_000;

const STEP: u32 = 32;

/// All dense voxel centres, by ascending key: `x y z normal_x normal_y normal_z curvature` (FLOAT32) and `label` (UINT32,
/// cluster id, 0 = in no cluster). Normals and curvature are NaN where there is none.
pub fn labelled_points(session: &Session, snapshot: &Snapshot) -> PointCloud2 {
    let voxels = shown(&snapshot.voxels, MAX_LABELLED);
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

/// Says how many are shown of this many dense voxels, of which `unclustered` are in no cluster; `None` where all are.
pub(crate) fn left_out(voxels: usize, unclustered: u32) -> Option<String> {
    let first = MAX_LABELLED.min(unclustered as usize);
    let sentence = || {
        format!(
            "~/points_labelled shows {MAX_LABELLED} of {voxels} dense voxels, of those in no cluster {first} of {unclustered}"
        )
    };
    (voxels > MAX_LABELLED).then(sentence)
}

/// At most `most` of the voxels, in their order: those in no cluster, and of clusters as many as there is room for. Where not all
/// of a kind have room, they are evenly spaced, so that no place is left out as a whole.
fn shown(voxels: &[DenseVoxel], most: usize) -> Vec<&DenseVoxel> {
    let unclustered = voxels.iter().filter(|voxel| voxel.cluster.is_none()).count();
    let first = unclustered.min(most);
    let mut alone = Thinned::new(unclustered, first);
    let mut clustered = Thinned::new(voxels.len() - unclustered, most - first);
    let is_shown = |voxel: &&DenseVoxel| {
        let kind = if voxel.cluster.is_none() { &mut alone } else { &mut clustered };
        kind.takes_next()
    };
    voxels.iter().filter(is_shown).collect()
}

/// Picks `most` of `all` items, evenly spaced.
struct Thinned {
    all: usize,
    most: usize,
    /// Where it is one or more, in parts of `all`, the next is taken.
    owed: usize,
}

impl Thinned {
    fn new(all: usize, most: usize) -> Self {
        Self { all, most: most.min(all), owed: 0 }
    }

    fn takes_next(&mut self) -> bool {
        self.owed += self.most;
        let takes = self.owed >= self.all;
        if takes {
            self.owed -= self.all;
        }
        takes
    }
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
    use std::collections::BTreeSet;

    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    use super::*;
    use crate::engine::{ClusterId, VoxelKey};

    #[test]
    fn what_is_left_out_is_said() {
        assert_eq!(left_out(MAX_LABELLED, 7), None);
        let sentence = |unclustered| left_out(MAX_LABELLED + 1, unclustered).unwrap();
        let words = "~/points_labelled shows 1000000 of 1000001 dense voxels, of those in no cluster";
        assert_eq!(sentence(7), format!("{words} 7 of 7"));
        assert_eq!(sentence(1_000_001), format!("{words} 1000000 of 1000001"));
    }

    fn voxel(x: i32, cluster: Option<u64>) -> DenseVoxel {
        DenseVoxel {
            key: VoxelKey::new(x, 0, 0).unwrap(),
            count: 20,
            centre: Point3::new(1.0, 2.0, 3.0),
            normal: Some(Vector3::z_axis()),
            curvature: 0.25,
            cluster: cluster.and_then(ClusterId::new),
        }
    }

    proptest! {
        #[test]
        fn voxels_in_no_cluster_come_first_and_what_is_left_out_of_a_kind_is_spread_over_it(
            clusters in prop::collection::vec(prop::option::weighted(0.7, 1..9_u64), 0..200),
            most in 0..220_usize,
        ) {
            let voxels: Vec<_> = (0..).zip(&clusters).map(|(x, cluster)| voxel(x, *cluster)).collect();
            let shown = shown(&voxels, most);
            prop_assert_eq!(shown.len(), most.min(voxels.len()));
            prop_assert!(shown.is_sorted_by(|a, b| a.key < b.key));
            let shown: BTreeSet<_> = shown.iter().map(|voxel| voxel.key).collect();
            let mut room = most;
            for is_alone in [true, false] {
                let of_kind: Vec<_> =
                    voxels.iter().filter(|voxel| voxel.cluster.is_none() == is_alone).collect();
                let taken = |end: usize| of_kind[..end].iter().filter(|voxel| shown.contains(&voxel.key)).count();
                let (all, share) = (of_kind.len(), of_kind.len().min(room));
                // Of every part of a kind as many as of all of it, to within one.
                for end in 0..=all {
                    prop_assert_eq!(taken(end), end * share / all.max(1));
                }
                room -= share;
            }
        }
    }

    #[test]
    fn a_voxel_lies_where_its_fields_say() {
        let voxel = voxel(0, Some(77));
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
