//! Clusters of made-up points.

use std::f64::consts::FRAC_PI_4;

use nalgebra::{Isometry3, Point3};

use super::*;
use crate::engine::consistent::block::block_and_cell;
use crate::engine::consistent::grid::Binned;
use crate::engine::key::VoxelKey;
use crate::engine::points::Points;
use crate::engine::scan::{Scan, Stamp};
use crate::engine::snapshot::ChangedCluster;

const VOXEL: f64 = 0.1;
const SENSOR: [f64; 3] = [2.5, 2.5, 2.0];

/// A grid and its surfaces, of which each scan publishes what it sees; nothing is cleared.
struct Bench {
    params: Params,
    grid: Grid,
    surfaces: Surfaces,
    binned: Binned,
    sequence: u64,
}

impl Bench {
    fn new() -> Self {
        let params = Params::default().with_voxel_size(VOXEL).unwrap();
        let (grid, surfaces) = (Grid::new(&params), Surfaces::new(&params));
        Self { params, grid, surfaces, binned: Binned::default(), sequence: 0 }
    }

    /// Takes in these points of the fixed frame (m).
    fn insert(&mut self, points: &[Point3<f64>]) -> Vec<ChangedCluster> {
        self.sequence += 1;
        let [x, y, z] = SENSOR;
        let fixed_from_sensor = Isometry3::translation(x, y, z);
        let seen = |point| fixed_from_sensor.inverse_transform_point(point).cast::<f32>().into();
        let points = Points::F32(points.iter().map(seen).collect());
        let scan = Scan { stamp: Stamp::from_nanos(0), fixed_from_sensor, points };
        self.grid.bin(&scan, self.sequence, &mut self.binned);
        let seen = self.binned.seen.clone();
        self.publish(&seen)
    }

    fn publish(&mut self, blocks: &[BlockIndex]) -> Vec<ChangedCluster> {
        let now = Now { sequence: self.sequence, stamp: Stamp::from_nanos(0) };
        self.surfaces.begin();
        self.surfaces.publish(&self.grid, blocks, std::iter::empty(), now);
        blocks.iter().for_each(|&block| self.grid.note_published(block, now.sequence));
        self.surfaces.describe(&self.params, SENSOR[2], now)
    }

    /// Takes out the voxels that are gone, and publishes the blocks that had them.
    fn take_away(&mut self, is_gone: impl Fn([i32; 3]) -> bool) -> Vec<ChangedCluster> {
        let mut gone = Vec::new();
        for (slot, block) in self.grid.blocks() {
            let cells = block.awake().iter().map(|voxel| voxel.cell);
            let cells = cells.filter(|cell| block.voxel_key(*cell).is_some_and(|key| is_gone(key.indices())));
            gone.extend(cells.map(|cell| (slot, cell)));
        }
        for &(slot, cell) in &gone {
            self.grid.remove(slot, cell);
        }
        let mut blocks: Vec<_> = gone.into_iter().map(|(slot, _)| slot).collect();
        blocks.dedup();
        self.publish(&blocks)
    }

    /// The id of the cluster that a voxel is in.
    fn id_at(&self, [x, y, z]: [i32; 3]) -> Option<u64> {
        let (block, cell) = block_and_cell(VoxelKey::new(x, y, z)?);
        let frozen = self.surfaces.freeze();
        let faces = frozen.faces();
        let voxels = frozen.voxels(self.grid.find(block)?, &faces);
        let (_, face) = voxels.into_iter().find(|(state, _)| state.cell() == cell)?;
        Some(face?.cluster?.get())
    }

    fn told(&self) -> Vec<u64> {
        self.surfaces.descriptions().iter().map(|cluster| cluster.id.get()).collect()
    }

    fn removed(&self) -> Vec<u64> {
        self.surfaces.removed().iter().map(|id| id.get()).collect()
    }
}

impl Surfaces {
    /// Asserts that the planes of clusters face the side that their patches do, wherever the two are no more than 60 degrees apart;
    /// returns how many the directions towards the sensor alone would have turned away.
    pub(in crate::engine::consistent) fn check_sides(&self) -> usize {
        let planes =
            self.clusters.iter().flatten().filter_map(|cluster| Some((&cluster.sums, cluster.plane?)));
        planes
            .filter(|(sums, plane)| {
                let along = sums.normal().try_normalize(0.0).unwrap_or_default().dot(&plane.normal);
                assert!(along >= -0.5, "{plane:?}, but {:?}", sums.normal());
                along > 0.5 && sums.towards().dot(&plane.normal) < 0.0
            })
            .count()
    }
}

/// The middles of `count` equal parts of a stretch.
fn parts(low: f64, high: f64, count: u32) -> impl Iterator<Item = f64> + Clone {
    (0..count).map(move |i| low + (high - low) * (f64::from(i) + 0.5) / f64::from(count))
}

/// A board that stands on the floor, in the fourth voxels along x and from the fourth along z on; 9 rows of 16 voxels.
fn board() -> Vec<Point3<f64>> {
    let heights = parts(0.38, 0.4, 4).chain(parts(0.4, 1.2, 64));
    heights.flat_map(|z| parts(0.0, 1.6, 128).map(move |y| Point3::new(0.35, y, z))).collect()
}

/// The floor before it, at 0.9 of the fourth layer of voxels.
fn floor() -> Vec<Point3<f64>> {
    let across = parts(0.4, 1.6, 96);
    across.flat_map(|x| parts(0.0, 1.6, 128).map(move |y| Point3::new(x, y, 0.39))).collect()
}

#[test]
fn a_thing_that_is_carried_away_is_gone_though_its_lowest_row_is_part_of_the_floor_then() {
    let mut bench = Bench::new();
    bench.insert(&board());
    assert_eq!(bench.told(), [1]);
    bench.insert(&floor());
    assert_eq!(bench.told(), [1, 2]);
    assert_eq!([bench.id_at([3, 5, 3]), bench.id_at([6, 5, 3])], [Some(1), Some(2)]);
    let changed = bench.take_away(|[x, _, z]| x == 3 && z > 3);
    assert_eq!(bench.id_at([3, 5, 3]), bench.id_at([6, 5, 3]), "the row is part of the floor");
    assert_eq!((bench.removed(), bench.told()), (vec![1], vec![2]));
    let [floor] = &changed[..] else { panic!("{changed:?}") };
    assert_eq!((floor.cluster.id.get(), &floor.merged_from[..]), (2, &[][..]));
}

#[test]
fn what_is_left_of_a_thing_is_that_thing_while_it_stands_for_itself() {
    let mut bench = Bench::new();
    bench.insert(&board());
    // 40 voxels of 144 stay.
    bench.take_away(|[_, y, z]| y > 7 || z > 7);
    assert_eq!((bench.removed(), bench.told()), (vec![], vec![1]));
}

/// A wall whose normal is horizontal and `turned` (rad) from x.
fn wall(turned: f64) -> Vec<Point3<f64>> {
    let (sin, cos) = turned.sin_cos();
    let column = |s: f64| parts(0.0, 0.8, 48).map(move |z| Point3::new(1.025 - s * sin, 1.025 + s * cos, z));
    parts(-0.8, 0.8, 96).flat_map(column).collect()
}

#[test]
fn a_wall_half_way_between_two_axes_is_drawn_along_the_same_one_all_the_time() {
    let mut bench = Bench::new();
    let mut axes = Vec::new();
    for number in 1..=30 {
        // The mean of all so far is now more and now less than half way.
        let off = if number % 2 == 0 { 0.001 } else { -0.001 };
        bench.insert(&wall(FRAC_PI_4 + off * f64::from(number)));
        let clusters = bench.surfaces.clusters.iter().flatten();
        let wall = clusters.max_by_key(|cluster| cluster.voxels).unwrap();
        assert!(wall.plane.is_some_and(|plane| (plane.normal.x - plane.normal.y).abs() < 0.05), "{number}");
        axes.push(wall.footprint.axis());
    }
    let changes = axes[9..].windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes <= 1, "{axes:?}");
}
