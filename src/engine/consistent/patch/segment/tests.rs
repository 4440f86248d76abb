//! What holds of the patches of any block, and of a block with one plane in it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, UnitVector3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::engine::consistent::block::{Cell, EDGE, Voxel};
use crate::engine::consistent::sums::ScanSums;
use crate::engine::params::Params;

/// Points along the edge of a voxel.
const FINE: i32 = 6;

/// A plane near the middle of the block, by its normal and how far its points scatter along the axis that it rises least along.
#[derive(Clone, Copy, Debug)]
struct Surface {
    normal: UnitVector3<f64>,
    /// How far it lies from the middle.
    off: f64,
    scatter: f64,
}

impl Surface {
    /// Its points within the block, from the block's corner.
    fn points(&self) -> Vec<Vector3<f64>> {
        let (normal, edge) = (self.normal.into_inner(), f64::from(EDGE));
        let up = normal.iamax();
        let [a, b] = [(up + 1) % 3, (up + 2) % 3];
        let height = normal.sum() * edge / 2.0 + self.off;
        let along = |step: i32| (f64::from(step) + 0.5) / f64::from(FINE);
        let point = |(i, j): (i32, i32)| {
            let mut point = Vector3::zeros();
            (point[a], point[b]) = (along(i), along(j));
            let noise = f64::from((i * 7919 + j * 104_729) % 997) / 997.0 - 0.5;
            point[up] = (height - normal.dot(&point)) / normal[up] + self.scatter * noise;
            point
        };
        let steps = (0..EDGE * FINE).flat_map(|i| (0..EDGE * FINE).map(move |j| (i, j)));
        steps.map(point).filter(|point| (0.0..edge).contains(&point[up])).collect()
    }
}

/// What a scan puts into each voxel, by its points from the block's corner.
fn sums(points: impl IntoIterator<Item = Vector3<f64>>) -> BTreeMap<Cell, ScanSums> {
    let mut sums: BTreeMap<_, ScanSums> = BTreeMap::new();
    for point in points {
        let at = point.map(|along| along.floor() as i32);
        let offset = (point - at.map(f64::from)).map(|offset| (offset * 4096.0) as u64);
        sums.entry(Cell::at(at.into())).or_default().add(offset.into());
    }
    sums
}

fn direction() -> impl Strategy<Value = UnitVector3<f64>> {
    let part = || prop_oneof![-1.0..-0.05, 0.05..1.0_f64];
    [part(), part(), part()].prop_map(|parts| UnitVector3::new_normalize(Vector3::from(parts)))
}

fn surface(scatter: impl Strategy<Value = f64>) -> impl Strategy<Value = Surface> {
    (direction(), -3.0..3.0, scatter).prop_map(|(normal, off, scatter)| Surface { normal, off, scatter })
}

/// The voxels of surfaces that were scanned one after another, from this direction and so far away (m).
fn states(surfaces: &[Surface], towards: &Vector3<f64>, distance: f64) -> Vec<State> {
    scanned(surfaces.iter().map(|surface| sums(surface.points())), towards, distance)
}

/// The voxels that these scans fill.
fn scanned(
    scans: impl Iterator<Item = BTreeMap<Cell, ScanSums>>,
    towards: &Vector3<f64>,
    distance: f64,
) -> Vec<State> {
    let weight = Params::default().noise_model().weight(distance);
    let mut voxels: BTreeMap<Cell, Voxel> = BTreeMap::new();
    for (cell, scan) in scans.flatten() {
        let voxel = voxels.entry(cell).or_insert_with(|| Voxel::new(cell));
        voxel.count += scan.count;
        voxel.moments.fold(&scan, weight, towards);
    }
    voxels.values().map(State::new).collect()
}

/// Whether one comes from any of these voxels to all others by those of them that touch.
fn is_connected(members: &[&State]) -> bool {
    let mut left: BTreeSet<[i32; 3]> = members.iter().map(|state| state.cell().coordinates()).collect();
    let mut open: Vec<_> = left.pop_first().into_iter().collect();
    while let Some(at) = open.pop() {
        let touches = |to: &[i32; 3]| (Vector3::from(*to) - Vector3::from(at)).amax() <= 1;
        let next: Vec<_> = left.iter().copied().filter(touches).collect();
        left.retain(|to| !next.contains(to));
        open.extend(next);
    }
    left.is_empty()
}

/// Variance of the points of voxels about the plane that they lie nearest to, and most that noise gives them along any direction.
fn variances(members: &[&State], rules: &Rules) -> [f64; 2] {
    let count = members.len() as f64;
    let mean = members.iter().map(|state| state.mean()).sum::<Vector3<f64>>() / count;
    let about =
        |state: &&State| state.covariance() + (state.mean() - mean) * (state.mean() - mean).transpose();
    let square = members.iter().map(about).sum::<Matrix3<f64>>() / count;
    let noise =
        members.iter().map(|state| state.blur(&rules.noise).covariance()).sum::<Matrix3<f64>>() / count;
    [square.symmetric_eigenvalues().min(), noise.symmetric_eigenvalues().max()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Each voxel of a patch lay on one plane, within what is allowed, when it settled; so no patch scatters by more. The plane is
    /// fitted anew afterwards, and of that one a voxel may be further off.
    #[test]
    fn patches_are_connected_large_enough_and_no_thicker_than_is_allowed(
        surfaces in prop::collection::vec(surface(prop_oneof![Just(0.0), 0.0..1.5]), 1..4),
        towards in direction(), distance in 0.5..6.0,
    ) {
        let (states, rules) = (states(&surfaces, &towards, distance), Rules::new(&Params::default()));
        let Patches { owner, kinds } = segment(&states, &rules);
        prop_assert_eq!(owner.len(), states.len());
        prop_assert!(owner.iter().all(|&number| number == NO_PATCH || usize::from(number) < kinds.len()));
        for (number, kind) in (0..).zip(&kinds) {
            let own = states.iter().zip(&owner).filter(|(_, of)| **of == number);
            let members: Vec<_> = own.map(|(state, _)| state).collect();
            prop_assert!(members.len() >= MIN_VOXELS, "{} voxels in {}, {:?}", members.len(), number, kind);
            prop_assert!(is_connected(&members), "{}, {:?}", number, kind);
            let flatness = if *kind == Kind::Rough { rules.rough_flatness } else { rules.flatness };
            let [variance, noise] = variances(&members, &rules);
            let allowed = NOISE_FACTOR * NOISE_FACTOR * noise + flatness * flatness;
            prop_assert!(variance <= allowed + 1e-4, "{} of {} in {}, {:?}", variance, allowed, number, kind);
        }
    }

    #[test]
    fn one_plane_through_a_block_is_one_patch_of_all_its_voxels(surface in surface(Just(0.0))) {
        let states = states(&[surface], &surface.normal, 1.0);
        let Patches { owner, kinds } = segment(&states, &Rules::new(&Params::default()));
        prop_assert_eq!(kinds, [Kind::Flat]);
        prop_assert!(owner.iter().all(|number| *number == 0), "{:?}", owner);
    }
}

/// The voxels of a floor at this height that rises by 18 degrees from the third row along x on. Points scatter over 1.2 voxels along
/// z, as much as noise has them 3 m away.
fn foot_of_a_ramp(floor: f64) -> Vec<State> {
    let point = |(i, j, part): (i32, i32, i32)| {
        let [x, y] = [i, j].map(|step| (f64::from(step) + 0.5) / f64::from(FINE));
        let noise = 0.15 * (f64::from(part) - 3.5);
        Vector3::new(x, y, floor + 18.0_f64.to_radians().tan() * (x - 2.5).max(0.0) + noise)
    };
    let steps = (0..EDGE * FINE).flat_map(|i| (0..EDGE * FINE).map(move |j| (i, j)));
    let parts = steps.flat_map(|(i, j)| (0..8).map(move |part| (i, j, part)));
    let scan = sums(parts.map(point).filter(|point| point.z >= 0.0));
    scanned([scan].into_iter(), &Vector3::new(-0.7, 0.0, 0.7), 3.0)
}

/// Each layer alone is flat: the border between them cuts the slope's scatter.
#[test]
fn layers_of_one_scatter_are_one_patch() {
    for floor in [0.1, 0.3] {
        let states = foot_of_a_ramp(floor);
        let Patches { owner, kinds } = segment(&states, &Rules::new(&Params::default()));
        let of = |number: u8| states.iter().zip(&owner).filter(move |(_, owner)| **owner == number);
        let broadest = (0..kinds.len() as u8).max_by_key(|&number| of(number).count()).unwrap();
        let layers: BTreeSet<_> = of(broadest).map(|(state, _)| state.cell().coordinates()[2]).collect();
        assert!(of(broadest).count() >= 80 && layers.len() >= 2, "{floor}: {layers:?} of {}", states.len());
    }
}
