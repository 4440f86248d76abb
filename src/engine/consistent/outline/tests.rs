use std::collections::BTreeMap;

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

use self::plain::lies_within;
use super::footprint::{Axis, Content};
use super::*;
use crate::engine::key::VoxelKey;

mod plain;

/// A small generator of its own (xorshift64*), so that the shapes are the same on every run.
struct Random(u64);

impl Random {
    fn uniform(&mut self, from: f64, to: f64) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11;
        from + (to - from) * bits as f64 / (1u64 << 53) as f64
    }

    /// Of mean 0 and deviation 1 (Box and Muller).
    fn gaussian(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform(1e-12, 1.0).ln()).sqrt();
        radius * self.uniform(0.0, std::f64::consts::TAU).cos()
    }
}

/// Rectangles of a shape's own plane: those of which it is the union, and one that is cut out.
struct Shape {
    name: &'static str,
    parts: Vec<[f64; 4]>,
    hole: Option<[f64; 4]>,
}

const SPACING: f64 = 0.01;
/// How far apart the points of a scan are: a voxel of 5 cm holds a hundred, and is dense from fifteen on.
const APART: f64 = 0.5 * SPACING;

impl Shape {
    fn holds(&self, x: f64, y: f64) -> bool {
        let within = |r: &[f64; 4]| x > r[0] && x < r[2] && y > r[1] && y < r[3];
        self.parts.iter().any(within) && !self.hole.as_ref().is_some_and(within)
    }

    fn grid(&self, apart: f64) -> Vec<[f64; 2]> {
        let [mut w, mut h] = [0.0f64; 2];
        self.parts.iter().for_each(|r| (w, h) = (w.max(r[2]), h.max(r[3])));
        let steps = |length: f64| (0..(length / apart).round() as i32).map(|i| (f64::from(i) + 0.5) * apart);
        steps(w).flat_map(|x| steps(h).map(move |y| [x, y])).filter(|&[x, y]| self.holds(x, y)).collect()
    }

    /// By counting points: exact, since all edges lie on whole centimetres.
    fn area(&self) -> f64 {
        self.grid(SPACING).len() as f64 * SPACING * SPACING
    }

    fn rectangle(w: f64, h: f64) -> Self {
        Self { name: "rectangle", parts: vec![[0.0, 0.0, w, h]], hole: None }
    }

    fn random(kind: usize, random: &mut Random) -> Self {
        let mut length = |from: f64, to: f64| (random.uniform(from, to) / SPACING).round() * SPACING;
        match kind {
            0 => Self::rectangle(length(0.5, 5.0), length(0.5, 5.0)),
            1 => {
                let [w, h, a, b] = [length(0.8, 4.0), length(0.8, 4.0), length(0.3, 0.7), length(0.3, 0.7)];
                Self { name: "L", parts: vec![[0.0, 0.0, w, a], [0.0, 0.0, b, h]], hole: None }
            }
            _ => {
                let [w, h] = [length(1.5, 4.0), length(1.5, 4.0)];
                let [x, y] = [length(0.3, w - 0.9), length(0.3, h - 0.9)];
                let hole = Some([x, y, x + 0.6, y + 0.6]);
                Self { name: "with a hole", parts: vec![[0.0, 0.0, w, h]], hole }
            }
        }
    }
}

/// Where a shape stands.
struct Pose {
    turn: Rotation3<f64>,
    shift: Vector3<f64>,
}

impl Pose {
    fn random(random: &mut Random) -> Self {
        let axis = Vector3::from_fn(|_, _| random.gaussian());
        let turn = Rotation3::from_axis_angle(&UnitVector3::new_normalize(axis), random.uniform(0.0, 3.1));
        Self { turn, shift: Vector3::from_fn(|_, _| random.uniform(-3.0, 3.0)) }
    }

    fn plane(&self) -> PlaneEquation {
        let normal = UnitVector3::new_normalize(self.turn * Vector3::z());
        PlaneEquation { normal, d: -normal.dot(&self.shift) }
    }

    /// Points where `is_seen` holds of the first coordinate, with a noise of 5 mm along the normal.
    fn scan(
        &self,
        shape: &Shape,
        jitter: f64,
        random: &mut Random,
        is_seen: impl Fn(f64) -> bool,
    ) -> Vec<Vector3<f64>> {
        let mut points = Vec::new();
        for [x, y] in shape.grid(APART) {
            let [x, y] = [x, y].map(|c| c + random.uniform(-jitter, jitter));
            let point = Vector3::new(x, y, 0.005 * random.gaussian());
            points.extend(is_seen(x).then(|| self.turn * point + self.shift));
        }
        points
    }
}

/// A shape somewhere in space, seen `scans` times.
#[derive(Debug)]
struct Seen {
    footprint: Footprint,
    plane: PlaneEquation,
    voxel_size: f64,
}

fn seen(shape: &Shape, voxel_size: f64, scans: usize, random: &mut Random) -> Seen {
    let pose = Pose::random(random);
    let plane = pose.plane();
    // Every scan of several meets the surface elsewhere.
    let jitter = if scans > 1 { 0.5 * APART } else { 0.0 };
    let points: Vec<_> = (0..scans).flat_map(|_| pose.scan(shape, jitter, random, |_| true)).collect();
    Seen { footprint: binned(&points, &plane, voxel_size), plane, voxel_size }
}

/// The footprint of the dense voxels.
fn binned(points: &[Vector3<f64>], plane: &PlaneEquation, voxel_size: f64) -> Footprint {
    let axis = Axis::dominant(&plane.normal);
    let mut voxels: BTreeMap<VoxelKey, Vec<[f64; 2]>> = BTreeMap::new();
    for point in points {
        let scaled = point / voxel_size;
        let key = scaled.map(|c| c.floor() as i32);
        let points = voxels.entry(VoxelKey::new(key.x, key.y, key.z).unwrap()).or_default();
        points.push(axis.others().map(|i| scaled[i] - scaled[i].floor()));
    }
    let mut footprint = Footprint::new(axis);
    for (key, points) in voxels.into_iter().filter(|(_, points)| points.len() >= 15) {
        footprint.add(axis.column(key), &Content::of_points(&points));
    }
    footprint
}

impl Seen {
    fn outline(&self) -> Outline {
        self.outline_with(LEAST_HOLE, TOLERANCE).unwrap()
    }

    fn outline_with(&self, least_hole: u32, tolerance: f64) -> Option<Outline> {
        let drawing = &mut Drawing::default();
        Outline::with(&self.footprint, &self.plane, self.voxel_size, least_hole, tolerance, drawing)
    }
}

/// Seeds of random shapes; the property tests vary them.
fn any_shape() -> impl Strategy<Value = (Seen, f64)> {
    (0..3usize, 1..u64::MAX, 0..2usize, 1..3usize).prop_map(|(kind, seed, size, scans)| {
        let mut random = Random(seed);
        let shape = Shape::random(kind, &mut random);
        (seen(&shape, [0.05, 0.08][size], scans, &mut random), shape.area())
    })
}

/// A footprint of columns that are there or not, with points anywhere: nothing like a surface.
fn any_footprint() -> impl Strategy<Value = Seen> {
    let content = proptest::collection::vec(proptest::array::uniform2(0.0..1.0), 1..4);
    let column = (proptest::array::uniform2(-6..6), content);
    let normal = proptest::array::uniform3(-1.0..1.0f64)
        .prop_filter("of no length", |n| Vector3::from(*n).norm() > 0.1);
    (proptest::collection::vec(column, 1..140), normal, -5.0..5.0).prop_map(|(columns, normal, d)| {
        let normal = UnitVector3::new_normalize(Vector3::from(normal));
        let mut footprint = Footprint::new(Axis::dominant(&normal));
        for (column, points) in columns {
            footprint.add(column, &Content::of_points(&points));
        }
        Seen { footprint, plane: PlaneEquation { normal, d }, voxel_size: 0.05 }
    })
}

/// A footprint of many holes: of blocks that are there or not, each column with points anywhere. Parts stand in holes.
fn any_holed() -> impl Strategy<Value = Seen> {
    let extents = proptest::array::uniform2(8..70i32);
    (extents, 1..4i32, 0.4..0.95f64, 1..u64::MAX).prop_map(|([w, h], block, density, seed)| {
        let mut random = Random(seed);
        let blocks: Vec<_> = (0..70 * 70).map(|_| random.uniform(0.0, 1.0) < density).collect();
        let mut footprint = Footprint::new(Axis::dominant(&Vector3::z_axis()));
        for [x, y] in square([0, 0], w.max(h)).filter(|[x, y]| *x < w && *y < h) {
            let is_there = blocks[(x / block * 70 + y / block) as usize] || [x, y] == [0, 0];
            let point = [(); 2].map(|()| random.uniform(0.0, 1.0));
            let content = Content::of_points(&[point, [0.5, 0.5]]);
            is_there.then(|| footprint.add([x, y], &content));
        }
        Seen { footprint, plane: PlaneEquation { normal: Vector3::z_axis(), d: 0.0 }, voxel_size: 0.05 }
    })
}

/// Two directions of the plane, the normal between the first and the second.
fn basis(plane: &PlaneEquation) -> [Vector3<f64>; 2] {
    let u = plane.normal.cross(&Vector3::ith(plane.normal.iamin(), 1.0)).normalize();
    [u, plane.normal.cross(&u)]
}

fn in_plane(ring: &[Point3<f64>], plane: &PlaneEquation) -> Vec<Vector2<f64>> {
    let [u, v] = basis(plane);
    let foot = plane.normal.scale(-plane.d);
    ring.iter().map(|point| point.coords - foot).map(|p| Vector2::new(u.dot(&p), v.dot(&p))).collect()
}

/// Every pair of edges by itself.
fn crossings(rings: &[Vec<Vector2<f64>>]) -> usize {
    let edges: Vec<_> = rings
        .iter()
        .flat_map(|ring| ring.iter().copied().zip(ring.iter().copied().cycle().skip(1)))
        .collect();
    let side = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| (q - p).perp(&(r - p));
    let cross = |(a, b): (Vector2<f64>, Vector2<f64>), (c, d): (Vector2<f64>, Vector2<f64>)| {
        // Of edges on one line, far from each other, rounding says anything of the sides.
        let overlap = a.inf(&b).sup(&c.inf(&d)) <= a.sup(&b).inf(&c.sup(&d));
        overlap && side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
    };
    (0..edges.len()).map(|i| edges[..i].iter().filter(|&&other| cross(edges[i], other)).count()).sum()
}

/// Everything that is promised of an outline.
fn check(seen: &Seen, outline: &Outline) -> Result<(), TestCaseError> {
    let rings: Vec<_> = std::iter::once(&outline.boundary).chain(&outline.holes).collect();
    for point in rings.iter().copied().flatten() {
        prop_assert!((seen.plane.normal.dot(&point.coords) + seen.plane.d).abs() < 1e-9);
    }
    let flat: Vec<_> = rings.iter().map(|ring| in_plane(ring, &seen.plane)).collect();
    prop_assert_eq!(crossings(&flat), 0);
    let areas: Vec<_> = flat.iter().map(|ring| 0.5 * doubled_area(ring)).collect();
    prop_assert!(areas[0] > 0.0, "the boundary runs clockwise");
    prop_assert!(areas[1..].iter().all(|&area| area < 0.0), "a hole runs counter-clockwise");
    prop_assert!((areas.iter().sum::<f64>() - outline.area).abs() < 1e-9 * outline.area.max(1.0));
    for hole in &flat[1..] {
        prop_assert!(hole.iter().all(|&vertex| lies_within(vertex, &flat[0])));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn an_outline_is_simple_on_its_plane_and_has_the_area_of_its_rings((seen, truth) in any_shape()) {
        let outline = seen.outline();
        check(&seen, &outline)?;
        prop_assert!((outline.area / truth - 1.0).abs() < 0.25);
    }
}

proptest! {
    #[test]
    fn an_outline_is_simple_whatever_the_points_say(seen in any_footprint(), least_hole in 1u32..6) {
        for tolerance in [0.0, 0.5, 2.0] {
            let outline = seen.outline_with(least_hole, tolerance).unwrap();
            check(&seen, &outline)?;
        }
    }

    #[test]
    fn fewer_vertices_leave_the_area_as_it_is(seen in any_footprint()) {
        let mut traced = Rings::default();
        rings(&seen.footprint, &mut Tracing::default(), &mut traced).unwrap();
        for ring in traced.iter() {
            let mut few = Rings::default();
            Simplifying::default().draw(ring, 0.5, &mut few);
            prop_assert!(few.drawn().len() <= ring.len());
            prop_assert!((doubled_area(few.drawn()) - doubled_area(ring)).abs() < 1e-9);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn many_holes_are_drawn_as_when_each_is_held_against_every_other(seen in any_holed(), least_hole in 1u32..6) {
        let mut traced = Rings::default();
        rings(&seen.footprint, &mut Tracing::default(), &mut traced).unwrap();
        let mut drawing = Drawing::default();
        for tolerance in [0.0, 0.1, 0.5, 2.0] {
            let Seen { footprint, plane, voxel_size } = &seen;
            Outline::with(footprint, plane, *voxel_size, least_hole, tolerance, &mut drawing).unwrap();
            let plain = plain::drawn(&traced, least_hole, tolerance);
            prop_assert!(drawing.fewer.iter().eq(plain.iter()));
        }
    }
}

/// The mean error and the largest ones from 2 m^2 on and below.
fn errors(voxel_size: f64, scans: usize, random: &mut Random) -> [f64; 3] {
    const SHAPES: usize = 90;
    let [mut mean, mut large, mut small] = [0.0, 0.0, 0.0f64];
    for i in 0..SHAPES {
        let shape = Shape::random(i % 3, random);
        let (outline, truth) = (seen(&shape, voxel_size, scans, random).outline(), shape.area());
        let error = outline.area / truth - 1.0;
        println!(
            "{:<12} {truth:6.2} m2, {scans:2} scans at {voxel_size} m: {:+5.1} %, {:2} vertices, holes of {:?}",
            shape.name,
            100.0 * error,
            outline.boundary.len(),
            outline.holes.iter().map(Vec::len).collect::<Vec<_>>(),
        );
        mean += error / SHAPES as f64;
        let worst = if truth >= 2.0 { &mut large } else { &mut small };
        *worst = worst.max(error.abs());
    }
    [mean, large, small]
}

#[test]
fn areas_of_random_shapes_are_within_a_tenth_and_without_bias() {
    let mut random = Random(0x5EED);
    for (voxel_size, scans) in [(0.05, 1), (0.08, 1), (0.05, 4), (0.08, 4)] {
        let [mean, large, small] = errors(voxel_size, scans, &mut random);
        println!(
            "=> {scans} scans at {voxel_size} m: mean {:+.2} %, at most {:.1} % from 2 m2 on, {:.1} % below",
            100.0 * mean,
            100.0 * large,
            100.0 * small,
        );
        assert!(mean.abs() < 0.03 && large < 0.1 && small < 0.25);
    }
}

#[test]
fn tables_of_a_quarter_square_metre_are_within_a_quarter() {
    let mut random = Random(7);
    for voxel_size in [0.05, 0.08] {
        let mut mean = 0.0;
        for i in 0..40 {
            let side = |random: &mut Random| (random.uniform(0.5, 0.8) / SPACING).round() * SPACING;
            let shape = Shape::rectangle(side(&mut random), side(&mut random));
            let error = seen(&shape, voxel_size, 1 + i % 3, &mut random).outline().area / shape.area() - 1.0;
            assert!(error.abs() < 0.25, "{:.2} m2: {:+.1} %", shape.area(), 100.0 * error);
            mean += error / 40.0;
        }
        println!("=> 0.25 to 0.64 m2 at {voxel_size} m: mean {:+.2} %", 100.0 * mean);
        assert!(mean.abs() < 0.03);
    }
}

#[test]
fn a_strip_that_most_scans_miss_moves_the_area_by_less_than_two_percent() {
    for (voxel_size, missed) in [(0.05, 0.02), (0.05, 0.05), (0.08, 0.02), (0.08, 0.05)] {
        let mut random = Random(11);
        let mut mean = 0.0;
        for _ in 0..10 {
            let shape = Shape::random(0, &mut random);
            let width = shape.parts[0][2];
            let pose = Pose::random(&mut random);
            let mut points = Vec::new();
            for scan in 0..6 {
                let seen = |x: f64| scan < 2 || (missed..width - missed).contains(&x);
                points.extend(pose.scan(&shape, 0.5 * APART, &mut random, seen));
            }
            let footprint = binned(&points, &pose.plane(), voxel_size);
            let outline = Seen { footprint, plane: pose.plane(), voxel_size }.outline();
            mean += (outline.area / shape.area() - 1.0) / 10.0;
        }
        assert!(mean.abs() < 0.02, "{missed} m at {voxel_size} m: {:+.1} %", 100.0 * mean);
    }
}

/// Full columns on the plane z = 0, voxels of 1 m.
fn full(columns: &[Column]) -> Seen {
    let plane = PlaneEquation { normal: Vector3::z_axis(), d: 0.0 };
    let mut footprint = Footprint::new(Axis::dominant(&plane.normal));
    let points: Vec<_> = (0..1024).map(|i| [i % 32, i / 32].map(|at| (f64::from(at) + 0.5) / 32.0)).collect();
    columns.iter().for_each(|&column| footprint.add(column, &Content::of_points(&points)));
    Seen { footprint, plane, voxel_size: 1.0 }
}

fn square(corner: Column, side: i32) -> impl Iterator<Item = Column> {
    (0..side * side).map(move |i| [corner[0] + i % side, corner[1] + i / side])
}

#[test]
fn parts_that_touch_at_a_corner_share_a_boundary_and_others_are_left_out() {
    let touching: Vec<_> = square([0, 0], 5).chain(square([5, 5], 4)).collect();
    let outline = full(&touching).outline();
    assert!((outline.area - 41.0).abs() < 1.0, "{}", outline.area);

    let apart: Vec<_> = square([0, 0], 4).chain(square([6, 6], 5)).collect();
    let outline = full(&apart).outline();
    assert!((outline.area - 25.0).abs() < 0.7);
    assert!(outline.boundary.iter().all(|point| point.x > 5.9));
}

/// The outermost columns of a square.
fn frame(corner: i32, side: i32) -> impl Iterator<Item = Column> {
    let last = corner + side - 1;
    square([corner; 2], side).filter(move |column| column.iter().any(|&c| c == corner || c == last))
}

#[test]
fn the_largest_part_is_the_one_with_most_area_whatever_stands_around_it() {
    let thing = full(&frame(0, 15).chain(square([3, 3], 9)).collect::<Vec<_>>()).outline();
    assert!((thing.area - 81.0).abs() < 1.5 && thing.holes.is_empty(), "{thing:?}");
    let is_middle = |column: &Column| column.iter().all(|c| (6..9).contains(c));
    let holed = square([3, 3], 9).filter(|column| !is_middle(column));
    let holed = full(&frame(0, 15).chain(holed).collect::<Vec<_>>()).outline();
    assert!((holed.area - 72.0).abs() < 1.5 && holed.holes.len() == 1, "{holed:?}");
}

#[test]
fn the_hole_of_a_part_within_a_hole_is_not_the_boundarys() {
    let outline = full(&frame(0, 15).chain(frame(4, 7)).collect::<Vec<_>>()).outline();
    assert_eq!(outline.holes.len(), 1);
    assert!((outline.area - 56.0).abs() < 1.5, "{outline:?}");
}

#[test]
fn holes_of_fewer_columns_than_asked_for_are_filled() {
    let holed: Vec<_> =
        square([0, 0], 9).filter(|&[x, y]| !((2..4).contains(&x) && (3..5).contains(&y))).collect();
    let seen = full(&holed);
    let of = |least_hole| seen.outline_with(least_hole, TOLERANCE).unwrap();
    assert_eq!((of(4).holes.len(), of(5).holes.len()), (1, 0));
    assert!((of(5).area - of(4).area - 4.0).abs() < 1.0);
}

#[test]
fn no_columns_have_no_outline_and_one_column_has_one() {
    assert_eq!(full(&[]).outline_with(LEAST_HOLE, TOLERANCE), None);
    let one = full(&[[3, -4]]).outline();
    assert!(one.area > 0.4 && one.area < 1.1 && one.boundary.len() == 4, "{one:?}");
}
