//! Which patch a voxel in none belongs to, as a look at all patches says.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::*;
use crate::engine::consistent::block::Voxel;
use crate::engine::consistent::patch::examples::rows;
use crate::engine::consistent::patch::segmented::Segmented;
use crate::engine::consistent::patch::segmented::tests::of_patches;
use crate::engine::consistent::sums::ScanSums;
use crate::engine::params::Params;

/// Voxels by their coordinates in a block, each with the number of its patch.
type Drawn = BTreeMap<[i32; 3], u8>;

/// Patches of a block, and blocks at most.
const PATCHES: u8 = 3;
const BLOCKS: usize = 5;

/// Level planes, each at a height of its own, so that no two fit a voxel alike.
static LEVELS: LazyLock<Vec<Patch>> = LazyLock::new(|| {
    let height = |number: usize| 2.05 + 0.12 * number as f64;
    (0..BLOCKS * usize::from(PATCHES)).map(height).map(|height| rows(0..4, |_| height)).collect()
});

fn drawn() -> impl Strategy<Value = Drawn> {
    prop::collection::btree_map(prop::array::uniform3(0..EDGE), 0..PATCHES, 0..60)
}

/// The block of this number among the others.
fn block(number: usize, drawn: &Drawn) -> Segmented {
    let patch = |own: u8| {
        let mut patch = LEVELS[number * usize::from(PATCHES) + usize::from(own)].clone();
        let cells = drawn.iter().filter(|(_, of)| **of == own);
        patch.cells = cells.map(|(at, _)| Cell::at(*at)).collect();
        patch
    };
    of_patches((0..PATCHES).map(patch).collect())
}

/// A voxel with points on a level this far above its floor, in 4096ths.
fn voxel(at: [i32; 3], up: u64) -> State {
    let mut scan = ScanSums::default();
    for (a, b) in (0..8_u64).flat_map(|a| (0..8_u64).map(move |b| (a, b))) {
        scan.add([a * 512 + 256, b * 512 + 256, up]);
    }
    let mut voxel = Voxel::new(Cell::at(at));
    voxel.count = scan.count;
    voxel.moments.fold(&scan, Params::default().noise_model().weight(1.0), &Vector3::z());
    State::new(&voxel)
}

/// Of the patches that a voxel fits with a voxel of theirs within reach, the nearest; of several the one that it fits best, and
/// of equals the one in its own block, or in the one beside it along x, before those along y and z.
fn naive_nearest(state: &State, blocks: &[([i32; 3], Segmented)], rules: &Rules) -> Option<PatchId> {
    let (candidate, at) = (Candidate::new(state, &rules.noise), Vector3::from(state.cell().coordinates()));
    let mut fitting = Vec::new();
    for (block, (direction, segmented)) in (0..).map(BlockIndex).zip(blocks) {
        let corner = Vector3::from(*direction) * EDGE;
        let beside = (0..3).map(|axis| u8::from(direction[axis] != 0) << axis).sum::<u8>();
        let away = |cell: Cell| (Vector3::from(cell.coordinates()) + corner - at).amax();
        for (number, patch) in (0..).zip(&segmented.patches) {
            let nearest = patch.cells.iter().map(away).min().filter(|away| *away <= RIM_REACH);
            let misfit = candidate.misfit(&patch.plane(), RIM_NOISE_FACTOR, rules.rim_flatness, 1.0);
            let id = PatchId { block, number };
            fitting.extend(nearest.zip(misfit).map(|(away, misfit)| (away, misfit, beside, id)));
        }
    }
    fitting.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    fitting.first().map(|(.., id)| *id)
}

proptest! {
    #[test]
    fn a_voxel_in_no_patch_belongs_to_the_nearest_that_it_fits(
        mut own in drawn(),
        others in prop::collection::btree_map(prop::array::uniform3(-1..2_i32), drawn(), 1..BLOCKS),
        at in (0..EDGE, 0..EDGE, 1..5), up in 0..4096_u64,
    ) {
        let at = [at.0, at.1, at.2];
        own.remove(&at);
        let mut around = others;
        around.remove(&[0; 3]);
        let drawn = [([0; 3], own)].into_iter().chain(around);
        let blocks: Vec<_> =
            drawn.enumerate().map(|(number, (direction, drawn))| (direction, block(number, &drawn))).collect();
        let mut here = Block::new([0; 3]);
        for (index, (direction, _)) in (0..).map(BlockIndex).zip(&blocks) {
            here.around.set(Direction::of(*direction), Some(index));
        }
        let (state, rules) = (voxel(at, up), Rules::new(&Params::default()));
        let known = naive_nearest(&state, &blocks, &rules);
        let segmented = blocks.into_iter().map(|(_, segmented)| segmented).collect();
        prop_assert_eq!(Owners::new(&here, &segmented, &rules).of(&state), known);
    }
}
