//! CFODI itself: one scan in, what it changed out.

use nalgebra::Point3;

use super::describe::describe;
use super::globals::Globals;
use super::grid::{Binned, Grid};
use super::neighbourhood::Neighbourhood;
use super::saved::{self, SavedCfodi, SavedVoxel};
use super::{normals, partial, statics};
use crate::engine::key::Partition;
use crate::engine::now::{Now, Taken};
use crate::engine::params::Params;
use crate::engine::saved::{RestoreError, ensure};
use crate::engine::scan::Scan;
use crate::engine::snapshot::{ChangedCluster, DenseVoxel, Snapshot, Update};
use crate::engine::step::PipelineStep;

/// The map of one session: a grid of voxels and the global clusters that they form.
#[derive(Clone, Debug)]
pub struct Cfodi {
    params: Params,
    grid: Grid,
    globals: Globals,
    search: Neighbourhood,
    taken: Taken,
    /// Where the newest scan was taken from.
    sensor: Point3<f64>,
}

impl Cfodi {
    /// A map without a scan.
    pub fn new(params: Params) -> Self {
        Self {
            grid: Grid::new(params.voxel_size(), params.min_points()),
            globals: Globals::default(),
            search: Neighbourhood::default(),
            taken: Taken::default(),
            sensor: Point3::origin(),
            params,
        }
    }

    /// Takes in a scan (section IV.B): grid update, partial cluster extraction, global cluster update.
    pub fn insert(&mut self, scan: &Scan) -> Update {
        self.insert_observed(scan, |_| {})
    }

    /// Takes in a scan like [`Self::insert`]; `done` is called at the end of each step, for those who have a clock.
    pub fn insert_observed(&mut self, scan: &Scan, mut done: impl FnMut(PipelineStep)) -> Update {
        let now = self.taken.begin(scan.stamp);
        if scan.is_placed() {
            self.sensor = scan.sensor_origin();
        }
        self.globals.begin();
        let binned = self.grid.bin(scan, now.sequence);
        done(PipelineStep::Binned);
        self.globals.follow(&self.grid, &binned.touched, now);
        let depth = self.params.depth();
        let fresh =
            normals::update(&mut self.grid, &binned.newly_dense, depth, &self.sensor, &mut self.search);
        done(PipelineStep::Normals);
        let partials = partial::extract(&mut self.grid, &fresh, &self.params);
        done(PipelineStep::Partials);
        self.globals.update(&mut self.grid, &partials, &self.params, now);
        self.globals.refine();
        self.globals.finish(&self.params, now);
        let update = self.update(&binned, now);
        done(PipelineStep::Globals);
        update
    }

    pub(crate) const fn taken(&self) -> &Taken {
        &self.taken
    }

    pub(crate) fn save(&self) -> SavedCfodi {
        SavedCfodi {
            voxels: self.grid.voxels().iter().map(SavedVoxel::of).collect(),
            globals: self.globals.save(),
            sensor: self.sensor,
        }
    }

    /// The engine that was saved, after the scans that it had `taken` in.
    pub(crate) fn restore(params: Params, taken: Taken, map: &SavedCfodi) -> Result<Self, RestoreError> {
        ensure(map.sensor.iter().all(|c| c.is_finite()), || format!("the sensor is at {}", map.sensor))?;
        let grid = saved::grid(&map.voxels, map.globals.slots(), &params, taken.sequence)?;
        let globals = Globals::restore(&map.globals, &grid, &params, taken.now())?;
        Ok(Self { grid, globals, search: Neighbourhood::default(), taken, sensor: map.sensor, params })
    }

    /// The parameters it works with.
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Number of voxels that hold a point, dense or not.
    pub const fn voxel_count(&self) -> usize {
        self.grid.len()
    }

    /// Number of dense voxels.
    pub const fn dense_count(&self) -> usize {
        self.grid.dense() as usize
    }

    /// The whole map as it is now. Costs O(map).
    pub fn snapshot(&self) -> Snapshot {
        let now = self.taken.now();
        let clusters =
            self.globals.living().map(|global| describe(global, &self.grid, &self.params, now)).collect();
        Snapshot {
            sequence: self.taken.sequence,
            stamp: self.taken.stamp,
            voxel_size: self.params.voxel_size(),
            clusters,
            voxels: self.voxels(),
            unclustered_voxels: self.unclustered(),
        }
    }

    /// What the paper's baseline STATIC makes of the map as it is now: everything anew. Costs O(map).
    pub fn static_partition(&self) -> Partition {
        self.static_map().partition()
    }

    /// What the paper's baseline STATIC makes of the map as it is now, with the normals of voxels and clusters. Costs O(map).
    pub fn static_map(&self) -> statics::StaticMap {
        statics::map(&self.grid, &self.params, &self.sensor)
    }

    fn update(&self, binned: &Binned, now: Now) -> Update {
        let changed = self.globals.changed().map(|global| ChangedCluster {
            cluster: describe(global, &self.grid, &self.params, now),
            merged_from: global.merged_from.clone(),
        });
        Update {
            sequence: now.sequence,
            stamp: now.stamp,
            changed: changed.collect(),
            removed: self.globals.removed().to_vec(),
            newly_dense: binned.newly_dense.len() as u32,
            points_beyond_grid: binned.beyond,
            unclustered_voxels: self.unclustered(),
        }
    }

    fn voxels(&self) -> Vec<DenseVoxel> {
        let dense = self.grid.dense_voxels().into_iter().map(|voxel| &self.grid[voxel]);
        let id = self.globals.ids();
        dense
            .map(|voxel| DenseVoxel {
                key: voxel.key,
                count: voxel.count,
                centre: voxel.centre().metres(self.params.voxel_size()),
                normal: voxel.surface.map(|surface| surface.normal),
                curvature: voxel.surface.map_or(f32::NAN, |surface| surface.curvature),
                cluster: id(voxel.label),
            })
            .collect()
    }

    fn unclustered(&self) -> u32 {
        self.grid.dense() - self.globals.clustered()
    }
}
