//! Step 1: the points of a scan into their voxels (section III.B).
//!
//! Points are summed while they stay in one voxel, and looked up then; what a voxel received is folded into its sums at the
//! end, with one weight, so that the order of points does not matter.

use nalgebra::{Isometry3, Point3, Vector3};

use super::block::{BlockIndex, Cell, NO_VOXEL, UNTOUCHED, Voxel, place};
use super::grid::Grid;
use super::published::Published;
use super::sums::{ScanSums, Sums};
use super::view::Clearance;
use crate::engine::binning::{BATCH, Fixed, UNITS};
use crate::engine::key::VoxelKey;
use crate::engine::params::MAX_POINTS;
use crate::engine::scan::{Points, Scan};

/// A voxel that received points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touched {
    pub(super) block: BlockIndex,
    pub(super) cell: Cell,
    /// It became dense by them.
    pub(super) newly_dense: bool,
    sums: ScanSums,
}

/// What binning a scan did.
#[derive(Clone, Debug, Default)]
pub(super) struct Binned {
    /// Every voxel that received a point, once, in the order of the first points.
    pub(super) touched: Vec<Touched>,
    pub(super) newly_dense: u32,
    /// Points beyond the grid's reach.
    pub(super) beyond: u32,
}

/// Consecutive points of one voxel, summed before they are looked up.
struct Run {
    /// Place of one of them, in units.
    at: [i64; 3],
    /// `None` beyond the grid's reach.
    key: Option<VoxelKey>,
    sums: ScanSums,
}

impl Run {
    fn begin(at: [i64; 3]) -> Self {
        let [ix, iy, iz] = at.map(|units| (units >> UNITS.ilog2()) as i32);
        Self { at, key: VoxelKey::new(ix, iy, iz), sums: ScanSums::default() }
    }

    /// Whether a point lies in the same voxel: it differs in the bits of the offset alone.
    const fn holds(&self, [x, y, z]: [i64; 3]) -> bool {
        let [own_x, own_y, own_z] = self.at;
        ((x ^ own_x) | (y ^ own_y) | (z ^ own_z)) & !(UNITS - 1) == 0
    }
}

impl Grid {
    /// Puts the points of a scan into their voxels; `sequence` is the number of the scan.
    pub(super) fn bin(&mut self, scan: &Scan, sequence: u64, binned: &mut Binned) {
        binned.touched.clear();
        (binned.newly_dense, binned.beyond) = (0, 0);
        match &scan.points {
            Points::F32(points) => self.bin_points(points, &scan.fixed_from_sensor, binned),
            Points::F64(points) => self.bin_points(points, &scan.fixed_from_sensor, binned),
        }
        self.number_new(binned);
        for touched in &mut binned.touched {
            self.fold(touched, &scan.fixed_from_sensor, sequence);
            binned.newly_dense += u32::from(touched.newly_dense);
        }
        self.dense += binned.newly_dense;
    }

    fn bin_points<T: Copy + Into<f64>>(
        &mut self,
        points: &[[T; 3]],
        fixed_from_sensor: &Isometry3<f64>,
        binned: &mut Binned,
    ) {
        let rotation = fixed_from_sensor.rotation.to_rotation_matrix().into_inner();
        let translation = fixed_from_sensor.translation.vector;
        let mut fixed = Fixed::new(rotation, translation, self.voxel_size);
        let mut run = Run::begin([0; 3]);
        for batch in points.chunks(BATCH) {
            for at in fixed.place(batch) {
                if !run.holds(at) {
                    self.flush(&run, binned);
                    run = Run::begin(at);
                }
                if run.key.is_none() {
                    binned.beyond += 1;
                    continue;
                }
                run.sums.add(at.map(|units| (units & (UNITS - 1)) as u64));
            }
        }
        self.flush(&run, binned);
    }

    fn flush(&mut self, run: &Run, binned: &mut Binned) {
        let Some(key) = run.key.filter(|_| run.sums.count > 0) else { return };
        let (block_key, cell) = place(key);
        let block = self.block_at(block_key);
        let here = &mut self.blocks[block.0 as usize];
        let place = here.places[cell.index()];
        if place == NO_VOXEL {
            here.places[cell.index()] = here.voxels.len() as u16;
            here.voxels.push(Voxel {
                cell,
                count: 0,
                sums: Sums::default(),
                published: Published::default(),
                touched: UNTOUCHED,
                hit: 0,
                clearance: Clearance::default(),
            });
            self.voxels += 1;
        }
        let voxel = &mut here.voxels[usize::from(here.places[cell.index()])];
        if voxel.touched == UNTOUCHED {
            voxel.touched = binned.touched.len() as u32;
            let sums = ScanSums::default();
            binned.touched.push(Touched { block, cell, newly_dense: false, sums });
        }
        binned.touched[voxel.touched as usize].sums.merge(&run.sums);
    }

    /// Adds what a scan put into a voxel to what it had.
    fn fold(&mut self, touched: &mut Touched, fixed_from_sensor: &Isometry3<f64>, sequence: u64) {
        let block = &mut self.blocks[touched.block.0 as usize];
        let corner = Vector3::from(block.corner()) + Vector3::from(touched.cell.coordinates());
        let place = usize::from(block.places[touched.cell.index()]);
        let voxel = &mut block.voxels[place];
        let mean = (corner.map(f64::from) + touched.sums.mean()) * self.voxel_size;
        let in_sensor = fixed_from_sensor.inverse_transform_point(&Point3::from(mean));
        // The depth axis of a depth camera is the dominant one of every ray it has, whichever way its frame is turned.
        let weight = self.noise.weight(in_sensor.coords.amax());
        let towards = (fixed_from_sensor.translation.vector - mean).try_normalize(0.0);
        voxel.sums.fold(&touched.sums, weight, &towards.unwrap_or_default());
        let was_dense = voxel.count >= self.min_points;
        voxel.count = voxel.count.saturating_add(touched.sums.count).min(MAX_POINTS);
        voxel.touched = UNTOUCHED;
        voxel.hit = sequence;
        if touched.sums.count >= self.proof {
            voxel.clearance.received_points();
        } else {
            voxel.clearance.received_strays();
        }
        let is_dense = voxel.count >= self.min_points;
        touched.newly_dense = is_dense && !was_dense;
        let doubled = is_dense && voxel.published.is_doubled(&voxel.sums);
        let known = voxel.published.is_known();
        let drifts = known && doubled && voxel.published.has_begun_to_drift(&voxel.sums);
        block.note_seen(sequence);
        block.changed |= doubled;
        block.drifted += u32::from(drifts);
        block.dense += u32::from(touched.newly_dense);
        if is_dense {
            block.points += touched.sums.count;
            block.unknown += if known { 0 } else { touched.sums.count };
        }
    }
}
