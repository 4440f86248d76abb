//! Slices and bridges, and what they are joined to.

use nalgebra::Vector3;

use super::*;
use crate::engine::consistent::block::{BlockIndex, Direction, EDGE};
use crate::engine::consistent::patch::Kind;
use crate::engine::consistent::patch::contacts::Contacts;
use crate::engine::consistent::patch::examples::{self, rows, rows_from};
use crate::engine::consistent::patch::segmented::tests::of_patches;
use crate::engine::consistent::patch::segmented::{Segmented, contacts};
use crate::engine::params::Params;

fn id(block: u32, number: u8) -> PatchId {
    PatchId { block: BlockIndex(block), number }
}

/// The first block, of these patches, which meet each other.
fn of_a_block(patches: Vec<Patch>) -> Segmented {
    let mut here = of_patches(patches);
    for ((a, b), contact) in contacts(&here, &here.clone(), Direction::OWN) {
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
        let contact = all.contacts_of(id(0, 1)).find(|(met, _)| *met == id(0, 2)).unwrap().1;
        let [scatter, beside] = [1, 2].map(|number| all.patch(id(0, number)));
        assert!(scatter.is_equal_of(beside, &contact, &rules), "{slope}");
        assert!(scatter.misfit(beside, &rules) < scatter.misfit(&wall, &rules), "{slope}");
        (turn > rules.join_angle, host(&all, id(0, 1), &rules))
    };
    assert_eq!(beside(0.18), (true, Host::SliceOf(id(0, 0))));
    assert_eq!(beside(0.01), (false, Host::None), "what goes on as it does is its equal");
}

/// What a block has of a floor at the foot of a ramp.
#[test]
fn a_row_or_two_of_a_surface_are_a_slice_of_it_though_they_could_be_its_equal() {
    let rules = Rules::new(&Params::default());
    let floor = rows_from(1.0, 0..5, |_| 2.3);
    let strip = rows_from(1.2, 5..7, |_| 2.3);
    let all = SegmentedBlocks::from_iter([of_a_block(vec![floor, strip])]);
    let contact = all.contacts_of(id(0, 1)).find(|(met, _)| *met == id(0, 0)).unwrap().1;
    let [floor, strip] = [0, 1].map(|number| all.patch(id(0, number)));
    assert!(strip.is_narrow() && strip.is_equal_of(floor, &contact, &rules));
    assert_eq!(host(&all, id(0, 1), &rules), Host::SliceOf(id(0, 0)));
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
    let mut there = of_patches(vec![ramp]);
    there.contacts = Contacts::new(corner);
    let on_floor = SegmentedBlocks::from_iter([here.clone(), Segmented::default()]);
    for ((a, b), contact) in contacts(&here, &there, Direction::of([0, 1, 0])) {
        here.contacts.insert(a, id(1, b), &contact);
        there.contacts.insert(b, id(0, a), &contact);
    }
    let all = SegmentedBlocks::from_iter([here, there]);

    assert_eq!(host(&on_floor, id(0, 1), &rules), Host::None, "one end alone is no bridge");
    assert_eq!(host(&all, id(0, 0), &rules), Host::None, "a floor is no part of its ramp's foot");
    let Host::BridgeTo(end) = host(&all, id(0, 1), &rules) else {
        panic!("{:?}", host(&all, id(0, 1), &rules))
    };
    let misfits = [id(0, 0), id(1, 0)].map(|end| all.patch(id(0, 1)).misfit(all.patch(end), &rules));
    assert_eq!(end == id(0, 0), misfits[0] <= misfits[1], "{misfits:?}");
    let [foot, floor, ramp] = [id(0, 1), id(0, 0), id(1, 0)];
    let other = if end == floor { ramp } else { floor };
    let joined = |to: PatchId| {
        let mut all = all.clone();
        all[foot.block].patches[1].host = Host::BridgeTo(end);
        let contact = all.contacts_of(foot).find(|(met, _)| *met == to).unwrap().1;
        are_joined(&all, foot, to, &contact, &rules)
    };
    assert!(joined(end) && !joined(other));
}
