mod blocks;

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;

/// A solid box with edges along the axes of the fixed frame.
#[derive(Clone, Copy, Debug)]
struct Solid {
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Solid {
    fn new(low: [f64; 3], high: [f64; 3]) -> Self {
        Self { low: low.into(), high: high.into() }
    }

    /// The stretch of a ray that lies within.
    fn stretch(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<(f64, f64)> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let ends = [self.low[axis], self.high[axis]].map(|end| (end - origin[axis]) / direction[axis]);
            enter = enter.max(ends[0].min(ends[1]));
            leave = leave.min(ends[0].max(ends[1]));
        }
        (enter < leave).then_some((enter, leave))
    }
}

/// The rays of a sensor, in its frame.
#[derive(Clone, Debug)]
struct Sensor {
    fixed_from_sensor: Isometry3<f64>,
    rays: Vec<Vector3<f64>>,
}

impl Sensor {
    /// A Kinect with a `thin`-th of its columns and rows, z forward.
    fn kinect(fixed_from_sensor: Isometry3<f64>, thin: usize) -> Self {
        let pixel = |i: usize, count: usize| ((i * thin) as f64 - 0.5 * (count - 1) as f64) / 525.0;
        let rows = (0..480 / thin).map(|row| pixel(row, 480));
        let rays = rows.flat_map(|y| (0..640 / thin).map(move |x| Vector3::new(pixel(x, 640), y, 1.0)));
        Self { fixed_from_sensor, rays: rays.collect() }
    }

    /// The same sensor with other axes: what was along x, y, z is now along those of `turned`.
    fn turned(mut self, turned: UnitQuaternion<f64>) -> Self {
        self.fixed_from_sensor *= turned.inverse();
        self.rays.iter_mut().for_each(|ray| *ray = turned * *ray);
        self
    }

    /// All round, with `count` rays that lie on the sphere like the seeds of a sunflower.
    fn all_round(fixed_from_sensor: Isometry3<f64>, count: u32) -> Self {
        let rays = (0..count).map(|i| {
            let (z, angle) =
                (1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count), 2.399_963_23 * f64::from(i));
            let across = (1.0 - z * z).sqrt();
            Vector3::new(across * angle.cos(), across * angle.sin(), z)
        });
        Self { fixed_from_sensor, rays: rays.collect() }
    }

    /// The points where the rays end; `noise(i, depth)` is added to the depth of point i.
    fn measure(&self, solids: &[Solid], mut noise: impl FnMut(usize, f64) -> f64) -> Points {
        let origin = Point3::from(self.fixed_from_sensor.translation.vector);
        let points = self.rays.iter().enumerate().filter_map(|(i, ray)| {
            let direction = self.fixed_from_sensor * ray;
            let hits = solids.iter().filter_map(|solid| solid.stretch(&origin, &direction));
            let length = hits.map(|hit| hit.0).min_by(f64::total_cmp)?;
            let length = length + noise(i, length);
            (0.3..8.0).contains(&length).then(|| (ray * length).map(|x| x as f32).into())
        });
        Points::F32(points.collect())
    }

    fn voxel(&self, key: [i32; 3], edge: f64) -> (Point3<f64>, Vector3<f64>) {
        let centre = Point3::from(Vector3::from(key).map(|i| (f64::from(i) + 0.5) * edge));
        let sensor_from_fixed = self.fixed_from_sensor.inverse();
        (
            sensor_from_fixed * centre,
            super::blocks::cube_reach(&sensor_from_fixed.rotation.to_rotation_matrix(), edge),
        )
    }

    fn look(&self, grid: &RangeGrid, key: [i32; 3], edge: f64, margin: impl Fn(f64) -> f64) -> bool {
        let (centre, half) = self.voxel(key, edge);
        grid.sees_through(&padded(centre, half), margin(centre.coords.norm()))
    }
}

/// A box with a cell more on each side, as `clearing` has where a body is thin.
pub(super) fn padded(centre: Point3<f64>, half: Vector3<f64>) -> Body {
    let axis = centre.coords.iamax();
    let mut padding = Vector3::repeat(2.0 / FACE_EDGE as f64 * centre[axis].abs());
    padding[axis] = 0.0;
    Body { centre, half: half + padding, is_thin: [false; 3] }
}

/// x right, y down, z forward, at `place`, looking along the fixed x axis and `pitch` radians down.
fn looking_along_x(place: [f64; 3], pitch: f64) -> Isometry3<f64> {
    let optical = UnitQuaternion::from_euler_angles(-0.25 * TAU, 0.0, -0.25 * TAU);
    let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch);
    Isometry3::from_parts(Vector3::from(place).into(), down * optical)
}

/// Three standard deviations of a Kinect's depth and half a voxel.
fn margin(edge: f64) -> impl Fn(f64) -> f64 {
    move |depth| 3.0 * sigma(depth) + 0.5 * edge
}

fn sigma(depth: f64) -> f64 {
    (0.0012 + 0.0019 * (depth - 0.4).powi(2)).hypot(0.003_071 * depth * depth / 12_f64.sqrt())
}

/// A number between 0 and 1, the same for the same index (splitmix64).
fn uniform(index: u64) -> f64 {
    let mut bits = index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A depth's error: Nguyen's sigma, then a whole disparity.
fn kinect_noise(seed: u64) -> impl FnMut(usize, f64) -> f64 {
    move |i, depth| {
        let index = (seed << 32) + 2 * i as u64;
        let normal = (-2.0 * uniform(index).max(1e-300).ln()).sqrt() * (TAU * uniform(index + 1)).cos();
        let scattered = depth + (0.0012 + 0.0019 * (depth - 0.4).powi(2)) * normal;
        let raw = ((3.330_949_516_1 - 1.0 / scattered) / 0.003_071_101_6).round();
        1.0 / (3.330_949_516_1 - 0.003_071_101_6 * raw) - depth
    }
}

fn filled(points: &Points) -> RangeGrid {
    let mut grid = RangeGrid::new();
    grid.fill(points);
    grid
}

fn single(points: &Points) -> &[[f32; 3]] {
    let Points::F32(points) = points else { panic!("sensors measure in single precision") };
    points
}

/// All voxels of an edge within a box.
fn voxels(low: [f64; 3], high: [f64; 3], edge: f64) -> Vec<[i32; 3]> {
    let [low, high] = [low, high].map(|corner| corner.map(|x| (x / edge + 1e-9).floor() as i32));
    let xs = low[0]..high[0];
    xs.flat_map(|x| (low[1]..high[1]).flat_map(move |y| (low[2]..high[2]).map(move |z| [x, y, z]))).collect()
}

/// With its upper side at z = 0.
fn floor() -> Solid {
    Solid::new([-20.0, -20.0, -1.0], [20.0, 20.0, 0.0])
}

fn wall_at(x: f64) -> Solid {
    Solid::new([x, -20.0, -1.0], [x + 1.0, 20.0, 20.0])
}

#[test]
fn a_cell_has_the_smallest_depth_of_its_points_and_their_number() {
    let points: Vec<[f32; 3]> = (0..20_000)
        .map(|i| [0, 1, 2].map(|axis| (8.0 * uniform(3 * (i % 9000) + axis) - 4.0) as f32))
        .collect();
    let mut grid = filled(&Points::F32(vec![[1.0, 0.2, 0.3]; 700]));
    let doubles = points.iter().map(|point| point.map(f64::from)).collect();
    let backwards = points.iter().rev().copied().collect();
    for order in [Points::F32(points.clone()), Points::F64(doubles), Points::F32(backwards)] {
        grid.fill(&order);
        let mut naive = vec![EMPTY; 6 * FACE_CELLS];
        for &point in &points {
            let axis = (0..3).rev().max_by(|&a, &b| point[a].abs().total_cmp(&point[b].abs())).unwrap();
            let depth = point[axis].abs();
            let cell = |axis: usize| {
                let tangent = f64::from(point[axis] * (1.0 / depth));
                (((tangent + 1.0) * 128.0) as usize).min(FACE_EDGE - 1)
            };
            let across = [[1, 2], [0, 2], [0, 1]][axis];
            let face = 2 * axis + usize::from(point[axis] < 0.0);
            let cell = &mut naive[(face * FACE_EDGE + cell(across[1])) * FACE_EDGE + cell(across[0])];
            *cell = RangeCell { nearest: cell.nearest.min(depth), count: cell.count + 1 };
        }
        let differing =
            grid.cells.iter().zip(&naive).filter(|(a, b)| a.nearest != b.nearest || a.count != b.count);
        // Points within a rounding of a border.
        assert!(differing.count() <= 4);
        let occupied = naive.iter().filter(|cell| cell.count > 0).count();
        let filled = grid.cells.iter().filter(|cell| cell.count > 0).count();
        assert!(filled.abs_diff(occupied) <= 4);
    }
}

#[test]
fn nothing_measured_proves_nothing() {
    let sensor = Sensor::kinect(Isometry3::identity(), 4);
    let mut grid = filled(&sensor.measure(&[], |_, _| 0.0));
    assert!(!sensor.look(&grid, [0, 0, 20], 0.08, |_| 0.1));
    grid.fill(&sensor.measure(&[Solid::new([-9.0, -9.0, 4.0], [9.0, 9.0, 5.0])], |_, _| 0.0));
    let look = |key| sensor.look(&grid, key, 0.08, |_| 0.1);
    assert!(look([0, 0, 20]));
    assert!(!look([0, 0, 50]), "the wall");
    assert!(!look([0, 0, 60]), "behind the wall");
    assert!(!look([0, 0, -20]), "behind the sensor");
    assert!(!look([12, 0, 19]), "at the border of the image");
    assert!(!look([20, 0, 20]), "beside the image");
    assert!(!look([0, 0, 0]), "at the sensor");
    grid.fill(&Points::F32(Vec::new()));
    assert!(!sensor.look(&grid, [0, 0, 20], 0.08, |_| 0.1), "of the scan before");
}

#[test]
fn a_sensor_that_looks_all_round_sees_through_in_all_directions() {
    let walls = [0, 1, 2].into_iter().flat_map(|axis| {
        [-4.0, 3.0].map(|end| {
            let (mut low, mut high) = ([-9.0; 3], [9.0; 3]);
            (low[axis], high[axis]) = (end, end + 1.0);
            Solid::new(low, high)
        })
    });
    let sensor = Sensor::all_round(Isometry3::identity(), 4_000_000);
    let grid = filled(&sensor.measure(&walls.collect::<Vec<_>>(), |_, _| 0.0));
    // The eight voxels around the sensor are among them: all their directions were measured.
    for key in voxels([-2.56; 3], [2.56; 3], 0.16) {
        assert!(sensor.look(&grid, key, 0.16, |_| 0.08), "{key:?}");
    }
}

/// Looks at the voxels of a box of 0.4 m after it was taken away: how many are seen through, and of how many.
fn recall(depth: f64, bottom: f64, edge: f64) -> [usize; 2] {
    let solids = [floor(), wall_at(depth + 1.2)];
    let sensor = Sensor::kinect(looking_along_x([0.0, 0.0, 1.0], 0.26), 1);
    let grid = filled(&sensor.measure(&solids, kinect_noise(7)));
    let boxed = voxels([depth, -0.2, bottom], [depth + 0.4, 0.2, bottom + 0.4], edge);
    let through = boxed.iter().filter(|&&key| sensor.look(&grid, key, edge, margin(edge)));
    [through.count(), boxed.len()]
}

#[test]
fn a_box_that_was_taken_away_is_seen_through_at_once() {
    for depth in [1.0, 2.0, 3.0, 4.0] {
        for edge in [0.08, 0.05] {
            let [through, all] = recall(depth, 0.4, edge);
            assert_eq!(through, all, "of edge {edge} at {depth} m");
        }
    }
}

#[test]
fn what_stood_on_the_floor_is_seen_through_from_16_cm_up() {
    for depth in [1.6, 2.0, 3.0, 4.0] {
        for (edge, bottom) in [(0.08, 0.16), (0.05, 0.15)] {
            let [through, all] = recall(depth, bottom, edge);
            assert_eq!(through, all, "of edge {edge} at {depth} m");
        }
    }
}

#[test]
fn a_floor_seen_at_a_shallow_angle_is_never_seen_through() {
    for (height, edge) in [(0.3, 0.05), (0.5, 0.08), (1.0, 0.05), (1.0, 0.08)] {
        // The floor between the layers of voxels, and at several heights within one.
        for level in [0.0, 0.2, 0.5, 0.95] {
            let level = level * edge;
            let ground = Solid::new([-20.0, -20.0, -1.0], [20.0, 20.0, level]);
            let sensor = Sensor::kinect(looking_along_x([0.0, 0.013, height + level], 0.1), 1);
            // 5 degrees are seen at 11.4 heights.
            let keys = voxels([0.5, -0.5, -edge], [(11.4 * height).min(7.5), 0.5, edge], edge);
            let true_surface = |key: &&[i32; 3]| {
                level >= f64::from(key[2]) * edge - 1e-9 && level <= f64::from(key[2] + 1) * edge + 1e-9
            };
            for seed in 0..4 {
                let grid = filled(&sensor.measure(&[ground], kinect_noise(seed)));
                for key in keys.iter().filter(true_surface) {
                    let is_through = sensor.look(&grid, *key, edge, margin(edge));
                    assert!(!is_through, "{key:?} of {edge} m, floor at {level}, sensor {height}");
                }
            }
        }
    }
}

#[test]
fn a_voxel_that_holds_the_last_millimetres_of_a_table_is_not_seen_through() {
    for edge in [0.05, 0.08] {
        for sliver in [0.001, 0.004, 0.02] {
            for depth in [0.8, 1.5, 3.0, 5.0] {
                // Its edge lies a sliver within a voxel of the layer of y = 0.
                let board = Solid::new([depth, -0.8, 0.7], [depth + 0.8, sliver, 0.73]);
                let sensor = Sensor::kinect(looking_along_x([0.0, 0.0, 1.2], 0.3), 1);
                let points = sensor.measure(&[floor(), wall_at(depth + 3.0), board], kinect_noise(3));
                let grid = filled(&points);
                for key in voxels([depth, 0.0, 0.7], [depth + 0.8, edge, 0.7 + edge], edge) {
                    let is_through = sensor.look(&grid, key, edge, margin(edge));
                    assert!(!is_through, "{key:?} of {edge} m, sliver of {sliver} m at {depth} m");
                }
            }
        }
    }
}

prop_compose! {
    fn solids()(boxes in prop::collection::vec(
        (prop::array::uniform3(-2.5..2.5_f64), prop::array::uniform3(0.02..1.0_f64)), 1..6,
    ), wall in 3.0..5.0_f64) -> Vec<Solid> {
        let boxes = boxes.into_iter().map(|(low, size)| {
            let low = [low[0] + 2.6, low[1], 0.4 * low[2]];
            Solid::new(low, [0, 1, 2].map(|i| low[i] + size[i]))
        });
        let floor = Solid::new([-20.0, -20.0, -3.0], [20.0, 20.0, -1.0]);
        boxes.chain([wall_at(wall), floor]).collect()
    }
}

prop_compose! {
    /// Looks roughly along x, in a frame with axes turned at will.
    fn sensor()(
        place in prop::array::uniform3(-0.4..0.4_f64),
        pitch in -0.3..0.5_f64,
        axes in prop::array::uniform3(-3.2..3.2_f64),
        optical in any::<bool>(),
    ) -> Sensor {
        let sensor = Sensor::kinect(looking_along_x(place, pitch), 3);
        let turned = UnitQuaternion::from_euler_angles(axes[0], axes[1], axes[2]);
        if optical { sensor } else { sensor.turned(turned) }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_is_seen_through_is_empty_and_a_ray_passes_it(
        sensor in sensor(), solids in solids(), seed in 0..1000_u64, edge in 0.05..0.1_f64,
    ) {
        let measured = sensor.measure(&solids, kinect_noise(seed));
        let grid = filled(&measured);
        let points: Vec<Point3<f64>> = single(&measured)
            .iter()
            .map(|point| sensor.fixed_from_sensor * Point3::from(point.map(f64::from)))
            .collect();
        let origin = Point3::from(sensor.fixed_from_sensor.translation.vector);
        for key in voxels([0.0, -2.0, -1.2], [5.0, 2.0, 1.2], edge).into_iter().step_by(37) {
            if !sensor.look(&grid, key, edge, margin(edge)) {
                continue;
            }
            let low = Vector3::from(key).map(|i| f64::from(i) * edge);
            let voxel = Solid { low: low.into(), high: low.add_scalar(edge).into() };
            let (centre, _) = sensor.voxel(key, edge);
            let around = 0.5 * margin(edge)(centre.coords.norm());
            let within = |point: &&Point3<f64>| {
                (0..3).all(|i| (voxel.low[i] - around..voxel.high[i] + around).contains(&point[i]))
            };
            // A point beside the rays that pass the voxel may lie within `around`: the voxel stands on a surface.
            let passing: Vec<_> = points
                .iter()
                .filter_map(|point| Some((point, voxel.stretch(&origin, &(point - origin))?)))
                .collect();
            prop_assert!(!passing.is_empty(), "no ray passes {:?}", key);
            for (point, (_, leave)) in passing {
                prop_assert!(leave < 1.0 && !within(&point), "{} ends at or before {:?}", point, key);
            }
            let inside = |point: &&Point3<f64>| (0..3).all(|i| (voxel.low[i]..voxel.high[i]).contains(&point[i]));
            prop_assert!(!points.iter().any(|point| inside(&point)), "a point in {:?}", key);
        }
    }
}
