//! What a reader makes of the updates that has only those.

use std::collections::BTreeMap;

use cfodi::engine::{Cluster, ClusterId, Snapshot, Update};

#[derive(Default)]
pub(crate) struct Reader {
    clusters: BTreeMap<ClusterId, Cluster>,
    newest: Option<ClusterId>,
    sequence: u64,
}

impl Reader {
    /// One that begins with a snapshot.
    pub(crate) fn of(snapshot: &Snapshot) -> Self {
        let clusters: BTreeMap<_, _> = snapshot.clusters.iter().map(|c| (c.id, c.clone())).collect();
        let newest = clusters.keys().next_back().copied();
        Self { clusters, newest, sequence: snapshot.sequence }
    }

    pub(crate) fn apply(&mut self, update: &Update) {
        self.sequence += 1;
        assert_eq!(update.sequence, self.sequence);
        for id in &update.removed {
            assert!(self.clusters.remove(id).is_some(), "{id} removed without having been there");
        }
        for changed in &update.changed {
            let id = changed.cluster.id;
            if let Some(before) = self.clusters.insert(id, changed.cluster.clone()) {
                assert_eq!(changed.cluster.revision, before.revision + 1);
                let same = Cluster { revision: changed.cluster.revision, ..before };
                assert!(same != changed.cluster || !changed.merged_from.is_empty(), "nothing of {id} is new");
            } else {
                assert!(Some(id) > self.newest, "{id} was used before");
                assert_eq!(changed.cluster.revision, 1);
                self.newest = Some(id);
            }
            for merged in &changed.merged_from {
                assert!(update.removed.contains(merged), "{merged} is still there");
            }
        }
        assert!(update.removed.is_sorted());
    }

    /// The changes put together are the whole map, and its parts agree with each other.
    pub(crate) fn agrees(&self, update: &Update, snapshot: &Snapshot) {
        let (added_up, whole): (Vec<_>, Vec<_>) =
            (self.clusters.values().collect(), snapshot.clusters.iter().collect());
        // What is not known is NaN, which equals nothing: compared as text.
        assert_eq!(format!("{added_up:?}"), format!("{whole:?}"));
        let (mut counts, mut none) = (BTreeMap::<_, u32>::new(), 0);
        for voxel in &snapshot.voxels {
            match voxel.cluster {
                Some(id) => *counts.entry(id).or_default() += 1,
                None => none += 1,
            }
        }
        let told: BTreeMap<_, _> = snapshot.clusters.iter().map(|c| (c.id, c.voxel_count)).collect();
        assert_eq!(counts, told);
        assert_eq!([update.unclustered_voxels, snapshot.unclustered_voxels], [none; 2]);
        assert_eq!((update.sequence, Some(update.stamp)), (snapshot.sequence, snapshot.stamp));
        snapshot.clusters.iter().for_each(check);
    }
}

/// Numbers that a robot would steer by are numbers.
fn check(cluster: &Cluster) {
    let numbers = [
        cluster.normal.as_slice(),
        cluster.centroid.coords.as_slice(),
        cluster.covariance.as_slice(),
        cluster.pose.translation.vector.as_slice(),
        cluster.pose.rotation.coords.as_slice(),
        cluster.size.as_slice(),
        &[cluster.offset, cluster.rms_error, f64::from(cluster.class_confidence)],
        cluster.area.as_slice(),
    ];
    assert!(numbers.iter().all(|numbers| numbers.iter().all(|number| number.is_finite())), "{cluster:?}");
    let rings = std::iter::once(&cluster.boundary).chain(&cluster.holes);
    assert!(rings.flatten().all(|point| point.iter().all(|number| number.is_finite())), "{cluster:?}");
    assert!(
        (cluster.normal.norm() - 1.0).abs() < 1e-6 && cluster.size.iter().all(|side| *side >= 0.0),
        "{cluster:?}"
    );
    assert!(cluster.voxel_count > 0 && cluster.point_count > 0 && cluster.rms_error >= 0.0, "{cluster:?}");
}
