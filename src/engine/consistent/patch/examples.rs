//! Patches of known surfaces, for tests.

use super::super::block::{Cell, Voxel};
use super::super::sums::ScanSums;
use super::*;
use crate::engine::params::Params;

/// Rows of eight voxels along x, each with points on the surface z = `height`(y) that is seen from above.
pub(in super::super) fn rows(rows: std::ops::Range<i32>, height: impl Fn(f64) -> f64) -> Patch {
    rows_from(1.0, rows, height)
}

/// The same with the noise of a sensor at this distance (m).
pub(in super::super) fn rows_from(
    distance: f64,
    rows: std::ops::Range<i32>,
    height: impl Fn(f64) -> f64,
) -> Patch {
    rows_of(Kind::Flat, distance, rows, height)
}

/// The same as a patch of this kind.
pub(in super::super) fn rows_of(
    kind: Kind,
    distance: f64,
    rows: std::ops::Range<i32>,
    height: impl Fn(f64) -> f64,
) -> Patch {
    let (states, rules) = (states(distance, &Vector3::z(), rows, height), Rules::new(&Params::default()));
    let states: Vec<_> = states.iter().collect();
    Patch::new(&states, &Vector3::zeros(), kind, &rules).unwrap()
}

/// The voxels of such rows, seen from this direction.
pub(in super::super) fn states(
    distance: f64,
    towards: &Vector3<f64>,
    rows: std::ops::Range<i32>,
    height: impl Fn(f64) -> f64,
) -> Vec<State> {
    let noise = Params::default().noise_model();
    let mut states = Vec::new();
    for (x, y) in rows.flat_map(|y| (0..8).map(move |x| (x, y))) {
        let middle = f64::from(y) + 0.5;
        let z = height(middle).floor();
        let mut scan = ScanSums::default();
        for (a, b) in (0..64_u64).flat_map(|a| (0..64_u64).map(move |b| (a, b))) {
            let up = height(f64::from(y) + (b as f64 + 0.5) / 64.0) - z;
            scan.add([a * 64 + 32, b * 64 + 32, (up.clamp(0.0, 0.999) * 4096.0) as u64]);
        }
        let mut voxel = Voxel::new(Cell::at([x, y, z as i32]));
        voxel.count = scan.count;
        voxel.moments.fold(&scan, noise.weight(distance), towards);
        states.push(State::new(&voxel));
    }
    states
}
