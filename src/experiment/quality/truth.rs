//! The voxels of labelled scans, each with how many of its points belong to which surface.
//!
//! Bins by the arithmetic of mode `paper` (key = floor((R x + t) / size) in `f64`), so that the dense voxels are the same; those of
//! `consistent` are too but for points within a hair of their borders and for what was cleared. Costs
//! O(points) a scan; consecutive points of one voxel and surface are added up before the voxel is looked for.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Point3, Vector3};
use rustc_hash::FxHashMap;

use super::pieces::Truth;
use super::touching::Groups;
use crate::cloud::CloudFilter;
use crate::engine::binning::{floor, map};
use crate::engine::{Params, Points, Scan, VoxelKey};
use crate::sim::noise::axial_sigma;
use crate::sim::{PoseSpread, Scene, Surface};

/// Depths along the optical axis that count (m).
pub(super) const RANGE: RangeInclusive<f64> = CloudFilter::DEFAULT.min_range..=CloudFilter::DEFAULT.max_range;

/// Counts the points of labelled scans by voxel and surface.
#[derive(Clone, Debug)]
pub(super) struct TruthMap {
    pub(super) voxel_size: f64,
    pub(super) min_points: u32,
    pub(super) surfaces: Vec<Surface>,
    pub(super) groups: Groups,
    /// How far the told poses put points from where they are.
    spread: Option<PoseSpread>,
    index: FxHashMap<VoxelKey, u32>,
    voxels: Vec<TruthVoxel>,
}

/// The seen part of a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SeenPart {
    /// Middles of its 2 cm cells, in the fixed frame.
    pub(super) cells: Vec<Point3<f64>>,
    /// Area of them all (m^2); cells at an edge count for what lies on the surface.
    pub(super) area: f64,
}

/// What is known of a voxel.
#[derive(Clone, Debug)]
pub(super) struct TruthVoxel {
    pub(super) key: VoxelKey,
    /// Points by group of surfaces; `None` = on no surface. A handful, in the order they came.
    pub(super) counts: Vec<(Option<u32>, u32)>,
    /// Sum of the points (m).
    sum: Vector3<f64>,
    /// Sum of the variances of their depths, and of the places that wrong poses give them (m^2).
    variances: f64,
}

impl TruthVoxel {
    /// Number of points.
    pub(super) fn count(&self) -> u32 {
        self.counts.iter().map(|(_, count)| count).sum()
    }

    /// The group with the most points and how many they are; the lower group where two have as many, and `None` where
    /// most are on no surface.
    pub(super) fn majority(&self) -> Option<(u32, u32)> {
        let most = self.counts.iter().max_by_key(|(group, count)| (*count, std::cmp::Reverse(*group)))?;
        most.0.map(|group| (group, most.1))
    }

    pub(super) fn mean(&self) -> Point3<f64> {
        Point3::from(self.sum / f64::from(self.count()))
    }

    /// Root mean square of the points' sigma (m).
    pub(super) fn sigma(&self) -> f64 {
        (self.variances / f64::from(self.count())).sqrt()
    }
}

/// Consecutive points of one voxel and group.
struct Run {
    index: [i32; 3],
    group: Option<u32>,
    count: u32,
    sum: Vector3<f64>,
    variances: f64,
}

impl Run {
    const fn begin(index: [i32; 3], group: Option<u32>) -> Self {
        Self { index, group, count: 0, sum: Vector3::new(0.0, 0.0, 0.0), variances: 0.0 }
    }
}

impl TruthMap {
    /// An empty map of a scene, with voxels as the engine of these parameters has them. Of a surface that moves nothing is asked: the
    /// truth forgets no point, and a map is to forget those of where it was.
    pub(super) fn new(scene: &Scene, params: &Params) -> Self {
        Self {
            voxel_size: params.voxel_size(),
            min_points: params.min_points(),
            groups: Groups::new(scene.surfaces(), params.voxel_size()),
            surfaces: scene.surfaces().to_vec(),
            spread: None,
            index: FxHashMap::default(),
            voxels: Vec::new(),
        }
    }

    /// The same, for scans whose poses are told wrong by so much.
    pub(super) fn with_pose_spread(self, spread: Option<PoseSpread>) -> Self {
        Self { spread, ..self }
    }

    /// How far the sigma of wrong poses puts a point straight ahead at the end of the range from where it is (m).
    pub(super) fn spread_ahead(&self) -> f64 {
        self.spread.map_or(0.0, |spread| spread.variance(&Point3::new(0.0, 0.0, *RANGE.end())).sqrt())
    }

    /// Takes in a scan in the optical frame and the label of each of its points, 0 = on no surface. Points whose depth is
    /// out of range, or that lie beyond the grid, count nowhere.
    ///
    /// # Panics
    /// When there are not as many labels as points.
    pub(super) fn insert(&mut self, scan: &Scan, labels: &[u32]) {
        assert_eq!(scan.points.len(), labels.len(), "a label for each point");
        match &scan.points {
            Points::F32(points) | Points::Ended { points, .. } => self.bin(points, scan, labels),
            Points::F64(points) => self.bin(points, scan, labels),
            Points::Depths(depths) => self.bin(&depths.list(), scan, labels),
        }
    }

    fn bin<T: Copy + Into<f64>>(&mut self, points: &[[T; 3]], scan: &Scan, labels: &[u32]) {
        let rotation: Matrix3<f64> = scan.fixed_from_sensor.rotation.to_rotation_matrix().into_inner();
        let translation = scan.fixed_from_sensor.translation.vector;
        let mut run = Run::begin([0; 3], None);
        for (point, &label) in points.iter().zip(labels) {
            let sensed = point.map(Into::into);
            if !RANGE.contains(&sensed[2]) {
                continue;
            }
            let point = map(&rotation, &translation, sensed);
            let index = voxel_index(&point, self.voxel_size);
            let group = self.groups.of_label(label);
            if index != run.index || group != run.group {
                self.flush(&run);
                run = Run::begin(index, group);
            }
            run.count += 1;
            run.sum += point.coords;
            run.variances += axial_sigma(sensed[2]).powi(2);
            if let Some(spread) = &self.spread {
                run.variances += spread.variance(&Point3::from(sensed));
            }
        }
        self.flush(&run);
    }

    fn flush(&mut self, run: &Run) {
        let [ix, iy, iz] = run.index;
        let Some(key) = VoxelKey::new(ix, iy, iz).filter(|_| run.count > 0) else { return };
        let next = self.voxels.len() as u32;
        let found = *self.index.entry(key).or_insert(next);
        if found == next {
            let (counts, sum) = (Vec::new(), Vector3::zeros());
            self.voxels.push(TruthVoxel { key, counts, sum, variances: 0.0 });
        }
        let voxel = &mut self.voxels[found as usize];
        match voxel.counts.iter_mut().find(|(group, _)| *group == run.group) {
            Some((_, count)) => *count += run.count,
            None => voxel.counts.push((run.group, run.count)),
        }
        voxel.sum += run.sum;
        voxel.variances += run.variances;
    }

    /// Whether none of the surfaces of a group moves.
    pub(super) fn stays(&self, group: u32) -> bool {
        self.groups.members(group).all(|index| self.surfaces[index].motion().is_none())
    }

    /// The dense voxels by ascending key.
    pub(super) fn dense(&self) -> Vec<&TruthVoxel> {
        let mut dense: Vec<_> = self.voxels.iter().filter(|voxel| voxel.count() >= self.min_points).collect();
        dense.sort_by_key(|voxel| voxel.key);
        dense
    }

    /// The true surfaces as they are now. `seen` tells what a noise-free ray has hit of the surface with a label.
    pub(super) fn truth(&self, seen: impl Fn(u32) -> SeenPart) -> Truth {
        Truth::new(self, seen)
    }
}

/// Indices of the voxel that holds a point; far outside the grid they saturate there.
pub(super) fn voxel_index(point: &Point3<f64>, voxel_size: f64) -> [i32; 3] {
    let scaled: [f64; 3] = (point / voxel_size).into();
    scaled.map(floor)
}
