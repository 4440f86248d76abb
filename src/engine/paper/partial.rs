//! Step 2 (section IV.A): partial clusters, grown over the voxels that have a normal since this scan.

use std::collections::VecDeque;

use nalgebra::{UnitVector3, Vector3};

use super::grid::{Grid, Label, VoxelIndex};
use super::moments::Moments;
use crate::engine::params::Params;
use crate::engine::plane::{PlaneFit, turned};

/// A set of connected voxels of similar orientation, seen in one scan.
#[derive(Clone, Debug)]
pub(crate) struct Partial {
    /// In the order in which they were reached, the seed first.
    pub(crate) members: Vec<VoxelIndex>,
    pub(crate) moments: Moments,
    /// The fit over the members' centres, turned to the mean of their normals; that mean where the fit is degenerate
    /// (reading R7b).
    pub(crate) normal: UnitVector3<f64>,
}

/// Partial clusters of the voxels labelled [`Label::Fresh`], in the order of their seeds; `seeds` are these voxels by
/// ascending key. Afterwards each is labelled [`Label::Partial`].
pub(crate) fn extract(grid: &mut Grid, seeds: &[VoxelIndex], params: &Params) -> Vec<Partial> {
    let mut partials = Vec::new();
    for &seed in seeds {
        if grid[seed].label == Label::Fresh {
            partials.extend(grow(grid, seed, partials.len() as u32, params));
        }
    }
    partials
}

/// Grows breadth first from `seed`; a voxel refused by one member may be tried again from a later one (reading R7).
fn grow(grid: &mut Grid, seed: VoxelIndex, number: u32, params: &Params) -> Option<Partial> {
    let mut normal_sum = grid[seed].surface?.normal.into_inner();
    let mut members = vec![seed];
    let mut queue = VecDeque::from([seed]);
    grid[seed].label = Label::Partial(number);
    while let Some(member) = queue.pop_front() {
        for voxel in grid.dense_neighbours(member).into_iter().flatten() {
            if grid[voxel].label != Label::Fresh {
                continue;
            }
            let Some(surface) = grid[voxel].surface else { continue };
            if params.similar(&normal_sum, &surface.normal) {
                // Definition 6: the sum over the number of members is the paper's running mean.
                normal_sum += turned(surface.normal, &normal_sum).into_inner();
                grid[voxel].label = Label::Partial(number);
                members.push(voxel);
                queue.push_back(voxel);
            }
        }
    }
    Some(finish(grid, members, &normal_sum))
}

fn finish(grid: &Grid, members: Vec<VoxelIndex>, normal_sum: &Vector3<f64>) -> Partial {
    let mut moments = Moments::default();
    members.iter().for_each(|&voxel| moments.add(grid[voxel].centre()));
    let normal = PlaneFit::new(moments.count(), &moments.covariance())
        .map_or_else(|| UnitVector3::new_normalize(*normal_sum), |plane| turned(plane.normal, normal_sum));
    Partial { members, moments, normal }
}
