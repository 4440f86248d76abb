//! A tile: 64 points that lie near each other, put into their voxels together.
//!
//! One pass over the tile for each voxel in it: a point that is in that voxel is added, any other counts as nothing, so
//! that a pass has no branch and several points are done in one instruction. A tile of 8 x 8 pixels lies in 2 to 4 voxels of 8 cm.
//! Where there are more than [`PASSES`], the rest is added point by point.

use super::local::{Local, LocalKey};
use super::sums::ScanSums;

/// Pixels along the edge of a tile of an image.
pub(super) const SIDE: usize = 8;
/// Points of a tile.
pub(super) const TILE: usize = SIDE * SIDE;
/// Most passes over one tile. Noise that each pixel has of its own spreads a tile over some 20 voxels: with AVX-512 as many passes
/// take less time than its points one by one, with AVX2 as long.
const PASSES: usize = 24;

/// Places of points by axis, as [`Local::place`] gives them.
pub(super) type Places = [[i32; TILE]; 3];

/// Sums of a tile's points in one voxel. 64 squares of 24 bits have 30.
struct TileSums {
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

/// Calls `add` with the sums of each voxel in the tile, for most voxels once; returns the number of points that are in
/// none.
#[inline(always)]
pub(super) fn sum_by_voxel(places: &Places, mut add: impl FnMut(LocalKey, &ScanSums)) -> usize {
    let [xs, ys, zs] = places;
    let (mut keys, mut offsets) = ([0; TILE], [[0; TILE]; 3]);
    let (mut next, mut missing) = (i32::MAX, 0);
    for i in 0..TILE {
        let key = Local::key([xs[i], ys[i], zs[i]]).0;
        keys[i] = key;
        next = next.min(key);
        missing += u32::from(key == LocalKey::NONE.0);
    }
    for (offsets, places) in offsets.iter_mut().zip(places) {
        (0..TILE).for_each(|i| offsets[i] = Local::offset(places[i]));
    }
    for _ in 0..PASSES {
        if next == LocalKey::NONE.0 {
            return missing as usize;
        }
        let sums = pass(&keys, &offsets, next);
        add(LocalKey(next), &sums.widened());
        next = sums.next.0;
    }
    one_by_one(&keys, &offsets, next, add);
    missing as usize
}

/// Adds up the points with this key.
#[inline(always)]
fn pass(keys: &[i32; TILE], offsets: &[[i32; TILE]; 3], key: i32) -> TileSums {
    let [xs, ys, zs] = offsets;
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

/// Adds the points with this key or a higher one, each on its own.
fn one_by_one(
    keys: &[i32; TILE],
    [xs, ys, zs]: &[[i32; TILE]; 3],
    from: i32,
    mut add: impl FnMut(LocalKey, &ScanSums),
) {
    for i in (0..TILE).filter(|&i| keys[i] >= from && keys[i] != LocalKey::NONE.0) {
        let mut sums = ScanSums::default();
        sums.add([xs[i], ys[i], zs[i]].map(|offset| offset as u64));
        add(LocalKey(keys[i]), &sums);
    }
}
