//! The consistent engine itself: one scan in, what it changed out.

use nalgebra::Point3;

use super::block::{BlockIndex, Cell};
use super::bounds::Bounds;
use super::clearing::Clearing;
use super::frozen::FrozenConsistent;
use super::grid::{Binned, Grid};
use super::patch::segmented::Segmented;
use super::publish::due::Due;
use super::publish::news::Timing;
use super::publish::rest::Leaving;
use super::publish::standpoint::Standpoint;
use super::saved::{SavedBlock, SavedConsistent};
use super::scratch;
use super::surfaces::Surfaces;
use crate::engine::key::Partition;
use crate::engine::now::{Now, Taken};
use crate::engine::params::Params;
use crate::engine::saved::{RestoreError, ensure};
use crate::engine::scan::Scan;
use crate::engine::snapshot::{Snapshot, Update};
use crate::engine::step::PipelineStep;

/// The map of one session: a grid of voxels and the clusters that the definition makes of them.
#[derive(Clone, Debug)]
pub struct Consistent {
    params: Params,
    grid: Grid,
    surfaces: Surfaces,
    binned: Binned,
    /// `None` where nothing is to be cleared.
    clearing: Option<Clearing>,
    bounds: Bounds,
    standpoint: Standpoint,
    /// Blocks that wait for being published.
    due: Due,
    /// Blocks that are to rest.
    leaving: Leaving,
    taken: Taken,
}

impl Consistent {
    /// A map without a scan.
    pub fn new(params: Params) -> Self {
        Self {
            grid: Grid::new(&params),
            surfaces: Surfaces::new(&params),
            binned: Binned::default(),
            clearing: params.clearing().then(Clearing::new),
            bounds: Bounds::new(&params),
            standpoint: Standpoint::new(),
            due: Due::default(),
            leaving: Leaving::default(),
            taken: Taken::default(),
            params,
        }
    }

    /// Takes in a scan.
    pub fn insert(&mut self, scan: &Scan) -> Update {
        self.insert_observed(scan, |_| {})
    }

    /// Takes in a scan like [`Self::insert`]; `done` is called at the end of each step, for those who have a clock.
    pub fn insert_observed(&mut self, scan: &Scan, mut done: impl FnMut(PipelineStep)) -> Update {
        let now = self.taken.begin(scan.stamp);
        let sensor = self.sensor(scan);
        self.surfaces.begin();
        self.grid.bin(scan, now.sequence, &mut self.binned);
        done(PipelineStep::Binned);
        let thinned = self.thin(scan, &sensor, now);
        self.standpoint.follow(&scan.fixed_from_sensor, self.params.voxel_size(), now.sequence);
        self.leave();
        self.publish(&thinned, now);
        done(PipelineStep::Partials);
        self.surfaces.note_seen(&self.binned.seen, now);
        let update = self.update(&sensor, now);
        self.release(&thinned);
        done(PipelineStep::Globals);
        update
    }

    /// Where the sensor stands; where it stood, of a scan that lies nowhere.
    fn sensor(&self, scan: &Scan) -> Point3<f64> {
        if scan.is_placed() { scan.sensor_origin() } else { self.standpoint.origin() }
    }

    /// See [`Engine::tune`](crate::engine::Engine::tune).
    pub(crate) fn tune(&mut self, params: &Params) {
        self.params = self.params.tuned(params);
        let clearing = self.clearing.take();
        self.clearing = self.params.clearing().then(|| clearing.unwrap_or_else(Clearing::new));
        self.bounds.tune(&self.params, &self.grid);
    }

    /// The map as it is now.
    pub(crate) fn freeze(&self) -> FrozenConsistent {
        FrozenConsistent {
            blocks: self.grid.freeze(),
            surfaces: self.surfaces.freeze(),
            noise: self.surfaces.rules.noise,
            taken: self.taken,
            standpoint: self.standpoint,
            next: self.bounds.next(),
        }
    }

    /// The engine that was saved, after the scans that it had `taken` in.
    pub(crate) fn restore(params: Params, taken: Taken, map: SavedConsistent) -> Result<Self, RestoreError> {
        let SavedConsistent { blocks, surfaces, standpoint, next } = map;
        ensure(next <= blocks.len() as u64, || {
            format!("forgetting goes on at block {next} of {}", blocks.len())
        })?;
        let sequence = taken.sequence;
        standpoint.check(sequence)?;
        let mut engine = Self { standpoint, taken, ..Self::new(params) };
        // Each goes when its voxels are in the grid, and those are at rest where they are to be: a large map is in memory once.
        blocks.into_iter().try_for_each(|block| engine.restore_block(&block))?;
        engine.surfaces.restore(&surfaces, &engine.grid, &engine.params, sequence)?;
        engine.bounds = Bounds::restore(&engine.params, &engine.grid, next as usize);
        engine.due = Due::restore(&engine.grid);
        engine.restore_leaving();
        Ok(engine)
    }

    /// Takes in a block with what was published of it. Whether it is at rest follows from what it holds, and what of that is
    /// published.
    fn restore_block(&mut self, saved: &SavedBlock) -> Result<(), RestoreError> {
        let block = self.grid.restore(saved.restore(&self.params, self.taken.sequence)?)?;
        self.surfaces.restore_block(&saved.states, &self.grid, self.grid.block(block))?;
        if self.grid.states(self.grid.block(block)) != **self.surfaces.states(block) {
            self.grid.note_touched(block);
        }
        self.rest(block);
        Ok(())
    }

    /// The parameters it works with.
    pub const fn params(&self) -> &Params {
        &self.params
    }

    /// Number of voxels that hold a point, dense or not.
    pub const fn voxel_count(&self) -> usize {
        self.grid.len()
    }

    /// Number of dense voxels.
    pub fn dense_count(&self) -> usize {
        self.grid.dense() as usize
    }

    /// The whole map as it is now. Costs O(map).
    pub fn snapshot(&self) -> Snapshot {
        self.freeze().snapshot()
    }

    /// Takes out what the scan has seen through and what is beyond the bounds; returns the blocks that have lost voxels by it.
    fn thin(&mut self, scan: &Scan, sensor: &Point3<f64>, now: Now) -> Vec<BlockIndex> {
        let clearing = self.clearing.as_mut();
        let mut thinned =
            clearing.map_or_else(Vec::new, |clearing| clearing.clear(&mut self.grid, scan, now.sequence));
        thinned.extend(self.bounds.forget(&mut self.grid, &self.binned.seen, sensor, now.sequence));
        thinned
    }

    /// Publishes the blocks whose turn it is, and makes their clusters anew.
    fn publish(&mut self, thinned: &[BlockIndex], now: Now) {
        let touched = self.binned.seen.iter().chain(thinned);
        let timing = Timing { scan: now.sequence, still_since: self.standpoint.since() };
        let due = self.due.take(&self.grid, touched, timing);
        self.surfaces.publish(&self.grid, &due, self.binned.dense.iter().copied(), now);
        due.iter().for_each(|&block| self.grid.note_published(block, now.sequence));
        due.iter().for_each(|&block| self.rest(block));
    }

    /// What the scan has changed of what is told.
    fn update(&mut self, sensor: &Point3<f64>, now: Now) -> Update {
        Update {
            sequence: now.sequence,
            stamp: now.stamp,
            changed: self.surfaces.describe(&self.params, sensor.z, now),
            removed: self.surfaces.removed(),
            newly_dense: self.newly_dense(),
            points_beyond_grid: self.binned.beyond,
            unclustered_voxels: self.unclustered(),
        }
    }

    fn restore_leaving(&mut self) {
        let awake = self.grid.blocks().filter(|(_, block)| !block.is_empty() && !block.is_at_rest());
        self.leaving =
            Leaving::restore(awake.map(|(slot, block)| (block.news.seen(), slot)), self.taken.sequence);
    }

    /// Puts the blocks to rest that the sensor has left for long. Those that have changed are published first.
    fn leave(&mut self) {
        let sequence = self.taken.sequence;
        let woken = self.clearing.as_ref().map_or(&[][..], |clearing| &clearing.woken);
        self.leaving.follow(&self.binned.seen, woken, sequence);
        while let Some(block) = self.leaving.pop(sequence) {
            if self.grid.block(block).news.is_left(sequence) && self.grid.note_left(block) {
                self.due.push(block);
            }
            self.rest(block);
        }
    }

    /// Puts a block to rest if that is due.
    fn rest(&mut self, block: BlockIndex) {
        let here = self.grid.block(block);
        if here.is_to_rest(self.taken.sequence) {
            debug_assert_eq!(self.grid.states(here), **self.surfaces.states(block));
            self.grid.rest(block, self.surfaces.states_to_rest(block));
        }
    }

    /// Takes those of these blocks out that have lost all their voxels. Their places in the list go to others, so this comes
    /// last.
    fn release(&mut self, thinned: &[BlockIndex]) {
        let moves = self.grid.release(thinned);
        if !moves.gone().is_empty() {
            self.surfaces.follow(&self.grid, &moves);
            self.bounds.follow(&moves);
            self.leaving.rename(&moves);
            self.due.rename(&moves);
        }
    }

    /// Voxels that the scan made dense and that were not forgotten at once.
    fn newly_dense(&self) -> u32 {
        let is_there = |&&(block, cell): &&(BlockIndex, Cell)| self.grid.block(block).contains(cell);
        self.binned.dense.iter().filter(is_there).count() as u32
    }

    fn unclustered(&self) -> u32 {
        self.grid.dense() - self.surfaces.clustered()
    }
}

impl Consistent {
    /// The clusters of the published voxels, those that are too small to be told of included.
    pub fn partition(&self) -> Partition {
        self.freeze().partition()
    }

    /// What the definition makes of the published voxels, from scratch. Costs O(map).
    pub fn scratch(&self) -> Partition {
        scratch::partition(&self.grid, self.surfaces.segmented(), &self.surfaces.rules)
    }

    /// What the definition makes of the voxels as they are now, published or not, for tests. Costs O(map).
    #[doc(hidden)]
    pub fn scratch_of_all(&self) -> Partition {
        let rules = &self.surfaces.rules;
        let segmented =
            self.grid.blocks().map(|(_, block)| Segmented::new(&self.grid, block, rules)).collect();
        scratch::partition_of(&self.grid, segmented, rules)
    }
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests;
