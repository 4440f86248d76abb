//! STATIC, the paper's baseline: after a scan, all normals anew and partial extraction over all dense voxels
//! (reading R11). Its cost follows the size of the map.

use nalgebra::{Point3, UnitVector3};

use super::grid::{Grid, Label, VoxelIndex};
use super::neighbourhood::Neighbourhood;
use super::{normals, partial};
use crate::engine::key::{Partition, VoxelKey};
use crate::engine::params::Params;
use crate::engine::scan::Scan;
use crate::engine::step::PipelineStep;

/// What STATIC makes of a map.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StaticMap {
    /// The dense voxels by ascending key.
    pub voxels: Vec<StaticVoxel>,
    /// The normals of the clusters (Definition 5), by number.
    pub cluster_normals: Vec<UnitVector3<f64>>,
}

/// A dense voxel as STATIC sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticVoxel {
    /// Its index.
    pub key: VoxelKey,
    /// Its normal (Definition 3), `None` where its neighbourhood spans no plane.
    pub normal: Option<UnitVector3<f64>>,
    /// The number of its cluster, from 0; `None` = in no cluster. It names the cluster in this map only.
    pub cluster: Option<u32>,
}

impl StaticMap {
    /// The clusters without their normals.
    pub fn partition(&self) -> Partition {
        self.voxels.iter().map(|voxel| (voxel.key, voxel.cluster)).collect()
    }
}

/// STATIC as a method of its own: one scan in, everything clustered anew.
#[derive(Clone, Debug)]
pub struct Static {
    params: Params,
    grid: Grid,
    search: Neighbourhood,
    /// Number of scans taken in.
    sequence: u64,
    cluster_normals: Vec<UnitVector3<f64>>,
    /// Where the sensor stood last.
    sensor: Point3<f64>,
}

impl Static {
    /// STATIC with an empty map.
    pub fn new(params: Params) -> Self {
        Self {
            grid: Grid::new(params.voxel_size(), params.min_points()),
            search: Neighbourhood::default(),
            sequence: 0,
            cluster_normals: Vec::new(),
            sensor: Point3::origin(),
            params,
        }
    }

    /// Bins a scan and clusters all dense voxels anew. Costs O(map).
    pub fn insert(&mut self, scan: &Scan) {
        self.insert_observed(scan, |_| {});
    }

    /// Takes in a scan like [`Self::insert`]; `done` is called at the end of each step, for those who have a clock. There is no step
    /// [`PipelineStep::Globals`].
    pub fn insert_observed(&mut self, scan: &Scan, mut done: impl FnMut(PipelineStep)) {
        self.sequence += 1;
        if scan.is_placed() {
            self.sensor = scan.sensor_origin();
        }
        self.grid.bin(scan, self.sequence);
        done(PipelineStep::Binned);
        let Self { grid, params, search, sensor, .. } = self;
        self.cluster_normals = cluster(grid, params, sensor, search, done);
    }

    /// The whole map as it is now.
    pub fn map(&self) -> StaticMap {
        listed(&self.grid, &self.grid.dense_voxels(), self.cluster_normals.clone())
    }
}

/// What STATIC would make of another method's grid.
pub(crate) fn map(grid: &Grid, params: &Params, sensor: &Point3<f64>) -> StaticMap {
    let mut grid = grid.clone();
    let normals = cluster(&mut grid, params, sensor, &mut Neighbourhood::default(), |_| {});
    listed(&grid, &grid.dense_voxels(), normals)
}

/// Clusters all dense voxels anew and returns the clusters' normals by number.
fn cluster(
    grid: &mut Grid,
    params: &Params,
    sensor: &Point3<f64>,
    search: &mut Neighbourhood,
    mut done: impl FnMut(PipelineStep),
) -> Vec<UnitVector3<f64>> {
    let dense = grid.dense_voxels();
    let seeds = normals::renew(grid, &dense, params.depth(), sensor, search);
    done(PipelineStep::Normals);
    let partials = partial::extract(grid, &seeds, params);
    done(PipelineStep::Partials);
    partials.iter().map(|partial| partial.normal).collect()
}

fn listed(grid: &Grid, dense: &[VoxelIndex], cluster_normals: Vec<UnitVector3<f64>>) -> StaticMap {
    let number = |label| if let Label::Partial(number) = label { Some(number) } else { None };
    let voxels = dense.iter().map(|&voxel| &grid[voxel]).map(|voxel| StaticVoxel {
        key: voxel.key,
        normal: voxel.surface.map(|surface| surface.normal),
        cluster: number(voxel.label),
    });
    StaticMap { voxels: voxels.collect(), cluster_normals }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::engine::paper::Cfodi;
    use crate::engine::points::Points;
    use crate::engine::scan::Stamp;

    /// A floor below the sensor, and from the second scan on a wall beside it; a point in each voxel of 10 cm.
    fn scan(number: u8) -> Scan {
        let cells = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20)]);
        let floor =
            cells.clone().map(|[x, y]| [0.1 * x - 0.95, 0.1 * y - 0.95, -0.95 + 0.002 * (x * y).sin()]);
        let wall = cells.map(|[y, z]| [1.05 + 0.002 * (y * z).cos(), 0.1 * y - 0.95, 0.1 * z - 0.95]);
        let points = if number == 0 { floor.collect() } else { floor.chain(wall).collect() };
        Scan {
            stamp: Stamp::from_nanos(i64::from(number)),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F64(points),
        }
    }

    #[test]
    fn reading_r11_static_of_every_scan_is_static_of_the_engines_map() {
        let params = Params::paper().with_voxel_size(0.1).unwrap().with_min_points(1).unwrap();
        let (mut statics, mut engine) = (Static::new(params), Cfodi::new(params));
        // The last one lies nowhere.
        let nowhere = Scan { fixed_from_sensor: Isometry3::translation(f64::NAN, 0.0, 0.0), ..scan(3) };
        for scan in (0..3).map(scan).chain([nowhere]) {
            statics.insert(&scan);
            engine.insert(&scan);
            assert_eq!(statics.map(), engine.static_map());
            assert_eq!(statics.map().partition(), engine.static_partition());
        }
        let map = statics.map();
        assert_eq!(map.voxels.len(), 800);
        assert!(map.voxels.iter().all(|voxel| voxel.normal.is_some() && voxel.cluster.is_some()));
        // By ascending key the floor comes first and the top of the wall last; each normal faces the sensor.
        let normal_of = |voxel: StaticVoxel| map.cluster_normals[voxel.cluster.unwrap() as usize];
        let [floor, wall] = [map.voxels[0], map.voxels[799]].map(normal_of);
        assert!(floor.z > 0.95 && wall.x < -0.95, "{floor:?} {wall:?}");
    }

    #[test]
    fn the_steps_of_static_end_in_their_order_and_there_is_no_third() {
        let mut seen = Vec::new();
        Static::new(Params::paper()).insert_observed(&scan(0), |step| seen.push(step));
        assert_eq!(seen, [PipelineStep::Binned, PipelineStep::Normals, PipelineStep::Partials]);
    }

    #[test]
    fn static_of_nothing_is_an_empty_map() {
        let mut statics = Static::new(Params::paper());
        assert_eq!(statics.map(), StaticMap::default());
        statics.insert(&Scan { points: Points::F32(Vec::new()), ..scan(0) });
        assert_eq!(statics.map(), StaticMap::default());
    }
}
