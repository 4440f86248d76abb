//! What is kept of the points of a voxel.
//!
//! Offsets from the voxel's corner are whole 1/4096 of its edge (20 um at 8 cm). A scan's points are summed without a
//! weight first ([`ScanSums`]), as integers, so that neither their order nor how many are done at once matters, and are then
//! folded into the voxel with one weight for all of them ([`Moments`]).
//!
//! Of all its points a voxel keeps mean and covariance instead of sums: these need no more than 24 bits however many points
//! there are, where sums of squares need 56. A fold rounds a mean by 2^-25 of the edge at most.
//!
//! Nothing overflows: a square has 24 bits and a scan at most 2^24 points. Where the weights of a voxel exceed 2^32 or its
//! points 2^20, both are halved ([`Moments::fold`]), by which old scans fade where a voxel has been seen for long. For the sums
//! of a cluster see `cluster/sums`.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::state::State;
use crate::engine::binning;
use crate::engine::symmetric::{PAIRS, Symmetric3, quadratic};

/// Units of an offset in a voxel's edge.
const UNITS: f64 = binning::UNITS as f64;
/// Most weight and most points of a voxel; beyond either both are halved.
const MOST_WEIGHT: u64 = u32::MAX as u64;
const MOST_POINTS: u64 = 1 << 20;

/// What one scan puts into a voxel; offsets in 1/4096 of its edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ScanSums {
    pub(super) count: u32,
    pub(super) sum: [u64; 3],
    /// xx, xy, xz, yy, yz, zz.
    pub(super) squares: [u64; 6],
}

impl ScanSums {
    #[inline]
    pub(super) fn add(&mut self, [x, y, z]: [u64; 3]) {
        self.count += 1;
        for (sum, offset) in self.sum.iter_mut().zip([x, y, z]) {
            *sum += offset;
        }
        for (sum, square) in self.squares.iter_mut().zip([x * x, x * y, x * z, y * y, y * z, z * z]) {
            *sum += square;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        (0..3).for_each(|i| self.sum[i] += other.sum[i]);
        (0..6).for_each(|i| self.squares[i] += other.squares[i]);
    }

    /// Mean offset from the corner, in voxels.
    pub(super) fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.sum.map(|sum| sum as f64)) / (f64::from(self.count) * UNITS)
    }

    /// Mean products of these offsets, in voxels^2: xx, xy, xz, yy, yz, zz.
    fn products(&self) -> [f64; 6] {
        let scale = 1.0 / (f64::from(self.count) * UNITS * UNITS);
        self.squares.map(|square| square as f64 * scale)
    }
}

/// Everything a voxel knows of its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Moments {
    /// Number of points, halved with the weight.
    pub(super) points: u32,
    pub(super) weight: u32,
    /// That of the points that were seen from the other side of a thin panel than `towards`.
    pub(super) weight_behind: u32,
    /// Weighted mean offset from the corner, in voxels.
    mean: [f32; 3],
    /// Weighted covariance, in voxels^2: xx, xy, xz, yy, yz, zz.
    covariance: [f32; 6],
    /// Mean of the unit directions towards the sensor, one a point, those from the other side of a thin panel turned.
    towards: [f32; 3],
}

/// Most that an entry of the covariance of a voxel's points can be, in voxels^2: a quarter, and what rounding adds.
const MOST_COVARIANCE: f64 = 0.26;
/// Most that a part of a mean of unit directions can be: 1, and what rounding adds; a whole number of what a state
/// is rounded to.
const MOST_TOWARDS: f64 = 1.0 + 1.0 / 128.0;
/// Most variance of the points along the normal of a plane that was seen from both sides, in voxels^2: of those that fill a
/// voxel it is a twelfth.
const MOST_THICK: f64 = 0.07;
/// How much better than a plane that was seen from one side must one fit that was seen from both, in variances.
const PARTED: f64 = 8.0;
/// How many times the weight of one side of a panel must that of the other be, for it to be the side that it was seen from.
const OUTWEIGHS: u64 = 8;
/// How many points that fill the voxel count with those that it has: of few it is not known how they lie.
const UNKNOWN: f64 = 16.0;

impl Moments {
    /// Whether points can have these.
    pub(super) fn is_possible(&self) -> bool {
        let within = |values: &[f32], range: RangeInclusive<f64>| {
            values.iter().all(|&value| range.contains(&f64::from(value)))
        };
        self.points > 0
            && self.points <= self.weight
            && self.weight_behind <= self.weight
            && u64::from(self.points) <= MOST_POINTS
            && within(&self.mean, 0.0..=1.0)
            && within(&self.covariance, -MOST_COVARIANCE..=MOST_COVARIANCE)
            && within(&self.towards, -MOST_TOWARDS..=MOST_TOWARDS)
    }

    /// Adds a scan's points, each of this weight and seen from this direction (of unit length); returns how often the weight
    /// was halved. What is seen of the other side of a thin panel counts as seen from the first: the two would cancel out. Where
    /// the other has far more weight it is taken for the first: a wall's face, too, may have been hit first by noise from behind it.
    pub(super) fn fold(&mut self, scan: &ScanSums, weight: u64, towards: &Vector3<f64>) -> u32 {
        let count = u64::from(scan.count);
        let points = u64::from(self.points) + count;
        let weights = u64::from(self.weight) + weight * count;
        self.take_in(scan, (weight * count) as f64 / weights as f64);
        let part = count as f64 / points as f64;
        let seen = self.towards();
        let is_behind = self.is_other_side(&seen, towards, points);
        let behind = u64::from(self.weight_behind) + if is_behind { weight * count } else { 0 };
        let is_outweighed = behind > OUTWEIGHS * (weights - behind);
        let turned = |direction: Vector3<f64>, turns: bool| if turns { -direction } else { direction };
        let seen = turned(seen, is_outweighed);
        let towards = turned(*towards, is_behind != is_outweighed);
        self.towards = (seen + (towards - seen) * part).map(|along| along as f32).into();
        let behind = if is_outweighed { weights - behind } else { behind };
        let halvings = halvings(weights, MOST_WEIGHT).max(halvings(points, MOST_POINTS));
        self.points = (points >> halvings).max(1) as u32;
        [self.weight, self.weight_behind] = [weights, behind].map(|weight| (weight >> halvings) as u32);
        halvings
    }

    /// Whether what is seen from this direction is the other side of what was seen before: whether the points lie on a plane
    /// that parts the two directions rather than on one that has both on one side. The flatter a direction meets a plane, the
    /// less likely is it to have seen it. `points` is how many the covariance is of.
    fn is_other_side(&self, seen: &Vector3<f64>, towards: &Vector3<f64>, points: u64) -> bool {
        if seen.dot(towards) >= 0.0 {
            return false;
        }
        let seen = seen.normalize();
        // The normals of the two planes; half their lengths are the sines of the angles at which the directions meet them.
        let normals = [towards - seen, towards + seen];
        let known = points as f64 / (points as f64 + UNKNOWN);
        let unknown = Matrix3::from_diagonal_element((1.0 - known) / 12.0);
        let covariance = self.covariance() * known + unknown;
        let [parted, shared] = normals.map(|normal| quadratic(&covariance, &normal));
        let [parting, sharing] = normals.map(|normal| normal.norm_squared());
        parted <= MOST_THICK * parting && PARTED * parted * sharing * sharing <= shared * parting * parting
    }

    /// Moves mean and covariance towards those of a scan that has this part of all the weight.
    fn take_in(&mut self, scan: &ScanSums, part: f64) {
        let (before, there) = (self.mean(), scan.mean());
        let way = there - before;
        let products = scan.products();
        for (k, (i, j)) in PAIRS.into_iter().enumerate() {
            let here = f64::from(self.covariance[k]);
            let change = products[k] - there[i] * there[j] - here + (1.0 - part) * way[i] * way[j];
            self.covariance[k] = (here + part * change) as f32;
        }
        self.mean = (before + way * part).map(|offset| offset as f32).into();
    }

    /// The moments of `points` points whose weights sum to `weight`. `mean` (voxels, from the corner) and `covariance` (voxels^2) are
    /// weighted; `towards` is the mean of the unit directions towards the sensor, all from one side.
    pub(super) fn new(
        points: u32,
        weight: u32,
        mean: Vector3<f64>,
        covariance: &Matrix3<f64>,
        towards: Vector3<f64>,
    ) -> Self {
        let rounded = |exact: Vector3<f64>| exact.map(|part| part as f32).into();
        let covariance = Symmetric3::of(covariance).0.map(|entry| entry as f32);
        Self { points, weight, weight_behind: 0, mean: rounded(mean), covariance, towards: rounded(towards) }
    }

    /// The moments that a published state tells of its voxel.
    pub(super) fn of(state: &State) -> Self {
        Self::new(state.points(), state.weight(), state.offset(), &state.covariance(), state.towards())
    }

    /// Weighted mean offset from the corner, in voxels.
    pub(super) fn mean(&self) -> Vector3<f64> {
        Vector3::from(self.mean.map(f64::from))
    }

    /// Weighted covariance, in voxels^2.
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        Symmetric3(self.covariance.map(f64::from)).matrix()
    }

    /// Mean direction towards the sensor; its length is 1 where all points were seen along one line.
    pub(super) fn towards(&self) -> Vector3<f64> {
        Vector3::from(self.towards.map(f64::from))
    }
}

/// How often a number must be halved to be no more than `most`.
const fn halvings(number: u64, most: u64) -> u32 {
    let mut halvings = 0;
    while number >> halvings > most {
        halvings += 1;
    }
    halvings
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::block::{Cell, Voxel};
    use super::super::noise::MAX_WEIGHT;
    use super::*;

    /// A scan of some points in one voxel: these, their weight and where they were seen from.
    type Seen = (Vec<[u64; 3]>, u64, [f64; 3]);

    /// Seen from any directions of one octant.
    fn scans() -> impl Strategy<Value = Vec<Seen>> {
        let point = prop::array::uniform3(0..binning::UNITS as u64);
        let towards =
            prop::array::uniform3(0.0..1.0).prop_filter("none", |towards| towards.iter().sum::<f64>() > 0.1);
        prop::collection::vec((prop::collection::vec(point, 1..40), 1..=MAX_WEIGHT, towards), 1..60)
    }

    /// Mean, covariance and mean direction of all points of all scans, found at once.
    fn naive(scans: &[Seen]) -> (Vector3<f64>, Matrix3<f64>, Vector3<f64>) {
        let points = scans.iter().flat_map(|(points, weight, towards)| {
            let point = |point: &[u64; 3]| Vector3::from(point.map(|offset| offset as f64 / UNITS));
            points.iter().map(move |at| (point(at), *weight as f64, Vector3::from(*towards).normalize()))
        });
        let points: Vec<_> = points.collect();
        let weight: f64 = points.iter().map(|(_, weight, _)| weight).sum();
        let mean = points.iter().map(|(at, weight, _)| at * *weight).sum::<Vector3<f64>>() / weight;
        let square =
            |(at, weight, _): &(Vector3<f64>, f64, _)| (at - mean) * (at - mean).transpose() * *weight;
        let covariance = points.iter().map(square).sum::<Matrix3<f64>>() / weight;
        let towards = points.iter().map(|(_, _, towards)| towards).sum::<Vector3<f64>>();
        (mean, covariance, towards / points.len() as f64)
    }

    proptest! {
        #[test]
        fn what_is_folded_scan_by_scan_is_that_of_all_points_at_once(scans in scans()) {
            let mut moments = Moments::default();
            for (points, weight, towards) in &scans {
                let mut scan = ScanSums::default();
                points.iter().for_each(|&point| scan.add(point));
                prop_assert_eq!(moments.fold(&scan, *weight, &Vector3::from(*towards).normalize()), 0);
            }
            let (mean, covariance, towards) = naive(&scans);
            prop_assert!((moments.mean() - mean).amax() < 1e-6, "{} {mean}", moments.mean());
            prop_assert!((moments.covariance() - covariance).amax() < 1e-6, "{} {covariance}", moments.covariance());
            prop_assert!((moments.towards() - towards).amax() < 1e-6, "{} {towards}", moments.towards());
            prop_assert_eq!(moments.points as usize, scans.iter().map(|(points, ..)| points.len()).sum::<usize>());
            prop_assert!(moments.is_possible(), "{moments:?}");
        }

        #[test]
        fn whatever_is_folded_is_possible(
            scans in scans(), octants in prop::collection::vec(prop::array::uniform3(any::<bool>()), 60),
        ) {
            let mut moments = Moments::default();
            for ((points, weight, towards), octant) in scans.iter().zip(octants) {
                let mut scan = ScanSums::default();
                points.iter().for_each(|&point| scan.add(point));
                let turned = [0, 1, 2].map(|i| if octant[i] { towards[i] } else { -towards[i] });
                moments.fold(&scan, *weight, &Vector3::from(turned).normalize());
                prop_assert!(moments.is_possible(), "{moments:?}");
            }
        }

        /// As a panel is, of a quarter of a voxel at most, from up to 30 degrees off its normal on either side.
        #[test]
        fn what_is_seen_from_both_sides_counts_as_seen_from_the_first_or_from_one_that_outweighs_it(
            towards in prop::collection::vec((prop::array::uniform2(-0.4..0.4), any::<bool>()), 1..30), height in 0_u64..3072,
        ) {
            let (mut moments, mut expected) = (Moments::default(), Vector3::zeros());
            let (mut side, mut looks) = (towards[0].1, [0_u64; 2]);
            for &([x, y], is_front) in &towards {
                let mut scan = ScanSums::default();
                let face = height + if is_front { 1024 } else { 0 };
                let place = |i: u64| [i % 8 * 512, i / 8 * 512, face];
                (0..64).map(place).for_each(|point| scan.add(point));
                let direction = Vector3::new(x, y, if is_front { 1.0 } else { -1.0 }).normalize();
                moments.fold(&scan, 1, &direction);
                expected += if is_front { direction } else { -direction };
                looks[usize::from(is_front)] += 1;
                if looks[usize::from(!side)] > OUTWEIGHS * looks[usize::from(side)] {
                    side = !side;
                }
            }
            expected *= if side { 1.0 } else { -1.0 } / towards.len() as f64;
            prop_assert!((moments.towards() - expected).amax() < 1e-6, "{} {expected}", moments.towards());
        }
    }

    #[test]
    fn a_face_that_noise_from_behind_has_hit_first_is_seen_from_the_front() {
        let mut moments = Moments::default();
        let few = |at: u64| {
            let mut scan = ScanSums::default();
            (0..6).for_each(|i| scan.add([at * 37 % 4096, i * 600, 4000 - i * 80]));
            scan
        };
        // Half a minute of it.
        (0..1000).for_each(|at| _ = moments.fold(&few(at), 14, &-Vector3::z()));
        assert!(moments.towards().z < -0.9, "{}", moments.towards());
        let mut face = ScanSums::default();
        (0..400_u64).for_each(|i| face.add([i % 20 * 200, i / 20 * 200, 3900]));
        (0..3).for_each(|_| _ = moments.fold(&face, 650, &Vector3::z()));
        assert!(moments.towards().z > 0.9, "{}", moments.towards());
        (0..1000).for_each(|at| _ = moments.fold(&few(at), 14, &-Vector3::z()));
        assert!(moments.towards().z > 0.9, "{}", moments.towards());
    }

    #[test]
    fn what_is_seen_from_opposite_ends_of_a_floor_is_seen_from_above() {
        let mut scan = ScanSums::default();
        (0..64_u64).for_each(|i| scan.add([i % 8 * 512, i / 8 * 512, 2048]));
        let mut moments = Moments::default();
        for i in 0..20 {
            let along = if i % 2 == 0 { 1.0 } else { -1.0 };
            moments.fold(&scan, 1, &Vector3::new(along, 0.0, 0.3).normalize());
        }
        assert!(moments.towards().z > 0.2, "{}", moments.towards());
    }

    #[test]
    fn what_a_voxel_may_know_at_most_is_possible_as_a_state_too() {
        let mut voxel = Voxel::new(Cell(0));
        let towards = Vector3::repeat(MOST_TOWARDS);
        let covariance = Matrix3::repeat(MOST_COVARIANCE);
        voxel.count = 1;
        voxel.moments = Moments::new(1, 1, Vector3::repeat(1.0), &covariance, towards);
        assert!(voxel.moments.is_possible() && State::new(&voxel).is_possible());
    }

    #[test]
    fn as_many_points_of_the_greatest_weight_as_a_scan_may_have_overflow_nothing() {
        // All in the last place of a voxel, of as many points as the parameter `max_points` lets through.
        let (count, place) = (1_u32 << 24, u64::from(UNITS as u32 - 1));
        let many = u64::from(count);
        let scan = ScanSums { count, sum: [many * place; 3], squares: [many * place * place; 6] };
        let mut moments = Moments::default();
        for _ in 0..1000 {
            moments.fold(&scan, MAX_WEIGHT, &Vector3::new(0.0, 0.0, 1.0));
            assert!(
                (moments.mean() * UNITS - Vector3::repeat(place as f64)).amax() < 1e-3,
                "{:?}",
                moments.mean()
            );
            assert!(
                moments.covariance().amax() < 1e-6
                    && moments.towards().norm() < 1.001
                    && moments.is_possible()
            );
        }
    }

    #[test]
    fn where_a_voxel_was_seen_for_long_new_points_still_count() {
        let seen = |place: u64| {
            let mut scan = ScanSums::default();
            (0..1000).for_each(|_| scan.add([place; 3]));
            scan
        };
        let mut moments = Moments::default();
        let halvings = (0..5000).map(|_| moments.fold(&seen(1024), 1, &Vector3::x())).sum::<u32>();
        assert!(halvings > 0 && u64::from(moments.points) <= MOST_POINTS, "{halvings} {moments:?}");
        // Half a million points or more against as many: they have moved the mean at least half of the way.
        (0..1000).for_each(|_| _ = moments.fold(&seen(3072), 1, &Vector3::x()));
        assert!(moments.mean().min() > 0.5, "{}", moments.mean());
    }
}
