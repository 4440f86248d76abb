//! The arithmetic that decides which voxel a point falls into, to the last bit: in mode `paper` any, in `consistent` one in
//! double precision or beyond the region around the sensor. Within it that mode has an arithmetic of its own for single
//! precision (`consistent::grid::bin::region`), by which a point lies in another voxel only within a hair of a border.

use nalgebra::{Matrix3, Vector3};

/// p = R x + t, each term rounded on its own so that every processor finds the same voxel. The plain form of what
/// [`Fixed`] and [`Exact`] begin with, for what bins beside the engine: the truth of the experiments.
#[cfg(any(test, all(feature = "bag", feature = "sim")))]
pub(crate) fn map(
    rotation: &Matrix3<f64>,
    translation: &Vector3<f64>,
    [x, y, z]: [f64; 3],
) -> nalgebra::Point3<f64> {
    let axis = |i: usize| rotation[(i, 0)] * x + rotation[(i, 1)] * y + rotation[(i, 2)] * z + translation[i];
    nalgebra::Point3::new(axis(0), axis(1), axis(2))
}

/// The floor of an index; far outside the grid it saturates there. (`f64::floor` is a call on plain x86-64.)
pub(crate) fn floor(value: f64) -> i32 {
    let truncated = value as i32;
    truncated.saturating_sub(i32::from(value < f64::from(truncated)))
}

/// Units of a voxel's edge in [`Fixed`].
pub(crate) const UNITS: i64 = 4096;
/// Points that [`Fixed`] and [`Exact`] take at once.
pub(crate) const BATCH: usize = 64;

/// From the sensor's frame to the grid: lengths in voxels.
#[derive(Clone, Debug)]
struct Placing {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    voxel_size: f64,
}

impl Placing {
    /// Where the first [`BATCH`] points lie, handed over as axis, number of the point and the place along that axis. A
    /// loop that has no branch and no conversion, which plain x86-64 has for one number at a time only.
    #[inline(always)]
    fn place<T: Copy + Into<f64>>(&self, points: &[[T; 3]], mut put: impl FnMut(usize, usize, f64)) {
        let mut from = [[0.0; BATCH]; 3];
        for (i, point) in points.iter().take(BATCH).enumerate() {
            (0..3).for_each(|axis| from[axis][i] = point[axis].into());
        }
        let [xs, ys, zs] = &from;
        for axis in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|column| self.rotation[(axis, column)]);
            let t = self.translation[axis];
            let size = self.voxel_size;
            for (i, ((x, y), z)) in xs.iter().zip(ys).zip(zs).enumerate() {
                put(axis, i, (a * x + b * y + c * z + t) / size);
            }
        }
    }
}

/// Where points lie in the grid, in whole 1/4096 of a voxel's edge, rounded down: `units >> 12` is the [`floor`] of the
/// index, to the last bit, and `units & 4095` the offset in the voxel.
#[derive(Clone, Debug)]
pub(crate) struct Fixed {
    placing: Placing,
    units: [[i64; BATCH]; 3],
}

impl Fixed {
    pub(crate) const fn new(rotation: Matrix3<f64>, translation: Vector3<f64>, voxel_size: f64) -> Self {
        Self { placing: Placing { rotation, translation, voxel_size }, units: [[0; BATCH]; 3] }
    }

    /// Places of the first [`BATCH`] points, each [x, y, z].
    pub(crate) fn place<T: Copy + Into<f64>>(&mut self, points: &[[T; 3]]) -> impl Iterator<Item = [i64; 3]> {
        let units = &mut self.units;
        self.placing.place(points, |axis, i, place| units[axis][i] = nearest(floored(place * UNITS as f64)));
        each(&self.units, points.len())
    }
}

/// Where points lie in the grid, as the [`floor`] of the index and the offset in that voxel, in 2^-32 of its edge.
#[derive(Clone, Debug)]
pub(crate) struct Exact {
    placing: Placing,
    indices: [[i64; BATCH]; 3],
    offsets: [[i64; BATCH]; 3],
}

impl Exact {
    /// Units of a voxel's edge.
    pub(crate) const UNITS: f64 = 4_294_967_296.0;

    pub(crate) const fn new(rotation: Matrix3<f64>, translation: Vector3<f64>, voxel_size: f64) -> Self {
        let placing = Placing { rotation, translation, voxel_size };
        Self { placing, indices: [[0; BATCH]; 3], offsets: [[0; BATCH]; 3] }
    }

    /// Index and offset of the first [`BATCH`] points, each [x, y, z].
    pub(crate) fn place<T: Copy + Into<f64>>(
        &mut self,
        points: &[[T; 3]],
    ) -> impl Iterator<Item = ([i64; 3], [i64; 3])> {
        let (indices, offsets) = (&mut self.indices, &mut self.offsets);
        self.placing.place(points, |axis, i, place| {
            let place = place.clamp(-MOST, MOST);
            let floor = floored(place);
            indices[axis][i] = nearest(floor);
            offsets[axis][i] = nearest((place - floor) * Self::UNITS);
        });
        each(&self.indices, points.len()).zip(each(&self.offsets, points.len()))
    }
}

/// The first `count` points, [`BATCH`] at most, of numbers that lie axis by axis.
fn each([xs, ys, zs]: &[[i64; BATCH]; 3], count: usize) -> impl Iterator<Item = [i64; 3]> {
    xs.iter().zip(ys).zip(zs).take(count).map(|((&x, &y), &z)| [x, y, z])
}

/// At 1.5 * 2^52 the last bit of a number is 1, so that adding this rounds, and the bits hold the whole number.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// The nearest whole number of a value within 2^51. (`f64::round` is a call on plain x86-64.)
#[inline(always)]
pub(crate) fn nearest(value: f64) -> i64 {
    (value + ROUNDING).to_bits() as i64 - ROUNDING.to_bits() as i64
}

/// What [`floored`] stays within.
const MOST: f64 = (1_u64 << 42) as f64;

/// The floor; beyond 2^42 it stays there, and so does what is no number.
fn floored(value: f64) -> f64 {
    let value = if value.abs() <= MOST { value } else { MOST.copysign(value) };
    let nearest = (value + ROUNDING) - ROUNDING;
    if nearest > value { nearest - 1.0 } else { nearest }
}

/// Numbers from one to another, in 2^24 steps, for property tests: of a range of `f32` proptest 1.12 now and then makes
/// none, but panics.
#[cfg(test)]
pub(crate) fn between(from: f32, to: f32) -> impl proptest::strategy::Strategy<Value = f32> + Clone {
    use proptest::strategy::Strategy;
    (0..1_u32 << 24).prop_map(move |step| from + (to - from) * step as f32 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_whole_number_is_the_floor() {
        for value in
            [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.5, -2.5, 4095.999, -4096.0, -4096.001, 1e-300, -1e-300, 1e12]
        {
            assert_eq!(floored(value), value.floor(), "{value}");
            assert_eq!(i64::from(floor(value)), (value.floor() as i64).min(i64::from(i32::MAX)), "{value}");
        }
        assert_eq!([floored(f64::MAX), floored(f64::NEG_INFINITY)], [MOST, -MOST]);
        assert_eq!(floored(f64::NAN).abs(), MOST);
        assert_eq!([f64::NAN, 1e300, -1e300].map(floor), [0, i32::MAX, i32::MIN]);
    }

    #[test]
    fn a_point_on_a_border_lies_in_the_voxel_above_it() {
        let mut fixed = Fixed::new(Matrix3::identity(), Vector3::zeros(), 0.125);
        let below = 0.125_f32.next_down();
        let points = [[0.0, 0.125, -0.125], [-0.0, -f32::MIN_POSITIVE, below], [f32::MAX, -f32::MAX, 1e6]];
        let indices: Vec<_> = fixed.place(&points).map(|units| units.map(|units| units >> 12)).collect();
        assert_eq!(indices, [[0, 1, -1], [0, -1, 0], [1 << 30, -(1 << 30), 8_000_000]]);
    }

    proptest! {
        #[test]
        fn places_are_those_of_the_plain_arithmetic_to_the_last_bit(
            points in prop::collection::vec(prop::array::uniform3(between(-1e4, 1e4)), 1..BATCH + 1),
            turn in prop::array::uniform3(-3.0..3.0),
            way in prop::array::uniform3(-1e3..1e3),
            voxel_size in 0.01..1.0,
        ) {
            let pose = Isometry3::new(way.into(), turn.into());
            let rotation = pose.rotation.to_rotation_matrix().into_inner();
            let mut fixed = Fixed::new(rotation, pose.translation.vector, voxel_size);
            let mut exact = Exact::new(rotation, pose.translation.vector, voxel_size);
            let places = fixed.place(&points).zip(exact.place(&points));
            for (point, (units, (indices, offsets))) in points.iter().zip(places) {
                let plain = map(&rotation, &pose.translation.vector, point.map(Into::into)) / voxel_size;
                for axis in 0..3 {
                    let index = floor(plain[axis]);
                    prop_assert_eq!(units[axis] >> 12, i64::from(index));
                    prop_assert_eq!(indices[axis], i64::from(index));
                    let offset = plain[axis] - f64::from(index);
                    prop_assert_eq!((units[axis] & 4095) as f64, (offset * 4096.0).floor());
                    prop_assert_eq!(offsets[axis], (offset * Exact::UNITS).round_ties_even() as i64);
                }
            }
        }
    }
}
