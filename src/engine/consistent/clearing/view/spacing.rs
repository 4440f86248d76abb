//! How far apart a sensor's rays are, where that is farther than the cells of a [`RangeGrid`] are.
//!
//! A Kinect has 4 x 4 pixels in a cell: one without a measurement is a hole. Of a lidar's lines, or of the pixels of a camera that
//! has 120 in a row, not every cell has one, and what is between them was not to be measured. Along rows and along columns by
//! itself: a lidar's points follow close upon each other along its lines.

use std::ops::Range;

use super::silhouette::{Face, Silhouette};
use super::{FACE_CELLS, FACE_EDGE, RangeGrid, TILE_CELLS, split};
use crate::engine::points::Rays;

/// Cells between those that neighbouring rays fall into, at most, along a row of cells and along a column of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Gaps {
    along_row: usize,
    along_column: usize,
}

/// Cells from one that rays fall into to the next, at most, which is some 3.6 degrees: what is farther apart is another thing. No tile
/// of the grid is without a ray then.
const FARTHEST: usize = TILE_CELLS;

/// Part of a list's cells that may be farther from the next one than its rays are: they are at the edges of holes.
const HOLES: f64 = 0.25;

impl Gaps {
    /// The gaps of a camera, by its rays alone: what they have not measured is a hole, however much that is.
    pub(super) fn of_rays(rays: &Rays) -> Self {
        Self { along_row: between(&rays.x), along_column: between(&rays.y) }
    }

    /// Whether they are along an axis, of those that columns and rows run along, for which this holds.
    pub(super) const fn cross(self, [along_row, along_column]: [bool; 2]) -> bool {
        along_row && self.along_row > 0 || along_column && self.along_column > 0
    }

    pub(super) const fn is_none(self) -> bool {
        self.along_row == 0 && self.along_column == 0
    }
}

/// Cells between those of neighbouring rays, at most, of rays as far apart as these are on the mean.
fn between(rays: &[f32]) -> usize {
    let (Some(first), Some(last)) = (rays.first(), rays.last()) else { return 0 };
    let steps = rays.len().saturating_sub(1).max(1) as f32;
    let cells = (last - first).abs() * (0.5 * FACE_EDGE as f32) / steps;
    ((cells.ceil() as usize).max(1) - 1).min(FARTHEST - 1)
}

impl RangeGrid {
    /// The gaps of points that came in a list, by how far it is from most of the cells with points to the next one.
    pub(super) fn gaps_of_list(&self) -> Gaps {
        let (mut along_row, mut along_column) = (Steps::default(), Steps::default());
        let with_points = |index: &usize| self.cells[*index].count > 0;
        for index in self.occupied.iter().flat_map(Clone::clone).filter(with_points) {
            let (_, row, column) = split(index);
            along_row.count(self.to_next(index, 1, FACE_EDGE - 1 - column));
            along_column.count(self.to_next(index, FACE_EDGE, FACE_EDGE - 1 - row));
        }
        Gaps { along_row: along_row.most() - 1, along_column: along_column.most() - 1 }
    }

    /// Steps of `step` cells to the next one with points; `None` where there are more than [`FARTHEST`], or than `within` on the face.
    fn to_next(&self, index: usize, step: usize, within: usize) -> Option<usize> {
        (1..=FARTHEST.min(within)).find(|count| self.cells[index + count * step].count > 0)
    }

    /// Whether a ray went into a cell or, where rays are farther apart than that, into one next to it: what is farther from it may
    /// end between two of them.
    pub(super) fn is_next_to_ray(&self, index: usize) -> bool {
        let (face, row, column) = split(index);
        let mut rows = around(row, self.gaps.along_column.min(1), &(0..FACE_EDGE));
        let columns = around(column, self.gaps.along_row.min(1), &(0..FACE_EDGE));
        rows.any(|row| columns.clone().any(|column| self.is_measured(face, row, column)))
    }

    /// Whether, wherever rays are apart, the next ones to both sides of a cell end beyond `least` too: else what is there may lie between
    /// two rays, as a floor does that the one ends before and the other passes over.
    pub(super) fn passes_on_both_sides(&self, index: usize, least: f32) -> bool {
        let Gaps { along_row, along_column } = self.gaps;
        let (face, row, column) = split(index);
        let columns = around(column, along_row, &(0..FACE_EDGE));
        let rows = around(row, along_column, &(0..FACE_EDGE));
        let in_row =
            |row: usize| self.ends_beyond_of((face * FACE_EDGE + row) * FACE_EDGE, columns.clone(), 1, least);
        let in_column =
            |column: usize| self.ends_beyond_of(face * FACE_CELLS + column, rows.clone(), FACE_EDGE, least);
        (along_column == 0 || on_both_sides(row, along_column, in_row))
            && (along_row == 0 || on_both_sides(column, along_row, in_column))
    }

    /// Whether all of some cells that were measured end beyond `least`; `None` where none was.
    fn ends_beyond_of(&self, first: usize, places: Range<usize>, step: usize, least: f32) -> Option<bool> {
        let cells = places.map(|place| self.cells[first + place * step]);
        let mut nearest = cells.filter(|cell| cell.count >= self.min_count).map(|cell| cell.nearest);
        nearest.next().map(|first| nearest.fold(first, f32::min) > least)
    }

    /// Whether rays went into a cell.
    pub(super) fn is_ray(&self, index: usize) -> bool {
        self.cells[index].count >= self.min_count
    }

    fn is_measured(&self, face: usize, row: usize, column: usize) -> bool {
        self.is_ray((face * FACE_EDGE + row) * FACE_EDGE + column)
    }

    /// Whether each cell of a silhouette was measured or has one in it that was, no farther than rays are apart.
    pub(super) fn lies_between_rays(&self, face: Face, silhouette: &Silhouette) -> bool {
        let near = |row: usize, column: usize| {
            let mut rows = around(row, self.gaps.along_column, &silhouette.rows);
            let columns = around(column, self.gaps.along_row, &silhouette.columns);
            rows.any(|row| columns.clone().any(|column| self.is_measured(face.index(), row, column)))
        };
        silhouette.rows.clone().all(|row| silhouette.columns.clone().all(|column| near(row, column)))
    }
}

/// Whether the first lines of cells before `at` and after it in which rays went, no farther than these are apart, end beyond.
fn on_both_sides(at: usize, gap: usize, ends: impl Fn(usize) -> Option<bool>) -> bool {
    let before = (1..=(gap + 1).min(at)).find_map(|steps| ends(at - steps));
    let after = (1..=(gap + 1).min(FACE_EDGE - 1 - at)).find_map(|steps| ends(at + steps));
    before == Some(true) && after == Some(true)
}

/// From `reach` before `at` to `reach` after it, of those `within`.
fn around(at: usize, reach: usize, within: &Range<usize>) -> Range<usize> {
    within.start.max(at.saturating_sub(reach))..within.end.min(at + reach + 1)
}

/// How many cells have the next one 1, 2, ... steps away.
#[derive(Default)]
struct Steps([u32; FARTHEST]);

impl Steps {
    fn count(&mut self, steps: Option<usize>) {
        if let Some(steps) = steps {
            self.0[steps - 1] += 1;
        }
    }

    /// The most steps there are but for the [`HOLES`]; 1 where nothing was counted.
    fn most(&self) -> usize {
        let holes = HOLES * self.0.iter().map(|&cells| f64::from(cells)).sum::<f64>();
        let mut farther = 0.0;
        let is_common = |cells: &u32| {
            farther += f64::from(*cells);
            farther > holes
        };
        FARTHEST - self.0.iter().rev().position(is_common).unwrap_or(FARTHEST - 1)
    }
}
