//! What the consistent mode makes of real recordings, and of a robot that stands still.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod support;

use std::collections::{BTreeMap, BTreeSet};

use cfodi::engine::consistent::Consistent;
use cfodi::engine::paper::Cfodi;
use cfodi::engine::{ClusterId, Params, Snapshot, VoxelKey, canonical};
use cfodi::rand_index::adjusted_rand_index;
use nalgebra::{Point3, Vector3};
use serde::Deserialize;

/// What is known of a recording's planes.
#[derive(Deserialize)]
struct Truth {
    planes: Vec<TruePlane>,
}

#[derive(Deserialize)]
struct TruePlane {
    name: String,
    /// a, b, c and d of a x + b y + c z + d = 0.
    plane: [f64; 4],
}

/// A true plane: name, n and d of n . x + d = 0 with |n| = 1.
type Plane = (String, Vector3<f64>, f64);

fn true_planes(recording: &support::Recording) -> Vec<Plane> {
    let truth: Truth = serde_json::from_str(&recording.read("truth_planes.json")).unwrap();
    let plane = |TruePlane { name, plane: [a, b, c, d] }| {
        let normal = Vector3::new(a, b, c);
        (name, normal.normalize(), d / normal.norm())
    };
    truth.planes.into_iter().map(plane).collect()
}

/// The face of the box on the floor that a voxel's centre lies on: within 3 cm of it, and away from all others. The floor
/// is the first of the planes, the others are those of the box.
fn face(planes: &[Plane], centre: &Point3<f64>) -> Option<usize> {
    let heights: Vec<_> = planes.iter().map(|(_, normal, d)| normal.dot(&centre.coords) + d).collect();
    let beside = heights[2..].iter().any(|&height| height > 0.06);
    if heights[0].abs() < 0.03 && beside {
        return Some(0);
    }
    let within = |face: usize| (1..planes.len()).all(|other| other == face || heights[other] < -0.02);
    (1..planes.len()).find(|&face| heights[face].abs() < 0.03 && within(face) && heights[0] > 0.04)
}

#[test]
fn the_six_faces_of_the_cabinet_are_six_clusters() {
    let Some(recording) = support::recording("tum_fr3_cabinet58", "the_six_faces_of_the_cabinet") else {
        return;
    };
    let planes = true_planes(&recording);
    for (voxel_size, limit) in [(0.08, 3.0), (0.05, 1.5)] {
        let mut map = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
        recording.scans(1).for_each(|scan| drop(map.insert(&scan)));
        let snapshot = map.snapshot();
        let mut votes: Vec<BTreeMap<Option<ClusterId>, u32>> = vec![BTreeMap::new(); planes.len()];
        for voxel in &snapshot.voxels {
            if let Some(face) = face(&planes, &voxel.centre) {
                *votes[face].entry(voxel.cluster).or_default() += 1;
            }
        }
        let mut found = BTreeSet::new();
        for ((name, normal, d), votes) in planes.iter().zip(votes) {
            let all: u32 = votes.values().sum();
            let (id, most) = votes.into_iter().max_by_key(|(_, count)| *count).unwrap();
            let cluster = snapshot.clusters.iter().find(|cluster| Some(cluster.id) == id).unwrap();
            let angle = cluster.normal.angle(normal).to_degrees();
            let off = (normal.dot(&cluster.pose.translation.vector) + d).abs();
            let share = f64::from(most) / f64::from(all);
            eprintln!("{voxel_size} m, {name}: {share:.3} of {all} voxels, {angle:.2} degrees, {off:.4} m");
            assert!(share >= 0.85, "{name} at {voxel_size} m: {share} of {all} voxels");
            assert!(angle <= limit, "{name} at {voxel_size} m: {angle} degrees");
            assert!(off <= 0.025, "{name} at {voxel_size} m: {off} m");
            found.insert(cluster.id);
        }
        assert_eq!(found.len(), 6, "{voxel_size} m: a cluster for each face");
    }
}

#[test]
fn on_recordings_the_map_is_that_of_its_definition() {
    for (name, step) in [("tum_fr3_cabinet58", 1), ("tum_rpy179", 3)] {
        let Some(recording) = support::recording(name, "on_recordings_the_map_is_that_of_its_definition")
        else {
            return;
        };
        for voxel_size in [0.08, 0.05] {
            let mut map = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
            for (number, scan) in (1..).zip(recording.scans(step)) {
                map.insert(&scan);
                if number % 10 == 0 {
                    assert_eq!(canonical(map.partition()), canonical(map.scratch()), "scan {number}");
                }
            }
            // What waits for being published makes little difference. A voxel in no cluster is one by itself.
            let all: BTreeMap<_, _> = map.scratch_of_all().into_iter().collect();
            let label = |place: usize, cluster: Option<u32>| cluster.ok_or(place);
            let pairs: Vec<_> = map
                .partition()
                .into_iter()
                .enumerate()
                .map(|(place, (key, cluster))| (label(place, cluster), label(place, all[&key])))
                .collect();
            let index = adjusted_rand_index(&pairs);
            eprintln!("{name}, {voxel_size} m: {index:.4} against all voxels as they are now");
            assert!(index > 0.8, "{index}");
        }
    }
}

/// Clusters of one voxel, and mean angle (rad) between the normals of voxels and of their clusters, with the share of the
/// dense voxels that have both.
fn fragments(snapshot: &Snapshot) -> (usize, f64, f64) {
    let normals: BTreeMap<_, _> =
        snapshot.clusters.iter().map(|cluster| (cluster.id, cluster.normal)).collect();
    let angles: Vec<f64> = snapshot
        .voxels
        .iter()
        .filter_map(|voxel| {
            Some(normals[&voxel.cluster?].dot(&voxel.normal?.into_inner()).abs().min(1.0).acos())
        })
        .collect();
    let single = snapshot.clusters.iter().filter(|cluster| cluster.voxel_count == 1).count();
    let share = angles.len() as f64 / snapshot.voxels.len() as f64;
    (single, angles.iter().sum::<f64>() / angles.len() as f64, share)
}

#[test]
fn on_recordings_no_fragment_floods_the_message_and_normals_are_nearer_than_statics() {
    for (name, step) in [("tum_fr3_cabinet58", 1), ("tum_rpy179", 3)] {
        let Some(recording) = support::recording(name, "on_recordings_no_fragment_floods_the_message") else {
            return;
        };
        for voxel_size in [0.08, 0.05] {
            let with = |params: Params| params.with_voxel_size(voxel_size).unwrap();
            let mut map = Consistent::new(with(Params::default()));
            let mut paper = Cfodi::new(with(Params::paper()));
            for scan in recording.scans(step) {
                map.insert(&scan);
                paper.insert(&scan);
            }
            let (single, error, share) = fragments(&map.snapshot());
            let letter = fragments(&paper.snapshot()).0;
            let statics = paper.static_map();
            let of_static: Vec<f64> = statics
                .voxels
                .iter()
                .filter_map(|voxel| {
                    let cluster = statics.cluster_normals[voxel.cluster? as usize];
                    Some(cluster.dot(&voxel.normal?.into_inner()).abs().min(1.0).acos())
                })
                .collect();
            let of_static = of_static.iter().sum::<f64>() / of_static.len() as f64;
            eprintln!(
                "{name}, {voxel_size} m: {single} single voxels (the letter {letter}), normals {error:.3} rad at \
                 {share:.3} (STATIC {of_static:.3})"
            );
            assert!(10 * single <= letter);
            assert!(share >= 0.9, "{name}, {voxel_size} m: normals of {share}");
            assert!(error < of_static, "{error} rad, STATIC {of_static}");
        }
    }
}

/// What becomes of the labels while a robot stands for 300 scans, each with other noise.
#[cfg(feature = "sim")]
mod standing_still {
    use cfodi::engine::{Scan, Stamp};
    use cfodi::sim::{Drive, Scene};

    use super::*;

    /// A map, and what has changed in it from the 10th scan on.
    struct Standing {
        voxel_size: f64,
        map: Consistent,
        before: BTreeMap<VoxelKey, Option<ClusterId>>,
        /// Ids that are gone.
        gone: usize,
        /// Labels that a scan has changed, of voxels that were dense before, and how many could have been.
        changed: usize,
        voxels: usize,
    }

    impl Standing {
        fn new(voxel_size: f64) -> Self {
            let map = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
            Self { voxel_size, map, before: BTreeMap::new(), gone: 0, changed: 0, voxels: 0 }
        }

        fn take_in(&mut self, number: u32, scan: &Scan) {
            let update = self.map.insert(scan);
            let voxels = self.map.snapshot().voxels;
            let now: BTreeMap<_, _> = voxels.into_iter().map(|voxel| (voxel.key, voxel.cluster)).collect();
            if number >= 10 {
                self.gone += update.removed.len();
                let is_other = |(key, cluster): &(&VoxelKey, &Option<ClusterId>)| {
                    now.get(key).is_some_and(|now| now != *cluster)
                };
                self.changed += self.before.iter().filter(is_other).count();
                self.voxels += self.before.len();
            }
            self.before = now;
        }

        /// That few ids are gone, and few of the labels of a scan change, on average.
        fn changes_little(&self, most_gone: usize, place: (&str, u32)) {
            let share = self.changed as f64 / self.voxels as f64;
            let told = format!(
                "{place:?}, {} m: {} ids gone, {:.4} % of the labels a scan",
                self.voxel_size,
                self.gone,
                100.0 * share
            );
            eprintln!("{told}");
            assert!(self.gone <= most_gone && share < 0.001, "{told}");
        }
    }

    /// A map of each voxel size (m) in one view of a scene; at most so many ids may be gone.
    fn stand(place: (&str, u32), sizes: &[(f64, usize)]) {
        let (scene, view) = place;
        let mut maps: Vec<_> = sizes.iter().map(|(voxel_size, _)| Standing::new(*voxel_size)).collect();
        for number in 0..300_u32 {
            let start = Stamp::from_nanos(i64::from(number) * 33_333_333);
            let drive = Drive::new(Scene::named(scene).unwrap(), u64::from(number), start);
            let scan = drive.labelled_scan(view).scan;
            maps.iter_mut().for_each(|map| map.take_in(number, &scan));
        }
        for (map, (_, most_gone)) in maps.iter().zip(sizes) {
            map.changes_little(*most_gone, place);
        }
    }

    /// Ids that may go where a scan has few points in a voxel: the map is not whole after ten, and pieces of one surface still
    /// meet.
    const FAR: usize = 5;

    #[test]
    fn in_the_room_changes_no_id_and_few_labels() {
        stand(("room", 0), &[(0.08, 0), (0.05, FAR)]);
        stand(("room", 300), &[(0.08, 0)]);
    }

    #[test]
    fn in_the_laboratory_changes_no_id_and_few_labels() {
        stand(("lab", 600), &[(0.08, 0), (0.05, 0)]);
    }

    #[test]
    fn elsewhere_in_the_laboratory_changes_no_id_and_few_labels() {
        stand(("lab", 900), &[(0.05, 0)]);
    }

    #[test]
    fn far_from_most_things_changes_few_labels() {
        stand(("lab", 1200), &[(0.05, FAR)]);
    }
}
