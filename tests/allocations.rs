//! What a scan allocates: nothing where it shows nothing new, and some pieces for each cluster that it tells of else.
#![cfg(feature = "sim")]
#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

use cfodi::engine::{Engine, Params, Stamp, Update};
use cfodi::sim::{Drive, Scene};

/// Scans with other noise each; then they come again, so that nothing is new.
const NOISES: u32 = 20;
const ROUNDS: u32 = 10;

/// A scan's allocations and what it did.
fn standing_still(scene: &str, view: u32, voxel_size: f64) -> Vec<(u64, Update)> {
    let mut engine = Engine::new(Params::default().with_voxel_size(voxel_size).unwrap());
    let noisy = |noise: u32| {
        let drive = Drive::new(Scene::named(scene).unwrap(), noise.into(), Stamp::from_nanos(0));
        drive.labelled_scan(view).scan
    };
    let mut scans: Vec<_> = (0..NOISES).map(noisy).collect();
    let take_in = |number: u32| {
        let scan = &mut scans[(number % NOISES) as usize];
        scan.stamp = Stamp::from_nanos(i64::from(number) * 33_333_333);
        let mut update = None;
        let allocated = allocation_counter::measure(|| update = Some(engine.insert(scan)));
        (allocated.count_total, update.unwrap())
    };
    (0..ROUNDS * NOISES).map(take_in).skip((NOISES * ROUNDS / 2) as usize).collect()
}

/// Where nothing is told, nothing is allocated; what is told is handed out, in some pieces for each cluster.
#[test]
fn a_scan_that_shows_nothing_new_allocates_nothing_but_what_it_tells() {
    for (scene, view, voxel_size) in [("room", 0, 0.08), ("lab", 600, 0.08), ("lab", 600, 0.05)] {
        let scans = standing_still(scene, view, voxel_size);
        let steady: Vec<_> = scans
            .iter()
            .filter(|(_, update)| update.newly_dense == 0 && update.removed.is_empty())
            .map(|(allocations, update)| (*allocations, update.changed.len() as u64))
            .collect();
        let (silent, telling): (Vec<_>, Vec<_>) = steady.into_iter().partition(|(_, told)| *told == 0);
        eprintln!("{scene}, {voxel_size} m: {} silent scans, telling ones: {telling:?}", silent.len());
        assert!(silent.len() >= 5 && telling.len() >= 5, "{scene}: {} and {}", silent.len(), telling.len());
        assert!(silent.iter().all(|(allocations, _)| *allocations == 0), "{scene}: {silent:?}");
        let few = telling.iter().filter(|(allocations, told)| *allocations <= 10 * told).count();
        // The others publish a block.
        assert!(10 * few >= 9 * telling.len(), "{scene}: {telling:?}");
    }
}
