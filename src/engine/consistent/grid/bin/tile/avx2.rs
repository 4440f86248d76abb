//! The arithmetic of a tile for AVX2, with what a compiler does not find in the plain one: places stay in registers until they are
//! keys and offsets; an offset has 12 bits, so that 16 of them are multiplied at once and pairs of products added (`pmaddwd`);
//! eight sums are brought together in one tree; and a number that is none, or too large for 32 bits, is made a whole one below 0 by
//! the instruction that rounds it (`cvtpd2dq`), so that none needs to be kept within bounds before.

#![expect(clippy::needless_range_loop, reason = "several arrays have the same place")]

use std::arch::x86_64::__m256i;

use pulp::x86::V3;
use pulp::{cast, f64x4};

use super::{
    INFINITY, Lanes, Listed, LocalKey, Pixels, SensorRegion, TILE, Tile, TileSums, factors, of_depths,
    of_metres,
};
use crate::engine::consistent::grid::bin::region::{AXIS_BITS, UNIT_BITS};

/// Whole numbers of 32 bits in a vector.
const LANES: usize = 8;
/// Numbers in double precision in a vector.
const DOUBLES: usize = 4;
/// Vectors of keys, each of a row.
const ROWS: usize = TILE / LANES;
/// Rows in a word with a bit for each point.
const ROWS_OF_WORD: usize = 4;
const WORDS: usize = ROWS / ROWS_OF_WORD;
/// Vectors of 16 offsets.
const PAIRS: usize = ROWS / 2;

/// A processor with AVX2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2(pub(super) V3);

/// Keys row by row; the offsets of two rows at a time, in the order in which two vectors are packed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Packed {
    keys: [[i32; LANES]; ROWS],
    offsets: [[[i16; 2 * LANES]; PAIRS]; 3],
    /// One bit for each point that is still to be added up, in the order in which four rows are packed.
    left: [u32; WORDS],
    has_far: bool,
}

impl Packed {
    /// Row and lane of the key that has this bit.
    #[inline(always)]
    const fn place(word: usize, bit: u32) -> (usize, usize) {
        let (row, half, lane) = (bit >> 2 & 3, bit >> 4, bit & 3);
        (word * ROWS_OF_WORD + row as usize, (half * 4 + lane) as usize)
    }

    /// The offset of the point that has this bit.
    fn offset(&self, word: usize, bit: u32) -> [u64; 3] {
        let (pair, place) = (2 * word + (bit >> 3 & 1) as usize, ((bit >> 4) * 8 + (bit & 7)) as usize);
        [0, 1, 2].map(|axis| self.offsets[axis][pair][place] as u64)
    }
}

impl Tile for Packed {
    fn has_far(&self) -> bool {
        self.has_far
    }

    #[inline(always)]
    fn next(&self) -> Option<LocalKey> {
        let word = usize::from(self.left[0] == 0);
        let left = self.left[word];
        let (row, lane) = Self::place(word, left.trailing_zeros() % u32::BITS);
        (left != 0).then(|| LocalKey(self.keys[row][lane]))
    }

    fn each(&self, mut tell: impl FnMut(LocalKey, [u64; 3])) {
        for (word, left) in self.left.iter().enumerate() {
            for bit in (0..u32::BITS).filter(|bit| left >> bit & 1 == 1) {
                let (row, lane) = Self::place(word, bit);
                tell(LocalKey(self.keys[row][lane]), self.offset(word, bit));
            }
        }
    }
}

/// What a row of a tile is made of.
trait Row {
    /// The places of its points by axis, and which of them are points.
    fn places(&self, lanes: Avx2, region: &SensorRegion, row: usize) -> ([__m256i; 3], __m256i);
}

impl Row for Pixels<'_> {
    #[inline(always)]
    fn places(&self, lanes: Avx2, region: &SensorRegion, row: usize) -> ([__m256i; 3], __m256i) {
        let (avx, avx2) = (lanes.0.avx, lanes.0.avx2);
        let (depths, steps) = (self.depths[row], &self.rows[row]);
        // As bits depths above 0 have the order of what they stand for, and what is not a number lies above all.
        let bits: __m256i = cast(*depths);
        let is_above_0 = avx2._mm256_cmpgt_epi32(bits, avx._mm256_setzero_si256());
        let is_finite = avx2._mm256_cmpgt_epi32(avx._mm256_set1_epi32(INFINITY), bits);
        let depths = lanes.wide(depths);
        let mut places = [bits; 3];
        for axis in 0..3 {
            let columns: [f64x4; 2] = cast(*self.columns[axis]);
            let mut along = depths;
            for half in 0..2 {
                along[half] =
                    of_depths(lanes.0, depths[half], columns[half], steps[axis], region.origin[axis]);
            }
            places[axis] = lanes.rounded(along);
        }
        (places, avx2._mm256_and_si256(is_above_0, is_finite))
    }
}

impl Row for Listed {
    #[inline(always)]
    fn places(&self, lanes: Avx2, region: &SensorRegion, row: usize) -> ([__m256i; 3], __m256i) {
        let (avx, avx2) = (lanes.0.avx, lanes.0.avx2);
        let [xs, ys, zs] = self;
        let (x, y, z) = (&xs.as_chunks().0[row], &ys.as_chunks().0[row], &zs.as_chunks().0[row]);
        let size = avx2._mm256_and_si256(cast::<[f32; LANES], _>(*z), avx._mm256_set1_epi32(i32::MAX));
        let is_point = avx2._mm256_cmpgt_epi32(avx._mm256_set1_epi32(INFINITY), size);
        let (x, y, z) = (lanes.wide(x), lanes.wide(y), lanes.wide(z));
        let mut places = [size; 3];
        for axis in 0..3 {
            let mut along = x;
            for half in 0..2 {
                let metres = [x[half], y[half], z[half]];
                along[half] = of_metres(lanes.0, metres, region.units[axis], region.origin[axis]);
            }
            places[axis] = lanes.rounded(along);
        }
        (places, is_point)
    }
}

// Loops, for a closure that is handed to an array's method is not compiled for AVX2.
impl Lanes for Avx2 {
    type Tile = Packed;

    #[inline(always)]
    fn of_pixels(self, pixels: &Pixels<'_>, region: &SensorRegion) -> Packed {
        self.pack(pixels, region)
    }

    #[inline(always)]
    fn of_points(self, points: &Listed, region: &SensorRegion) -> Packed {
        self.pack(points, region)
    }

    #[inline(always)]
    fn pass(self, tile: &mut Packed, key: LocalKey) -> TileSums {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let key = avx._mm256_set1_epi32(key.0);
        let mut is_here = [key; PAIRS];
        for pair in 0..PAIRS {
            let low = avx2._mm256_cmpeq_epi32(cast(tile.keys[2 * pair]), key);
            let high = avx2._mm256_cmpeq_epi32(cast(tile.keys[2 * pair + 1]), key);
            is_here[pair] = avx2._mm256_packs_epi32(low, high);
        }
        let mut count = 0;
        for word in 0..WORDS {
            let here = self.bits([is_here[2 * word], is_here[2 * word + 1]]);
            tile.left[word] &= !here;
            count += here.count_ones();
        }
        self.sum(tile, &is_here, count)
    }
}

impl Avx2 {
    /// The sums of the points that are here.
    #[inline(always)]
    fn sum(self, tile: &Packed, is_here: &[__m256i; PAIRS], count: u32) -> TileSums {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let ones = avx._mm256_set1_epi16(1);
        let mut sums = [avx._mm256_setzero_si256(); 9];
        for pair in 0..PAIRS {
            let (mut all, mut here) = ([ones; 3], [ones; 3]);
            for axis in 0..3 {
                all[axis] = cast(tile.offsets[axis][pair]);
                here[axis] = avx2._mm256_and_si256(all[axis], is_here[pair]);
            }
            let factors = factors(ones, all, here);
            for (sum, (a, b)) in sums.iter_mut().zip(factors) {
                *sum = avx2._mm256_add_epi32(*sum, avx2._mm256_madd_epi16(a, b));
            }
        }
        let [x, y, z, xx, xy, xz, yy, yz, zz] = sums;
        let [x, y, z, xx, xy, xz, yy, yz] = self.each_added_up([x, y, z, xx, xy, xz, yy, yz]);
        let mut all = 0;
        for part in cast::<_, [u32; LANES]>(zz) {
            all += part;
        }
        TileSums { count, sum: [x, y, z], squares: [xx, xy, xz, yy, yz, all] }
    }

    #[inline(always)]
    fn pack(self, points: &impl Row, region: &SensorRegion) -> Packed {
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let zero = avx._mm256_setzero_si256();
        let (none, in_voxel) =
            (avx._mm256_set1_epi32(LocalKey::NONE.0), avx._mm256_set1_epi32(SensorRegion::offset(-1)));
        let mut keys = [[0; LANES]; ROWS];
        let mut offsets = [[[0; 2 * LANES]; PAIRS]; 3];
        let (mut left, mut far) = ([0; WORDS], zero);
        for word in 0..WORDS {
            let mut here = [zero; 2];
            for half in 0..2 {
                let pair = word * 2 + half;
                let mut of_pair = ([[zero; 3]; 2], [zero; 2]);
                for row in 0..2 {
                    let (places, is_point) = points.places(self, region, 2 * pair + row);
                    let (key, is_near) = self.key(places);
                    let is_here = avx2._mm256_and_si256(is_near, is_point);
                    far = avx2._mm256_or_si256(far, avx2._mm256_andnot_si256(is_near, is_point));
                    keys[2 * pair + row] = cast(avx2._mm256_blendv_epi8(none, key, is_here));
                    for axis in 0..3 {
                        of_pair.0[row][axis] = avx2._mm256_and_si256(places[axis], in_voxel);
                    }
                    of_pair.1[row] = is_here;
                }
                let (places, is_here) = of_pair;
                for axis in 0..3 {
                    offsets[axis][pair] = cast(avx2._mm256_packs_epi32(places[0][axis], places[1][axis]));
                }
                here[half] = avx2._mm256_packs_epi32(is_here[0], is_here[1]);
            }
            left[word] = self.bits(here);
        }
        Packed { keys, offsets, left, has_far: avx._mm256_testz_si256(far, far) == 0 }
    }

    /// The keys of places ([`SensorRegion::key`]), and which of these lie in the region.
    #[inline(always)]
    fn key(self, [x, y, z]: [__m256i; 3]) -> (__m256i, __m256i) {
        const UNITS: i32 = UNIT_BITS as i32;
        const Y: i32 = AXIS_BITS as i32;
        const Z: i32 = 2 * Y;
        const PLACE: i32 = UNITS + Y;
        let (avx, avx2) = (self.0.avx, self.0.avx2);
        let any = avx2._mm256_or_si256(avx2._mm256_or_si256(x, y), z);
        let is_near =
            avx2._mm256_cmpeq_epi32(avx2._mm256_srli_epi32::<PLACE>(any), avx._mm256_setzero_si256());
        let y = avx2._mm256_slli_epi32::<Y>(avx2._mm256_srli_epi32::<UNITS>(y));
        let z = avx2._mm256_slli_epi32::<Z>(avx2._mm256_srli_epi32::<UNITS>(z));
        let key = avx2._mm256_or_si256(avx2._mm256_or_si256(avx2._mm256_srli_epi32::<UNITS>(x), y), z);
        (key, is_near)
    }

    /// A bit for each number of 16 bits, which is 0 or -1, as they are packed.
    #[inline(always)]
    fn bits(self, [first, second]: [__m256i; 2]) -> u32 {
        let avx2 = self.0.avx2;
        avx2._mm256_movemask_epi8(avx2._mm256_packs_epi16(first, second)) as u32
    }

    #[inline(always)]
    fn wide(self, numbers: &[f32; LANES]) -> [f64x4; 2] {
        let [low, high]: [[f32; DOUBLES]; 2] = cast(*numbers);
        [cast(self.0.avx._mm256_cvtps_pd(cast(low))), cast(self.0.avx._mm256_cvtps_pd(cast(high)))]
    }

    /// The nearest whole numbers, those half way between two even; [`i32::MIN`] of what is none or too large.
    #[inline(always)]
    fn rounded(self, [low, high]: [f64x4; 2]) -> __m256i {
        let avx = self.0.avx;
        avx._mm256_set_m128i(avx._mm256_cvtpd_epi32(cast(high)), avx._mm256_cvtpd_epi32(cast(low)))
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
