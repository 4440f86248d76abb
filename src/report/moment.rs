//! The map at one time, as what differs from the time before.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::row::row;
use crate::engine::{ClusterId, DenseVoxel, Snapshot, Stamp, VoxelKey};

/// What is drawn of a dense voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Look {
    pub(super) cluster: Option<ClusterId>,
    /// The normal in 127ths; zeros where there is none.
    pub(super) normal: [i8; 3],
}

impl From<&DenseVoxel> for Look {
    fn from(voxel: &DenseVoxel) -> Self {
        let normal = voxel.normal.map_or([0; 3], |n| [n.x, n.y, n.z].map(|x| (127.0 * x).round() as i8));
        Self { cluster: voxel.cluster, normal }
    }
}

/// What a map has become since the moment before; `None` stands for what is gone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Moment {
    /// Number of scans taken in.
    pub(super) scan: u64,
    pub(super) stamp: Stamp,
    /// Dense voxels in no cluster.
    pub(super) unclustered: u32,
    /// By number of the voxel.
    pub(super) voxels: BTreeMap<u32, Option<Look>>,
    /// Each cluster's fields as JSON.
    pub(super) clusters: BTreeMap<ClusterId, Option<Box<str>>>,
}

impl Moment {
    /// Makes this moment follow on the one before `earlier`.
    pub(super) fn take_in(&mut self, earlier: Self) {
        for (number, look) in earlier.voxels {
            self.voxels.entry(number).or_insert(look);
        }
        for (id, row) in earlier.clusters {
            self.clusters.entry(id).or_insert(row);
        }
    }
}

/// All voxels that were ever dense, and the map as it was at the newest moment.
#[derive(Clone, Debug, Default)]
pub(super) struct Latest {
    /// By number.
    pub(super) keys: Vec<VoxelKey>,
    numbers: FxHashMap<VoxelKey, u32>,
    looks: Vec<Option<Look>>,
    rows: BTreeMap<ClusterId, Box<str>>,
}

impl Latest {
    /// Becomes the map of this snapshot, and says what that changed.
    pub(super) fn advance(&mut self, snapshot: &Snapshot, scan: u64) -> Moment {
        Moment {
            scan,
            stamp: snapshot.stamp.unwrap_or_default(),
            unclustered: snapshot.unclustered_voxels,
            voxels: self.changed_voxels(snapshot),
            clusters: self.changed_clusters(snapshot),
        }
    }

    fn changed_voxels(&mut self, snapshot: &Snapshot) -> BTreeMap<u32, Option<Look>> {
        let mut looks = vec![None; self.looks.len()];
        for voxel in &snapshot.voxels {
            let number = *self.numbers.entry(voxel.key).or_insert_with(|| {
                self.keys.push(voxel.key);
                self.looks.push(None);
                looks.push(None);
                self.keys.len() as u32 - 1
            });
            looks[number as usize] = Some(Look::from(voxel));
        }
        let before = std::mem::replace(&mut self.looks, looks);
        let pairs = (0..).zip(self.looks.iter().zip(before));
        pairs.filter(|(_, (now, before))| *now != before).map(|(number, (now, _))| (number, *now)).collect()
    }

    fn changed_clusters(&mut self, snapshot: &Snapshot) -> BTreeMap<ClusterId, Option<Box<str>>> {
        let rows: BTreeMap<_, _> =
            snapshot.clusters.iter().map(|cluster| (cluster.id, row(&cluster.into()))).collect();
        let before = std::mem::replace(&mut self.rows, rows);
        let gone = before.keys().filter(|id| !self.rows.contains_key(id)).map(|&id| (id, None));
        let changed = self.rows.iter().filter(|(id, row)| before.get(id) != Some(row));
        gone.chain(changed.map(|(&id, row)| (id, Some(row.clone())))).collect()
    }
}
