//! Forgetting: how many voxels the map may hold, and how far from the sensor.
//!
//! Whole blocks go, so that what remains of a surface has few new edges.
//!
//! **Kept true.** After each scan no more than `max_voxels` voxels hold points: the blocks go that have not been seen for
//! longest, of those seen last in one scan the farthest first. Beyond `keep_radius`, to a block, nothing is kept that the scan put there,
//! and what the sensor has left behind is gone when all blocks that are there have had their turn: [`LOOKS`] have it in a scan,
//! so 4 scans (0.13 s of a Kinect's) for the 2,000 that there may be within 6 m at 8 cm. Turns go down the list, for a block
//! that moves in it moves down: none is passed over, and one that has moved waits for two rounds at most.
//!
//! **Cost.** A logarithm of the map for each block that the scan put points into, a distance for each of those and for
//! [`LOOKS`] others; and what is forgotten.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use nalgebra::Point3;

use super::block::{Block, BlockIndex, EDGE};
use super::grid::Grid;
use super::grid::moves::Moves;
use super::lists::by::Place;
use super::lists::shared::Shared;
use crate::engine::params::Params;

/// Blocks that a scan looks at, in turn, for being too far away.
const LOOKS: usize = 512;

#[derive(Clone, Debug)]
pub(super) struct Bounds {
    /// 0 = none.
    max_voxels: u64,
    /// m; 0 = none.
    keep_radius: f64,
    /// The scan that put a point into it last and the block; kept where there is a bound on voxels.
    by_last_seen: BTreeSet<(u64, BlockIndex)>,
    /// The scan that put a point into it last, as far as that was noted.
    last_seen: Shared<BlockIndex, u64>,
    /// The blocks below this one are looked at next, downwards.
    next: usize,
}

impl Bounds {
    pub(super) const fn new(params: &Params) -> Self {
        Self {
            max_voxels: params.max_voxels(),
            keep_radius: params.keep_radius(),
            by_last_seen: BTreeSet::new(),
            last_seen: Shared::new(),
            next: 0,
        }
    }

    /// The blocks below this one are looked at next.
    pub(super) const fn next(&self) -> u64 {
        self.next as u64
    }

    /// The bounds as they were when the blocks of `grid` were saved, or other ones over these.
    pub(super) fn restore(params: &Params, grid: &Grid, next: usize) -> Self {
        let mut bounds = Self { next, ..Self::new(params) };
        if bounds.max_voxels > 0 {
            bounds.note_all(grid);
        }
        bounds
    }

    /// Other bounds, which hold after the next scan.
    pub(super) fn tune(&mut self, params: &Params, grid: &Grid) {
        let held = std::mem::replace(&mut self.max_voxels, params.max_voxels()) > 0;
        self.keep_radius = params.keep_radius();
        if self.max_voxels == 0 {
            (self.by_last_seen, self.last_seen) = (BTreeSet::new(), Shared::new());
        } else if !held {
            self.note_all(grid);
        }
    }

    /// Follows blocks to other places.
    pub(super) fn follow(&mut self, moves: &Moves) {
        self.next = self.next.min(moves.slots());
        if self.max_voxels == 0 {
            return;
        }
        self.last_seen.set_len(moves.slots() + moves.gone().len());
        for &gone in moves.gone() {
            self.by_last_seen.remove(&(self.last_seen[gone], gone));
        }
        for &(from, to) in moves.moved() {
            let last = self.last_seen[from];
            if self.by_last_seen.remove(&(last, from)) {
                self.by_last_seen.insert((last, to));
            }
        }
        moves.apply(&mut self.last_seen);
    }

    /// Notes when the blocks were seen last.
    fn note_all(&mut self, grid: &Grid) {
        for (slot, block) in grid.blocks() {
            self.note_seen(&[slot], block.news.seen());
        }
    }

    /// Empties blocks until the bounds hold; `seen` are those that the scan put points into. Returns what it emptied.
    pub(super) fn forget(
        &mut self,
        grid: &mut Grid,
        seen: &[BlockIndex],
        sensor: &Point3<f64>,
        sequence: u64,
    ) -> Vec<BlockIndex> {
        let mut emptied = Vec::new();
        if self.keep_radius > 0.0 {
            self.leave_behind(grid, seen, sensor, &mut emptied);
        }
        if self.max_voxels > 0 {
            self.note_seen(seen, sequence);
            self.forget_oldest(grid, sensor, &mut emptied);
        }
        emptied
    }

    fn leave_behind(
        &mut self,
        grid: &mut Grid,
        seen: &[BlockIndex],
        sensor: &Point3<f64>,
        emptied: &mut Vec<BlockIndex>,
    ) {
        let slots = grid.slots();
        let looks = LOOKS.min(slots);
        let in_turn = (1..=looks).map(|look| BlockIndex::at((self.next + slots - look) % slots));
        for block in in_turn.chain(seen.iter().copied()) {
            let here = grid.block(block);
            if !here.is_empty() && distance(grid, here, sensor) > self.keep_radius {
                grid.empty(block);
                emptied.push(block);
            }
        }
        self.next = (self.next + slots - looks) % slots.max(1);
    }

    fn note_seen(&mut self, seen: &[BlockIndex], sequence: u64) {
        for &block in seen {
            let before = std::mem::replace(self.last_seen.grow_to(block), sequence);
            self.by_last_seen.remove(&(before, block));
            self.by_last_seen.insert((sequence, block));
        }
    }

    fn forget_oldest(&mut self, grid: &mut Grid, sensor: &Point3<f64>, emptied: &mut Vec<BlockIndex>) {
        while grid.len() as u64 > self.max_voxels {
            let Some(&(oldest, _)) = self.by_last_seen.first() else { return };
            let group = self.by_last_seen.range((oldest, BlockIndex(0))..=(oldest, BlockIndex(u32::MAX)));
            let mut group: Vec<_> = group.map(|(_, block)| *block).collect();
            let place = |&block: &BlockIndex| {
                let here = grid.block(block);
                // Distances are not negative: their bits are ordered as they are.
                (Reverse(distance(grid, here, sensor).to_bits()), here.key)
            };
            group.sort_by_cached_key(place);
            for block in group {
                if grid.len() as u64 <= self.max_voxels {
                    return;
                }
                self.by_last_seen.remove(&(oldest, block));
                if !grid.block(block).is_empty() {
                    grid.empty(block);
                    emptied.push(block);
                }
            }
        }
    }
}

/// From a point to the nearest point of a block (m).
fn distance(grid: &Grid, block: &Block, from: &Point3<f64>) -> f64 {
    let size = grid.voxel_size();
    let low = block.low() * size;
    let high = block.low().add_scalar(f64::from(EDGE)) * size;
    let nearest = from.coords.sup(&low).inf(&high);
    (nearest - from.coords).norm()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::engine::scan::Stamp;
    use crate::engine::{Engine, Isometry3, Points, Scan};

    /// Points of plates, each of which fills a side of one block: 64 voxels. They are this far away and aside (m).
    fn plates(places: &[[f32; 2]]) -> Scan {
        let plate = |&[x, y]: &[f32; 2]| {
            (0..1024_u16)
                .map(move |i| [x, y + 0.01 + 0.02 * f32::from(i % 32), 0.01 + 0.02 * f32::from(i / 32)])
        };
        Scan {
            stamp: Stamp::from_nanos(1),
            fixed_from_sensor: Isometry3::identity(),
            points: Points::F32(places.iter().flat_map(plate).collect()),
        }
    }

    /// How many voxels a map has, and the indices of all along one axis.
    fn layers(engine: &Engine, axis: usize) -> (usize, Vec<i32>) {
        let voxels = engine.snapshot().voxels;
        let layers: BTreeSet<_> = voxels.iter().map(|voxel| voxel.key.indices()[axis]).collect();
        (voxels.len(), layers.into_iter().collect())
    }

    #[test]
    fn of_what_one_scan_has_seen_the_farthest_goes_first() {
        let scan = plates(&[2.52, 4.04, 1.0].map(|x| [x, 0.0]));
        for (bound, kept) in
            [(192, vec![12, 31, 50]), (191, vec![12, 31]), (128, vec![12, 31]), (64, vec![12])]
        {
            let mut engine = Engine::new(Params::default().with_max_voxels(bound).unwrap());
            engine.insert(&scan);
            assert_eq!(layers(&engine, 0), (64 * kept.len(), kept), "{bound}");
        }
    }

    /// The plates stand side by side, so that none is looked through.
    #[test]
    fn what_was_not_seen_for_longest_goes_first() {
        let mut engine = Engine::new(Params::default().with_max_voxels(128).unwrap());
        // Beside each other by two blocks, of which each plate fills one.
        let mut kept_after = |number: u8| {
            engine.insert(&plates(&[[2.52, 1.28 * f32::from(number)]]));
            let (voxels, layers) = layers(&engine, 1);
            let plates: BTreeSet<_> = layers.into_iter().map(|layer| layer / 16).collect();
            (voxels, Vec::from_iter(plates))
        };
        assert_eq!(kept_after(1), (64, vec![1]));
        assert_eq!(kept_after(2), (128, vec![1, 2]));
        assert_eq!(kept_after(3), (128, vec![2, 3]), "the first was not seen for longest");
        assert_eq!(kept_after(2), (128, vec![2, 3]));
        assert_eq!(kept_after(4), (128, vec![2, 4]), "the second was seen again after the third");
    }
}
