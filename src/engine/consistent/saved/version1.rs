//! A map as it was saved while voxels kept sums: read, and never written.

use nalgebra::Vector3;
use serde::Deserialize;

use super::{SavedBlock, SavedConsistent, SavedGrid, SavedVoxel};
use crate::engine::consistent::block::Cell;
use crate::engine::consistent::published::Published;
use crate::engine::consistent::sums::{MOST_POINTS, MOST_WEIGHT, Moments, UNITS, halvings};
use crate::engine::consistent::view::Clearance;
use crate::engine::symmetric::symmetric;

/// A voxel with the sums of its points.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Voxel {
    cell: Cell,
    count: u32,
    sums: Sums,
    published: Noted,
    hit: u64,
    clearance: Clearance,
}

/// Sums over points, weighed but for the directions.
#[derive(Clone, Debug, Deserialize)]
struct Sums {
    points: u64,
    weight: u64,
    /// Sums of offsets from the corner, in 1/4096 of the voxel's edge.
    sum: [u64; 3],
    /// Sums of their products: xx, xy, xz, yy, yz, zz.
    squares: [u64; 6],
    /// Sums of unit directions towards the sensor times 1024.
    towards: [i64; 3],
}

/// What was noted of a voxel when it was published.
#[derive(Clone, Debug, Deserialize)]
struct Noted {
    mean: [u16; 3],
    points: u64,
    weight: u64,
    looked_at: u64,
    drifted: bool,
}

/// In a file whole numbers have no width: these may not have been halved yet.
impl From<&Sums> for Moments {
    fn from(sums: &Sums) -> Self {
        let (weight, points) = (sums.weight as f64, sums.points as f64);
        let mean = Vector3::from(sums.sum.map(|sum| sum as f64)) / (weight * UNITS);
        let products = sums.squares.map(|square| square as f64 / (weight * UNITS * UNITS));
        let covariance = symmetric(products) - mean * mean.transpose();
        let towards = Vector3::from(sums.towards.map(|sum| sum as f64 / (points * 1024.0)));
        let halvings = halvings(sums.weight, MOST_WEIGHT).max(halvings(sums.points, MOST_POINTS));
        let [points, weight] = [sums.points, sums.weight].map(|number| (number >> halvings) as u32);
        Self::new(points, weight, mean, &covariance, towards)
    }
}

/// Weights may not have been halved yet.
impl From<&Noted> for Published {
    fn from(noted: &Noted) -> Self {
        let Noted { mean, points, weight, looked_at, drifted } = *noted;
        let beyond = (weight | looked_at).max(1).ilog2().saturating_sub(u32::BITS - 1);
        let noise = if weight > 0 { points as f32 / weight as f32 } else { 0.0 };
        Self::new(mean, drifted, noise, (looked_at >> beyond) as u32)
    }
}

impl From<Voxel> for SavedVoxel {
    fn from(voxel: Voxel) -> Self {
        let Voxel { cell, count, sums, published, hit, clearance } = voxel;
        let (moments, published) = (Moments::from(&sums), Published::from(&published));
        Self { cell, count, moments, published, hit, clearance }
    }
}

impl From<SavedConsistent<Voxel>> for SavedConsistent {
    fn from(map: SavedConsistent<Voxel>) -> Self {
        let SavedConsistent { grid: SavedGrid { blocks, free }, surfaces, standpoint, next } = map;
        let blocks = blocks.into_iter().map(|(slot, block)| (slot, block.into())).collect();
        Self { grid: SavedGrid { blocks, free }, surfaces, standpoint, next }
    }
}

impl From<SavedBlock<Voxel>> for SavedBlock {
    fn from(block: SavedBlock<Voxel>) -> Self {
        Self {
            key: block.key,
            voxels: block.voxels.into_iter().map(SavedVoxel::from).collect(),
            changed: block.changed,
            drifted: block.drifted,
            points: block.points,
            unknown: block.unknown,
            published: block.published,
            begun: block.begun,
            seen: block.seen,
            states: block.states,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;

    #[test]
    fn sums_that_were_saved_wider_are_halved_and_have_the_same_moments() {
        let unit = UNITS as u64;
        let square = unit * unit;
        let wide = Sums {
            points: 1 << 22,
            weight: 1 << 33,
            sum: [unit << 32, unit << 31, 0],
            squares: [square << 32, square << 30, 0, square << 32, 0, 0],
            towards: [-1 << 32, 0, 1 << 31],
        };
        let moments = Moments::from(&wide);
        assert_eq!((moments.points, moments.weight), (1 << 20, 1 << 31));
        assert_eq!(moments.mean(), Vector3::new(0.5, 0.25, 0.0));
        assert_eq!(moments.towards(), Vector3::new(-1.0, 0.0, 0.5));
        assert_eq!(moments.covariance(), Matrix3::new(0.25, 0.0, 0.0, 0.0, 0.4375, 0.0, 0.0, 0.0, 0.0));
    }
}
