//! The naive oracle: the same definitions and readings, slow and plain.
//!
//! It shares types with the engine and no function: trees instead of hash tables, sums in `f64` over all members
//! instead of running integers, Jacobi rotations instead of a library's eigenvalues. Property tests and the real
//! recordings hold the engine equal to it after every scan.

mod fit;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::{Point3, Vector3};

use self::fit::{Normal, fit, mean, towards};
use crate::engine::{ClusterId, Params, Points, Scan, Snapshot, VoxelKey};

#[derive(Clone, Debug, Default)]
struct Cell {
    points: u32,
    sum: Vector3<f64>,
    normal: Option<Normal>,
    cluster: Option<ClusterId>,
}

#[derive(Clone, Debug)]
struct Cluster {
    normal: Normal,
    last: u64,
}

/// A map that is built by the letter of the definitions.
#[derive(Clone, Debug)]
pub struct Oracle {
    params: Params,
    cells: BTreeMap<VoxelKey, Cell>,
    clusters: BTreeMap<ClusterId, Cluster>,
    scans: u64,
    ids_given: u64,
}

struct Partial {
    members: Vec<VoxelKey>,
    normal: Normal,
}

impl Oracle {
    /// An empty map.
    pub fn new(params: Params) -> Self {
        Self { params, cells: BTreeMap::new(), clusters: BTreeMap::new(), scans: 0, ids_given: 0 }
    }

    /// Takes in a scan.
    pub fn insert(&mut self, scan: &Scan) {
        self.scans += 1;
        let newly_dense = self.bin(scan);
        let members = self.give_normals(&newly_dense, &scan.sensor_origin());
        let partials = self.partials(members);
        self.absorb(&partials);
    }

    fn is_dense(&self, key: VoxelKey) -> bool {
        self.cells.get(&key).is_some_and(|cell| cell.points >= self.params.min_points())
    }

    fn dense_beside(&self, key: VoxelKey) -> Vec<VoxelKey> {
        let [x, y, z] = key.indices();
        let beside =
            [(x + 1, y, z), (x - 1, y, z), (x, y + 1, z), (x, y - 1, z), (x, y, z + 1), (x, y, z - 1)];
        let keys = beside.into_iter().filter_map(|(x, y, z)| VoxelKey::new(x, y, z));
        keys.filter(|&key| self.is_dense(key)).collect()
    }

    fn centre(&self, key: VoxelKey) -> Vector3<f64> {
        let cell = &self.cells[&key];
        cell.sum / f64::from(cell.points)
    }

    fn similar(&self, a: &Normal, b: &Normal) -> bool {
        let cosine = a.vector.dot(&b.vector) / (a.vector.norm() * b.vector.norm());
        cosine.abs() >= self.params.max_normal_angle().cos()
    }

    fn bin(&mut self, scan: &Scan) -> BTreeSet<VoxelKey> {
        let points: Vec<Vector3<f64>> = match &scan.points {
            Points::F32(points) | Points::Ended { points, .. } => {
                points.iter().map(|p| Vector3::from(p.map(f64::from))).collect()
            }
            Points::F64(points) => points.iter().map(|&p| Vector3::from(p)).collect(),
            Points::Depths(depths) => depths.list().iter().map(|p| Vector3::from(p.map(f64::from))).collect(),
        };
        let rotation = scan.fixed_from_sensor.rotation.to_rotation_matrix();
        let mut newly_dense = BTreeSet::new();
        for point in points {
            let point = rotation * point + scan.fixed_from_sensor.translation.vector;
            if !point.iter().all(|c| c.is_finite()) {
                continue;
            }
            let index = point.map(|c| (c / self.params.voxel_size()).floor() as i32);
            let Some(key) = VoxelKey::new(index.x, index.y, index.z) else { continue };
            let cell = self.cells.entry(key).or_default();
            cell.points += 1;
            cell.sum += point;
            if cell.points == self.params.min_points() {
                newly_dense.insert(key);
            }
        }
        newly_dense
    }

    /// Definition 2, the voxel itself included.
    fn neighbourhood(&self, key: VoxelKey) -> BTreeSet<VoxelKey> {
        let mut reached = BTreeSet::from([key]);
        for _ in 0..self.params.depth() {
            let rim: Vec<_> = reached.iter().flat_map(|&key| self.dense_beside(key)).collect();
            reached.extend(rim);
        }
        reached
    }

    fn give_normals(&mut self, newly_dense: &BTreeSet<VoxelKey>, sensor: &Point3<f64>) -> BTreeSet<VoxelKey> {
        let near = newly_dense.iter().flat_map(|&key| self.neighbourhood(key));
        let bare: BTreeSet<_> = near.filter(|key| self.cells[key].normal.is_none()).collect();
        let mut given = BTreeSet::new();
        for key in bare {
            let centres: Vec<_> = self.neighbourhood(key).into_iter().map(|key| self.centre(key)).collect();
            let Some(normal) = fit(&centres) else { continue };
            let to_sensor = sensor.coords - self.centre(key);
            if let Some(cell) = self.cells.get_mut(&key) {
                cell.normal = Some(towards(normal, &to_sensor));
                given.insert(key);
            }
        }
        given
    }

    fn partials(&self, mut free: BTreeSet<VoxelKey>) -> Vec<Partial> {
        let mut partials = Vec::new();
        while let Some(seed) = free.pop_first() {
            let Some(mut running) = self.cells[&seed].normal else { continue };
            let (mut members, mut queue) = (vec![seed], VecDeque::from([seed]));
            while let Some(member) = queue.pop_front() {
                for key in self.dense_beside(member) {
                    let Some(normal) = self.cells[&key].normal.filter(|_| free.contains(&key)) else {
                        continue;
                    };
                    if self.similar(&running, &normal) {
                        running = mean(running, members.len(), towards(normal, &running.vector), 1);
                        free.remove(&key);
                        members.push(key);
                        queue.push_back(key);
                    }
                }
            }
            let normal =
                self.fit_members(&members).map_or_else(|| running.unit(), |n| towards(n, &running.vector));
            partials.push(Partial { members, normal });
        }
        partials
    }

    fn fit_members(&self, members: &[VoxelKey]) -> Option<Normal> {
        let centres: Vec<_> = members.iter().map(|&key| self.centre(key)).collect();
        fit(&centres)
    }

    fn members(&self, id: ClusterId) -> Vec<VoxelKey> {
        let mine = self.cells.iter().filter(|(_, cell)| cell.cluster == Some(id));
        mine.map(|(&key, _)| key).collect()
    }

    fn pairs(&self, partials: &[Partial]) -> Vec<(u32, ClusterId, usize)> {
        let mut pairs = Vec::new();
        for (number, partial) in partials.iter().enumerate() {
            let mut vicinity = BTreeMap::<ClusterId, u32>::new();
            for id in partial.members.iter().flat_map(|&key| self.dense_beside(key)) {
                if let Some(id) = self.cells[&id].cluster {
                    *vicinity.entry(id).or_default() += 1;
                }
            }
            for (id, vicinity) in vicinity {
                let cluster = &self.clusters[&id];
                let interval = u64::from(self.params.expansion_interval());
                let active = interval == 0 || self.scans - cluster.last <= interval;
                let near = vicinity >= self.params.min_vicinity();
                if active && near && self.similar(&cluster.normal, &partial.normal) {
                    pairs.push((vicinity, id, number));
                }
            }
        }
        pairs.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
        pairs
    }

    fn absorb(&mut self, partials: &[Partial]) {
        let mut survivor: BTreeMap<ClusterId, ClusterId> = BTreeMap::new();
        let mut owner: BTreeMap<usize, ClusterId> = BTreeMap::new();
        let mut grown = BTreeSet::new();
        for (_, id, number) in self.pairs(partials) {
            let follow = |mut id: ClusterId| {
                while let Some(&next) = survivor.get(&id) {
                    id = next;
                }
                id
            };
            let (id, partial) = (follow(id), &partials[number]);
            let Some(other) = owner.get(&number).map(|&other| follow(other)) else {
                if self.similar(&self.clusters[&id].normal, &partial.normal) {
                    self.join(id, &partial.members, partial.normal);
                    owner.insert(number, id);
                    grown.insert(id);
                }
                continue;
            };
            if other != id && self.similar(&self.clusters[&id].normal, &self.clusters[&other].normal) {
                let (stays, goes) = (id.min(other), id.max(other));
                let (members, normal) = (self.members(goes), self.clusters[&goes].normal);
                self.clusters.remove(&goes);
                self.join(stays, &members, normal);
                survivor.insert(goes, stays);
                grown.remove(&goes);
                grown.insert(stays);
            }
        }
        for (number, partial) in partials.iter().enumerate() {
            if !owner.contains_key(&number) {
                self.start(partial);
            }
        }
        grown.into_iter().for_each(|id| self.refine(id));
    }

    fn join(&mut self, id: ClusterId, members: &[VoxelKey], normal: Normal) {
        let before = self.members(id).len();
        if let Some(cluster) = self.clusters.get_mut(&id) {
            let turned = towards(normal, &cluster.normal.vector);
            cluster.normal = mean(cluster.normal, before, turned, members.len()).unit();
            cluster.last = self.scans;
        }
        self.label(members, id);
    }

    fn start(&mut self, partial: &Partial) {
        self.ids_given += 1;
        if let Some(id) = ClusterId::new(self.ids_given) {
            self.clusters.insert(id, Cluster { normal: partial.normal, last: self.scans });
            self.label(&partial.members, id);
        }
    }

    fn label(&mut self, members: &[VoxelKey], id: ClusterId) {
        for key in members {
            if let Some(cell) = self.cells.get_mut(key) {
                cell.cluster = Some(id);
            }
        }
    }

    fn refine(&mut self, id: ClusterId) {
        let refit = self.fit_members(&self.members(id));
        if let (Some(cluster), Some(normal)) = (self.clusters.get_mut(&id), refit) {
            cluster.normal = towards(normal, &cluster.normal.vector);
        }
    }

    /// The first difference between this map and the engine's, or `None` where they are equal: voxels, counts, labels
    /// and ids exactly, centres to 1e-8 m, normals to 1e-6 + 1e-13 l2 / (l1 - l0) rad.
    pub fn difference(&self, snapshot: &Snapshot) -> Option<String> {
        self.voxel_difference(snapshot).or_else(|| self.cluster_difference(snapshot))
    }

    fn voxel_difference(&self, snapshot: &Snapshot) -> Option<String> {
        let mine: Vec<_> = self.cells.iter().filter(|(key, _)| self.is_dense(**key)).collect();
        if mine.len() != snapshot.voxels.len() {
            return Some(format!("{} dense voxels, the engine has {}", mine.len(), snapshot.voxels.len()));
        }
        let pairs = mine.into_iter().zip(&snapshot.voxels);
        let differs = |((key, cell), voxel): &((&VoxelKey, &Cell), &crate::engine::DenseVoxel)| {
            **key != voxel.key
                || cell.points != voxel.count
                || cell.cluster != voxel.cluster
                || (self.centre(**key) - voxel.centre.coords).norm() > 1e-8
                || !Normal::agree(cell.normal.as_ref(), voxel.normal.as_ref())
        };
        pairs.into_iter().find(differs).map(|((key, cell), voxel)| {
            format!("scan {}: {key:?} {cell:?}, the engine has {voxel:?}", self.scans)
        })
    }

    fn cluster_difference(&self, snapshot: &Snapshot) -> Option<String> {
        let ids: Vec<_> = snapshot.clusters.iter().map(|cluster| cluster.id).collect();
        let mine: Vec<_> = self.clusters.keys().copied().collect();
        if ids != mine {
            return Some(format!("scan {}: ids {mine:?}, the engine has {ids:?}", self.scans));
        }
        let differs = |cluster: &&crate::engine::Cluster| {
            let mine = &self.clusters[&cluster.id];
            let members = self.members(cluster.id);
            let points: u64 = members.iter().map(|key| u64::from(self.cells[key].points)).sum();
            let centroid = members.iter().map(|&key| self.centre(key)).sum::<Vector3<f64>>();
            members.len() != cluster.voxel_count as usize
                || points != cluster.point_count
                || (centroid / members.len() as f64 - cluster.centroid.coords).norm() > 1e-8
                || !Normal::agree(Some(&mine.normal), Some(&cluster.normal))
        };
        let different = snapshot.clusters.iter().find(differs);
        different.map(|cluster| {
            format!("scan {}: {:?}, the engine has {cluster:?}", self.scans, self.clusters[&cluster.id])
        })
    }
}
