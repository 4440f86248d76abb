//! The pixels of a camera into the directions: those of a row go into one row of cells, those of a column into one column.
//!
//! So what is nearest is found down the columns first, several of them in one instruction, and along a row of cells once.

use pulp::{Simd, WithSimd};

use super::spacing::Gaps;
use super::{FACE_EDGE, RangeCell, RangeGrid, cell_and_depth, farther};
use crate::engine::arch::arch;
use crate::engine::points::{Depths, Rays};

/// What the rows of pixels in one row of cells have so far, by column of pixels; its memory stays for the next scan.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    /// Smallest depths, as bits, which above 0 have the order of what they stand for: what is chosen by a comparison of floating
    /// point is compiled to a store that leaves out lanes, and takes as long as thirty others on some processors.
    nearest: Vec<u32>,
    count: Vec<u32>,
    /// The first column of cells with pixels, and the number of pixels in it and in each one after it.
    first: usize,
    columns: Vec<usize>,
}

/// In place of the depth of a pixel that measured none.
const FARTHER: u32 = f32::INFINITY.to_bits();

impl RangeGrid {
    /// Takes in a camera's pixels, those as well that are too far away to be points; returns how many were measured, and the gaps
    /// between its rays where all look through one face.
    pub(super) fn fill_pixels(&mut self, depths: &Depths) -> (usize, Option<Gaps>) {
        if is_ahead(depths.rays()) {
            let mut line = std::mem::take(&mut self.line);
            line.begin(&depths.rays().x);
            let measured = arch().dispatch(Filling { grid: self, line: &mut line, depths });
            self.line = line;
            (measured as usize, Some(Gaps::of_rays(depths.rays())))
        } else {
            (self.fill_lists(&depths.list(), &depths.ends()), None)
        }
    }

    /// Puts a line into the row of cells that begins at `row`, and empties it; returns how many pixels it held.
    #[inline(always)]
    fn put(&mut self, line: &mut Line, row: usize) -> u32 {
        let part = row + line.first..row + line.first + line.columns.len();
        let mut pixels = line.nearest.iter().zip(&line.count);
        let mut all = 0;
        for (cell, &width) in self.cells[part.clone()].iter_mut().zip(&line.columns) {
            let (mut nearest, mut count) = (FARTHER, 0);
            for (&depth, &measured) in pixels.by_ref().take(width) {
                nearest = depth.min(nearest);
                count += measured;
            }
            *cell = RangeCell { nearest: f32::from_bits(nearest), count };
            all += count;
        }
        self.occupied.push(part);
        line.nearest.fill(FARTHER);
        line.count.fill(0);
        all
    }
}

impl Line {
    fn begin(&mut self, rays: &[f32]) {
        self.nearest.clear();
        self.nearest.resize(rays.len(), FARTHER);
        self.count.clear();
        self.count.resize(rays.len(), 0);
        self.columns.clear();
        for &x in rays {
            let column = column_of(x);
            if self.columns.is_empty() {
                self.first = column;
            }
            self.columns.resize(column - self.first + 1, 0);
            self.columns[column - self.first] += 1;
        }
    }

    #[inline(always)]
    fn take(&mut self, row: &[f32]) {
        for ((nearest, count), depth) in self.nearest.iter_mut().zip(&mut self.count).zip(row) {
            let depth = if *depth == 0.0 { FARTHER } else { depth.abs().to_bits() };
            *nearest = depth.min(*nearest);
            *count += u32::from(depth < FARTHER);
        }
    }
}

/// All rows of an image, in code for the processor at hand.
struct Filling<'a> {
    grid: &'a mut RangeGrid,
    line: &'a mut Line,
    depths: &'a Depths,
}

impl WithSimd for Filling<'_> {
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> u32 {
        let rows = self.depths.rows().zip(&self.depths.rays().y);
        let mut rows = rows.map(|(row, &y)| (row, row_of(y))).peekable();
        let mut measured = 0;
        while let Some((row, cells)) = rows.next() {
            self.grid.farthest = farther(self.grid.farthest, row);
            self.line.take(row);
            if rows.peek().is_none_or(|(_, next)| *next != cells) {
                measured += self.grid.put(self.line, cells);
            }
        }
        measured
    }
}

/// Whether all pixels look through the face ahead, one after the other to the right and down.
fn is_ahead(rays: &Rays) -> bool {
    [&rays.x, &rays.y].into_iter().all(|rays| rays.is_sorted() && rays.iter().all(|ray| ray.abs() < 1.0))
}

/// The column of cells ahead in which this x / z is.
fn column_of(x: f32) -> usize {
    cell_and_depth([x, 0.0, 1.0]).0 as usize % FACE_EDGE
}

/// Where the row of cells ahead begins in which this y / z is.
fn row_of(y: f32) -> usize {
    let cell = cell_and_depth([0.0, y, 1.0]).0 as usize;
    cell - cell % FACE_EDGE
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::engine::binning::between;
    use crate::engine::points::Points;

    /// The occupied cells, each with what it holds.
    fn cells(grid: &RangeGrid) -> Vec<(usize, u32, u32)> {
        let occupied = (0..).zip(&grid.cells).filter(|(_, cell)| cell.count > 0);
        occupied.map(|(index, cell)| (index, cell.nearest.to_bits(), cell.count)).collect()
    }

    proptest! {
        /// Rays in the middle between the borders of cells, so that rounding moves no point into the cell beside.
        #[test]
        fn pixels_fill_the_cells_that_their_points_fill(
            width in 1..30_usize, scale in 1..9_usize,
            depths in prop::collection::vec(
                prop_oneof![1 => Just(f32::INFINITY), 1 => Just(0.0), 1 => between(-9.0, -6.0), 4 => between(0.4, 6.0)], 1..200,
            ),
        ) {
            let rays = |count: usize| -> Vec<f32> {
                (0..count).map(|i| (0.5 + ((i * scale / 4) as f32 - count as f32).floor()) / 128.0).collect()
            };
            let height = depths.len() / width;
            let depths = depths[..width * height].to_vec();
            let depths = Depths::new(Arc::new(Rays { x: rays(width), y: rays(height) }), depths).unwrap();
            let [mut pixels, mut points] = [RangeGrid::new(), RangeGrid::new()];
            points.fill(&Points::Ended { points: depths.list(), ends: depths.ends() });
            // What a scan before has left behind must not matter.
            pixels.fill(&Points::F32(vec![[0.1, 0.2, 1.0]; 9]));
            pixels.fill(&Points::Depths(depths));
            prop_assert_eq!(cells(&pixels), cells(&points));
            prop_assert_eq!((&pixels.tiles, pixels.min_count), (&points.tiles, points.min_count));
            prop_assert_eq!(pixels.farthest, points.farthest);
        }
    }
}
