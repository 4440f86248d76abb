//! On simulated drives: what is taken away goes, what stands still stays. [`between_rays`]: also where rays are far apart.

mod between_rays;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::*;
use crate::engine::consistent::block::{CELLS, block_and_cell};
use crate::engine::consistent::grid::Binned;
use crate::engine::key::VoxelKey;
use crate::engine::params::Params;
use crate::engine::points::{Depths, Points, Rays};
use crate::engine::scan::Stamp;
use crate::sim::{Drive, Scene, Shape};

/// Labels of the points in a voxel, each with their number.
type Labels = Vec<(u32, u32)>;

/// A grid that is cleared, and beside it which surface the points of each voxel came from.
struct Bench {
    voxel_size: f64,
    grid: Grid,
    clearing: Clearing,
    binned: Binned,
    labels: FxHashMap<[i32; 3], Labels>,
    /// Voxels that were dense by points of a surface, by its label.
    dense: BTreeMap<u32, BTreeSet<[i32; 3]>>,
    /// Those of them that were cleared.
    cleared: BTreeMap<u32, BTreeSet<[i32; 3]>>,
    removed: usize,
    sequence: u64,
}

impl Bench {
    fn new(params: &Params) -> Self {
        Self {
            voxel_size: params.voxel_size(),
            grid: Grid::new(params),
            clearing: Clearing::new(),
            binned: Binned::default(),
            labels: FxHashMap::default(),
            dense: BTreeMap::new(),
            cleared: BTreeMap::new(),
            removed: 0,
            sequence: 0,
        }
    }

    fn insert(&mut self, scan: &Scan, labels: &[u32]) {
        self.sequence += 1;
        self.grid.bin(scan, self.sequence, &mut self.binned);
        let Points::F32(points) = &scan.points else { panic!("a Kinect measures in single precision") };
        let size = self.voxel_size;
        for (point, &label) in points.iter().zip(labels) {
            let point = scan.fixed_from_sensor * Point3::from(point.map(f64::from));
            let key = [point.x, point.y, point.z].map(|x| (x / size).floor() as i32);
            let labels = self.labels.entry(key).or_default();
            match labels.iter_mut().find(|(known, _)| *known == label) {
                Some((_, count)) => *count += 1,
                None => labels.push((label, 1)),
            }
        }
        for &slot in &self.binned.seen {
            let block = self.grid.block(slot);
            let hit = block.awake().iter().filter(|voxel| voxel.hit == self.sequence as u32);
            for voxel in hit.filter(|voxel| self.grid.is_dense(voxel)) {
                let key = block.voxel_key(voxel.cell).unwrap().indices();
                self.dense.entry(majority(&self.labels[&key])).or_default().insert(key);
            }
        }
        let cleared = self.clearing.clear(&mut self.grid, scan, self.sequence);
        self.removed += cleared.len();
        for block in cleared.into_iter().collect::<BTreeSet<_>>() {
            let block = self.grid.block(block);
            for cell in (0..CELLS as u16).map(Cell).filter(|cell| !block.contains(*cell)) {
                let key = block.voxel_key(cell).unwrap().indices();
                let Some(labels) = self.labels.remove(&key) else { continue };
                if self.dense.values().any(|dense| dense.contains(&key)) {
                    self.cleared.entry(majority(&labels)).or_default().insert(key);
                }
            }
        }
    }

    /// The dense voxels with a majority of points of these surfaces.
    fn dense_of(&self, labels: &[u32]) -> Vec<[i32; 3]> {
        let voxels = self.grid.blocks().flat_map(|(_, block)| {
            let dense = block.awake().iter().filter(|voxel| self.grid.is_dense(voxel));
            dense.map(|voxel| block.voxel_key(voxel.cell).unwrap().indices())
        });
        voxels.filter(|key| labels.contains(&majority(&self.labels[key]))).collect()
    }

    /// Dense voxels with a majority of points of these surfaces, but for those that the floor has as well: it passes
    /// between two layers of voxels, whose points it goes on measuring, so that nothing sees through them.
    fn left_of(&self, labels: &[u32], floor: u32) -> Vec<[i32; 3]> {
        let has_floor = |key: &[i32; 3]| self.labels[key].iter().any(|&(label, _)| label == floor);
        let mut left = self.dense_of(labels);
        left.retain(|key| !((-1..=0).contains(&key[2]) && has_floor(key)));
        left
    }

    /// Dense voxels of a surface and those of them that were cleared.
    fn lost(&self, label: u32) -> [usize; 2] {
        [&self.dense, &self.cleared].map(|voxels| voxels.get(&label).map_or(0, BTreeSet::len))
    }
}

fn majority(labels: &Labels) -> u32 {
    labels.iter().max_by_key(|(label, count)| (*count, *label)).unwrap().0
}

fn params(voxel_size: f64) -> Params {
    Params::default().with_voxel_size(voxel_size).unwrap()
}

/// Whether noise-free rays pass a voxel, and none of those towards it ends before it or in it.
fn is_seen_through(key: [i32; 3], size: f64, sensor: &Point3<f64>, ends: &[Point3<f64>]) -> bool {
    let mut passed = false;
    for end in ends {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let sides = [key[axis], key[axis] + 1]
                .map(|i| (f64::from(i) * size - sensor[axis]) / (end[axis] - sensor[axis]));
            (enter, leave) = (enter.max(sides[0].min(sides[1])), leave.min(sides[0].max(sides[1])));
        }
        if enter < leave && leave >= 1.0 {
            return false;
        }
        passed |= enter < leave;
    }
    passed
}

fn area(shape: &Shape) -> f64 {
    let [width, height] = shape.half_ranges().map(|half| 2.0 * half);
    let holes = if let Shape::Rectangle { holes, .. } = shape { &holes[..] } else { &[] };
    let cut = holes.iter().map(|hole| (hole.high[0] - hole.low[0]) * (hole.high[1] - hole.low[1]));
    width * height - cut.sum::<f64>()
}

/// The surfaces that stand still, with their areas (m^2).
fn still(scene: &Scene) -> Vec<(u32, String, f64)> {
    let still = scene.surfaces().iter().filter(|surface| surface.motion().is_none());
    still.map(|surface| (surface.label(), surface.name().to_owned(), area(surface.shape()))).collect()
}

/// Every voxel that a surface which stands still passes through, from points on it 1 cm apart.
pub(in super::super) fn on_surfaces(scene: &Scene, size: f64) -> BTreeSet<[i32; 3]> {
    let mut keys = BTreeSet::new();
    for surface in scene.surfaces().iter().filter(|surface| surface.motion().is_none()) {
        let halves = surface.shape().half_ranges();
        let [us, vs] = halves.map(|half| (2.0 * half / 0.01).ceil() as i32);
        let along = |i: i32, count: i32, half: f64| (2.0 * f64::from(i) / f64::from(count) - 1.0) * half;
        for (u, v) in (0..=us).flat_map(|u| (0..=vs).map(move |v| (u, v))) {
            let at = [along(u, us, halves[0]), along(v, vs, halves[1])];
            if surface.shape().reaches(at) {
                let point = surface.pose() * surface.shape().point(at);
                keys.insert([point.x, point.y, point.z].map(|x| (x / size).floor() as i32));
            }
        }
    }
    keys
}

impl Bench {
    /// How much of the surfaces that stand still was cleared, come back or not: of the voxels that were dense by their
    /// points, the scatter before and behind them included, and of those that they pass through.
    fn check_surfaces(&self, scene: &Scene, most: f64) {
        println!("{} m: {} voxels cleared, {} left", self.voxel_size, self.removed, self.grid.len());
        let on = on_surfaces(scene, self.voxel_size);
        let mut all = [[0; 2]; 2];
        for (label, name, area) in still(scene) {
            let lost = self.lost(label);
            let lost_on = [&self.dense, &self.cleared]
                .map(|voxels| voxels.get(&label).map_or(0, |voxels| voxels.intersection(&on).count()));
            all = [0, 1].map(|i| [all[i][0] + [lost, lost_on][i][0], all[i][1] + [lost, lost_on][i][1]]);
            if area >= 0.5 && lost[0] > 0 {
                println!(
                    "  {name}, {area:.2} m2: {} of {} on it, {} of {} by its points",
                    lost_on[1], lost_on[0], lost[1], lost[0]
                );
                assert!(lost[1] as f64 <= most * lost[0] as f64, "{name}");
            }
        }
        println!(
            "  all: {} of {} on them, {} of {} by their points",
            all[1][1], all[1][0], all[0][1], all[0][0]
        );
        assert_eq!(all[1][1], 0, "a voxel that a surface passes through");
    }
}

/// The box is taken away in scan 360, when the robot has passed it; it comes to see the place in scan 1481.
const COMES_BACK: u32 = 1470;

/// Drives through the scene with the box that is taken away: its voxels may stay for 30 scans that see through them, and
/// no surface of 0.5 m^2 that stands still may lose more than 2 % of its voxels.
fn drive_past_the_box(scans: impl Iterator<Item = u32>) {
    let scene = Scene::named("moving").unwrap();
    let drive = Drive::new(scene.clone(), 1, Stamp::from_nanos(0));
    let of_box: Vec<_> = scene
        .surfaces()
        .iter()
        .filter(|s| s.name().starts_with("box/"))
        .map(crate::sim::surface::Surface::label)
        .collect();
    let floor = scene.surfaces().iter().find(|s| s.name() == "floor").unwrap().label();
    let mut benches = [0.08, 0.05].map(|size| Bench::new(&params(size)));
    // Scans that see through each voxel of the box until it is gone.
    let mut seen: [BTreeMap<[i32; 3], u32>; 2] = Default::default();
    for index in scans {
        let labelled = drive.labelled_scan(index);
        benches.iter_mut().for_each(|bench| bench.insert(&labelled.scan, &labelled.labels));
        if index < COMES_BACK {
            continue;
        }
        let sensor = drive.true_fixed_from_optical(index) * Point3::origin();
        let ends: Vec<_> = drive.true_hits(index, 4).map(|(_, end)| end).collect();
        for (bench, seen) in benches.iter().zip(&mut seen) {
            for key in bench.left_of(&of_box, floor) {
                let through = is_seen_through(key, bench.voxel_size, &sensor, &ends);
                *seen.entry(key).or_default() += u32::from(through);
            }
        }
    }
    for (bench, seen) in benches.iter().zip(&seen) {
        let size = bench.voxel_size;
        let left = bench.left_of(&of_box, floor);
        let mut layers = BTreeMap::<i32, [u32; 2]>::new();
        for (key, &scans) in seen {
            let [all, most] = layers.entry(key[2]).or_default();
            (*all, *most) = (*all + 1, (*most).max(scans));
        }
        println!("{size} m: voxels of each layer, and most scans that saw through one: {layers:?}");
        assert!(left.is_empty(), "{left:?}");
        assert!(layers.values().all(|&[_, most]| most <= 30));
        // All of its height was there: the top is at 0.513 m.
        assert!((1..=(0.513 / size) as i32).all(|layer| layers[&layer][0] > 10));
        bench.check_surfaces(&scene, 0.02);
    }
}

#[test]
fn a_box_that_is_taken_away_is_gone_within_a_second_and_what_stands_still_stays() {
    drive_past_the_box((0..COMES_BACK).step_by(5).chain(COMES_BACK..1600));
}

#[test]
fn in_20_seconds_of_the_laboratory_what_stands_still_stays() {
    let scene = Scene::named("lab").unwrap();
    let drive = Drive::new(scene.clone(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut benches = [0.08, 0.05].map(|size| Bench::new(&params(size)));
    for index in (0..600).step_by(4) {
        let labelled = drive.labelled_scan(index);
        benches.iter_mut().for_each(|bench| bench.insert(&labelled.scan, &labelled.labels));
    }
    benches.iter().for_each(|bench| bench.check_surfaces(&scene, 0.02));
}

/// The voxels that are left of a plate at a depth (m) once every pixel of a camera that stands still says something else; `of`
/// makes points of the pixels.
fn left_of_a_plate(of: fn(Depths) -> Points, [before, after]: [f32; 2]) -> usize {
    let rays = |count: i32| (-count..count).map(|i| (i as f32 + 0.5) / 256.0).collect();
    let rays = Arc::new(Rays { x: rays(50), y: rays(40) });
    let mut grid = Grid::new(&params(0.08));
    let (mut clearing, mut binned) = (Clearing::new(), Binned::default());
    for sequence in 1..=60 {
        let depth = if sequence <= 10 { before } else { after };
        let points = of(Depths::new(Arc::clone(&rays), vec![depth; 100 * 80]).unwrap());
        let scan =
            Scan { stamp: Stamp::from_nanos(sequence), fixed_from_sensor: Isometry3::identity(), points };
        grid.bin(&scan, sequence as u64, &mut binned);
        clearing.clear(&mut grid, &scan, sequence as u64);
    }
    let depths = grid.blocks().flat_map(|(_, block)| {
        block.awake().iter().map(|voxel| 0.08 * f64::from(block.corner()[2] + voxel.cell.coordinates()[2]))
    });
    depths.filter(|depth| *depth < f64::from(before) + 1.0).count()
}

#[test]
fn a_background_that_is_too_far_away_to_be_mapped_proves_what_is_before_it_to_be_empty() {
    for of in [Points::Depths, as_list] {
        assert_eq!(left_of_a_plate(of, [2.0, -7.5]), 0);
        assert!(left_of_a_plate(of, [2.0, f32::INFINITY]) > 60, "what was not measured proves nothing");
        assert!(left_of_a_plate(of, [2.0, -1.8]) > 60, "what ends before the plate proves nothing");
    }
}

#[test]
fn what_stood_farther_away_than_a_kinect_sees_goes_where_there_are_points_beyond_it() {
    for of in [Points::Depths, as_list] {
        let [before, after] = [f32::INFINITY, 18.0].map(|after| left_of_a_plate(of, [15.0, after]));
        // Those at the border are not seen all round.
        assert!(before > 3000 && after < before / 5, "{after} left of {before}");
    }
}

#[expect(clippy::needless_pass_by_value, reason = "as `Points::Depths` takes them")]
fn as_list(depths: Depths) -> Points {
    Points::Ended { points: depths.list(), ends: depths.ends() }
}

/// A camera stands still before a plate at 2 m, which is taken away after ten scans; from then on one point strays into the place
/// of a voxel of it every `every` scans. After how many scans that voxel is no longer dense; `None` where it still is after
/// `scans`.
fn dense_for(min_points: i64, every: i64, scans: i64) -> Option<i64> {
    const PLATE: f32 = 2.03;
    const BEFORE: i64 = 10;
    let rays = |count: i32| (-count..count).map(|i| (i as f32 + 0.5) / 256.0).collect();
    let rays = Arc::new(Rays { x: rays(50), y: rays(40) });
    let params = params(0.08).with_min_points(min_points).unwrap();
    let mut grid = Grid::new(&params);
    let (mut clearing, mut binned) = (Clearing::new(), Binned::default());
    let (block, cell) = block_and_cell(VoxelKey::new(0, 0, 25).unwrap());
    for sequence in 1..=BEFORE + scans {
        let is_there = sequence <= BEFORE;
        let mut depths = vec![if is_there { PLATE } else { -7.5 }; 100 * 80];
        // The ray nearest to the middle.
        if sequence % every == 0 {
            depths[40 * 100 + 50] = PLATE;
        }
        let points = Points::Depths(Depths::new(Arc::clone(&rays), depths).unwrap());
        let scan =
            Scan { stamp: Stamp::from_nanos(sequence), fixed_from_sensor: Isometry3::identity(), points };
        grid.bin(&scan, sequence as u64, &mut binned);
        clearing.clear(&mut grid, &scan, sequence as u64);
        let voxel = grid.find(block).and_then(|block| grid.block(block).voxel(cell));
        let is_dense = voxel.is_some_and(|voxel| grid.is_dense(voxel));
        assert!(is_dense || !is_there);
        if !is_dense {
            return Some(sequence - BEFORE);
        }
    }
    None
}

#[test]
fn a_point_that_strays_into_an_empty_voxel_now_and_then_does_not_keep_it_however_few_make_one_dense() {
    for min_points in [2, 4, 7, 15] {
        assert!(dense_for(min_points, 12, 60).is_some(), "{min_points}");
    }
    assert_eq!(dense_for(4, 2, 300), None, "hit as often as it is missed");
    assert_eq!(dense_for(1, 12, 60), None, "where one point is a surface");
}
