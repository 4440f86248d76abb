//! The arithmetic of a tile for AVX-512: as for AVX2 (`avx2`), with two rows in a vector of keys and four in one of offsets, and a
//! bit instead of a number for what is here. On the cabinet recording a scan is put into its voxels in two thirds of the time.

#![expect(clippy::needless_range_loop, reason = "several arrays have the same place")]

use std::arch::x86_64::{__m256i, __m512i};

use pulp::x86::V4;
use pulp::{cast, f64x8};

use super::{
    INFINITY, Lanes, Listed, LocalKey, Pixels, SIDE, SensorRegion, TILE, Tile, TileSums, factors, of_depths,
    of_metres,
};
use crate::engine::consistent::grid::bin::region::{AXIS_BITS, UNIT_BITS};

/// Whole numbers of 32 bits in a vector.
const LANES: usize = 16;
/// Vectors of keys, each of two rows.
const PAIRS: usize = TILE / LANES;
/// Vectors of offsets, each of two pairs.
const HALVES: usize = PAIRS / 2;
/// Bits of an offset in a lane, which holds one of each pair.
const OFFSET: u32 = 16;
/// Those of the first pair.
const BELOW: i32 = (1 << OFFSET) - 1;

/// A processor with AVX-512 as servers have had it since Skylake.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx512(pub(super) V4);

/// Keys two rows at a time; offsets four, those of the first two in the lower half of each lane.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(super) struct Packed {
    keys: [[i32; LANES]; PAIRS],
    offsets: [[[i32; LANES]; HALVES]; 3],
    /// One bit for each point that is still to be added up, in their order.
    left: u64,
    has_far: bool,
}

impl Tile for Packed {
    fn has_far(&self) -> bool {
        self.has_far
    }

    #[inline(always)]
    fn next(&self) -> Option<LocalKey> {
        let place = self.left.trailing_zeros() as usize % TILE;
        (self.left != 0).then(|| LocalKey(self.keys.as_flattened()[place]))
    }

    fn each(&self, mut tell: impl FnMut(LocalKey, [u64; 3])) {
        for point in (0..TILE).filter(|point| self.left >> point & 1 == 1) {
            let (pair, lane) = (point / LANES, point % LANES);
            let shift = OFFSET * (pair % 2) as u32;
            let offset = |axis: usize| self.offsets[axis][pair / 2][lane] >> shift & BELOW;
            tell(LocalKey(self.keys[pair][lane]), [0, 1, 2].map(|axis| offset(axis) as u64));
        }
    }
}

/// What a pair of rows is made of.
trait Pair {
    /// The places of its points by axis, and which of them are points.
    fn places(&self, lanes: Avx512, region: &SensorRegion, pair: usize) -> ([__m512i; 3], u16);
}

impl Pair for Pixels<'_> {
    #[inline(always)]
    fn places(&self, lanes: Avx512, region: &SensorRegion, pair: usize) -> ([__m512i; 3], u16) {
        let avx = lanes.0.avx512f;
        let rows = [self.depths[2 * pair], self.depths[2 * pair + 1]];
        // As bits depths above 0 have the order of what they stand for, and what is not a number lies above all.
        let bits = lanes.joined([cast(*rows[0]), cast(*rows[1])]);
        let is_above_0 = avx._mm512_cmpgt_epi32_mask(bits, avx._mm512_setzero_si512());
        let is_point = avx._mm512_mask_cmpgt_epi32_mask(is_above_0, avx._mm512_set1_epi32(INFINITY), bits);
        let depths = [lanes.wide(rows[0]), lanes.wide(rows[1])];
        let mut places = [bits; 3];
        for axis in 0..3 {
            let columns: f64x8 = cast(*self.columns[axis]);
            let mut along = depths;
            for row in 0..2 {
                let step = self.rows[2 * pair + row][axis];
                along[row] = of_depths(lanes.0, depths[row], columns, step, region.origin[axis]);
            }
            places[axis] = lanes.rounded(along);
        }
        (places, is_point)
    }
}

impl Pair for Listed {
    #[inline(always)]
    fn places(&self, lanes: Avx512, region: &SensorRegion, pair: usize) -> ([__m512i; 3], u16) {
        let avx = lanes.0.avx512f;
        let of = |axis: usize, row: usize| &self[axis].as_chunks::<SIDE>().0[2 * pair + row];
        let zs = [cast(*of(2, 0)), cast(*of(2, 1))];
        let size = avx._mm512_and_si512(lanes.joined(zs), avx._mm512_set1_epi32(i32::MAX));
        let is_point = avx._mm512_cmpgt_epi32_mask(avx._mm512_set1_epi32(INFINITY), size);
        let mut metres = [[lanes.wide(of(2, 0)); 3]; 2];
        for row in 0..2 {
            for axis in 0..3 {
                metres[row][axis] = lanes.wide(of(axis, row));
            }
        }
        let mut places = [size; 3];
        for axis in 0..3 {
            let mut along = [metres[0][axis]; 2];
            for row in 0..2 {
                along[row] = of_metres(lanes.0, metres[row], region.units[axis], region.origin[axis]);
            }
            places[axis] = lanes.rounded(along);
        }
        (places, is_point)
    }
}

impl Lanes for Avx512 {
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
        let avx = self.0.avx512f;
        let key = avx._mm512_set1_epi32(key.0);
        let (below, above) = (avx._mm512_set1_epi32(BELOW), avx._mm512_set1_epi32(!BELOW));
        let mut is_here = [key; HALVES];
        let mut here = 0;
        for half in 0..HALVES {
            let low = avx._mm512_cmpeq_epi32_mask(cast(tile.keys[2 * half]), key);
            let high = avx._mm512_cmpeq_epi32_mask(cast(tile.keys[2 * half + 1]), key);
            here |= (u64::from(low) | u64::from(high) << LANES) << (2 * LANES * half);
            let first = avx._mm512_maskz_mov_epi32(low, below);
            is_here[half] = avx._mm512_mask_or_epi32(first, high, first, above);
        }
        tile.left &= !here;
        self.sum(tile, &is_here, here.count_ones())
    }
}

impl Avx512 {
    /// The sums of the points that are here.
    #[inline(always)]
    fn sum(self, tile: &Packed, is_here: &[__m512i; HALVES], count: u32) -> TileSums {
        let (avx, words) = (self.0.avx512f, self.0.avx512bw);
        let ones = avx._mm512_set1_epi16(1);
        let mut sums = [avx._mm512_setzero_si512(); 9];
        for half in 0..HALVES {
            let (mut all, mut here) = ([ones; 3], [ones; 3]);
            for axis in 0..3 {
                all[axis] = cast(tile.offsets[axis][half]);
                here[axis] = avx._mm512_and_si512(all[axis], is_here[half]);
            }
            let factors = factors(ones, all, here);
            for (sum, (a, b)) in sums.iter_mut().zip(factors) {
                *sum = avx._mm512_add_epi32(*sum, words._mm512_madd_epi16(a, b));
            }
        }
        let [x, y, z, xx, xy, xz, yy, yz, zz] = sums;
        let [x, y, z, xx, xy, xz, yy, yz] = self.each_added_up(&[x, y, z, xx, xy, xz, yy, yz]);
        let halved = self
            .0
            .avx2
            ._mm256_add_epi32(avx._mm512_castsi512_si256(zz), avx._mm512_extracti64x4_epi64::<1>(zz));
        let mut all = 0;
        for part in cast::<_, [u32; 8]>(halved) {
            all += part;
        }
        TileSums { count, sum: [x, y, z], squares: [xx, xy, xz, yy, yz, all] }
    }

    #[inline(always)]
    fn pack(self, points: &impl Pair, region: &SensorRegion) -> Packed {
        /// Each bit of the second where the first has one, and of the third elsewhere.
        const WHERE: i32 = 0xca;
        let avx = self.0.avx512f;
        let none = avx._mm512_set1_epi32(LocalKey::NONE.0);
        let in_voxel = avx._mm512_set1_epi32(SensorRegion::offset(-1) << OFFSET | SensorRegion::offset(-1));
        let below = avx._mm512_set1_epi32(BELOW);
        let mut keys = [[0; LANES]; PAIRS];
        let mut offsets = [[[0; LANES]; HALVES]; 3];
        let (mut left, mut far) = (0, 0);
        for half in 0..HALVES {
            let mut of_half = [[none; 3]; 2];
            for side in 0..2 {
                let pair = 2 * half + side;
                let (places, is_point) = points.places(self, region, pair);
                let (key, is_near) = self.key(places);
                let is_here = is_near & is_point;
                far |= !is_near & is_point;
                left |= u64::from(is_here) << (LANES * pair);
                keys[pair] = cast(avx._mm512_mask_blend_epi32(is_here, none, key));
                of_half[side] = places;
            }
            for axis in 0..3 {
                let above = avx._mm512_slli_epi32::<OFFSET>(of_half[1][axis]);
                let both = avx._mm512_ternarylogic_epi32::<WHERE>(below, of_half[0][axis], above);
                offsets[axis][half] = cast(avx._mm512_and_si512(both, in_voxel));
            }
        }
        Packed { keys, offsets, left, has_far: far != 0 }
    }

    /// The keys of places ([`SensorRegion::key`]), and which of these lie in the region.
    #[inline(always)]
    fn key(self, [x, y, z]: [__m512i; 3]) -> (__m512i, u16) {
        const UNITS: u32 = UNIT_BITS;
        const Y: u32 = AXIS_BITS;
        const Z: u32 = 2 * Y;
        const BEYOND: i32 = !0 << (UNITS + Y);
        let avx = self.0.avx512f;
        let any = avx._mm512_or_si512(avx._mm512_or_si512(x, y), z);
        let is_near = avx._mm512_testn_epi32_mask(any, avx._mm512_set1_epi32(BEYOND));
        let y = avx._mm512_slli_epi32::<Y>(avx._mm512_srli_epi32::<UNITS>(y));
        let z = avx._mm512_slli_epi32::<Z>(avx._mm512_srli_epi32::<UNITS>(z));
        let key = avx._mm512_or_si512(avx._mm512_or_si512(avx._mm512_srli_epi32::<UNITS>(x), y), z);
        (key, is_near)
    }

    /// Both in one.
    #[inline(always)]
    fn joined(self, [low, high]: [__m256i; 2]) -> __m512i {
        let avx = self.0.avx512f;
        avx._mm512_inserti64x4::<1>(avx._mm512_castsi256_si512(low), high)
    }

    #[inline(always)]
    fn wide(self, numbers: &[f32; SIDE]) -> f64x8 {
        cast(self.0.avx512f._mm512_cvtps_pd(cast(*numbers)))
    }

    /// The nearest whole numbers, those half way between two even; [`i32::MIN`] of what is none or too large.
    #[inline(always)]
    fn rounded(self, [low, high]: [f64x8; 2]) -> __m512i {
        let avx = self.0.avx512f;
        self.joined([avx._mm512_cvtpd_epi32(cast(low)), avx._mm512_cvtpd_epi32(cast(high))])
    }

    /// The sum of each vector's numbers.
    #[inline(always)]
    fn each_added_up(self, vectors: &[__m512i; 8]) -> [u32; 8] {
        let avx = self.0.avx512f;
        let &[a, b, c, d, e, f, g, h] = vectors;
        let low = self.in_fours(self.in_twos(a, b), self.in_twos(c, d));
        let high = self.in_fours(self.in_twos(e, f), self.in_twos(g, h));
        let eight = avx._mm512_add_epi32(
            avx._mm512_shuffle_i32x4::<0b01_00_01_00>(low, high),
            avx._mm512_shuffle_i32x4::<0b11_10_11_10>(low, high),
        );
        let sums = avx._mm512_add_epi32(eight, avx._mm512_shuffle_i32x4::<0b10_11_00_01>(eight, eight));
        let [x, y, z, xx, _, _, _, _, xy, xz, yy, yz, ..] = cast::<_, [u32; 16]>(sums);
        [x, y, z, xx, xy, xz, yy, yz]
    }

    /// Two parts of each sum side by side in every quarter.
    #[inline(always)]
    fn in_twos(self, a: __m512i, b: __m512i) -> __m512i {
        let avx = self.0.avx512f;
        avx._mm512_add_epi32(avx._mm512_unpacklo_epi32(a, b), avx._mm512_unpackhi_epi32(a, b))
    }

    /// What is left of four sums in every quarter.
    #[inline(always)]
    fn in_fours(self, a: __m512i, b: __m512i) -> __m512i {
        let avx = self.0.avx512f;
        avx._mm512_add_epi32(avx._mm512_unpacklo_epi64(a, b), avx._mm512_unpackhi_epi64(a, b))
    }
}
