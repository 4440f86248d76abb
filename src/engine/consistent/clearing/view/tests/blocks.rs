//! Which blocks are listed.

use std::collections::BTreeSet;

use super::*;

proptest! {
    #[test]
    fn all_blocks_with_a_voxel_seen_through_are_listed_once_in_order(
        sensor in sensor(), solids in solids(), seed in 0..1000_u64, edge in 0.05..0.1_f64,
    ) {
        let grid = filled(&sensor.measure(&solids, kinect_noise(seed)));
        let mut listed = vec![[7; 3]];
        grid.blocks_in_view(&sensor.fixed_from_sensor, 8.0 * edge, 6.0, everywhere(), |_| true, &mut listed);
        prop_assert!(listed.is_sorted_by(|a, b| a < b));
        let (even, mut wanted) = (|key: [i32; 3]| key[0] % 2 == 0, vec![[7; 3]]);
        grid.blocks_in_view(&sensor.fixed_from_sensor, 8.0 * edge, 6.0, everywhere(), even, &mut wanted);
        let expected: Vec<_> = listed.iter().copied().filter(|&key| even(key)).collect();
        prop_assert_eq!(wanted, expected);
        // Of few known ones, these in view, in order; the others lie far behind.
        let few: Vec<_> = listed.iter().step_by(9).rev().copied().collect();
        let known: Vec<_> = few.iter().flat_map(|&key| [key, key.map(|i| i - 1000)]).collect();
        let mut of_few = vec![[7; 3]];
        let pose = &sensor.fixed_from_sensor;
        let is_known = |key| few.contains(&key);
        grid.blocks_in_view(pose, 8.0 * edge, 6.0, (known.len(), known.into_iter()), is_known, &mut of_few);
        prop_assert!(of_few.iter().eq(few.iter().rev()));
        let through = voxels([-1.0, -4.0, -1.5], [5.5, 4.0, 2.5], edge).into_iter().step_by(7);
        // What lies farther away than the blocks are asked for need not be listed, though the sensor may see through it.
        let sensor_from_fixed = sensor.fixed_from_sensor.inverse();
        let depth = |key: [i32; 3]| {
            let middle = Vector3::from(key).map(|i| (f64::from(i) + 0.5) * edge);
            (sensor_from_fixed * Point3::from(middle)).coords.amax()
        };
        let through = through.filter(|&key| depth(key) < 6.0 && sensor.look(&grid, key, edge, |_| 0.0));
        for block in through.map(|key| key.map(|i| i.div_euclid(8))).collect::<BTreeSet<_>>() {
            prop_assert!(listed.binary_search(&block).is_ok(), "{:?}", block);
        }
    }
}

/// More blocks than lie around any view.
fn everywhere() -> (usize, impl Iterator<Item = [i32; 3]>) {
    (1 << 20, std::iter::repeat_n([0; 3], 1 << 20))
}

#[test]
fn no_block_is_in_view_of_an_empty_scan_or_behind_the_wall() {
    let sensor = Sensor::kinect(looking_along_x([0.0, 0.0, 1.0], 0.0), 2);
    let mut grid = RangeGrid::new();
    let mut blocks = vec![[0; 3]];
    grid.blocks_in_view(&sensor.fixed_from_sensor, 0.64, 6.0, everywhere(), |_| true, &mut blocks);
    assert!(blocks.is_empty());
    grid.fill(&sensor.measure(&[wall_at(3.0)], |_, _| 0.0));
    grid.blocks_in_view(&sensor.fixed_from_sensor, 0.64, 6.0, everywhere(), |_| true, &mut blocks);
    assert!(blocks.contains(&[3, 0, 1]));
    assert!(blocks.iter().all(|&[x, ..]| (0..=4).contains(&x)), "{blocks:?}");
    grid.blocks_in_view(&sensor.fixed_from_sensor, 0.64, 2.0, everywhere(), |_| true, &mut blocks);
    assert!(blocks.iter().all(|&[x, ..]| (0..=3).contains(&x)), "{blocks:?}");
}

#[test]
fn blocks_ever_so_small_are_looked_for_among_the_known_ones() {
    let sensor = Sensor::kinect(looking_along_x([0.0, 0.0, 1.0], 0.0), 2);
    let mut grid = RangeGrid::new();
    grid.fill(&sensor.measure(&[wall_at(3.0)], |_, _| 0.0));
    let mut blocks = Vec::new();
    // Of a nanometre: more than an index counts lie in view.
    let known = [[2_000_000_000, 0, 1_000_000_000], [-2_000_000_000, 0, 1_000_000_000]];
    grid.blocks_in_view(
        &sensor.fixed_from_sensor,
        1e-9,
        6.0,
        (known.len(), known.into_iter()),
        |_| true,
        &mut blocks,
    );
    assert_eq!(blocks, known[..1]);
}
