//! The pixels of a camera into the directions: those of a row go into one row of cells, those of a column into one column.
//!
//! So what is nearest is found down the columns first, several of them in one instruction, and along a row of cells once.

use super::{BATCH, Cell, RangeGrid, cell_and_depth};
use crate::engine::points::{Depths, Rays};

/// What the rows of pixels in one row of cells have so far, by column.
struct Line {
    nearest: Vec<f32>,
    count: Vec<u32>,
}

impl RangeGrid {
    /// Takes in a camera's pixels.
    pub(super) fn fill_pixels(&mut self, depths: &Depths) {
        let rays = depths.rays();
        if !is_ahead(rays) {
            depths.list().chunks(BATCH).for_each(|batch| self.fill_batch(batch));
            return;
        }
        let columns: Vec<u32> = rays.x.iter().map(|&x| cell_of([x, 0.0])).collect();
        let mut line = Line { nearest: vec![f32::INFINITY; columns.len()], count: vec![0; columns.len()] };
        let mut rows = depths.rows().zip(&rays.y).map(|(row, &y)| (row, cell_of([0.0, y]))).peekable();
        while let Some((row, cell)) = rows.next() {
            line.take(row);
            if rows.peek().is_none_or(|(_, next)| *next != cell) {
                self.put(&mut line, &columns, cell);
            }
        }
    }

    /// Puts a line into its row of cells and empties it.
    fn put(&mut self, line: &mut Line, columns: &[u32], row: u32) {
        let row = row - row % super::CELLS as u32;
        let pixels = line.nearest.iter().zip(&line.count).zip(columns);
        for ((&nearest, &count), column) in pixels.filter(|((_, count), _)| **count > 0) {
            let index = row + column % super::CELLS as u32;
            let cell: &mut Cell = &mut self.cells[index as usize];
            if cell.count == 0 {
                self.occupied.push(index);
            }
            cell.nearest = cell.nearest.min(nearest);
            cell.count += count;
        }
        line.nearest.fill(f32::INFINITY);
        line.count.fill(0);
    }
}

impl Line {
    fn take(&mut self, row: &[f32]) {
        for ((nearest, count), &depth) in self.nearest.iter_mut().zip(&mut self.count).zip(row) {
            *nearest = if depth < *nearest { depth } else { *nearest };
            *count += u32::from(depth < f32::INFINITY);
        }
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
