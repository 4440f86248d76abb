//! STATIC, the paper's baseline: after a scan, all normals anew and partial extraction over all dense voxels
//! (reading R11). Its cost follows the size of the map.

use nalgebra::Point3;

use super::grid::{Grid, Label};
use super::key::VoxelKey;
use super::neighbourhood::Neighbourhood;
use super::params::Params;
use super::{normals, partial};

/// The dense voxels by ascending key, each with the number of its cluster; `None` = in no cluster.
pub type Partition = Vec<(VoxelKey, Option<u32>)>;

pub(crate) fn cluster(grid: &Grid, params: &Params, sensor: &Point3<f64>) -> Partition {
    let mut grid = grid.clone();
    let dense = grid.dense_voxels();
    for &voxel in &dense {
        grid[voxel].surface = None;
        grid[voxel].label = Label::None;
    }
    let seeds = normals::update(&mut grid, &dense, params.depth(), sensor, &mut Neighbourhood::default());
    partial::extract(&mut grid, &seeds, params);
    let number = |label| if let Label::Partial(number) = label { Some(number) } else { None };
    dense.into_iter().map(|voxel| (grid[voxel].key, number(grid[voxel].label))).collect()
}
