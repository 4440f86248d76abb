//! What tiles put into voxels against the same done point by point.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::engine::binning::{between, map};
use crate::engine::points::Rays;
use crate::engine::scan::Stamp;

type Naive = BTreeMap<(BlockKey, Cell), ScanSums>;

/// Adds a point whose places are known.
fn add(naive: &mut Naive, region: &SensorRegion, places: [i32; 3]) -> bool {
    let key = SensorRegion::key(places);
    let voxel = region.voxel(key).filter(|_| key != LocalKey::NONE);
    if let Some(voxel) = voxel {
        let offsets = places.map(|place| u64::from(place as u32 % 4096));
        naive.entry(block_and_cell(voxel)).or_default().add(offsets);
    }
    voxel.is_some()
}

/// One point after the other, by the definition of a place in a list or in an image.
fn naive(scan: &Scan, voxel_size: f64) -> Naive {
    let region = SensorRegion::new(&scan.fixed_from_sensor, voxel_size).unwrap();
    let mut naive = Naive::new();
    match &scan.points {
        Points::F32(points) | Points::Ended { points, .. } => {
            for [x, y, z] in points.iter().map(|point| point.map(f64::from)) {
                let place = |axis: usize| {
                    let [a, b, c] = region.units[axis];
                    SensorRegion::place(a * x + b * y + c * z, region.origin[axis])
                };
                add(&mut naive, &region, [0, 1, 2].map(place));
            }
        }
        Points::Depths(depths) => {
            let rays = depths.rays();
            for (row, y) in depths.rows().zip(&rays.y) {
                let pixels = row.iter().zip(&rays.x).map(|(&z, &x)| (f64::from(z), f64::from(x)));
                for (z, x) in pixels.filter(|(z, _)| *z > 0.0) {
                    let place = |axis: usize| {
                        let [a, b, c] = region.units[axis];
                        SensorRegion::place(z * ((a * x + c) + b * f64::from(*y)), region.origin[axis])
                    };
                    add(&mut naive, &region, [0, 1, 2].map(place));
                }
            }
        }
        Points::F64(_) => panic!("not placed in single precision"),
    }
    naive
}

fn received(scan: &Scan, voxel_size: f64) -> (Naive, u32) {
    let mut received = Received::default();
    // What a scan before has left behind must not matter.
    received
        .take(&Scan { fixed_from_sensor: Isometry3::translation(0.1, 0.0, 0.0), ..scan.clone() }, voxel_size);
    let beyond = received.take(scan, voxel_size);
    let in_order = received
        .in_order()
        .flat_map(|(block, voxels)| voxels.map(move |(cell, sums)| ((block, cell), *sums)));
    let in_order: Vec<_> = in_order.collect();
    assert!(in_order.is_sorted_by(|(a, _), (b, _)| a < b), "each voxel once, in order");
    (in_order.into_iter().collect(), beyond)
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    let far = prop_oneof![Just(0.0), -1e4_f64..1e4];
    (prop::array::uniform3(-3.0_f64..3.0), prop::array::uniform3(-3.0_f64..3.0), far)
        .prop_map(|(way, turn, far)| Isometry3::new([way[0] + far, way[1] - far, way[2]].into(), turn.into()))
}

fn scan(points: Points, pose: Isometry3<f64>) -> Scan {
    Scan { stamp: Stamp::from_nanos(1), fixed_from_sensor: pose, points }
}

/// An image with steps, smooth parts, holes and parts that are too far away, of a size that tiles do not divide.
fn image() -> impl Strategy<Value = Depths> {
    let depth = prop_oneof![1 => Just(f32::INFINITY), 1 => between(-9.0, -6.0), 8 => between(0.4, 6.0)];
    let row = prop::collection::vec(depth, 1..6);
    (1..40_usize, prop::collection::vec(row, 1..20), between(0.0, 0.02)).prop_map(|(width, rows, slope)| {
        let rays = |count: usize| (0..count).map(|i| (i as f32 - 0.5 * count as f32) / 60.0).collect();
        let depth = |row: &Vec<f32>, u: usize| row[u * row.len() / width] + u as f32 * slope;
        let depths = rows.iter().flat_map(|row| (0..width).map(move |u| depth(row, u))).collect();
        Depths::new(Arc::new(Rays { x: rays(width), y: rays(rows.len()) }), depths).unwrap()
    })
}

proptest! {
    #[test]
    fn an_image_is_summed_as_point_by_point(depths in image(), pose in pose(), size in 0.02..0.5) {
        let scan = scan(Points::Depths(depths), pose);
        prop_assert_eq!(received(&scan, size), (naive(&scan, size), 0));
    }

    #[test]
    fn a_list_is_summed_as_point_by_point_in_any_order(
        mut points in prop::collection::vec(prop::array::uniform3(between(-4.0, 4.0)), 0..300),
        pose in pose(), size in 0.02..0.5,
    ) {
        let forth = scan(Points::F32(points.clone()), pose);
        points.reverse();
        let back = scan(Points::F32(points), pose);
        let expected = (naive(&forth, size), 0);
        prop_assert_eq!(&received(&forth, size), &expected);
        prop_assert_eq!(&received(&back, size), &expected);
    }

    #[test]
    fn a_place_is_rounded_down(point in prop::array::uniform3(between(-8.0, 8.0)), pose in pose(), size in 0.03..0.5) {
        let region = SensorRegion::new(&pose, size).unwrap();
        let exact = pose * Point3::from(point.map(f64::from)) / size;
        let [x, y, z] = point.map(f64::from);
        let places = [0, 1, 2].map(|axis| {
            let [a, b, c] = region.units[axis];
            SensorRegion::place(a * x + b * y + c * z, region.origin[axis])
        });
        let voxel = region.voxel(SensorRegion::key(places)).unwrap().indices();
        for axis in 0..3 {
            let offset = f64::from(SensorRegion::offset(places[axis]));
            let units = exact[axis] * 4096.0 - f64::from(voxel[axis]) * 4096.0 - offset;
            // 10 km away a number in double precision has an error of 2e-12 m.
            prop_assert!((-1e-6..1.0 + 1e-6).contains(&units), "{units}");
        }
    }
}

/// The one voxel that a point is put into.
fn voxel_of(points: Points, pose: Isometry3<f64>, voxel_size: f64) -> (BlockKey, Cell) {
    *received(&scan(points, pose), voxel_size).0.first_key_value().unwrap().0
}

/// A sensor that stands on a border of voxels along each axis, and a point near it or not, of which many lie beside a border.
fn beside_borders() -> impl Strategy<Value = (Isometry3<f64>, f64, [f32; 3])> {
    let tiny =
        (20..60_i32, any::<bool>()).prop_map(|(by, above)| if above { 1.0 } else { -1.0 } * 2_f32.powi(-by));
    let length = prop_oneof![1 => between(-4.0, 4.0), 3 => tiny];
    let at = prop::array::uniform3(-50..50_i32);
    (0.02..0.5, at, prop::array::uniform3(-3.0..3.0), prop::array::uniform3(length)).prop_map(
        |(size, at, turn, point)| {
            let sensor = Vector3::from(at.map(|at| f64::from(at) * size));
            (Isometry3::new(sensor, turn.into()), size, point)
        },
    )
}

proptest! {
    #[test]
    fn single_precision_bins_as_double_but_within_a_hair_of_a_border((pose, size, point) in beside_borders()) {
        let double = point.map(f64::from);
        let voxels =
            [Points::F32(vec![point]), Points::F64(vec![double])].map(|points| voxel_of(points, pose, size));
        // In units, as `Fixed` has it.
        let place = map(pose.rotation.to_rotation_matrix().matrix(), &pose.translation.vector, double) / size * 4096.0;
        let is_at_border = place.iter().any(|at| (at - (at / 4096.0).round() * 4096.0).abs() < 2_f64.powi(-23));
        prop_assert!(voxels[0] == voxels[1] || is_at_border, "{voxels:?}: {place:?}");
    }
}

#[test]
fn what_lies_a_hair_below_a_border_counts_as_above_it() {
    let unit = 0.125 / 4096.0;
    for (below, is_above) in [(2_f32.powi(-25), true), (2_f32.powi(-23), false)] {
        let point = [0.5, -below * unit, 0.5];
        let key = |y| block_and_cell(VoxelKey::new(4, y, 4).unwrap());
        let single = voxel_of(Points::F32(vec![point]), Isometry3::identity(), 0.125);
        assert_eq!(single, key(if is_above { 0 } else { -1 }));
        let double = voxel_of(Points::F64(vec![point.map(f64::from)]), Isometry3::identity(), 0.125);
        assert_eq!(double, key(-1));
    }
}

#[test]
fn points_beyond_the_region_are_placed_in_double_precision() {
    let points = vec![[1.0, 0.0, 0.0], [60.0, 0.0, 0.0], [-200.0, 3.0, 1.0], [2e5, 0.0, 0.0], [f32::MAX; 3]];
    let (sums, beyond) =
        received(&scan(Points::F32(points), Isometry3::translation(0.025, 0.025, 0.025)), 0.05);
    let voxels: Vec<_> = sums.keys().copied().collect();
    let key = |x, y, z| block_and_cell(VoxelKey::new(x, y, z).unwrap());
    assert_eq!(voxels, [key(-4000, 60, 20), key(20, 0, 0), key(1200, 0, 0)]);
    assert_eq!((beyond, sums.values().map(|sums| sums.count).sum::<u32>()), (2, 3));
}

#[test]
fn a_sensor_beyond_the_grid_puts_nothing_into_it() {
    let far = Isometry3::translation(1e9, 0.0, 0.0);
    let (sums, beyond) = received(&scan(Points::F32(vec![[1.0; 3]; 70]), far), 0.05);
    assert_eq!((sums.len(), beyond), (0, 70));
}

#[test]
fn blocks_that_share_a_place_among_the_recent_ones_are_kept_apart() {
    // 16 blocks of 8 voxels apart along x, in turn.
    let points: Vec<_> = (0..640).map(|i| [0.05 + 12.8 * (i % 2) as f32, 0.05, 0.05]).collect();
    let (sums, _) = received(&scan(Points::F32(points), Isometry3::identity()), 0.1);
    assert_eq!(sums.values().map(|sums| sums.count).collect::<Vec<_>>(), [320, 320]);
}

#[test]
fn a_scan_of_scattered_points_leaves_no_memory_behind() {
    let along = |i: usize, step: usize| (i * step % 61) as f32 - 30.0;
    let scattered = (0..61 * 61 * 61).map(|i| [along(i, 1), along(i / 61, 1), along(i / 3721, 1)]).collect();
    let small = scan(Points::F32(vec![[0.5; 3]; 100]), Isometry3::identity());
    let mut received = Received::default();
    received.take(&scan(Points::F32(scattered), Isometry3::identity()), 0.1);
    let room = |received: &Received| {
        [received.sums.capacity(), received.blocks.capacity(), received.index.capacity()]
    };
    assert_eq!(received.sums.len(), 61 * 61 * 61);
    let most = room(&received);
    // What the next one may need is kept once.
    received.take(&small, 0.1);
    received.take(&small, 0.1);
    let [sums, blocks, index] = room(&received);
    assert!(sums <= KEPT_SUMS && blocks <= KEPT && index <= 4 * KEPT, "{most:?} {:?}", room(&received));
    assert_eq!(received.in_order().map(|(_, sums)| sums.count()).sum::<usize>(), 1);
}
