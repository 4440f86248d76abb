//! The pixels of a camera into the directions: those of a row go into one row of cells, those of a column into one column.
//!
//! So what is nearest is found down the columns first, several of them in one instruction, and along a row of cells once.

use pulp::{Arch, Simd, WithSimd};

use super::{CELLS, RangeGrid, cell_and_depth, farther};
use crate::engine::points::{Depths, Rays};

/// What the rows of pixels in one row of cells have so far, by column of pixels; its memory stays for the next scan.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    /// Smallest depths, as bits, which above 0 have the order of what they stand for: what is chosen by a comparison of floating
    /// point is compiled to a store that leaves out lanes, and takes as long as thirty others on some processors.
    nearest: Vec<u32>,
    count: Vec<u32>,
    /// For each column of cells with pixels the cell and the number of pixels.
    columns: Vec<(u32, usize)>,
}

/// In place of the depth of a pixel that measured none.
const FARTHER: u32 = f32::INFINITY.to_bits();

impl RangeGrid {
    /// Takes in a camera's pixels, those as well that are too far away to be points; returns how many were measured.
    pub(super) fn fill_pixels(&mut self, depths: &Depths) -> usize {
        if is_ahead(depths.rays()) {
            let mut line = std::mem::take(&mut self.line);
            line.begin(&depths.rays().x);
            let measured = Arch::new().dispatch(Filling { grid: self, line: &mut line, depths });
            self.line = line;
            measured as usize
        } else {
            self.fill_lists(&depths.list(), &depths.ends())
        }
    }

    /// Puts a line into its row of cells, and empties it; returns how many pixels it held.
    fn put(&mut self, line: &mut Line, row: u32) -> u32 {
        let mut all = 0;
        let mut pixels = line.nearest.iter().zip(&line.count);
        for &(column, width) in &line.columns {
            let (mut nearest, mut count) = (FARTHER, 0);
            for (&depth, &measured) in pixels.by_ref().take(width) {
                nearest = depth.min(nearest);
                count += measured;
            }
            if count == 0 {
                continue;
            }
            let index = row + column;
            let cell = &mut self.cells[index as usize];
            if cell.count == 0 {
                self.occupied.push(index);
            }
            cell.nearest = f32::from_bits(cell.nearest.to_bits().min(nearest));
            cell.count += count;
            all += count;
        }
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
            let column = cell_of([x, 0.0]) % CELLS as u32;
            match self.columns.last_mut() {
                Some((last, pixels)) if *last == column => *pixels += 1,
                _ => self.columns.push((column, 1)),
            }
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
        let row_of = |y: f32| {
            let cell = cell_of([0.0, y]);
            cell - cell % CELLS as u32
        };
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

/// Whether all pixels look through the face ahead.
fn is_ahead(rays: &Rays) -> bool {
    rays.x.iter().chain(&rays.y).all(|ray| ray.abs() < 1.0)
}

/// The cell of a direction ahead.
fn cell_of([x, y]: [f32; 2]) -> u32 {
    cell_and_depth([x, y, 1.0]).0
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::engine::binning::between;
    use crate::engine::points::Points;

    /// The occupied cells, each with what it holds.
    fn cells(grid: &RangeGrid) -> Vec<(u32, u32, u32)> {
        let mut cells = grid.occupied.clone();
        cells.sort_unstable();
        let cell = |index: u32| grid.cells[index as usize];
        cells.into_iter().map(|index| (index, cell(index).nearest.to_bits(), cell(index).count)).collect()
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
