//! How far apart a sensor's rays are, where that is farther than the cells of a [`RangeGrid`] are.
//!
//! A Kinect has 4 x 4 pixels in a cell: one without a measurement is a hole. Of a lidar's lines, or of the pixels of a camera that
//! has 120 in a row, not every cell has one, and what is between them was not to be measured. Along rows and along columns by
//! itself: a lidar's points follow close upon each other along its lines.
//!
//! A camera's pixels are equal in tangent, as cells are. A lidar's rays are equal in angle, and towards the border of a face, where
//! cells are half as wide, up to twice as many cells apart as in its middle: so the angle is measured, and looked up in cells at a
//! place.

use std::ops::Range;

use super::silhouette::{Face, Silhouette};
use super::{FACE_CELLS, FACE_EDGE, RangeGrid, TILE_CELLS, TILES, cell_and_depth, split};
use crate::engine::points::Rays;

/// How far apart neighbouring rays are, along a row of cells and along a column of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gaps {
    /// Cells between those that neighbouring rays fall into, at most, wherever these are: a camera's pixels are equal in tangent, as
    /// cells are.
    between: [usize; 2],
    /// The angle from ray to ray, in widths of a cell in the middle of a face; 0 where there are no empty cells between.
    ///
    /// A lidar's rays are equal in angle: towards the border of a face, where cells are half as wide, more lie between two of them.
    angles: [f32; 2],
}

/// Cells between those that neighbouring rays fall into at a place of a face, at most.
#[derive(Clone, Copy, Debug)]
struct Between {
    along_row: usize,
    along_column: usize,
}

/// Cells from one that rays fall into to the next, at most, which is some 3.6 degrees: what is farther apart is another thing. No tile
/// of the grid is without a ray then.
const FARTHEST: usize = TILE_CELLS;

/// Part of a list's cells that may be farther from the next one than its rays are: they are at the edges of holes.
const HOLES: f64 = 0.25;

/// Width of a cell, in those of one in the middle of a face, up to which its neighbours are beside what is in it.
const NARROW: f32 = 2.0 / 3.0;

impl Gaps {
    /// The gaps of a camera, by its rays alone: what they have not measured is a hole, however much that is.
    pub(super) fn of_rays(rays: &Rays) -> Self {
        Self { between: [between(&rays.x), between(&rays.y)], angles: [0.0; 2] }
    }

    /// Those at a place of a face.
    fn at(self, row: usize, column: usize) -> Between {
        let widths = widths(row, column);
        let [along_row, along_column] = [0, 1].map(|axis| {
            let steps = (self.angles[axis] / widths[axis]).ceil() as usize;
            self.between[axis].max(steps.saturating_sub(1)).min(FARTHEST - 1)
        });
        Between { along_row, along_column }
    }

    /// Whether there are none in any place.
    pub(super) fn is_none(self) -> bool {
        self == Self::default()
    }
}

/// The angles across a cell, along its row and along its column, in those across a cell in the middle of a face.
fn widths(row: usize, column: usize) -> [f32; 2] {
    let [column, row] = [column, row].map(|at| tangent(at as isize).powi(2));
    let square = 1.0 + column + row;
    [(1.0 + row).sqrt() / square, (1.0 + column).sqrt() / square]
}

/// The tangent of the middle of a column or row of cells, which may be beyond the border of the face.
fn tangent(at: isize) -> f32 {
    (2 * at + 1) as f32 / FACE_EDGE as f32 - 1.0
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
        let widths: [_; TILES * TILES] = std::array::from_fn(|tile| {
            let middle = |tile| tile * TILE_CELLS + TILE_CELLS / 2;
            widths(middle(tile / TILES), middle(tile % TILES)).map(|width| (width * WIDTHS as f32) as u8)
        });
        let (mut along_row, mut along_column) = (ByWidth::default(), ByWidth::default());
        let with_points = |index: &usize| self.cells[*index].count > 0;
        for index in self.occupied.iter().flat_map(Clone::clone).filter(with_points) {
            let (_, row, column) = split(index);
            let [width, height] = widths[row / TILE_CELLS * TILES + column / TILE_CELLS];
            along_row.count(width, self.to_next(index, 1, FACE_EDGE - 1 - column));
            along_column.count(height, self.to_next(index, FACE_EDGE, FACE_EDGE - 1 - row));
        }
        let axes = [along_row, along_column];
        Gaps {
            between: [0, 1].map(|axis| Steps::sum(&axes[axis].0).most() - 1),
            angles: [0, 1].map(|axis| axes[axis].angle()),
        }
    }

    /// Steps of `step` cells to the next one with points; `None` where there are more than [`FARTHEST`], or than `within` on the face.
    fn to_next(&self, index: usize, step: usize, within: usize) -> Option<usize> {
        (1..=FARTHEST.min(within)).find(|count| self.cells[index + count * step].count > 0)
    }

    /// Whether a ray went into a cell or, where rays are farther apart than that, into one next to it: what is farther from it may
    /// end between two of them. What is thin along the columns or the rows lies beside a ray that is a cell away along these; but
    /// where cells are [`NARROW`], that ray is as near to it as one in its own cell elsewhere.
    pub(super) fn is_next_to_ray(&self, index: usize, is_thin: [bool; 2]) -> bool {
        let (face, row, column) = split(index);
        let (gaps, widths) = (self.gaps.at(row, column), widths(row, column));
        let reach =
            |axis: usize, gap: usize| if is_thin[axis] && widths[axis] > NARROW { 0 } else { gap.min(1) };
        let mut rows = around(row, reach(1, gaps.along_column));
        let columns = around(column, reach(0, gaps.along_row));
        rows.any(|row| columns.clone().any(|column| self.is_measured(face, row, column)))
    }

    /// Whether, wherever rays are apart, the next ones to both sides of a cell end beyond `least` too: else what is there may lie between
    /// two rays, as a floor does that the one ends before and the other passes over.
    pub(super) fn passes_on_both_sides(&self, index: usize, least: f32) -> bool {
        let (face, row, column) = split(index);
        let Between { along_row, along_column } = self.gaps.at(row, column);
        let columns = around(column, along_row);
        let rows = around(row, along_column);
        let in_row =
            |row: isize| self.ends_beyond_of(columns.clone().map(|column| beside(face, row, column)), least);
        let in_column =
            |column: isize| self.ends_beyond_of(rows.clone().map(|row| beside(face, row, column)), least);
        (along_column == 0 || on_both_sides(row, along_column, in_row))
            && (along_row == 0 || on_both_sides(column, along_row, in_column))
    }

    /// Whether all of some cells that were measured end beyond `least`, which is a depth of the face that [`beside`] was asked for;
    /// `None` where none was.
    fn ends_beyond_of(&self, places: impl Iterator<Item = (usize, f32)>, least: f32) -> Option<bool> {
        let measured = places.filter(|(index, _)| self.is_ray(*index));
        let mut ends = measured.map(|(index, depth)| self.cells[index].nearest > least * depth);
        ends.next().map(|first| first && ends.all(|ends| ends))
    }

    /// Whether rays went into a cell.
    fn is_ray(&self, index: usize) -> bool {
        self.cells[index].count >= self.min_count
    }

    fn is_measured(&self, face: usize, row: isize, column: isize) -> bool {
        self.is_ray(beside(face, row, column).0)
    }

    /// Whether each cell of a silhouette was measured or has one in it that was, no farther than rays are apart.
    pub(super) fn lies_between_rays(&self, face: Face, silhouette: &Silhouette) -> bool {
        let middle = |places: &Range<usize>| usize::midpoint(places.start, places.end - 1);
        let gaps = self.gaps.at(middle(&silhouette.rows), middle(&silhouette.columns));
        let near = |row: usize, column: usize| {
            let mut rows = within(around(row, gaps.along_column), &silhouette.rows);
            let columns = within(around(column, gaps.along_row), &silhouette.columns);
            rows.any(|row| columns.clone().any(|column| self.is_measured(face.index(), row, column)))
        };
        silhouette.rows.clone().all(|row| silhouette.columns.clone().all(|column| near(row, column)))
    }
}

/// The cell at a row and a column that may lie beyond the border of a face, so on another one; and its depth there of what is at
/// depth 1 of the face.
fn beside(face: usize, row: isize, column: isize) -> (usize, f32) {
    const ON_FACE: Range<isize> = 0..FACE_EDGE as isize;
    if ON_FACE.contains(&row) && ON_FACE.contains(&column) {
        return (face * FACE_CELLS + row as usize * FACE_EDGE + column as usize, 1.0);
    }
    let across = [column, row].map(|at| tangent(at).into());
    let (index, depth) = cell_and_depth(Face::new(face).point(across, 1.0).coords.map(|x| x as f32).into());
    (index as usize, depth)
}

/// Whether the first lines of cells before `at` and after it in which rays went, no farther than these are apart, end beyond.
fn on_both_sides(at: usize, gap: usize, ends: impl Fn(isize) -> Option<bool>) -> bool {
    let (at, farthest) = (at as isize, gap as isize + 1);
    let before = (1..=farthest).find_map(|steps| ends(at - steps));
    let after = (1..=farthest).find_map(|steps| ends(at + steps));
    before == Some(true) && after == Some(true)
}

/// From `reach` before `at` to `reach` after it.
fn around(at: usize, reach: usize) -> Range<isize> {
    let (at, reach) = (at as isize, reach as isize);
    at - reach..at + reach + 1
}

/// Those of some places that a silhouette has, which goes on beyond a border of the face that it reaches.
fn within(places: Range<isize>, silhouette: &Range<usize>) -> Range<isize> {
    let start = if silhouette.start == 0 { places.start } else { silhouette.start as isize };
    let end = if silhouette.end == FACE_EDGE { places.end } else { silhouette.end as isize };
    places.start.max(start)..places.end.min(end)
}

/// Widths that are told apart, from 0 to that of a cell in the middle of a face; none is less than 15 of them.
const WIDTHS: usize = 32;
/// Of so many widths next to each other, cells are of a kind.
const ALIKE: usize = 4;
/// A kind of cells with no more than this part of all says nothing.
const FEW: u32 = 32;
/// Steps to the next cell, on the mean, from which on rays leave cells out: with fewer it is holes in what was measured.
const APART: f32 = 1.05;

/// How many cells of each width have the next one 1, 2, ... steps away.
#[derive(Default)]
struct ByWidth([Steps; WIDTHS]);

impl ByWidth {
    fn count(&mut self, width: u8, steps: Option<usize>) {
        if let Some(steps) = steps {
            self.0[usize::from(width).min(WIDTHS - 1)].0[steps - 1] += 1;
        }
    }

    /// The angle from ray to ray in widths of a cell in the middle of a face; 0 where they leave no cells out.
    ///
    /// Each kind of cells has its mean. It is too large where rays are closer than cells, where there are holes and where lines cross
    /// rows aslant, and hardly ever too small; so the least counts.
    fn angle(&self) -> f32 {
        let few = Steps::sum(&self.0).cells() / FEW;
        let (mut is_apart, mut least) = (false, f32::INFINITY);
        for (kind, widths) in self.0.chunks(ALIKE).enumerate() {
            let all = Steps::sum(widths);
            if all.cells() > few {
                let most = (all.most() + 1).min(FARTHEST);
                let width = |place: usize| ((kind * ALIKE + place) as f32 + 0.5) / WIDTHS as f32;
                let angles =
                    (0..).zip(widths).map(|(place, steps)| width(place) * steps.all_up_to(most) as f32);
                let cells = all.0[..most].iter().sum::<u32>() as f32;
                is_apart |= all.all_up_to(most) as f32 >= APART * cells;
                least = least.min(angles.sum::<f32>() / cells);
            }
        }
        if is_apart { least } else { 0.0 }
    }
}

/// How many cells have the next one 1, 2, ... steps away.
#[derive(Clone, Copy, Default)]
struct Steps([u32; FARTHEST]);

impl Steps {
    fn sum(of: &[Self]) -> Self {
        Self(std::array::from_fn(|steps| of.iter().map(|one| one.0[steps]).sum()))
    }

    fn cells(&self) -> u32 {
        self.0.iter().sum()
    }

    /// The steps of all cells with no more than `most` together.
    fn all_up_to(&self, most: usize) -> u32 {
        (1..).zip(&self.0[..most]).map(|(steps, cells)| steps * cells).sum()
    }

    /// The most steps there are but for the [`HOLES`]; 1 where nothing was counted.
    fn most(&self) -> usize {
        let holes = HOLES * f64::from(self.cells());
        let mut farther = 0.0;
        let is_common = |cells: &u32| {
            farther += f64::from(*cells);
            farther > holes
        };
        FARTHEST - self.0.iter().rev().position(is_common).unwrap_or(FARTHEST - 1)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;
    use crate::engine::points::Points;

    fn gaps(points: Vec<[f32; 3]>) -> Gaps {
        let mut grid = RangeGrid::new();
        grid.fill(&Points::F32(points));
        grid.gaps
    }

    #[test]
    fn more_cells_lie_between_the_rays_of_a_lidar_where_they_are_narrower() {
        let ray = |line: u32, column: u32| {
            let up = (45.0 * (line as f32 / 63.0 - 0.5)).to_radians();
            let around = TAU * column as f32 / 1024.0;
            [around.cos(), around.sin(), up.tan()]
        };
        let gaps = gaps((0..64).flat_map(|line| (0..1024).map(move |column| ray(line, column))).collect());
        let between = |row: usize, column: usize| {
            let between = gaps.at(row, column);
            [between.along_row, between.along_column]
        };
        let half = FACE_EDGE / 2;
        assert_eq!(between(half, half), [0, 1]);
        assert_eq!(between(half, FACE_EDGE - 1), [1, 2]);
        assert_eq!(between(half, 0), [1, 2]);
    }

    /// Those of a Kinect, where one cell in a hundred has no point.
    #[test]
    fn there_are_none_between_pixels_that_are_closer_than_cells() {
        let cell = |tangent: f32| (tangent * (0.5 * FACE_EDGE as f32)).floor() as i32;
        let rays = |count: i32| (-count..count).map(|i| (i as f32 + 0.5) / 525.0);
        let points = rays(240).flat_map(|y| rays(320).map(move |x| [x, y, 1.0]));
        let gaps = gaps(points.filter(|[x, y, _]| (cell(*x) + 7 * cell(*y)).rem_euclid(100) != 0).collect());
        assert!(gaps.is_none(), "{gaps:?}");
    }
}
