//! Slots follow the blocks that are there.

use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::engine::consistent::block::{BlockKey, Direction};
use crate::engine::consistent::patch::PatchId;
use crate::engine::consistent::patch::contacts::Contact;
use crate::engine::key::canonical;

/// One point in each of 60 x 60 x 10 blocks of 8 cm, 1 m and more before the sensor.
const MANY: usize = 60 * 60 * 10;

fn many_blocks() -> Vec<[f32; 3]> {
    let place = |number: usize| (number as f32).mul_add(0.08, 0.005);
    (0..MANY).map(|i| [place(i % 60) - 2.4, place(i / 60 % 60) - 2.4, place(i / 3600) + 1.04]).collect()
}

/// Half a metre by half a metre, half a metre before the sensor.
fn plate() -> Vec<[f32; 3]> {
    let place = |number: usize| (number as f32).mul_add(0.005, -0.25);
    (0..10_000).map(|i| [place(i % 100), place(i / 100), 0.5]).collect()
}

fn scan(number: i64, x: f64, points: Vec<[f32; 3]>) -> Scan {
    let fixed_from_sensor = Isometry3::translation(x, 0.0, 0.0);
    Scan { stamp: Stamp::from_nanos(number * 33_333_333), fixed_from_sensor, points: Points::F32(points) }
}

/// A scan from the place of another that shows nothing.
fn blind(view: &Scan) -> Scan {
    Scan { points: Points::F32(Vec::new()), ..view.clone() }
}

fn centimetres() -> Params {
    Params::default().with_voxel_size(0.01).unwrap().with_min_points(1).unwrap()
}

/// Every slot has a block with a voxel, which is found by its key, and all that is kept by slot follows.
fn check_slots(engine: &Consistent) {
    let slots = engine.grid.slots();
    for (slot, block) in engine.grid.blocks() {
        assert!(!block.is_empty() && engine.grid.find(block.key) == Some(slot), "{slot:?} of {slots}");
        for direction in Direction::all() {
            let offset = direction.offset();
            let beside = engine.grid.find([0, 1, 2].map(|axis| block.key[axis] + offset[axis]));
            assert_eq!(block.around.get(direction), beside, "{slot:?} of {slots}, {offset:?}");
        }
    }
    assert_eq!(engine.grid.keys().count(), slots);
    assert!(engine.due.stale().iter().all(|block| engine.grid.block(*block).news.is_stale()));
    let restored = Consistent::restore(engine.params, engine.taken, engine.freeze().save()).unwrap();
    let frozen = [engine, &restored].map(|engine| engine.surfaces.freeze());
    let frozen = frozen.map(|surfaces| (surfaces.faces(), surfaces));
    for (slot, _) in engine.grid.blocks() {
        let [here, there] = [engine, &restored].map(|engine| &engine.surfaces.segmented()[slot]);
        let [contacts, others] = [here, there].map(contacts);
        assert_eq!(contacts, others, "{slot:?}");
        assert!(here.patches.iter().map(|it| it.host).eq(there.patches.iter().map(|it| it.host)));
        let voxels = frozen.each_ref().map(|(faces, surfaces)| format!("{:?}", surfaces.voxels(slot, faces)));
        let [voxels, others] = voxels;
        assert_eq!(voxels, others, "{slot:?}");
    }
    assert_eq!(engine.surfaces.segmented().len(), slots);
}

/// Where each patch of a block meets others.
fn contacts(here: &Segmented) -> Vec<Vec<(PatchId, Contact)>> {
    (0..here.patches.len() as u8).map(|number| here.contacts.of(number).collect()).collect()
}

/// How many blocks have other slots than before.
fn moved(engine: &Consistent, before: &mut BTreeMap<BlockKey, BlockIndex>) -> usize {
    let now: BTreeMap<_, _> = engine.grid.blocks().map(|(slot, block)| (block.key, slot)).collect();
    let moved = now.iter().filter(|(key, slot)| before.get(*key).is_some_and(|before| before != *slot));
    let moved = moved.count();
    *before = now;
    moved
}

#[test]
fn whatever_is_forgotten_slots_have_blocks_and_the_map_is_what_its_definition_makes_of_it() {
    for (voxels, radius) in [(0, 2.5), (2000, 0.0), (1500, 3.0)] {
        let params = Params::default().with_max_voxels(voxels).unwrap().with_keep_radius(radius).unwrap();
        let mut next = laboratory();
        let mut engine = Consistent::new(params);
        let (mut before, mut moves) = (BTreeMap::new(), 0);
        for _ in 0..30 {
            engine.insert(&next());
            moves += moved(&engine, &mut before);
            check_slots(&engine);
            let [kept, scratch] = [engine.partition(), engine.scratch()].map(canonical);
            assert!(kept == scratch, "after {} scans", engine.taken.sequence);
        }
        assert!(moves > 0, "none moves with {voxels} and {radius}");
    }
}

#[test]
fn what_was_frozen_stays_as_it_was_whatever_is_forgotten_and_seen_after_it() {
    let params = Params::default().with_max_voxels(2000).unwrap().with_keep_radius(3.0).unwrap();
    let mut next = laboratory();
    let views: Vec<_> = (0..12).map(|_| next()).collect();
    let mut engine = Consistent::new(params);
    let mut frozen = Vec::new();
    for (number, views) in (0..).zip(views.chunks(3).cycle().take(8)) {
        views.iter().for_each(|view| drop(engine.insert(view)));
        if number % 2 == 1 {
            // Long enough for all blocks to come to rest; the next view wakes some.
            (0..70).for_each(|_| drop(engine.insert(&blind(&views[0]))));
        }
        let map = engine.freeze();
        let then = (map.save(), format!("{:?}", map.snapshot()));
        frozen.push((map, then));
    }
    for (number, (map, (saved, snapshot))) in frozen.iter().enumerate() {
        assert!(map.save() == *saved, "{number}");
        // As a text, in which what has no curvature is equal to itself.
        assert!(format!("{:?}", map.snapshot()) == *snapshot, "{number}");
    }
}

#[test]
fn a_scan_after_the_map_was_frozen_copies_what_it_changes_alone() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default());
    (0..40).for_each(|_| drop(engine.insert(&next())));
    let view = next();
    // Until all that was due is published, and all blocks are at rest.
    (0..70).for_each(|_| drop(engine.insert(&blind(&view))));
    let frozen = engine.freeze();
    let shared = |engine: &Consistent| {
        let now = engine.freeze();
        let [segmented, nodes, graph] = now.surfaces.shared_with(&frozen.surfaces);
        [now.blocks.shared_with(&frozen.blocks), segmented, nodes, graph]
    };
    assert_eq!(shared(&engine), [1.0; 4], "freezing copies nothing");
    engine.insert(&blind(&view));
    assert_eq!(shared(&engine), [1.0; 4], "nor does a scan that shows nothing");
    engine.insert(&view);
    assert!(shared(&engine).iter().all(|part| *part < 1.0), "{:?}", shared(&engine));
    let around = |block: &BlockIndex| engine.grid.block(*block).around.iter().map(|(_, beside)| beside);
    let reached: BTreeSet<_> = engine.binned.seen.iter().flat_map(around).collect();
    let now = engine.freeze();
    let copied = now.blocks.copied_since(&frozen.blocks).chain(now.surfaces.copied_since(&frozen.surfaces));
    for page in copied {
        let blocks = BlockIndex(page.start as u32)..BlockIndex(page.end as u32);
        assert!(reached.range(blocks.clone()).next().is_some(), "{blocks:?}");
    }
}

#[test]
fn a_map_that_had_many_blocks_at_once_has_slots_for_those_it_has_and_is_restored() {
    let params = centimetres().with_max_voxels(1000).unwrap();
    let mut engine = Engine::new(params);
    engine.insert(&scan(1, 0.0, many_blocks()));
    let saved = engine.freeze().save();
    let mut restored = Engine::restore(params, saved.clone()).unwrap();
    assert!(restored.freeze().save() == saved);
    for number in 2..6 {
        let scan = scan(number, 0.0, plate()[..900].to_vec());
        let updates = [engine.insert(&scan), restored.insert(&scan)];
        assert_eq!(format!("{:?}", updates[0]), format!("{:?}", updates[1]));
        assert!(engine.freeze().save() == restored.freeze().save(), "after {number} scans");
    }
    let mut map = Consistent::new(params);
    map.insert(&scan(1, 0.0, many_blocks()));
    assert_eq!([map.voxel_count(), map.grid.slots()], [1000, 1000]);
}

#[test]
fn what_is_left_behind_is_gone_when_the_blocks_that_are_there_have_had_their_turn() {
    let mut map = Consistent::new(centimetres().with_keep_radius(1.0).unwrap());
    map.insert(&scan(1, 0.0, many_blocks()));
    (2..6).for_each(|number| drop(map.insert(&scan(number, 0.0, plate()))));
    assert!(map.grid.slots() < 200, "{}", map.grid.slots());
    map.insert(&scan(6, 10.0, plate()));
    assert!(map.snapshot().voxels.iter().all(|voxel| voxel.centre.x > 5.0));
    check_slots(&map);
}

#[test]
fn every_block_has_its_turn_within_two_rounds_while_others_go_and_move() {
    let mut map = Consistent::new(centimetres().with_keep_radius(3.5).unwrap().with_clearing(false));
    // A block of one and a block of the other in each column: the sensor leaves the former behind.
    let wall = |y: f32| {
        let place = |number: usize| (number as f32).mul_add(0.08, 0.045);
        (0..40 * 25).map(move |i| [place(i % 40) - 1.6, y, place(i / 40)])
    };
    map.insert(&scan(1, 0.0, wall(-1.99).chain(wall(0.5)).collect()));
    let blocks = map.grid.slots();
    assert_eq!(blocks, 2000);
    let beside = Isometry3::translation(0.0, 1.6, 0.0);
    for number in 0..2 * blocks.div_ceil(512) as i64 {
        let scan = scan(2 + number, 0.0, vec![[0.0, 0.0, 0.5]]);
        map.insert(&Scan { fixed_from_sensor: beside, ..scan });
    }
    assert!(map.snapshot().voxels.iter().all(|voxel| voxel.centre.y > 0.0));
    assert_eq!(map.grid.slots(), 1001);
    check_slots(&map);
}
