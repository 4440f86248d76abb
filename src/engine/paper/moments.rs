//! Exact sums over voxel centres (the paper's LS, and its second moments).
//!
//! Centres are rounded to 2^-30 of a voxel (0.07 nm at 8 cm) and summed as integers, so that a sum depends neither on
//! the order of its terms nor on its history: taking a centre out leaves exactly the sum without it, and the refit of
//! a cluster from its running sums equals the fit over all its voxels. No sum overflows: an index has 20 bits and a
//! sign ([`crate::engine::GRID_REACH`]), so a coordinate stays below 2^50 units, its square below 2^100, and a map of 2^27
//! voxels within 2^127. Adding, removing and merging cost O(1).

use nalgebra::{Matrix3, Point3};

use crate::engine::key::VoxelKey;
use crate::engine::symmetric::PAIRS;

/// Units of a voxel's edge.
const UNITS: i64 = 1 << 30;

/// The centre of a voxel in units of `voxel_size / 2^30`, fixed frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Centre([i64; 3]);

impl Centre {
    /// The mean of `count` offsets from the corner of `key`, summed per axis in units of `voxel_size / 2^32`.
    pub(crate) fn new(key: VoxelKey, sum: [u64; 3], count: u32) -> Self {
        let divisor = u64::from(count) * 4;
        let axis = |i: usize| {
            let offset = (sum[i] + divisor / 2) / divisor;
            i64::from(key.indices()[i]) * UNITS + offset as i64
        };
        Self([axis(0), axis(1), axis(2)])
    }

    /// In metres.
    pub(crate) fn metres(self, voxel_size: f64) -> Point3<f64> {
        Point3::from(self.0.map(|c| c as f64 / UNITS as f64 * voxel_size))
    }
}

/// Number, sum and sum of outer products of a set of centres, these in the order of [`PAIRS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Moments {
    count: u32,
    sum: [i128; 3],
    outer: [i128; 6],
}

impl Moments {
    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    pub(crate) fn add(&mut self, centre: Centre) {
        self.count += 1;
        self.shift(centre, 1);
    }

    /// A member's centre has moved.
    pub(crate) fn replace(&mut self, before: Centre, after: Centre) {
        self.shift(before, -1);
        self.shift(after, 1);
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        for (mine, theirs) in self.sum.iter_mut().zip(other.sum) {
            *mine += theirs;
        }
        for (mine, theirs) in self.outer.iter_mut().zip(other.outer) {
            *mine += theirs;
        }
    }

    fn shift(&mut self, Centre(centre): Centre, sign: i128) {
        let c = centre.map(i128::from);
        for (sum, c) in self.sum.iter_mut().zip(c) {
            *sum += sign * c;
        }
        for (outer, (i, j)) in self.outer.iter_mut().zip(PAIRS) {
            *outer += sign * c[i] * c[j];
        }
    }

    /// Mean of the centres (m); NaN when there is none.
    pub(crate) fn mean(&self, voxel_size: f64) -> Point3<f64> {
        let n = i128::from(self.count);
        if n == 0 {
            return Point3::from([f64::NAN; 3]);
        }
        // Whole units first: a plain division of two large f64 would lose the digits below them.
        let axis = |s: i128| s.div_euclid(n) as f64 + s.rem_euclid(n) as f64 / n as f64;
        Point3::from(self.sum.map(|s| axis(s) / UNITS as f64 * voxel_size))
    }

    /// Covariance of the centres in squared voxels (divided by n); zero when there is none.
    ///
    /// The sums are first moved, exactly, to an origin within one unit of the mean, where nothing cancels.
    pub(crate) fn covariance(&self) -> Matrix3<f64> {
        let n = i128::from(self.count.max(1));
        let origin = self.sum.map(|s| s.div_euclid(n));
        let rest: [f64; 3] = std::array::from_fn(|i| (self.sum[i] - n * origin[i]) as f64 / n as f64);
        let scale = 1.0 / (UNITS as f64 * UNITS as f64);
        let mut covariance = Matrix3::zeros();
        for (outer, (i, j)) in self.outer.iter().zip(PAIRS) {
            // The result fits whenever the sums do; a term on the way may not, hence arithmetic modulo 2^128.
            let moved = outer
                .wrapping_sub(origin[i].wrapping_mul(self.sum[j]))
                .wrapping_sub(origin[j].wrapping_mul(self.sum[i]))
                .wrapping_add(n.wrapping_mul(origin[i]).wrapping_mul(origin[j]));
            let entry = (moved as f64 / n as f64 - rest[i] * rest[j]) * scale;
            covariance[(i, j)] = entry;
            covariance[(j, i)] = entry;
        }
        covariance
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn centre() -> impl Strategy<Value = Centre> {
        let index = -(1i64 << 20)..(1i64 << 20);
        let offset = 0..UNITS;
        proptest::array::uniform3((index, offset)).prop_map(|axes| Centre(axes.map(|(i, o)| i * UNITS + o)))
    }

    fn of(centres: &[Centre]) -> Moments {
        let mut moments = Moments::default();
        centres.iter().for_each(|&c| moments.add(c));
        moments
    }

    proptest! {
        #[test]
        fn sums_are_free_of_order_and_history(
            mut centres in proptest::collection::vec(centre(), 2..40), moved in centre(), at in 1usize..39,
        ) {
            let mut running = of(&centres);
            running.replace(centres[0], moved);
            centres[0] = moved;
            centres.reverse();
            let at = at.min(centres.len() - 1);
            let mut halves = of(&centres[..at]);
            halves.merge(&of(&centres[at..]));
            prop_assert_eq!(running, of(&centres));
            prop_assert_eq!(halves, running);
        }

        #[test]
        fn the_covariance_is_as_good_80_km_away_as_at_the_origin(
            near in proptest::collection::vec(proptest::array::uniform3(0..8 * UNITS), 1..60),
            far in proptest::array::uniform3(-(1i64 << 20)..(1i64 << 20) - 8),
        ) {
            let here = of(&near.iter().map(|&c| Centre(c)).collect::<Vec<_>>());
            let shift = |c: [i64; 3]| Centre(std::array::from_fn(|i| c[i] + far[i] * UNITS));
            let there = of(&near.iter().map(|&c| shift(c)).collect::<Vec<_>>());
            let n = near.len() as f64;
            let centred = |i: usize| {
                let mean = near.iter().map(|c| c[i] as f64 / UNITS as f64).sum::<f64>() / n;
                near.iter().map(move |c| c[i] as f64 / UNITS as f64 - mean).collect::<Vec<_>>()
            };
            for (i, j) in PAIRS {
                let naive = centred(i).iter().zip(centred(j)).map(|(a, b)| a * b).sum::<f64>() / n;
                prop_assert!((here.covariance()[(i, j)] - naive).abs() < 1e-12);
                prop_assert!((there.covariance()[(i, j)] - naive).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn the_largest_map_at_the_edge_of_the_grid_does_not_overflow() {
        let corner = Centre([-(1 << 50); 3]);
        let mut moments = of(&[corner]);
        for _ in 0..26 {
            let twin = moments;
            moments.merge(&twin);
        }
        assert_eq!(moments.count(), 1 << 26);
        assert_eq!(moments.covariance(), Matrix3::zeros());
        assert_eq!(moments.mean(1.0), Point3::from([-f64::from(1 << 20); 3]));
    }

    #[test]
    fn nothing_has_no_mean_and_no_spread() {
        assert!(Moments::default().mean(0.08).x.is_nan());
        assert_eq!(Moments::default().covariance(), Matrix3::zeros());
    }

    #[test]
    fn a_centre_is_the_rounded_mean_of_its_offsets() {
        let key = VoxelKey::new(-2, 0, 5).unwrap();
        let centre = Centre::new(key, [1 << 32, 3 << 31, 0], 3);
        let metres = centre.metres(0.3);
        assert!((metres - Point3::new((-2.0 + 1.0 / 3.0) * 0.3, 0.15, 1.5)).norm() < 1e-9);
    }
}
