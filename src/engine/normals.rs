//! The second half of step 1: normals of the newly dense voxels (Definition 3), and of those that had none.

use nalgebra::{Matrix3, Point3, Vector3};

use super::grid::{Grid, Label, Surface, VoxelIndex};
use super::neighbourhood::Neighbourhood;
use super::plane::{PlaneFit, turned};

/// Gives normals to the newly dense voxels and, where they are within `depth` steps of one, to dense voxels that had
/// none so far (reading R4); returns those that have a normal now, by ascending key, labelled [`Label::Fresh`].
///
/// Normals face `sensor`, the origin of this scan's sensor frame (reading R6).
pub(crate) fn update(
    grid: &mut Grid,
    newly_dense: &[VoxelIndex],
    depth: u8,
    sensor: &Point3<f64>,
    search: &mut Neighbourhood,
) -> Vec<VoxelIndex> {
    let candidates = with_bare_neighbours(grid, newly_dense, depth, search);
    let mut fresh = Vec::new();
    for &voxel in &candidates {
        let Some(surface) = fit(grid, voxel, depth, sensor, search) else { continue };
        grid[voxel].surface = Some(surface);
        grid[voxel].label = Label::Fresh;
        fresh.push(voxel);
    }
    fresh
}

/// The newly dense voxels and the voxels without a normal in their neighbourhoods, by ascending key.
fn with_bare_neighbours(
    grid: &Grid,
    newly_dense: &[VoxelIndex],
    depth: u8,
    search: &mut Neighbourhood,
) -> Vec<VoxelIndex> {
    let mut candidates = Vec::with_capacity(newly_dense.len());
    for &voxel in newly_dense {
        let around = search.of(grid, voxel, depth).iter().map(|&(voxel, _)| voxel);
        candidates.extend(around.filter(|&voxel| grid[voxel].surface.is_none()));
    }
    candidates.sort_unstable();
    candidates.dedup();
    grid.sort_by_key(&mut candidates);
    candidates
}

/// The plane through the centres of a voxel's neighbourhood, turned towards the sensor.
fn fit(
    grid: &Grid,
    voxel: VoxelIndex,
    depth: u8,
    sensor: &Point3<f64>,
    search: &mut Neighbourhood,
) -> Option<Surface> {
    let origin = grid[voxel].key;
    let (mut sum, mut outer) = (Vector3::zeros(), Matrix3::zeros());
    let around = search.of(grid, voxel, depth);
    for &(neighbour, _) in around {
        let offset = grid[neighbour].centre().offset_from(origin);
        sum += offset;
        outer += offset * offset.transpose();
    }
    let n = around.len() as f64;
    let mean = sum / n;
    let plane = PlaneFit::new(around.len() as u32, &(outer / n - mean * mean.transpose()))?;
    let towards_sensor = sensor - grid[voxel].centre().metres(grid.voxel_size());
    Some(Surface { normal: turned(plane.normal, &towards_sensor), curvature: plane.curvature as f32 })
}
