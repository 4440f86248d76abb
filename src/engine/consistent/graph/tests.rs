//! The graph beside a naive one, and counts of its work.

mod naive;
mod shapes;

use proptest::prelude::*;

use self::naive::Held;
use self::shapes::{Patches, Shape, change, shape};
use super::{Batch, ComponentId, End, Flow, Graph, Moved, NodeId};

fn old(one: u32, other: u32) -> (End, End) {
    (End::Old(NodeId(one)), End::Old(NodeId(other)))
}

/// The flows as (from, to, weight).
fn flows(flows: &[Flow]) -> Vec<(u32, u32, u64)> {
    flows.iter().map(|flow| (flow.from.0, flow.to.0, flow.weight)).collect()
}

#[test]
fn nothing_comes_of_an_empty_batch() {
    let mut held = Held::default();
    assert_eq!(held.apply(&Batch::default()), super::Outcome::default());
    held.apply(&Shape::Path(3).batch());
    assert_eq!(held.apply(&Batch::default()), super::Outcome::default());
}

#[test]
fn the_heavier_component_of_a_merge_keeps_its_slot_however_many_nodes_the_other_has() {
    let mut held = Held::default();
    let connect = vec![(End::New(0), End::New(1)), (End::New(1), End::New(2))];
    held.apply(&Batch { add: vec![1, 1, 1, 10], connect, ..Batch::default() });
    let outcome = held.apply(&Batch { connect: vec![old(0, 3)], ..Batch::default() });
    assert_eq!(outcome.removed, [ComponentId(0)]);
    assert_eq!(flows(&outcome.flows), [(0, 1, 3), (1, 1, 10)]);
    assert_eq!((outcome.moved.len(), held.graph.weight(ComponentId(1))), (3, 13));
}

#[test]
fn a_new_node_without_old_ones_beside_it_makes_a_component_even_where_one_went() {
    let mut held = Held::default();
    held.apply(&Batch { add: vec![5], ..Batch::default() });
    let outcome = held.apply(&Batch { remove: vec![NodeId(0)], add: vec![5], ..Batch::default() });
    assert_eq!(outcome.gone, [(NodeId(0), ComponentId(0))]);
    assert_eq!(outcome.added, [(NodeId(1), ComponentId(1))]);
    assert_eq!((outcome.removed, outcome.created), (vec![ComponentId(0)], vec![ComponentId(1)]));
}

#[test]
fn a_split_and_a_merge_in_one_batch_move_the_part_straight_into_the_other_component() {
    // 0 - 1 - 2 - 3 - 4 - 5 - 6 loses 1 - 2; 0 - 1 joins the component of 7.
    let mut held = Held::default();
    held.apply(&Shape::Path(7).batch());
    held.apply(&Batch { add: vec![9], ..Batch::default() });
    let disconnect = vec![(NodeId(2), NodeId(1))];
    let outcome = held.apply(&Batch { disconnect, connect: vec![old(0, 7)], ..Batch::default() });
    let moved = |node| Moved { node: NodeId(node), from: ComponentId(0), to: ComponentId(1) };
    assert_eq!(outcome.moved, [moved(1), moved(0)]);
    assert_eq!(flows(&outcome.flows), [(0, 0, 5), (0, 1, 2), (1, 1, 9)]);
    assert!(outcome.created.is_empty() && outcome.removed.is_empty());
}

#[test]
fn parts_that_only_another_component_joins_again_move_nowhere() {
    // The path is cut in the middle, and both its ends are joined to another component.
    let mut held = Held::default();
    held.apply(&Shape::Path(20).batch());
    held.apply(&Batch { add: vec![1, 1], connect: vec![(End::New(0), End::New(1))], ..Batch::default() });
    let disconnect = vec![(NodeId(9), NodeId(10))];
    let connect = vec![old(0, 20), old(19, 21)];
    let outcome = held.apply(&Batch { disconnect, connect, ..Batch::default() });
    assert!(outcome.moved.iter().all(|moved| moved.from == ComponentId(1)) && outcome.moved.len() == 2);
    assert_eq!(outcome.removed, [ComponentId(1)]);
}

#[test]
fn an_edge_that_goes_and_comes_in_one_batch_stays() {
    let mut held = Held::default();
    held.apply(&Shape::Path(10).batch());
    let disconnect = vec![(NodeId(4), NodeId(5)), (NodeId(5), NodeId(4))];
    held.apply(&Batch { disconnect, connect: vec![old(5, 4), old(4, 5)], ..Batch::default() });
    assert_eq!((held.graph.expanded, held.graph.components().count()), (0, 1));
}

#[test]
#[should_panic(expected = "NodeId(1) is not in the graph")]
fn a_node_that_goes_takes_no_new_edge() {
    let mut graph = Graph::default();
    graph.apply(&Shape::Path(3).batch());
    graph.apply(&Batch { remove: vec![NodeId(1)], connect: vec![old(0, 1)], ..Batch::default() });
}

#[test]
#[should_panic(expected = "cannot be joined to itself")]
fn a_node_is_not_its_own_neighbour() {
    Graph::default().apply(&Batch {
        add: vec![1],
        connect: vec![(End::New(0), End::New(0))],
        ..Batch::default()
    });
}

#[test]
fn a_tip_that_is_cut_off_a_long_path_costs_the_tip() {
    const LENGTH: u32 = 100_000;
    for tip in [1, 10, 100, 1000] {
        let mut graph = Graph::default();
        graph.apply(&Shape::Path(LENGTH).batch());
        let cut = NodeId(LENGTH - tip - 1);
        let outcome = graph.apply(&Batch { remove: vec![cut], ..Batch::default() });
        // As many on the other side, in lockstep, and the one that found the end.
        assert!(graph.expanded <= 2 * u64::from(tip) + 2, "{} for a tip of {tip}", graph.expanded);
        assert_eq!(outcome.moved.len(), tip as usize);
        assert_eq!(outcome.created, [ComponentId(1)]);
        assert_eq!(graph.weight(ComponentId(0)), u64::from(LENGTH - tip - 1));
    }
}

#[test]
fn all_tips_but_the_longest_part_are_searched_when_many_are_cut_off_at_once() {
    let mut graph = Graph::default();
    graph.apply(&Shape::Path(100_000).batch());
    // Parts of 50, 99, 149, 199, 199 and the rest.
    let remove = [50, 150, 300, 500, 700].map(NodeId).to_vec();
    let outcome = graph.apply(&Batch { remove, ..Batch::default() });
    assert_eq!((graph.components().count(), outcome.moved.len()), (6, 50 + 99 + 149 + 199 + 199));
    // Inner parts have a group of terminals at either end; together they expand each node once.
    assert!(graph.expanded <= 2 * outcome.moved.len() as u64, "{}", graph.expanded);
}

#[test]
fn a_node_in_the_middle_of_a_large_grid_is_replaced_without_a_search() {
    const SIDE: u32 = 300;
    let mut graph = Graph::default();
    graph.apply(&Shape::Grid(SIDE, SIDE).batch());
    let middle = SIDE / 2 * SIDE + SIDE / 2;
    let around = [middle - SIDE, middle - 1, middle + 1, middle + SIDE].map(NodeId);
    let connect = around.map(|node| (End::New(0), End::Old(node))).to_vec();
    let outcome =
        graph.apply(&Batch { remove: vec![NodeId(middle)], add: vec![7], connect, ..Batch::default() });
    assert_eq!((graph.expanded, outcome.moved.len()), (0, 0));
    let new = outcome.added[0];
    assert_eq!(new.1, ComponentId(0));
    // Without a replacement the four neighbours meet around the hole.
    let outcome = graph.apply(&Batch { remove: vec![new.0], ..Batch::default() });
    assert!(graph.expanded <= 12 && outcome.moved.is_empty(), "{}", graph.expanded);
}

#[test]
fn a_small_component_that_touches_a_large_one_costs_the_small_one() {
    let mut graph = Graph::default();
    graph.apply(&Shape::Path(10).batch());
    graph.apply(&Shape::Path(100_000).batch());
    let outcome = graph.apply(&Batch { connect: vec![old(9, 10)], ..Batch::default() });
    assert_eq!((graph.expanded, outcome.moved.len(), outcome.removed), (0, 10, vec![ComponentId(0)]));
}

#[test]
fn a_cycle_that_is_opened_is_walked_until_both_walks_meet() {
    let mut graph = Graph::default();
    graph.apply(&Shape::Cycle(1000).batch());
    let outcome = graph.apply(&Batch { remove: vec![NodeId(500)], ..Batch::default() });
    assert!((990..=1000).contains(&graph.expanded) && outcome.moved.is_empty(), "{}", graph.expanded);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn components_are_those_of_a_search_from_scratch(
        shape in shape(), changes in proptest::collection::vec(change(), 1..12),
    ) {
        let mut held = Held::default();
        held.apply(&shape.batch());
        for change in &changes {
            held.apply(&change.batch(&held.naive));
        }
    }

    #[test]
    fn components_of_patches_segmented_anew_are_those_of_a_search_from_scratch(
        side in (3usize..14, 3usize..14), blocks in proptest::collection::vec(shapes::block(), 1..16),
    ) {
        let (mut held, mut patches) = (Held::default(), Patches::new(side));
        for block in &blocks {
            let batch = patches.batch(block);
            let outcome = held.apply(&batch);
            patches.take(&outcome);
        }
    }

    #[test]
    fn pieces_that_part_and_join_again_and_again_are_those_of_a_search_from_scratch(
        length in 10u32..60, cuts in proptest::collection::vec(proptest::collection::vec(any::<u16>(), 1..6), 1..12),
    ) {
        // Each batch mends the cuts of the one before in another order of ends.
        let mut held = Held::default();
        held.apply(&Shape::Path(length).batch());
        let mut open: Vec<(NodeId, NodeId)> = Vec::new();
        for cuts in cuts {
            let connect = open.iter().map(|edge| old(edge.1.0, edge.0.0)).collect();
            let places = cuts.iter().map(|&cut| u32::from(cut) % (length - 1));
            open = places.map(|at| (NodeId(at), NodeId(at + 1))).collect();
            held.apply(&Batch { disconnect: open.clone(), connect, ..Batch::default() });
        }
    }
}
