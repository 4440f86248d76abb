//! What one scan proves to be empty.
//!
//! A [`RangeGrid`] keeps, for every direction from the sensor, the smallest depth that was measured there. A box is seen
//! through when all directions towards it were measured and end beyond it. What was not measured proves nothing, but where the
//! sensor's own rays are farther apart than directions are ([`spacing`]): there all those towards the box that were measured must
//! end beyond it, one of them next to its centre and the next ones beside that, and none may be farther from one that was than rays
//! are from each other there. What is thin must have a ray in the direction of its own centre, across what is thin of it.
//! [`RangeGrid::blocks_in_view`] names the blocks in which such voxels may lie, and [`super::Clearance`] says when one has been
//! seen through often enough to lose its points.
//!
//! **Kept true.** A box with a measured point in it, or nearer than `margin` behind its far side, is never seen through where it
//! is padded: a point may be counted in the cell beside its own. The result does not depend on the order of the points.
//!
//! **Why floors are safe.** A ray just above a floor voxel ends far behind it, but the floor within the voxel lies in the
//! voxel's own directions, and the floor before it in those just below: the smallest depth over all of them is not
//! beyond the voxel, however shallow the angle. Where rays are apart, the next one below ends on the floor before the voxel. So it
//! is at the edge of a table: the voxel that holds the last few millimetres has the table itself in the directions beside it, which
//! the padding of `clearing`'s boxes takes in.
//!
//! Any box can be looked at. With the cubes of voxels, what stood on a floor would stay up to 15 cm above it, as long as
//! it is seen from 1.5 m or more: the rays beside it end on the floor, too near behind the cubes to tell. `clearing`
//! therefore looks at where a voxel's points are.
//!
//! **Directions.** The sensor may look along any axis, or all round. So the directions lie on a cube around it: the axis
//! of the largest coordinate picks one of six faces, the two other coordinates divided by it a cell. Depth is that
//! largest coordinate: monotone along a ray, and without a root.
//!
//! **Cost.** Filling: one division and one write a point of a list, 2 to 3 ns; a tenth of that a pixel (`pixels`). A look
//! at a voxel: the cells that it covers, until the first that does not end beyond it; mostly one. Memory: 8 bytes a cell, 3
//! MB. After the first scans nothing is allocated.
//!
//! Units are metres, in the sensor's frame where nothing else is said.

use std::ops::Range;

use nalgebra::Point3;
use pulp::{Simd, WithSimd};

use super::body::Body;
use crate::engine::arch::arch;
use crate::engine::points::Points;
use silhouette::{Face, Silhouette};
use spacing::Gaps;

mod blocks;
mod pixels;
mod silhouette;
mod spacing;
#[cfg(test)]
mod tests;
#[cfg(test)]
#[cfg(feature = "sim")]
mod tests_on_scans;

/// Cells along the edge of a face.
///
/// A cell is 1/128 of the depth wide: 0.45 degrees, 4 x 4 of a Kinect's pixels. At 6 m it is as wide as a voxel of 5 cm, at
/// 1 m a voxel of 8 cm covers 10 x 10. Larger cells would blur what stands on a floor with the floor (3 cm
/// at 4 m); smaller ones hold too few points to say that a direction was measured.
const FACE_EDGE: usize = 1 << FACE_EDGE_BITS;
const FACE_EDGE_BITS: u32 = 8;
const FACE_CELLS: usize = FACE_EDGE * FACE_EDGE;
/// Cells along the edge of a tile, over which the farthest cell is kept for whole blocks.
const TILE_CELLS: usize = 8;
/// Tiles along the edge of a face.
const TILES: usize = FACE_EDGE / TILE_CELLS;
/// A cell with fewer than the mean number of points divided by this says nothing: most of it was not measured.
///
/// Directions at the corner of a face are up to 5.2 times denser or sparser than in its middle.
const SPARSE: u32 = 8;
/// Points whose cells are computed at once, so that the compiler can do several in one instruction.
const BATCH: usize = 256;

/// What was measured in a direction: how far the nearest point in it is, and how many there are.
#[derive(Clone, Copy, Debug)]
struct RangeCell {
    nearest: f32,
    count: u32,
}

const EMPTY: RangeCell = RangeCell { nearest: f32::INFINITY, count: 0 };

/// The smallest depth in each direction from the sensor, of one scan; reused for the next.
#[derive(Clone, Debug)]
pub(crate) struct RangeGrid {
    /// Six faces, row by row.
    cells: Vec<RangeCell>,
    /// Where the cells with points are: parts of rows, none in two of them. There may be cells without a point between.
    occupied: Vec<Range<usize>>,
    /// Six faces, row by row: the largest of the cells' smallest depths; 0 in a tile without points.
    tiles: Vec<f32>,
    /// Whether there are points on the face.
    faces: [bool; 6],
    /// Fewest points with which a cell says something.
    min_count: u32,
    /// How far apart neighbouring rays are.
    gaps: Gaps,
    /// Largest depth of a point, 0 without one; rays that end beyond what is mapped do not count.
    farthest: f32,
    line: pixels::Line,
}

impl RangeGrid {
    /// A grid without points.
    pub(crate) fn new() -> Self {
        Self {
            cells: vec![EMPTY; 6 * FACE_CELLS],
            occupied: Vec::new(),
            tiles: vec![0.0; 6 * TILES * TILES],
            faces: [false; 6],
            min_count: 1,
            gaps: Gaps::default(),
            farthest: 0.0,
            line: pixels::Line::default(),
        }
    }

    /// Takes in the points of a scan in place of those before.
    pub(crate) fn fill(&mut self, points: &Points) {
        self.clear();
        // What lies between a camera's pixels is known from its rays, of others from where their points are.
        let (measured, gaps) = match points {
            Points::F32(points) => (self.fill_list(points), None),
            Points::Ended { points, ends } => (self.fill_lists(points, ends), None),
            Points::F64(points) => {
                let points: Vec<_> = points.iter().map(|point| point.map(|c| c as f32)).collect();
                (self.fill_list(&points), None)
            }
            Points::Depths(depths) => self.fill_pixels(depths),
        };
        self.finish(measured);
        self.gaps = gaps.unwrap_or_else(|| self.gaps_of_list());
    }

    /// Takes in points, and where rays end beyond what is mapped; returns how many there are of both.
    fn fill_lists(&mut self, points: &[[f32; 3]], ends: &[[f32; 3]]) -> usize {
        let points = self.fill_list(points);
        let farthest = self.farthest;
        let ends = self.fill_list(ends);
        self.farthest = farthest;
        points + ends
    }

    /// Takes in points; returns how many.
    fn fill_list(&mut self, points: &[[f32; 3]]) -> usize {
        arch().dispatch(Filling { grid: self, points });
        points.len()
    }

    fn clear(&mut self) {
        for part in self.occupied.drain(..) {
            self.cells[part].fill(EMPTY);
        }
        self.tiles.fill(0.0);
        self.faces = [false; 6];
        self.farthest = 0.0;
    }

    #[inline(always)]
    fn fill_batch(&mut self, batch: &[[f32; 3]]) {
        let (mut cells, mut depths) = ([0_u32; BATCH], [0.0_f32; BATCH]);
        for ((cell, depth), &point) in cells.iter_mut().zip(&mut depths).zip(batch) {
            (*cell, *depth) = cell_and_depth(point);
        }
        self.farthest = farther(self.farthest, &depths);
        for (&index, &depth) in cells.iter().zip(&depths).take(batch.len()) {
            let index = index as usize;
            let cell = &mut self.cells[index];
            if cell.count == 0 {
                self.occupied.push(index..index + 1);
            }
            cell.nearest = cell.nearest.min(depth);
            cell.count += 1;
        }
    }

    fn finish(&mut self, points: usize) {
        let mut filled = 0;
        for part in &self.occupied {
            let (face, row, first) = split(part.start);
            let tiles = (face * TILES + row / TILE_CELLS) * TILES;
            let mut column = first;
            let mut rest = &self.cells[part.clone()];
            while !rest.is_empty() {
                let in_tile = (TILE_CELLS - column % TILE_CELLS).min(rest.len());
                let (cells, others) = rest.split_at(in_tile);
                let tile = &mut self.tiles[tiles + column / TILE_CELLS];
                for cell in cells.iter().filter(|cell| cell.count > 0) {
                    *tile = tile.max(cell.nearest);
                    self.faces[face] = true;
                    filled += 1;
                }
                (column, rest) = (column + in_tile, others);
            }
        }
        let mean = points / filled.max(1);
        self.min_count = (mean as u32 / SPARSE).max(1);
    }

    /// Whether a body was seen through. `margin` is how far beyond its far side a ray must end.
    pub(crate) fn sees_through(&self, body: &Body, margin: f64) -> bool {
        let Body { centre, half, is_thin } = body;
        let [x, y, z] = [centre.x, centre.y, centre.z].map(|coordinate| coordinate as f32);
        let (index, depth) = cell_and_depth([x, y, z]);
        let face = Face::new(index as usize / FACE_CELLS);
        let reach = (face.half_depth(half) + margin) as f32;
        let cell = self.cells[index as usize];
        // The cell of the centre decides for most boxes: it is they that are measured.
        if !self.may_end_beyond(cell, depth + reach) {
            return false;
        }
        let is_passed = |index| {
            self.is_next_to_ray(index, face.across().map(|axis| is_thin[axis]))
                && self.passes_on_both_sides(index, depth + reach)
        };
        if !self.gaps.is_none() && !is_passed(index as usize) {
            return false;
        }
        Face::all().all(|face| {
            Silhouette::new(face, centre, half, FACE_EDGE)
                .is_none_or(|cells| self.ends_beyond(face, &cells, margin))
        })
    }

    /// Largest depth of a point (m), 0 without one.
    pub(crate) const fn farthest(&self) -> f32 {
        self.farthest
    }

    /// Whether the direction of a point was measured and ends beyond it by `margin`, or lies between rays.
    pub(crate) fn ends_past(&self, point: &Point3<f64>, margin: f64) -> bool {
        let (index, depth) = cell_and_depth([point.x, point.y, point.z].map(|coordinate| coordinate as f32));
        self.may_end_beyond(self.cells[index as usize], depth + margin as f32)
    }

    /// Whether a cell does not speak against a box of which this is the largest depth.
    fn may_end_beyond(&self, cell: RangeCell, least: f32) -> bool {
        if cell.count >= self.min_count { cell.nearest > least } else { !self.gaps.is_none() }
    }

    /// Whether all cells of a silhouette were measured, or lie between such, and end beyond the box by `margin`.
    fn ends_beyond(&self, face: Face, silhouette: &Silhouette, margin: f64) -> bool {
        let least = (silhouette.far + margin) as f32;
        let all_end = silhouette.rows.clone().all(|row| {
            let start = (face.index() * FACE_EDGE + row) * FACE_EDGE;
            let cells = &self.cells[start + silhouette.columns.start..start + silhouette.columns.end];
            cells.iter().all(|cell| self.may_end_beyond(*cell, least))
        });
        all_end && (self.gaps.is_none() || self.lies_between_rays(face, silhouette))
    }
}

/// A list of points, in code for the processor at hand.
struct Filling<'a> {
    grid: &'a mut RangeGrid,
    points: &'a [[f32; 3]],
}

impl WithSimd for Filling<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.points.chunks(BATCH).for_each(|batch| self.grid.fill_batch(batch));
    }
}

/// The largest of these depths that are those of points, finite and above 0; as bits, of which a processor takes several at
/// once: they have the order of what they stand for, and those of all others, of what is below 0 too, are not less than
/// those of infinity.
#[inline(always)]
fn farther(than: f32, depths: &[f32]) -> f32 {
    let mut most = 0;
    for depth in depths {
        let bits = depth.to_bits();
        most = most.max(if bits < f32::INFINITY.to_bits() { bits } else { 0 });
    }
    than.max(f32::from_bits(most))
}

/// Face, row and column of a cell.
const fn split(index: usize) -> (usize, usize, usize) {
    (index / FACE_CELLS, index / FACE_EDGE % FACE_EDGE, index % FACE_EDGE)
}

/// The cell in which a point lies and its depth there.
///
/// Without a branch or a sum that is checked, so that several points are done at once. Rounding may put a point on a border into
/// the cell beside it, so boxes are padded.
#[inline(always)]
#[expect(clippy::needless_bitwise_bool, reason = "a lazy operator is a branch")]
fn cell_and_depth([x, y, z]: [f32; 3]) -> (u32, f32) {
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let along_x = (ax >= ay) & (ax >= az);
    let along_y = !along_x & (ay >= az);
    let largest = if along_x {
        x
    } else if along_y {
        y
    } else {
        z
    };
    let axis = if along_x {
        0
    } else if along_y {
        2
    } else {
        4
    };
    let column = if along_x { y } else { x };
    let row = if along_x | along_y { z } else { y };
    let depth = largest.abs();
    let face = axis | (largest.to_bits() >> 31);
    let inverse = 1.0 / depth;
    let cell =
        (face << FACE_EDGE_BITS | whole_cell(row * inverse)) << FACE_EDGE_BITS | whole_cell(column * inverse);
    (cell, depth)
}

/// The cell of a coordinate at depth 1, which is in -1 ..= 1.
#[inline(always)]
fn whole_cell(tangent: f32) -> u32 {
    /// Floats from here to twice this are the whole numbers, and their last bits are those numbers.
    const WHOLE: f32 = 8_388_608.0;
    const HALF: f32 = 0.5 * FACE_EDGE as f32;
    // Half a cell less, as the addition rounds to the nearest; a point at the sensor, 0 / 0, goes to the first cell.
    let cell = (tangent * HALF + (HALF - 0.5)).max(0.0).min(FACE_EDGE as f32 - 1.0);
    (cell + WHOLE).to_bits() & (FACE_EDGE as u32 - 1)
}
