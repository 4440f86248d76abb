//! A tile: 64 points that lie near each other, put into their voxels together.
//!
//! One pass over the tile for each voxel in it: a point that is in that voxel is added, any other counts as nothing, so
//! that a pass has no branch and several points are done in one instruction. A tile of 8 x 8 pixels lies in 2 to 4 voxels of 8 cm.
//! Where there are more than [`PASSES`], the rest is added point by point.
//!
//! What takes most of the time is written once in plain Rust ([`Plain`]), of which the compiler makes vectors, and once for AVX2
//! (`avx2`).

use pulp::{Arch, NullaryFnOnce};

use super::local::{Local, LocalKey};
use super::sums::ScanSums;

#[cfg(target_arch = "x86_64")]
mod avx2;

/// Pixels along the edge of a tile of an image.
pub(super) const SIDE: usize = 8;
/// Points of a tile.
pub(super) const TILE: usize = SIDE * SIDE;
/// Most passes over one tile. Noise that each pixel has of its own spreads a tile over some 20 voxels: with AVX-512 as many passes
/// take less time than its points one by one, with AVX2 as long.
const PASSES: usize = 24;

/// Places of points by axis, as [`Local::place`] gives them.
pub(super) type Places = [[i32; TILE]; 3];

/// By point.
type Keys = [i32; TILE];

/// The arithmetic of a tile: several points at once.
pub(super) trait Lanes: Copy {
    /// The keys of a tile and the offsets of its places, as a pass reads them.
    type Tile<'a>;

    /// Places along one axis ([`Local::place`]) of pixels in a row: each depth times what its column and the row add to a unit of
    /// depth.
    fn place_pixels(self, depths: &[f32; SIDE], columns: &[f64; SIDE], row: f64, origin: f64) -> [i32; SIDE];

    /// The same of points, by what a metre along each axis of the sensor adds.
    fn place_points(self, points: [&[f32; SIDE]; 3], units: [f64; 3], origin: f64) -> [i32; SIDE];

    fn tile<'a>(self, keys: &'a Keys, places: &Places) -> Self::Tile<'a>;

    /// Adds up the points with this key.
    fn pass(self, tile: &Self::Tile<'_>, key: i32) -> TileSums;
}

/// Work on tiles.
pub(super) trait OnTiles {
    fn run(self, lanes: impl Lanes);
}

/// Does work on tiles in code for the processor at hand.
pub(super) fn dispatch(work: impl OnTiles) {
    #[cfg(target_arch = "x86_64")]
    if let Some(lanes) = avx2::Avx2::if_best() {
        return lanes.dispatch(Running(work, lanes));
    }
    Arch::new().dispatch(Running(work, Plain));
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TileSums {
    count: u32,
    sum: [u32; 3],
    squares: [u32; 6],
    /// The lowest key above that of the voxel.
    next: LocalKey,
}

impl TileSums {
    fn widened(&self) -> ScanSums {
        ScanSums { count: self.count, sum: self.sum.map(u64::from), squares: self.squares.map(u64::from) }
    }
}

/// Tells `sink` the sums of each voxel in the tile, of most voxels once; returns the number of points that are in none.
#[inline(always)]
pub(super) fn sum_by_voxel(lanes: impl Lanes, places: &Places, sink: &mut impl Sink) -> usize {
    let [xs, ys, zs] = places;
    let mut keys = [0; TILE];
    let (mut next, mut missing) = (i32::MAX, 0);
    for i in 0..TILE {
        let key = Local::key([xs[i], ys[i], zs[i]]).0;
        keys[i] = key;
        next = next.min(key);
        missing += u32::from(key == LocalKey::NONE.0);
    }
    let tile = lanes.tile(&keys, places);
    for _ in 0..PASSES {
        if next == LocalKey::NONE.0 {
            return missing as usize;
        }
        let sums = lanes.pass(&tile, next);
        sink.add(LocalKey(next), &sums.widened());
        next = sums.next.0;
    }
    one_by_one(&keys, places, next, sink);
    missing as usize
}

/// For any processor.
#[derive(Clone, Copy)]
struct Plain;

impl Lanes for Plain {
    type Tile<'a> = (&'a Keys, [[i32; TILE]; 3]);

    #[inline(always)]
    fn place_pixels(self, depths: &[f32; SIDE], columns: &[f64; SIDE], row: f64, origin: f64) -> [i32; SIDE] {
        let mut places = [0; SIDE];
        for i in 0..SIDE {
            places[i] = Local::place(f64::from(depths[i]) * (columns[i] + row), origin);
        }
        places
    }

    #[inline(always)]
    fn place_points(self, [xs, ys, zs]: [&[f32; SIDE]; 3], [a, b, c]: [f64; 3], origin: f64) -> [i32; SIDE] {
        let mut places = [0; SIDE];
        for i in 0..SIDE {
            let [x, y, z] = [xs[i], ys[i], zs[i]].map(f64::from);
            places[i] = Local::place(a * x + b * y + c * z, origin);
        }
        places
    }

    #[inline(always)]
    fn tile<'a>(self, keys: &'a Keys, places: &Places) -> Self::Tile<'a> {
        let mut offsets = [[0; TILE]; 3];
        for (offsets, places) in offsets.iter_mut().zip(places) {
            (0..TILE).for_each(|i| offsets[i] = Local::offset(places[i]));
        }
        (keys, offsets)
    }

    #[inline(always)]
    fn pass(self, (keys, [xs, ys, zs]): &Self::Tile<'_>, key: i32) -> TileSums {
        let mut next = i32::MAX;
        let mut count = 0;
        let (mut sum, mut squares) = ([0; 3], [0; 6]);
        for i in 0..TILE {
            let is_here = -i32::from(keys[i] == key);
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
            let later = if keys[i] > key { keys[i] } else { i32::MAX };
            next = next.min(later);
        }
        TileSums {
            count: count as u32,
            sum: sum.map(|sum: i32| sum as u32),
            squares: squares.map(|square: i32| square as u32),
            next: LocalKey(next),
        }
    }
}

/// Adds the points with this key or a higher one, each on its own.
#[cold]
fn one_by_one(keys: &Keys, [xs, ys, zs]: &Places, from: i32, sink: &mut impl Sink) {
    for i in (0..TILE).filter(|&i| keys[i] >= from && keys[i] != LocalKey::NONE.0) {
        let mut sums = ScanSums::default();
        sums.add([xs[i], ys[i], zs[i]].map(|place| Local::offset(place) as u64));
        sink.add(LocalKey(keys[i]), &sums);
    }
}
