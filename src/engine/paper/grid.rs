//! The sparse voxel grid: what each voxel has counted, and step 1's binning of a scan (section III.B).
//!
//! A voxel holds the number of its points and the integer sum of their offsets from its corner, so that its centre
//! depends neither on the order of the points nor on the distance from the origin, until it is full ([`MAX_POINTS`]): runs
//! that would be more than that are left out whole. Binning costs one hash look-up per run of consecutive points in the same
//! voxel.

use hashbrown::HashMap;
use nalgebra::{UnitVector3, Vector3};
use rustc_hash::FxBuildHasher;

use super::moments::Centre;
use crate::engine::binning::{BATCH, Exact};
use crate::engine::key::{DIRECTIONS, VoxelKey};
use crate::engine::params::MAX_POINTS;
use crate::engine::points::Points;
use crate::engine::scan::Scan;

/// Place of a voxel in the grid's list; it never changes, since nothing is taken out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct VoxelIndex(u32);

/// Which cluster a voxel belongs to, and where it stands on the way there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Label {
    /// In no cluster: not dense, or without a normal.
    None,
    /// Has a normal since this scan and waits for step 2.
    Fresh,
    /// In the partial cluster of this number.
    Partial(u32),
    /// In the global cluster of this slot, or in what that one has been merged into.
    Global(u32),
}

/// The local surface at a voxel (Definition 3).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Towards the sensor that saw it.
    pub(crate) normal: UnitVector3<f64>,
    /// Smallest eigenvalue over the sum.
    pub(crate) curvature: f32,
}

#[derive(Clone, Debug)]
pub(crate) struct Voxel {
    pub(crate) key: VoxelKey,
    pub(crate) count: u32,
    /// Offsets from the corner, summed per axis, in units of `voxel_size / 2^32` ([`Exact`]).
    pub(super) sum: [u64; 3],
    /// The newest scan that put a point here.
    pub(super) touched: u64,
    pub(crate) surface: Option<Surface>,
    pub(crate) label: Label,
}

impl Voxel {
    pub(crate) fn centre(&self) -> Centre {
        Centre::new(self.key, self.sum, self.count)
    }

    /// The centre from the corner of voxel `origin`, in voxels, as exact as the sums are: a normal of voxels that lie nearly
    /// on a line turns by a thousand times what a centre is rounded by.
    pub(crate) fn offset_from(&self, origin: VoxelKey) -> Vector3<f64> {
        let (own, other) = (self.key.indices(), origin.indices());
        let mean = |i: usize| self.sum[i] as f64 / f64::from(self.count) / Exact::UNITS;
        Vector3::from_fn(|i, _| f64::from(own[i] - other[i]) + mean(i))
    }
}

/// A voxel that received points, and how it was before them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touched {
    pub(crate) voxel: VoxelIndex,
    pub(crate) count_before: u32,
    /// Its centre, where it already belonged to a global cluster.
    pub(crate) centre_before: Option<Centre>,
}

/// What binning a scan did.
#[derive(Debug, Default)]
pub(crate) struct Binned {
    /// Every voxel that received a point, once.
    pub(crate) touched: Vec<Touched>,
    /// The voxels that became dense (the paper's `DU_t`), by ascending key.
    pub(crate) newly_dense: Vec<VoxelIndex>,
    /// Points beyond the grid's reach.
    pub(crate) beyond: u32,
}

#[derive(Clone, Debug)]
pub(crate) struct Grid {
    voxel_size: f64,
    min_points: u32,
    index: HashMap<VoxelKey, VoxelIndex, FxBuildHasher>,
    voxels: Vec<Voxel>,
    dense: u32,
}

/// Consecutive points of one voxel, summed before they are looked up.
struct Run {
    index: [i64; 3],
    /// `None` beyond the grid's reach.
    key: Option<VoxelKey>,
    count: u32,
    sum: [u64; 3],
}

impl Run {
    fn begin(index: [i64; 3]) -> Self {
        let [ix, iy, iz] = index.map(|i| i.clamp(i32::MIN.into(), i32::MAX.into()) as i32);
        Self { index, key: VoxelKey::new(ix, iy, iz), count: 0, sum: [0; 3] }
    }
}

/// A scan on its way into the grid.
struct Binning {
    places: Exact,
    /// What has not been put into its voxel yet.
    run: Run,
    sequence: u64,
    binned: Binned,
}

impl Binning {
    fn new(scan: &Scan, voxel_size: f64, sequence: u64) -> Self {
        let rotation = scan.fixed_from_sensor.rotation.to_rotation_matrix().into_inner();
        let places = Exact::new(rotation, scan.fixed_from_sensor.translation.vector, voxel_size);
        Self { places, run: Run::begin([0; 3]), sequence, binned: Binned::default() }
    }
}

impl Grid {
    pub(crate) fn new(voxel_size: f64, min_points: u32) -> Self {
        Self { voxel_size, min_points, index: HashMap::default(), voxels: Vec::new(), dense: 0 }
    }

    /// A grid of these voxels, each of another key, in the order of the list.
    pub(super) fn of(voxel_size: f64, min_points: u32, voxels: Vec<Voxel>) -> Self {
        let index = (0..).map(VoxelIndex).zip(&voxels).map(|(index, voxel)| (voxel.key, index)).collect();
        let dense = voxels.iter().filter(|voxel| voxel.count >= min_points).count() as u32;
        Self { voxel_size, min_points, index, voxels, dense }
    }

    /// All voxels, in the order of the list.
    pub(super) fn voxels(&self) -> &[Voxel] {
        &self.voxels
    }

    pub(crate) const fn voxel_size(&self) -> f64 {
        self.voxel_size
    }

    /// Number of dense voxels.
    pub(crate) const fn dense(&self) -> u32 {
        self.dense
    }

    /// Number of voxels that hold a point.
    pub(crate) const fn len(&self) -> usize {
        self.voxels.len()
    }

    pub(crate) fn is_dense(&self, voxel: VoxelIndex) -> bool {
        self[voxel].count >= self.min_points
    }

    pub(crate) fn get(&self, key: VoxelKey) -> Option<VoxelIndex> {
        self.index.get(&key).copied()
    }

    /// The dense voxel of this key.
    pub(crate) fn get_dense(&self, key: VoxelKey) -> Option<VoxelIndex> {
        self.get(key).filter(|&voxel| self.is_dense(voxel))
    }

    /// The dense voxels directly connected to this one (Definition 1), in the order +x -x +y -y +z -z.
    pub(crate) fn dense_neighbours(&self, voxel: VoxelIndex) -> [Option<VoxelIndex>; 6] {
        DIRECTIONS.map(|direction| self[voxel].key.step(direction).and_then(|key| self.get_dense(key)))
    }

    /// All dense voxels by ascending key.
    pub(crate) fn dense_voxels(&self) -> Vec<VoxelIndex> {
        let all = 0..self.voxels.len() as u32;
        let mut dense: Vec<_> = all.map(VoxelIndex).filter(|&voxel| self.is_dense(voxel)).collect();
        self.sort_by_key(&mut dense);
        dense
    }

    pub(crate) fn sort_by_key(&self, voxels: &mut [VoxelIndex]) {
        voxels.sort_unstable_by_key(|&voxel| self[voxel].key);
    }

    /// Puts the points of a scan into their voxels; `sequence` is the number of the scan.
    pub(crate) fn bin(&mut self, scan: &Scan, sequence: u64) -> Binned {
        let mut binning = Binning::new(scan, self.voxel_size, sequence);
        match &scan.points {
            Points::F32(points) | Points::Ended { points, .. } => self.bin_points(points, &mut binning),
            Points::F64(points) => self.bin_points(points, &mut binning),
            Points::Depths(depths) => depths.each_row(|row| self.bin_points(row, &mut binning)),
        }
        let Binning { run, mut binned, .. } = binning;
        self.flush(&run, sequence, &mut binned);
        for touched in &binned.touched {
            if touched.count_before < self.min_points && self.is_dense(touched.voxel) {
                binned.newly_dense.push(touched.voxel);
            }
        }
        self.dense += binned.newly_dense.len() as u32;
        self.sort_by_key(&mut binned.newly_dense);
        binned
    }

    fn bin_points<T: Copy + Into<f64>>(&mut self, points: &[[T; 3]], binning: &mut Binning) {
        let Binning { places, run, sequence, binned } = binning;
        for batch in points.chunks(BATCH) {
            for (index, offset) in places.place(batch) {
                if index != run.index {
                    self.flush(run, *sequence, binned);
                    *run = Run::begin(index);
                }
                if run.key.is_none() {
                    binned.beyond += 1;
                    continue;
                }
                run.count += 1;
                (0..3).for_each(|axis| run.sum[axis] += offset[axis] as u64);
            }
        }
    }

    fn flush(&mut self, run: &Run, sequence: u64, binned: &mut Binned) {
        let Some(key) = run.key.filter(|_| run.count > 0) else { return };
        let next = VoxelIndex(self.voxels.len() as u32);
        let found = *self.index.entry(key).or_insert(next);
        if found == next {
            let surface = None;
            self.voxels.push(Voxel { key, count: 0, sum: [0; 3], touched: 0, surface, label: Label::None });
        }
        let voxel = &mut self.voxels[found.0 as usize];
        if voxel.touched != sequence {
            voxel.touched = sequence;
            let centre_before = matches!(voxel.label, Label::Global(_)).then(|| voxel.centre());
            binned.touched.push(Touched { voxel: found, count_before: voxel.count, centre_before });
        }
        if voxel.count <= MAX_POINTS - run.count.min(MAX_POINTS) {
            voxel.count += run.count;
            for (sum, more) in voxel.sum.iter_mut().zip(run.sum) {
                *sum += more;
            }
        }
    }
}

impl std::ops::Index<VoxelIndex> for Grid {
    type Output = Voxel;

    fn index(&self, VoxelIndex(index): VoxelIndex) -> &Voxel {
        &self.voxels[index as usize]
    }
}

impl std::ops::IndexMut<VoxelIndex> for Grid {
    fn index_mut(&mut self, VoxelIndex(index): VoxelIndex) -> &mut Voxel {
        &mut self.voxels[index as usize]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3};

    use super::*;
    use crate::engine::scan::Stamp;

    fn scan(points: Vec<[f64; 3]>) -> Scan {
        Scan {
            stamp: Stamp::from_nanos(0),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F64(points),
        }
    }

    #[test]
    fn a_point_left_of_the_origin_lies_in_voxel_minus_one() {
        let mut grid = Grid::new(0.5, 1);
        let binned = grid.bin(&scan(vec![[-0.1, 0.5, -0.5]]), 1);
        assert_eq!(grid[binned.newly_dense[0]].key.indices(), [-1, 1, -1]);
    }

    #[test]
    fn a_voxel_is_dense_from_min_points_on_and_newly_dense_once() {
        let mut grid = Grid::new(1.0, 3);
        let inside = [0.25, 0.5, 0.75];
        assert_eq!(grid.bin(&scan(vec![inside; 2]), 1).newly_dense.len(), 0);
        assert_eq!(grid.bin(&scan(vec![inside]), 2).newly_dense.len(), 1);
        let third = grid.bin(&scan(vec![inside; 5]), 3);
        assert_eq!((third.newly_dense.len(), third.touched.len(), third.touched[0].count_before), (0, 1, 3));
        assert_eq!(grid.dense(), 1);
    }

    #[test]
    fn the_centre_is_the_mean_of_the_points_whatever_their_order() {
        let points = vec![[0.1, 0.2, 0.3], [5.5, 0.0, 0.0], [0.3, 0.4, 0.5], [0.8, 0.9, 0.1]];
        let mut reversed = points.clone();
        reversed.reverse();
        let [mut a, mut b] = [Grid::new(1.0, 1), Grid::new(1.0, 1)];
        a.bin(&scan(points), 1);
        b.bin(&scan(reversed), 1);
        let key = VoxelKey::new(0, 0, 0).unwrap();
        let centre = |grid: &Grid| grid[grid.get(key).unwrap()].centre();
        assert_eq!(centre(&a), centre(&b));
        assert!((centre(&a).metres(1.0) - Point3::new(0.4, 0.5, 0.3)).norm() < 1e-8);
    }

    #[test]
    fn points_beyond_the_reach_are_counted_and_nothing_else_is_lost() {
        let mut grid = Grid::new(0.08, 1);
        let far = [[1e9, 0.0, 0.0], [1e30, 0.0, 0.0], [-1e300, 0.0, 1e300], [0.0, -9e4, 0.0]];
        let points = [[0.0; 3]].into_iter().chain(far).chain(far).chain([[1.0; 3]]).collect();
        let binned = grid.bin(&scan(points), 1);
        assert_eq!((binned.beyond, binned.newly_dense.len()), (8, 2));
    }

    #[test]
    fn a_full_voxel_keeps_its_count_and_centre() {
        let mut grid = Grid::new(1.0, 1);
        let voxel = grid.bin(&scan(vec![[0.25; 3]]), 1).newly_dense[0];
        grid.voxels[0].count = MAX_POINTS;
        grid.voxels[0].sum = [u64::from(MAX_POINTS) << 30; 3];
        grid.bin(&scan(vec![[0.75; 3]; 100]), 2);
        assert_eq!(grid[voxel].count, MAX_POINTS);
        assert!((grid[voxel].centre().metres(1.0) - Point3::new(0.25, 0.25, 0.25)).norm() < 1e-9);
    }
}
