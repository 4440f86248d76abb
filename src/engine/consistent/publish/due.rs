//! Which blocks a scan publishes: what is due, by turns where it is too much for one scan.

use super::news::Timing;
use crate::engine::consistent::block::BlockIndex;
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::grid::moves::Moves;

/// Area of the voxels that one scan publishes (m^2), those of blocks that cannot wait among them; what is due beyond that waits. On
/// the recordings the 99th percentile of a scan's time is twice the median with it, four times without.
///
/// Blocks with the most news first instead of those that wait longest: while the sensor walks round the cabinet (5 cm), the
/// partition is nearer to that of all voxels as they are (adjusted Rand index 0.82 instead of 0.72), but clusters take 17 % longer;
/// 4 m^2 or a sixth of the longest waiting gives 0.85 for 8 %.
const SHARE: f64 = 3.0;
/// Where more is due, this part of it: what waits is published within half a second or so.
const PART: u32 = 8;

/// The blocks that have something to publish.
#[derive(Clone, Debug, Default)]
pub(crate) struct Due {
    /// In any order, and some of them twice, until they are next looked at.
    stale: Vec<BlockIndex>,
}

impl Due {
    /// Those of a map that is restored.
    pub(crate) fn restore(grid: &Grid) -> Self {
        let stale = grid.blocks().filter(|(_, block)| block.news.is_stale());
        Self { stale: stale.map(|(slot, _)| slot).collect() }
    }

    /// Adds a block that has something to publish.
    pub(crate) fn push(&mut self, block: BlockIndex) {
        self.stale.push(block);
    }

    /// The blocks to be published now, ascending; the others go on waiting. What has changed is in those that the scan
    /// `touched`: put points into, or took voxels from.
    pub(crate) fn take<'a>(
        &mut self,
        grid: &Grid,
        touched: impl Iterator<Item = &'a BlockIndex>,
        timing: Timing,
    ) -> Vec<BlockIndex> {
        self.stale.extend(touched.filter(|&&block| grid.block(block).news.is_stale()));
        self.stale.sort_unstable();
        self.stale.dedup();
        let is_due = |block: &mut BlockIndex| is_due(grid, *block, timing);
        let due = self.stale.extract_if(.., is_due).collect();
        self.first_of(grid, due, timing)
    }

    /// The blocks, of those that are due (ascending), which are published in this scan: all that cannot wait, and of the
    /// others, the longest published first, as many as have what is left of [`SHARE`] m^2, or one in [`PART`] where more wait.
    fn first_of(&mut self, grid: &Grid, due: Vec<BlockIndex>, timing: Timing) -> Vec<BlockIndex> {
        let voxels = |&block: &BlockIndex| grid.block(block).dense;
        let (mut first, mut others): (Vec<_>, Vec<_>) =
            due.into_iter().partition(|&block| grid.block(block).news.is_urgent(timing));
        let size = grid.voxel_size();
        let share = ((SHARE / (size * size)) as u32).saturating_sub(first.iter().map(voxels).sum());
        // One at least: a block whose turn never comes would wait for ever.
        let most = share.max(others.iter().map(voxels).sum::<u32>() / PART).max(1);
        others.sort_by_key(|&block| grid.block(block).news.published());
        let mut taken = 0;
        let later = others.iter().position(|block| {
            let is_over = taken >= most;
            taken += voxels(block);
            is_over
        });
        self.stale.extend(others.drain(later.unwrap_or(others.len())..));
        first.extend(others);
        first.sort_unstable();
        first
    }

    /// Names blocks by the places that they have now.
    pub(crate) fn rename(&mut self, moves: &Moves) {
        moves.rename(&mut self.stale);
    }

    /// The blocks that have something to publish.
    #[cfg(test)]
    pub(crate) fn stale(&self) -> &[BlockIndex] {
        &self.stale
    }

    /// How many blocks are due and still wait.
    #[cfg(test)]
    pub(crate) fn overdue(&self, grid: &Grid, timing: Timing) -> usize {
        self.stale.iter().filter(|&&block| is_due(grid, block, timing)).count()
    }
}

fn is_due(grid: &Grid, block: BlockIndex, timing: Timing) -> bool {
    let block = grid.block(block);
    block.news.is_due(block.dense, timing)
}
