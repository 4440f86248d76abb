//! Where patches meet, as all pairs of their voxels say.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::super::block::{BlockIndex, place_of};
use super::super::patch::Kind;
use super::super::patch::examples::{self, rows, rows_from};
use super::*;
use crate::engine::params::Params;

/// Voxels by their coordinates in the block, each with the number of its patch.
type Drawn = BTreeMap<[i32; 3], u8>;

const PATCHES: u8 = 4;

fn drawn() -> impl Strategy<Value = Drawn> {
    prop::collection::btree_map(prop::array::uniform3(0..EDGE), 0..PATCHES, 0..300)
}

/// Of these patches, whose voxels have no states.
pub(in super::super) fn of_patches(patches: Vec<Patch>) -> Segmented {
    let cells = patches.iter().flat_map(|patch| patch.cells.iter()).collect();
    Segmented { cells, patches, ..Segmented::default() }
}

/// Of patches of which nothing counts but their cells.
fn block(drawn: &Drawn) -> Segmented {
    static ANY: LazyLock<Patch> = LazyLock::new(|| rows(0..4, |_| 2.3));
    let patch = |number: u8| {
        let mut patch = ANY.clone();
        let own = drawn.iter().filter(|(_, of)| **of == number);
        patch.cells = own.map(|(at, _)| Cell::at(*at)).collect();
        patch
    };
    of_patches((0..PATCHES).map(patch).collect())
}

/// Two patches meet in each pair of voxels that lie within `reach` of each other along each axis. Within a block the one with the
/// lower number meets the other.
fn naive_contacts(
    here: &Drawn,
    there: &Drawn,
    direction: [i32; 3],
    corner: [i32; 3],
    reach: i32,
) -> BTreeMap<(u8, u8), Contact> {
    let mut contacts: BTreeMap<_, Contact> = BTreeMap::new();
    let [from, to] = [[0; 3], direction].map(|blocks| Vector3::from(corner) + Vector3::from(blocks) * EDGE);
    for (a, own) in here {
        for (b, other) in there {
            let (a, b) = (from + Vector3::from(*a), to + Vector3::from(*b));
            let is_met = direction != [0; 3] || own < other;
            if is_met && (a - b).amax() <= reach {
                let contact = contacts.entry((*own, *other)).or_default();
                contact.pairs += 1;
                contact.sum += (a + b).map(f64::from) + Vector3::repeat(1.0);
            }
        }
    }
    contacts
}

proptest! {
    #[test]
    fn contacts_are_those_of_all_pairs_of_voxels(
        here in drawn(), there in drawn(), direction in prop::array::uniform3(-1..2_i32),
        key in prop::array::uniform3(-1000..1000_i32), reach in 1..4_i32,
    ) {
        let there = if direction == [0; 3] { here.clone() } else { there };
        let corner = key.map(|along| along * EDGE);
        let found = contacts(&block(&here), &block(&there), place_of(direction), corner, reach);
        let known = naive_contacts(&here, &there, direction, corner, reach);
        prop_assert_eq!(found, known.into_iter().collect::<Vec<_>>());
    }
}

fn id(block: u32, number: u8) -> PatchId {
    PatchId { block: BlockIndex(block), number }
}

/// The first block, of these patches, which meet each other.
fn of_a_block(patches: Vec<Patch>) -> Segmented {
    let mut here = of_patches(patches);
    for ((a, b), contact) in contacts(&here, &here.clone(), place_of([0; 3]), [0; 3], CONTACT_REACH) {
        here.contacts.insert(a, id(0, b), &contact);
        here.contacts.insert(b, id(0, a), &contact);
    }
    here
}

/// A wall, what its points scattered by when it was seen from afar, and beside that the scatter of a door that stands ajar.
#[test]
fn what_scatters_before_a_wall_is_a_slice_of_it_though_it_fits_a_scatter_that_leads_away_better() {
    let rules = Rules::new(&Params::default());
    let wall = rows_from(2.5, 0..4, |_| 2.15);
    let scatter = rows_from(4.5, 0..4, |y| 3.0 + 0.01 * y);
    let beside = |slope: f64| {
        let beside = rows_from(4.4, 4..8, |y| 3.05 + slope * (y - 4.0));
        let turn = beside.normal().angle(&wall.normal());
        assert!(beside.slice_of(&wall, &rules).is_some(), "{slope}");
        let all = SegmentedBlocks::from_iter([of_a_block(vec![wall.clone(), scatter.clone(), beside])]);
        let contact = contacts_of(&all, id(0, 1)).find(|(met, _)| *met == id(0, 2)).unwrap().1;
        let [scatter, beside] = [1, 2].map(|number| patch(&all, id(0, number)));
        assert!(scatter.is_equal_of(beside, &contact, &rules), "{slope}");
        assert!(scatter.misfit(beside, &rules) < scatter.misfit(&wall, &rules), "{slope}");
        (turn > rules.join_angle, host(&all, id(0, 1), &rules))
    };
    assert_eq!(beside(0.18), (true, Host::SliceOf(id(0, 0))));
    assert_eq!(beside(0.01), (false, Host::None), "what goes on as it does is its equal");
}

/// The foot of a ramp of 18 degrees, as it is seen from afar: the last rows of a block lie between floor and ramp. Of neither floor
/// nor foot does the block hold more than two layers.
#[test]
fn what_lies_between_floor_and_ramp_is_a_part_of_the_one_that_it_fits_best() {
    let rules = Rules::new(&Params::default());
    let floor = rows(0..4, |_| 0.35);
    let foot = rows(4..8, |y| 0.35 + 0.16 * (y - 4.0));
    let corner = [0, EDGE, 0];
    let ramp_states = examples::states(1.0, &Vector3::z(), 0..5, |y| 1.0 + 0.32 * y);
    let ramp_states: Vec<_> = ramp_states.iter().collect();
    let ramp = Patch::new(&ramp_states, &Vector3::from(corner).map(f64::from), Kind::Flat, &rules).unwrap();

    let mut here = of_a_block(vec![floor, foot]);
    let mut there = Segmented { contacts: Contacts::new(corner), ..of_patches(vec![ramp]) };
    let on_floor = SegmentedBlocks::from_iter([here.clone(), Segmented::default()]);
    for ((a, b), contact) in contacts(&here, &there, place_of([0, 1, 0]), [0; 3], CONTACT_REACH) {
        here.contacts.insert(a, id(1, b), &contact);
        there.contacts.insert(b, id(0, a), &contact);
    }
    let all = SegmentedBlocks::from_iter([here, there]);

    assert_eq!(host(&on_floor, id(0, 1), &rules), Host::None, "one end alone is no bridge");
    assert_eq!(host(&all, id(0, 0), &rules), Host::None, "a floor is no part of its ramp's foot");
    let Host::BridgeTo(end) = host(&all, id(0, 1), &rules) else {
        panic!("{:?}", host(&all, id(0, 1), &rules))
    };
    let misfits = [id(0, 0), id(1, 0)].map(|end| patch(&all, id(0, 1)).misfit(patch(&all, end), &rules));
    assert_eq!(end == id(0, 0), misfits[0] <= misfits[1], "{misfits:?}");
    let [foot, floor, ramp] = [id(0, 1), id(0, 0), id(1, 0)];
    let other = if end == floor { ramp } else { floor };
    let joined = |to: PatchId| {
        let mut all = all.clone();
        all[foot.block].patches[1].host = Host::BridgeTo(end);
        let contact = contacts_of(&all, foot).find(|(met, _)| *met == to).unwrap().1;
        are_joined(&all, foot, to, &contact, &rules)
    };
    assert!(joined(end) && !joined(other));
}
