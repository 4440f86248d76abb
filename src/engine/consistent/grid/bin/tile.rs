//! A tile: 64 points that lie near each other, put into their voxels together.
//!
//! One pass over the tile for each voxel in it: a point that is in that voxel is added, any other counts as nothing, so
//! that a pass has no branch and several points are done in one instruction. A tile of 8 x 8 pixels lies in 2 to 4 voxels of 8 cm.
//! Where there are more than [`PASSES`], the rest is added point by point.
//!
//! What takes most of the time is written in plain Rust ([`Plain`]), of which the compiler makes vectors, and for AVX2 and AVX-512
//! (`avx2`, `avx512`).

use pulp::NullaryFnOnce;
#[cfg(target_arch = "x86_64")]
use pulp::{Arch, Simd};

use super::region::{LocalKey, SensorRegion};
use crate::engine::arch::arch;
use crate::engine::consistent::sums::ScanSums;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

/// Pixels along the edge of a tile of an image.
pub(super) const SIDE: usize = 8;
/// Points of a tile.
pub(super) const TILE: usize = SIDE * SIDE;
/// Most passes over one tile. Noise that each pixel has of its own spreads a tile over some 20 voxels: as many passes take as long
/// as its points one by one.
const PASSES: usize = 24;

/// The pixels of a tile. What measured none is 0 or less, or not finite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixels<'a> {
    /// By row.
    pub(super) depths: [&'a [f32; SIDE]; SIDE],
    /// By axis what each column adds to a unit of depth.
    pub(super) columns: [&'a [f64; SIDE]; 3],
    /// What each row adds to it, by axis.
    pub(super) rows: &'a [[f64; 3]; SIDE],
}

/// Points by axis, in the sensor's frame. Those that are none have a z that is not finite.
pub(super) type Listed = [[f32; TILE]; 3];

/// The arithmetic of a tile: several points at once.
pub(super) trait Lanes: Copy {
    /// Points of which some are still to be added up.
    type Tile: Tile;

    /// The tile of pixels: each place along one axis ([`SensorRegion::place`]) is the depth times what column and row add.
    fn of_pixels(self, pixels: &Pixels<'_>, region: &SensorRegion) -> Self::Tile;

    /// The tile of listed points: each place along one axis is what their metres along each axis of the sensor add.
    fn of_points(self, points: &Listed, region: &SensorRegion) -> Self::Tile;

    /// Adds up the points with this key, and leaves them out from then on.
    fn pass(self, tile: &mut Self::Tile, key: LocalKey) -> TileSums;
}

pub(super) trait Tile {
    /// Whether there are points beyond the region.
    fn has_far(&self) -> bool;

    /// The key of a point that is still to be added up.
    fn next(&self) -> Option<LocalKey>;

    /// Tells all these points, each with its offset.
    fn each(&self, tell: impl FnMut(LocalKey, [u64; 3]));
}

/// Work on tiles.
pub(super) trait OnTiles {
    fn run(self, lanes: impl Lanes);
}

/// Does work on tiles in code for the processor at hand.
pub(super) fn dispatch(work: impl OnTiles) {
    match arch() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => simd.vectorize(Running(work, avx512::Avx512(simd))),
        #[cfg(target_arch = "x86_64")]
        Arch::V3(simd) => simd.vectorize(Running(work, avx2::Avx2(simd))),
        other => other.dispatch(Running(work, Plain)),
    }
}

struct Running<W, L>(W, L);

impl<W: OnTiles, L: Lanes> NullaryFnOnce for Running<W, L> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.0.run(self.1);
    }
}

/// What is told what a tile has put into its voxels.
pub(super) trait Sink {
    fn add(&mut self, key: LocalKey, sums: &ScanSums);
}

/// Sums of a tile's points in one voxel. 64 squares of 24 bits have 30.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct TileSums {
    count: u32,
    sum: [u32; 3],
    squares: [u32; 6],
}

impl TileSums {
    #[inline(always)]
    fn widened(&self) -> ScanSums {
        ScanSums { count: self.count, sum: self.sum.map(u64::from), squares: self.squares.map(u64::from) }
    }
}

/// What is not less than these bits is no finite number in single precision above 0.
#[cfg(target_arch = "x86_64")]
const INFINITY: i32 = f32::INFINITY.to_bits() as i32;

/// Places of pixels along one axis ([`Lanes::of_pixels`]), before they are rounded.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn of_depths<S: Simd>(simd: S, depths: S::f64s, columns: S::f64s, row: f64, origin: f64) -> S::f64s {
    let directions = simd.add_f64s(columns, simd.splat_f64s(row));
    simd.add_f64s(simd.mul_f64s(depths, directions), simd.splat_f64s(origin))
}

/// Places of listed points along one axis ([`Lanes::of_points`]), before they are rounded.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn of_metres<S: Simd>(simd: S, [x, y, z]: [S::f64s; 3], units: [f64; 3], origin: f64) -> S::f64s {
    let [a, b, c] = [simd.splat_f64s(units[0]), simd.splat_f64s(units[1]), simd.splat_f64s(units[2])];
    let from_sensor = simd.add_f64s(simd.mul_f64s(a, x), simd.mul_f64s(b, y));
    simd.add_f64s(simd.add_f64s(from_sensor, simd.mul_f64s(c, z)), simd.splat_f64s(origin))
}

/// Of what the nine sums are products, with the offsets of all points and of those that are here by axis: x, y, z, xx, xy, xz, yy, yz
/// and zz.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
const fn factors<V: Copy>(one: V, [x, y, z]: [V; 3], [x_here, y_here, z_here]: [V; 3]) -> [(V, V); 9] {
    [
        (x_here, one),
        (y_here, one),
        (z_here, one),
        (x_here, x),
        (x_here, y),
        (x_here, z),
        (y_here, y),
        (y_here, z),
        (z_here, z),
    ]
}

/// Tells `sink` the sums of each voxel in the tile, of most voxels once.
#[inline(always)]
pub(super) fn sum_by_voxel<L: Lanes>(lanes: L, tile: &mut L::Tile, sink: &mut impl Sink) {
    for _ in 0..PASSES {
        let Some(key) = tile.next() else { return };
        sink.add(key, &lanes.pass(tile, key).widened());
    }
    one_by_one(tile, sink);
}

#[cold]
fn one_by_one(tile: &impl Tile, sink: &mut impl Sink) {
    tile.each(|key, offset| {
        let mut sums = ScanSums::default();
        sums.add(offset);
        sink.add(key, &sums);
    });
}

/// For any processor.
#[derive(Clone, Copy)]
pub(super) struct Plain;

/// By point, in order.
pub(super) struct PlainTile {
    keys: [i32; TILE],
    offsets: [[i32; TILE]; 3],
    /// Points beyond the region, a bit for each.
    far: u64,
    /// The lowest key that is still to come.
    next: i32,
}

impl PlainTile {
    /// `is_point` says which places are those of points.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
    fn new(places: &[[i32; TILE]; 3], is_point: impl Fn(usize) -> bool) -> Self {
        let [xs, ys, zs] = places;
        let mut tile = Self { keys: [0; TILE], offsets: [[0; TILE]; 3], far: 0, next: LocalKey::NONE.0 };
        for i in 0..TILE {
            let key = SensorRegion::key([xs[i], ys[i], zs[i]]);
            tile.keys[i] = if is_point(i) { key.0 } else { LocalKey::NONE.0 };
            tile.next = tile.next.min(tile.keys[i]);
            tile.far |= u64::from(is_point(i) & (key == LocalKey::NONE)) << i;
        }
        for (offsets, places) in tile.offsets.iter_mut().zip(places) {
            (0..TILE).for_each(|i| offsets[i] = SensorRegion::offset(places[i]));
        }
        tile
    }

    /// Whether a point lies beyond the region.
    pub(super) fn is_far(&self, point: usize) -> bool {
        self.far >> point & 1 == 1
    }
}

impl Tile for PlainTile {
    fn has_far(&self) -> bool {
        self.far != 0
    }

    #[inline(always)]
    fn next(&self) -> Option<LocalKey> {
        Some(LocalKey(self.next)).filter(|next| *next != LocalKey::NONE)
    }

    fn each(&self, mut tell: impl FnMut(LocalKey, [u64; 3])) {
        for i in (0..TILE).filter(|&i| self.keys[i] >= self.next && self.keys[i] != LocalKey::NONE.0) {
            tell(LocalKey(self.keys[i]), [0, 1, 2].map(|axis| self.offsets[axis][i] as u64));
        }
    }
}

impl Lanes for Plain {
    type Tile = PlainTile;

    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
    fn of_pixels(self, pixels: &Pixels<'_>, region: &SensorRegion) -> PlainTile {
        let mut places = [[0; TILE]; 3];
        for (axis, places) in places.iter_mut().enumerate() {
            let (columns, origin) = (pixels.columns[axis], region.origin[axis]);
            for (v, depths) in pixels.depths.iter().enumerate() {
                let row = pixels.rows[v][axis];
                for u in 0..SIDE {
                    places[v * SIDE + u] =
                        SensorRegion::place(f64::from(depths[u]) * (columns[u] + row), origin);
                }
            }
        }
        PlainTile::new(&places, |i| {
            let depth = pixels.depths[i / SIDE][i % SIDE];
            (depth > 0.0) & (depth < f32::INFINITY)
        })
    }

    #[inline(always)]
    fn of_points(self, points: &Listed, region: &SensorRegion) -> PlainTile {
        let [xs, ys, zs] = points;
        let mut places = [[0; TILE]; 3];
        for (axis, places) in places.iter_mut().enumerate() {
            let ([a, b, c], origin) = (region.units[axis], region.origin[axis]);
            for i in 0..TILE {
                let [x, y, z] = [xs[i], ys[i], zs[i]].map(f64::from);
                places[i] = SensorRegion::place(a * x + b * y + c * z, origin);
            }
        }
        PlainTile::new(&places, |i| zs[i].abs() < f32::INFINITY)
    }

    #[inline(always)]
    fn pass(self, tile: &mut PlainTile, key: LocalKey) -> TileSums {
        let ([xs, ys, zs], LocalKey(key)) = (&tile.offsets, key);
        let mut next = LocalKey::NONE.0;
        let mut count = 0;
        let (mut sum, mut squares) = ([0; 3], [0; 6]);
        for i in 0..TILE {
            let is_here = -i32::from(tile.keys[i] == key);
            let (x, y, z) = (xs[i] & is_here, ys[i] & is_here, zs[i] & is_here);
            count -= is_here;
            sum[0] += x;
            sum[1] += y;
            sum[2] += z;
            squares[0] += x * xs[i];
            squares[1] += x * ys[i];
            squares[2] += x * zs[i];
            squares[3] += y * ys[i];
            squares[4] += y * zs[i];
            squares[5] += z * zs[i];
            let later = if tile.keys[i] > key { tile.keys[i] } else { LocalKey::NONE.0 };
            next = next.min(later);
        }
        tile.next = next;
        TileSums {
            count: count as u32,
            sum: sum.map(|sum: i32| sum as u32),
            squares: squares.map(|square: i32| square as u32),
        }
    }
}

#[cfg(test)]
mod tests;
