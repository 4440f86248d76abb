//! Step 1: the points of a scan into their voxels (section III.B).
//!
//! What a voxel received (`received`) is folded into its sums at the end, with one weight, so that the order of points does
//! not matter. Voxels come block by block, so a block is looked up once.

mod received;
mod recent;
mod region;
mod tile;

use nalgebra::{Isometry3, Matrix3, Vector3};

use self::received::Received;
use super::Grid;
use crate::engine::consistent::block::{Block, BlockIndex, Cell};
use crate::engine::consistent::noise::NoiseModel;
use crate::engine::consistent::publish::news::Folded;
use crate::engine::consistent::sums::ScanSums;
use crate::engine::params::MAX_POINTS;
use crate::engine::scan::Scan;

/// What binning a scan did.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Binned {
    /// The blocks that received points, ascending.
    pub(in super::super) seen: Vec<BlockIndex>,
    /// The voxels that became dense, in the order of their blocks' keys and of their cells.
    pub(in super::super) dense: Vec<(BlockIndex, Cell)>,
    /// Points beyond the grid's reach.
    pub(in super::super) beyond: u32,
    received: Received,
}

impl Grid {
    /// Puts the points of a scan into their voxels; `sequence` is the number of the scan.
    pub(in super::super) fn bin(&mut self, scan: &Scan, sequence: u64, binned: &mut Binned) {
        binned.seen.clear();
        binned.dense.clear();
        binned.beyond = binned.received.take(scan, self.voxel_size());
        let folding = Folding {
            weighing: Weighing::new(&scan.fixed_from_sensor),
            voxel_size: self.voxel_size(),
            min_points: self.blocks.min_points,
            proof: self.proof,
            noise: self.noise,
            sequence,
        };
        for (block_key, voxels) in binned.received.in_order() {
            let slot = self.block_at(block_key);
            self.wake(slot);
            binned.seen.push(slot);
            let block = &mut self.blocks.list[slot];
            block.news.note_seen(sequence);
            let mut from = 0;
            for (cell, sums) in voxels {
                let (rank, is_new) = block.rank_or_insert(from, cell);
                from = rank;
                self.voxels += usize::from(is_new);
                if folding.fold(block, rank, sums) {
                    binned.dense.push((slot, cell));
                }
            }
        }
        binned.seen.sort_unstable();
        self.blocks.dense += binned.dense.len() as u32;
    }
}

/// What a voxel needs to know to take in what a scan put into it.
struct Folding {
    weighing: Weighing,
    voxel_size: f64,
    min_points: u32,
    proof: u32,
    noise: NoiseModel,
    sequence: u64,
}

impl Folding {
    /// Adds what a scan put into a voxel to what it had; whether it became dense by it.
    fn fold(&self, block: &mut Block, rank: usize, scan: &ScanSums) -> bool {
        let low = block.low();
        let voxel = block.at(rank);
        let mean = (low + voxel.cell.corner() + scan.mean()) * self.voxel_size;
        let (depth, towards) = self.weighing.of(&mean);
        let halvings = voxel.moments.fold(scan, self.noise.weight(depth), &towards);
        voxel.baseline.note_halved(halvings);
        let was_dense = voxel.count >= self.min_points;
        voxel.count = voxel.count.saturating_add(scan.count).min(MAX_POINTS);
        voxel.hit = self.sequence as u32;
        if scan.count >= self.proof {
            voxel.clearance.note_points();
        } else {
            voxel.clearance.note_strays();
        }
        let is_dense = voxel.count >= self.min_points;
        let newly_dense = is_dense && !was_dense;
        let folded = is_dense.then(|| {
            let has_doubled = voxel.baseline.is_doubled(&voxel.moments);
            let is_known = voxel.baseline.is_known();
            let drifts = is_known && has_doubled && voxel.baseline.note_drift(&voxel.moments);
            Folded { points: scan.count, is_known, has_doubled, drifts }
        });
        block.dense += u32::from(newly_dense);
        folded.into_iter().for_each(|folded| block.news.note_folded(folded));
        newly_dense
    }
}

/// How a scan looks at a place.
struct Weighing {
    sensor_from_fixed: Matrix3<f64>,
    sensor: Vector3<f64>,
}

impl Weighing {
    fn new(fixed_from_sensor: &Isometry3<f64>) -> Self {
        let rotation = fixed_from_sensor.rotation.to_rotation_matrix();
        Self {
            sensor_from_fixed: rotation.matrix().transpose(),
            sensor: fixed_from_sensor.translation.vector,
        }
    }

    /// The depth of a place and the direction from there to the sensor.
    fn of(&self, place: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let to_sensor = self.sensor - place;
        // The depth axis of a depth camera is the dominant one of every ray it has, whichever way its frame is turned.
        let depth = (self.sensor_from_fixed * to_sensor).amax();
        (depth, to_sensor.try_normalize(0.0).unwrap_or_default())
    }
}
