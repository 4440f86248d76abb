//! Definition 2: the dense voxels that can be reached over dense voxels in at most `depth` direct steps.

use super::grid::{Grid, VoxelIndex};
use crate::engine::key::DIRECTIONS;
use crate::engine::params::MAX_DEPTH;

/// Cells a side of the cube around the start, with one layer of margin so that a step from the rim stays inside.
const SIDE: i32 = 2 * (MAX_DEPTH as i32 + 1) + 1;
const CELLS: usize = (SIDE * SIDE * SIDE) as usize;

/// Breadth-first search over dense voxels; its memory is kept from one search to the next.
#[derive(Clone, Debug)]
pub(crate) struct Neighbourhood {
    /// For each cell of the cube the search that looked at it last.
    seen: Vec<u32>,
    search: u32,
    /// Voxels found, with their offset from the start; nearest first.
    found: Vec<(VoxelIndex, [i32; 3])>,
}

impl Default for Neighbourhood {
    fn default() -> Self {
        Self { seen: vec![0; CELLS], search: 0, found: Vec::new() }
    }
}

impl Neighbourhood {
    /// The dense voxel `start` and its neighbourhood in `depth`, in an order that the dense voxels alone determine.
    pub(crate) fn of(&mut self, grid: &Grid, start: VoxelIndex, depth: u8) -> &[(VoxelIndex, [i32; 3])] {
        self.begin();
        self.visit([0; 3]);
        self.found.push((start, [0; 3]));
        let mut layer = 0..1;
        for _ in 0..depth {
            for at in layer.clone() {
                self.step_from(grid, start, at);
            }
            layer = layer.end..self.found.len();
        }
        &self.found
    }

    fn begin(&mut self) {
        self.found.clear();
        self.search = self.search.wrapping_add(1);
        if self.search == 0 {
            self.seen.fill(0);
            self.search = 1;
        }
    }

    fn step_from(&mut self, grid: &Grid, start: VoxelIndex, at: usize) {
        let offset = self.found[at].1;
        for direction in DIRECTIONS {
            let offset = [0, 1, 2].map(|axis| offset[axis] + direction[axis]);
            if self.visit(offset)
                && let Some(key) = grid[start].key.step(offset)
                && let Some(voxel) = grid.get_dense(key)
            {
                self.found.push((voxel, offset));
            }
        }
    }

    /// Whether this is the search's first look at the cell.
    fn visit(&mut self, [x, y, z]: [i32; 3]) -> bool {
        let half = SIDE / 2;
        let cell = ((x + half) * SIDE + y + half) * SIDE + z + half;
        let seen = &mut self.seen[cell as usize];
        std::mem::replace(seen, self.search) != self.search
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::engine::key::VoxelKey;
    use crate::engine::points::Points;
    use crate::engine::scan::{Scan, Stamp};

    fn grid(cells: &[[i32; 3]]) -> Grid {
        let points = cells.iter().map(|cell| cell.map(|i| f64::from(i) + 0.5)).collect();
        let mut grid = Grid::new(1.0, 1);
        grid.bin(
            &Scan {
                stamp: Stamp::default(),
                fixed_from_sensor: Isometry3::identity(),
                points: Points::F64(points),
            },
            1,
        );
        grid
    }

    fn reached(grid: &Grid, start: [i32; 3], depth: u8) -> Vec<[i32; 3]> {
        let start = grid.get(VoxelKey::new(start[0], start[1], start[2]).unwrap()).unwrap();
        let mut search = Neighbourhood::default();
        let mut cells: Vec<_> =
            search.of(grid, start, depth).iter().map(|&(voxel, _)| grid[voxel].key.indices()).collect();
        cells.sort_unstable();
        cells
    }

    #[test]
    fn definition_2_neighbourhood_reaches_depth_d_over_dense_voxels() {
        let line: Vec<_> = (-9..=9).map(|x| [x, 0, 0]).collect();
        for depth in 1..=8u8 {
            let d = i32::from(depth);
            let expected: Vec<_> = (-d..=d).map(|x| [x, 0, 0]).collect();
            assert_eq!(reached(&grid(&line), [0, 0, 0], depth), expected);
        }
    }

    #[test]
    fn definition_2_a_gap_is_walked_around_and_not_jumped() {
        let bent = [[0, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [2, 0, 0], [4, 0, 0]];
        assert_eq!(reached(&grid(&bent), [0, 0, 0], 3), [[0, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]]);
        assert_eq!(reached(&grid(&bent), [0, 0, 0], 8).len(), 5);
    }
}
