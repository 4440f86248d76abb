//! Where patches meet, as all pairs of their voxels say.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::*;
use crate::engine::consistent::block::Direction;
use crate::engine::consistent::patch::examples::rows;

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

/// A block with this lower corner, of patches of which nothing counts but their cells.
fn block(drawn: &Drawn, corner: [i32; 3]) -> Segmented {
    static ANY: LazyLock<Patch> = LazyLock::new(|| rows(0..4, |_| 2.3));
    let patch = |number: u8| {
        let mut patch = ANY.clone();
        let own = drawn.iter().filter(|(_, of)| **of == number);
        patch.cells = own.map(|(at, _)| Cell::at(*at)).collect();
        patch
    };
    Segmented { contacts: Contacts::new(corner), ..of_patches((0..PATCHES).map(patch).collect()) }
}

/// Two patches meet in each pair of voxels that touch, be it with a corner. Within a block the one with the
/// lower number meets the other.
fn naive_contacts(
    here: &Drawn,
    there: &Drawn,
    direction: [i32; 3],
    corner: [i32; 3],
) -> BTreeMap<(u8, u8), Contact> {
    let mut contacts: BTreeMap<_, Contact> = BTreeMap::new();
    let [from, to] = [[0; 3], direction].map(|blocks| Vector3::from(corner) + Vector3::from(blocks) * EDGE);
    for (a, own) in here {
        for (b, other) in there {
            let (a, b) = (from + Vector3::from(*a), to + Vector3::from(*b));
            let is_met = direction != [0; 3] || own < other;
            if is_met && (a - b).amax() <= 1 {
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
        key in prop::array::uniform3(-1000..1000_i32),
    ) {
        let there = if direction == [0; 3] { here.clone() } else { there };
        let corner = key.map(|along| along * EDGE);
        // Where the other lies follows from the direction.
        let found = contacts(&block(&here, corner), &block(&there, [0; 3]), Direction::of(direction));
        let known = naive_contacts(&here, &there, direction, corner);
        prop_assert_eq!(found, known.into_iter().collect::<Vec<_>>());
    }
}
