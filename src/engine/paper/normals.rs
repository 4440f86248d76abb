//! The second half of step 1: normals of the newly dense voxels (Definition 3), and of those that had none.

use nalgebra::{Matrix3, Point3, Vector3};

use super::grid::{Grid, Label, Surface, VoxelIndex};
use super::neighbourhood::Neighbourhood;
use crate::engine::plane::{PlaneFit, turned};

/// Gives normals to the newly dense voxels (by ascending key) and, where they are within `depth` steps of one, to dense
/// voxels that had none so far (reading R4); returns those that have a normal now, by ascending key, labelled
/// [`Label::Fresh`].
///
/// Normals face `sensor`, the origin of this scan's sensor frame (reading R6). A normal depends on the dense voxels alone,
/// not on other normals, so the order in which they are given does not matter.
pub(crate) fn update(
    grid: &mut Grid,
    newly_dense: &[VoxelIndex],
    depth: u8,
    sensor: &Point3<f64>,
    search: &mut Neighbourhood,
) -> Vec<VoxelIndex> {
    let (mut fresh, mut bare) = (Vec::new(), Vec::new());
    for &voxel in newly_dense {
        let around = search.of(grid, voxel, depth);
        bare.extend(around.iter().map(|&(neighbour, _)| neighbour).filter(|&n| grid[n].surface.is_none()));
        let surface = fit(grid, voxel, around, sensor);
        fresh.extend(give(grid, voxel, surface));
    }
    bare.sort_unstable();
    bare.dedup();
    // The newly dense ones among them have just been tried.
    bare.retain(|&voxel| {
        newly_dense.binary_search_by_key(&grid[voxel].key, |&other| grid[other].key).is_err()
    });
    for voxel in bare {
        let surface = fit(grid, voxel, search.of(grid, voxel, depth), sensor);
        fresh.extend(give(grid, voxel, surface));
    }
    grid.sort_by_key(&mut fresh);
    fresh
}

/// Gives every dense voxel its normal anew, whatever it had; `dense` are all of them by ascending key. Returns as
/// [`update`] does.
pub(crate) fn renew(
    grid: &mut Grid,
    dense: &[VoxelIndex],
    depth: u8,
    sensor: &Point3<f64>,
    search: &mut Neighbourhood,
) -> Vec<VoxelIndex> {
    let mut fresh = Vec::with_capacity(dense.len());
    for &voxel in dense {
        grid[voxel].surface = None;
        grid[voxel].label = Label::None;
        let surface = fit(grid, voxel, search.of(grid, voxel, depth), sensor);
        fresh.extend(give(grid, voxel, surface));
    }
    fresh
}

fn give(grid: &mut Grid, voxel: VoxelIndex, surface: Option<Surface>) -> Option<VoxelIndex> {
    grid[voxel].surface = Some(surface?);
    grid[voxel].label = Label::Fresh;
    Some(voxel)
}

/// The plane through the centres of a voxel's neighbourhood, turned towards the sensor.
fn fit(
    grid: &Grid,
    voxel: VoxelIndex,
    around: &[(VoxelIndex, [i32; 3])],
    sensor: &Point3<f64>,
) -> Option<Surface> {
    let origin = grid[voxel].key;
    let (mut sum, mut outer) = (Vector3::zeros(), Matrix3::zeros());
    for &(neighbour, _) in around {
        let offset = grid[neighbour].offset_from(origin);
        sum += offset;
        outer += offset * offset.transpose();
    }
    let n = around.len() as f64;
    let mean = sum / n;
    let plane = PlaneFit::new(around.len() as u32, &(outer / n - mean * mean.transpose()))?;
    let towards_sensor = sensor - grid[voxel].centre().metres(grid.voxel_size());
    Some(Surface { normal: turned(plane.normal, &towards_sensor), curvature: plane.curvature as f32 })
}
