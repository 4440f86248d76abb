//! The arithmetic of a tile for AVX2, with what a compiler does not find in the plain one: an offset has 12 bits, so that 16 of
//! them are multiplied at once and pairs of products added (`pmaddwd`); eight sums are brought together in one tree; and a number
//! that is none, or too large for 32 bits, is made a whole one below 0 by the instruction that rounds it (`cvtpd2dq`), so that
//! none needs to be kept within bounds before.

use std::arch::x86_64::{__m256d, __m256i};

use pulp::x86::{V3, V4};
use pulp::{NullaryFnOnce, cast};

use super::{Keys, Lanes, Local, LocalKey, Places, SIDE, TILE, TileSums};

/// Whole numbers of 32 bits in a vector.
const LANES: usize = 8;
/// Numbers in double precision in a vector.
const DOUBLES: usize = 4;
const KEYS: usize = TILE / LANES;
/// Vectors of 16 offsets.
const HALVES: usize = KEYS / 2;

/// A processor with AVX2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2(V3);

impl Avx2 {
    /// `None` without AVX2, and with AVX-512, whose vectors make the plain pass as fast.
    pub(super) fn if_best() -> Option<Self> {
        V3::try_new().filter(|_| V4::try_new().is_none()).map(Self)
    }

    pub(super) fn dispatch<W: NullaryFnOnce<Output = ()>>(self, work: W) {
        self.0.vectorize(work);
    }
}

/// In vectors: the keys in order, and the offsets 16 at a time, in the order in which two vectors are packed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packed {
    keys: [__m256i; KEYS],
    offsets: [[__m256i; HALVES]; 3],
}

// Loops, for a closure that is handed to an array's method is not compiled for AVX2.
impl Lanes for Avx2 {
    type Tile<'a> = Packed;

    #[inline(always)]
    fn place_pixels(self, depths: &[f32; SIDE], columns: &[f64; SIDE], row: f64, origin: f64) -> [i32; SIDE] {
        let avx = self.0.avx;
        let [row, origin] = [avx._mm256_set1_pd(row), avx._mm256_set1_pd(origin)];
        let mut places = [[0; DOUBLES]; SIDE / DOUBLES];
        let each = depths.as_chunks().0.iter().zip(columns.as_chunks().0);
        for (places, (depths, columns)) in places.iter_mut().zip(each) {
            let direction = avx._mm256_add_pd(cast::<[f64; DOUBLES], _>(*columns), row);
            *places =
                self.rounded(avx._mm256_add_pd(avx._mm256_mul_pd(self.wide(*depths), direction), origin));
        }
        cast(places)
    }

    #[inline(always)]
    fn place_points(self, [xs, ys, zs]: [&[f32; SIDE]; 3], [a, b, c]: [f64; 3], origin: f64) -> [i32; SIDE] {
        let avx = self.0.avx;
        let [a, b] = [avx._mm256_set1_pd(a), avx._mm256_set1_pd(b)];
        let [c, origin] = [avx._mm256_set1_pd(c), avx._mm256_set1_pd(origin)];
        let mut places = [[0; DOUBLES]; SIDE / DOUBLES];
        let each = xs.as_chunks().0.iter().zip(ys.as_chunks().0).zip(zs.as_chunks().0);
        for (places, ((x, y), z)) in places.iter_mut().zip(each) {
            let x = avx._mm256_mul_pd(a, self.wide(*x));
            let y = avx._mm256_mul_pd(b, self.wide(*y));
            let z = avx._mm256_mul_pd(c, self.wide(*z));
            let from_sensor = avx._mm256_add_pd(avx._mm256_add_pd(x, y), z);
            *places = self.rounded(avx._mm256_add_pd(from_sensor, origin));
        }
        cast(places)
    }

    #[inline(always)]
    fn tile(self, keys: &Keys, places: &Places) -> Packed {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let zero = avx._mm256_setzero_si256();
        let mut packed = Packed { keys: [zero; KEYS], offsets: [[zero; HALVES]; 3] };
        for (vector, keys) in packed.keys.iter_mut().zip(keys.as_chunks().0) {
            *vector = cast::<[i32; LANES], _>(*keys);
        }
        let in_voxel = avx._mm256_set1_epi32(Local::offset(-1));
        for (vectors, places) in packed.offsets.iter_mut().zip(places) {
            for (vector, [low, high]) in vectors.iter_mut().zip(places.as_chunks().0.as_chunks().0) {
                let low = avx2._mm256_and_si256(cast::<[i32; LANES], _>(*low), in_voxel);
                let high = avx2._mm256_and_si256(cast::<[i32; LANES], _>(*high), in_voxel);
                *vector = avx2._mm256_packs_epi32(low, high);
            }
        }
        packed
    }

    #[inline(always)]
    fn pass(self, tile: &Packed, key: i32) -> TileSums {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let (key, none) = (avx._mm256_set1_epi32(key), avx._mm256_set1_epi32(LocalKey::NONE.0));
        let (zero, ones) = (avx._mm256_setzero_si256(), avx._mm256_set1_epi16(1));
        let [xs, ys, zs] = &tile.offsets;
        let (mut next, mut sums) = (none, [zero; 10]);
        for ((([low, high], x), y), z) in tile.keys.as_chunks().0.iter().zip(xs).zip(ys).zip(zs) {
            let equal = [avx2._mm256_cmpeq_epi32(*low, key), avx2._mm256_cmpeq_epi32(*high, key)];
            let is_here = avx2._mm256_packs_epi32(equal[0], equal[1]);
            let x_here = avx2._mm256_and_si256(*x, is_here);
            let y_here = avx2._mm256_and_si256(*y, is_here);
            let z_here = avx2._mm256_and_si256(*z, is_here);
            let factors = [
                (x_here, ones),
                (y_here, ones),
                (z_here, ones),
                (x_here, *x),
                (x_here, *y),
                (x_here, *z),
                (y_here, *y),
                (y_here, *z),
                (z_here, *z),
                // -1 times -1 for each point.
                (is_here, is_here),
            ];
            for (sum, (a, b)) in sums.iter_mut().zip(factors) {
                *sum = avx2._mm256_add_epi32(*sum, avx2._mm256_madd_epi16(a, b));
            }
            for keys in [low, high] {
                let later = avx2._mm256_blendv_epi8(none, *keys, avx2._mm256_cmpgt_epi32(*keys, key));
                next = avx2._mm256_min_epi32(next, later);
            }
        }
        let [x, y, z, xx, xy, xz, yy, yz, zz, count] = sums;
        let [x, y, z, xx, xy, xz, yy, yz] = self.each_added_up([x, y, z, xx, xy, xz, yy, yz]);
        let [zz, count, ..] = self.each_added_up([zz, count, zero, zero, zero, zero, zero, zero]);
        let mut least = LocalKey::NONE.0;
        for key in cast::<_, [i32; LANES]>(next) {
            least = least.min(key);
        }
        TileSums { count, sum: [x, y, z], squares: [xx, xy, xz, yy, yz, zz], next: LocalKey(least) }
    }
}

impl Avx2 {
    #[inline(always)]
    fn wide(self, numbers: [f32; DOUBLES]) -> __m256d {
        self.0.avx._mm256_cvtps_pd(cast(numbers))
    }

    /// The nearest whole numbers, those half way between two even; [`i32::MIN`] of what is none or too large.
    #[inline(always)]
    fn rounded(self, numbers: __m256d) -> [i32; DOUBLES] {
        cast(self.0.avx._mm256_cvtpd_epi32(numbers))
    }

    /// The sum of each vector's numbers.
    #[inline(always)]
    fn each_added_up(self, vectors: [__m256i; LANES]) -> [u32; LANES] {
        let avx2 = self.0.avx2;
        let [a, b, c, d, e, f, g, h] = vectors;
        let low = avx2._mm256_hadd_epi32(avx2._mm256_hadd_epi32(a, b), avx2._mm256_hadd_epi32(c, d));
        let high = avx2._mm256_hadd_epi32(avx2._mm256_hadd_epi32(e, f), avx2._mm256_hadd_epi32(g, h));
        // What is left of each are two, in the two halves of a vector.
        let first = avx2._mm256_permute2x128_si256::<0x20>(low, high);
        let second = avx2._mm256_permute2x128_si256::<0x31>(low, high);
        cast(avx2._mm256_add_epi32(first, second))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::engine::consistent::tile::Plain;

    /// As a tile tells one place from another.
    fn told(places: [i32; SIDE]) -> [Option<i32>; SIDE] {
        places.map(|place| (Local::key([place; 3]) != LocalKey::NONE).then_some(place))
    }

    fn eight<T: std::fmt::Debug>(of: impl Strategy<Value = T>) -> impl Strategy<Value = [T; SIDE]> {
        prop::collection::vec(of, SIDE).prop_map(|eight| eight.try_into().unwrap())
    }

    /// Any number in single precision, most of them where depths and coordinates are.
    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![4 => (-9.0..9.0_f64).prop_map(|number| number as f32), 1 => prop::num::f32::ANY]
    }

    proptest! {
        #[test]
        fn places_are_where_the_plain_ones_are(
            xs in eight(number()), ys in eight(number()), zs in eight(number()), columns in eight(-1e5..1e5_f64),
            units in prop::array::uniform3(-1e5..1e5_f64), row in -1e5..1e5_f64, origin in -1.0..4e6_f64,
        ) {
            let Some(lanes) = V3::try_new().map(Avx2) else { return Ok(()) };
            let pixels = [lanes.place_pixels(&zs, &columns, row, origin), Plain.place_pixels(&zs, &columns, row, origin)];
            prop_assert_eq!(told(pixels[0]), told(pixels[1]));
            let points = [&xs, &ys, &zs];
            let points = [lanes.place_points(points, units, origin), Plain.place_points(points, units, origin)];
            prop_assert_eq!(told(points[0]), told(points[1]));
        }

        #[test]
        fn a_pass_gives_what_the_plain_one_gives(
            keys in prop::collection::vec(prop_oneof![4 => 0..4_i32, 1 => Just(LocalKey::NONE.0), 1 => 0..1 << 30], TILE),
            places in prop::array::uniform3(prop::collection::vec(prop_oneof![Just(4095), 0..1 << 22], TILE)),
        ) {
            let Some(lanes) = V3::try_new().map(Avx2) else { return Ok(()) };
            let keys: Keys = keys.try_into().unwrap();
            let places: Places = places.map(|places| places.try_into().unwrap());
            let (tile, plain) = (lanes.tile(&keys, &places), Plain.tile(&keys, &places));
            for key in keys {
                prop_assert_eq!(lanes.pass(&tile, key), Plain.pass(&plain, key));
            }
        }
    }
}
