//! The voxels of the clusters: those of patches, and the loose ones beside them.

use super::{PublishedBlocks, Surfaces};
use crate::engine::consistent::block::{BlockIndex, CELLS, Cell};
use crate::engine::consistent::cluster::{Member, Share};
use crate::engine::consistent::graph::{Batch, ComponentId, Moved, NodeId};
use crate::engine::consistent::grid::Grid;
use crate::engine::consistent::patch::PatchId;
use crate::engine::consistent::patch::segmented::Segmented;
use crate::engine::consistent::rules::Rules;
use crate::engine::consistent::state::State;

impl Surfaces {
    /// Takes the voxels of these blocks out of their clusters, and finds their patches anew; returns what the blocks were.
    pub(super) fn replace(
        &mut self,
        grid: &Grid,
        published: PublishedBlocks<'_>,
        batch: &mut Batch,
    ) -> Vec<Old> {
        let old = published.iter().map(|block| self.withdraw(block, batch)).collect();
        for block in published.iter() {
            self.segmented[block] = Segmented::new(grid, grid.block(block), &self.rules);
        }
        old
    }

    /// Takes all voxels of a block out of their clusters, and its nodes out of the graph; returns what it was.
    fn withdraw(&mut self, block: BlockIndex, batch: &mut Batch) -> Old {
        (0..self.segmented[block].loose.len()).for_each(|number| self.leave_loose(block, number));
        let segmented = self.segmented.take(block);
        let nodes = self.nodes.take(block);
        let components: Vec<_> = nodes.iter().map(|&node| self.graph.component(node)).collect();
        let numbers = segmented.numbers();
        for (number, row) in rows(&segmented.states, &numbers) {
            if segmented.is_loose(number) {
                continue;
            }
            let component = components[usize::from(number)];
            let Some(cluster) = self.clusters[component].as_mut() else { continue };
            self.changed.insert(component);
            for state in row {
                let member = segmented.member(state, Some(number), &self.rules);
                member.iter().for_each(|member| cluster.remove(member));
            }
        }
        nodes.iter().for_each(|&node| self.patches[node] = None);
        batch.remove.extend(nodes);
        Old { segmented, components }
    }

    /// Moves a patch and the loose voxels beside it to another cluster.
    pub(super) fn transfer(&mut self, grid: &Grid, &Moved { node, from, to }: &Moved) {
        let Some(id) = self.patches[node] else { return };
        let (mut lost, mut gained) = (self.clusters[from].take(), self.clusters[to].take());
        self.for_each_voxel(grid, node, id, |block, state| {
            let own = self.number_in(id, block, state.cell());
            let member = self.segmented[block].member(state, own, &self.rules);
            if let (Some(member), Some(lost), Some(gained)) = (member, lost.as_mut(), gained.as_mut()) {
                lost.remove(&member);
                gained.add(&member);
            }
        });
        self.clusters[from] = lost;
        self.clusters[to] = gained;
        self.changed.extend([from, to]);
    }

    /// The number of a patch in its block, where a voxel is in it; `None` where that is one beside it.
    pub(super) fn number_in(&self, patch: PatchId, block: BlockIndex, cell: Cell) -> Option<u8> {
        let is_in = patch.block == block && self.segmented.patch(patch).cells.contains(cell);
        is_in.then_some(patch.number)
    }

    /// Visits the voxels that belong to a node's patch: those in it, and the loose ones beside it.
    pub(super) fn for_each_voxel(
        &self,
        grid: &Grid,
        node: NodeId,
        id: PatchId,
        mut visit: impl FnMut(BlockIndex, &State),
    ) {
        let (here, patch) = (&self.segmented[id.block], self.segmented.patch(id));
        let whole = patch.cells.iter().filter(|_| !patch.is_frayed());
        whole.filter_map(|cell| here.state(cell)).for_each(|state| visit(id.block, state));
        for (_, block) in grid.block(id.block).around.iter() {
            let there = &self.segmented[block];
            let beside = there.loose.iter().filter(|loose| loose.owner() == Some(node));
            beside.for_each(|loose| visit(block, &there.states[loose.place()]));
        }
    }

    /// Puts the voxels of a block that was segmented anew into their clusters.
    pub(super) fn enter(&mut self, grid: &Grid, block: BlockIndex) {
        let here = &self.segmented[block];
        debug_assert_eq!(here.corner(), grid.block(block).corner());
        let numbers = here.numbers();
        for (number, row) in rows(&here.states, &numbers) {
            if here.is_loose(number) {
                continue;
            }
            let component = self.graph.component(self.nodes[block][usize::from(number)]);
            let Some(cluster) = self.clusters[component].as_mut() else { continue };
            for state in row {
                let member = here.member(state, Some(number), &self.rules);
                member.iter().for_each(|member| cluster.add(member));
            }
        }
        self.enter_loose(grid, block, 0..self.segmented[block].loose.len());
    }
}

impl Segmented {
    /// A voxel of this block as a cluster counts it: as one of its own patch, of the number `own`, or, where that is `None`, as one
    /// beside a patch. `None` beyond the grid.
    pub(super) fn member<'a>(&self, state: &'a State, own: Option<u8>, rules: &Rules) -> Option<Member<'a>> {
        let key = self.voxel_key(state.cell())?;
        let share = own.map(|number| {
            let patch = &self.patches[usize::from(number)];
            let weight = patch.weight_of(state, &rules.noise);
            Share { corner: self.corner(), weight, normal: patch.normal(), noise: patch.noise() }
        });
        Some(Member { key, state, is_thin: self.is_thin(state, rules), share })
    }
}

/// The states of a block in rows of one patch, or of none, with its number.
fn rows<'a>(states: &'a [State], numbers: &[u8; CELLS]) -> impl Iterator<Item = (u8, &'a [State])> {
    let number = |state: &State| numbers[state.cell().index()];
    let rows = states.chunk_by(move |a, b| number(a) == number(b));
    rows.filter_map(move |row| Some((number(row.first()?), row)))
}

/// A block before it was published anew.
pub(super) struct Old {
    pub(super) segmented: Segmented,
    /// The components of its patches, by number.
    pub(super) components: Vec<ComponentId>,
}
