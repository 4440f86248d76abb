//! Where surfaces are narrow, or spread: what belongs to them there, on a scene whose points are given.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::ops::Range;

use cfodi::engine::consistent::Consistent;
use cfodi::engine::{ClusterId, Isometry3, NoiseModel, Params, Points, Scan, Snapshot, Stamp};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// The points of a rectangle, a `step` from each other (m): a corner, and its two sides with their lengths (m).
fn rectangle(corner: [f64; 3], sides: [[f64; 3]; 2], lengths: [f64; 2], step: f64) -> Vec<Vector3<f64>> {
    let sides = sides.map(|side| Vector3::from(side).normalize());
    let along = |length: f64| (0..(length / step) as u32).map(move |i| (f64::from(i) + 0.5) * step);
    let points = along(lengths[0]).flat_map(|a| along(lengths[1]).map(move |b| (a, b)));
    points.map(|(a, b)| Vector3::from(corner) + sides[0] * a + sides[1] * b).collect()
}

/// What is found of these points, seen from a place in the direction of +x.
fn found(points: &[Vector3<f64>], from: [f64; 3], voxel_size: f64) -> Snapshot {
    let mut map = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
    look(&mut map, 1, points, from, 0.0);
    map.snapshot()
}

/// Takes in these points as scan `number`, seen from a place in the direction of +x turned by an angle about z (rad).
fn look(map: &mut Consistent, number: i64, points: &[Vector3<f64>], from: [f64; 3], turned: f64) {
    // Optical axes: x to the right, y down, z forwards.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let rotation = UnitQuaternion::from(Rotation3::from_matrix_unchecked(axes));
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turned) * rotation;
    let fixed_from_sensor = Isometry3::from_parts(Vector3::from(from).into(), rotation);
    let sensed = points.iter().map(|point| fixed_from_sensor.inverse() * nalgebra::Point3::from(*point));
    let points = Points::F64(sensed.map(|point| point.coords.into()).collect());
    map.insert(&Scan { stamp: Stamp::from_nanos(number), fixed_from_sensor, points });
}

/// Number of voxels by cluster, of those whose points have their mean within these bounds (m); 0 = in no cluster.
fn clusters_in(snapshot: &Snapshot, bounds: &[Range<f64>; 3]) -> BTreeMap<u64, usize> {
    let mut clusters = BTreeMap::new();
    let is_in = |centre: &[f64; 3]| bounds.iter().zip(centre).all(|(range, at)| range.contains(at));
    for voxel in snapshot.voxels.iter().filter(|voxel| is_in(&voxel.centre.coords.into())) {
        *clusters.entry(voxel.cluster.map_or(0, ClusterId::get)).or_default() += 1;
    }
    clusters
}

/// Share of the voxels within these bounds (m) that the largest of the clusters there has, and how many clusters there are.
fn wholeness(snapshot: &Snapshot, bounds: &[Range<f64>; 3]) -> (f64, usize) {
    let clusters = clusters_in(snapshot, bounds);
    let all: usize = clusters.values().sum();
    let found = clusters.iter().filter(|(id, _)| **id != 0);
    let most = found.clone().map(|(_, voxels)| *voxels).max().unwrap_or(0);
    (most as f64 / all as f64, found.count())
}

/// Uniform numbers from 0 to 1, the same each time.
fn random() -> impl FnMut() -> f64 {
    let mut seed = 1_u64;
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Of twelve uniform numbers the sum has a variance of one.
fn normal(uniform: &mut impl FnMut() -> f64) -> f64 {
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

const EVERYWHERE: [Range<f64>; 3] = [0.0..9.0, -3.0..3.0, 0.0..3.0];

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// A wall from `x` on with a doorway up to `lintel`, below a ceiling 0.24 m above that (m).
fn doorway(x: f64, lintel: f64) -> Vec<Vector3<f64>> {
    let ceiling = lintel + 0.24;
    let rectangle = |corner, sides, lengths| rectangle(corner, sides, lengths, 0.01);
    let mut points = Vec::new();
    for (y, z, lengths) in
        [(-2.5, 0.0, [2.0, ceiling]), (0.5, 0.0, [2.0, ceiling]), (-0.5, lintel, [1.0, 0.24])]
    {
        points.extend(rectangle([x, y, z], [Y, Z], lengths));
    }
    // The lintel's lower side, a jamb, the ceiling on this side.
    points.extend(rectangle([x, -0.5, lintel], [Y, X], [1.0, 0.12]));
    points.extend(rectangle([x, -0.5, 0.0], [Z, X], [lintel, 0.12]));
    points.extend(rectangle([x - 1.5, -2.5, ceiling], [Y, X], [5.0, 1.5]));
    points
}

#[test]
fn two_halves_of_a_wall_are_one_by_the_strip_above_a_doorway() {
    // The strip is two or three voxels high, wherever the voxels' borders are.
    for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
        let (x, lintel) = (2.0 + 0.01 * f64::from(i), 2.03 + 0.01 * f64::from(j));
        let snapshot = found(&doorway(x, lintel), [0.0, 0.1, 1.1], 0.08);
        let (share, _) = wholeness(&snapshot, &[x - 0.02..x + 0.02, -2.5..2.5, 0.1..2.0]);
        assert!(share >= 0.95, "wall at {x} m, lintel at {lintel} m: {share}");
    }
}

#[test]
fn a_surface_that_crosses_a_corner_of_a_block_in_one_row_of_voxels_is_whole() {
    // A block of eight voxels ends at x = 2.4 m and at y = 0, and the surface goes by that edge at different distances.
    for (i, degrees) in (0..8).flat_map(|i| [22.0_f64, 30.0, 40.0, 50.0].map(|degrees| (i, degrees))) {
        let x = 2.09 + 0.01 * f64::from(i);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let points = rectangle([x, -0.49, 0.0], [Z, [sin, cos, 0.0]], [2.05, 0.92], 0.005);
        let snapshot = found(&points, [0.0, 0.1, 1.1], 0.05);
        let (share, _) = wholeness(&snapshot, &[0.0..5.0, -1.0..1.0, 0.0..3.0]);
        assert!(share >= 0.98, "from {x} m at {degrees} degrees: {share}");
    }
}

#[test]
fn the_faces_of_a_post_are_surfaces_of_their_own() {
    for (i, voxel_size) in (0..8).flat_map(|i| [0.05, 0.08].map(|voxel_size| (i, voxel_size))) {
        let (x, y) = (2.0 + 0.03 * f64::from(i), 0.02 * f64::from(i));
        let face = |side| rectangle([x, y, 0.0], [Z, side], [2.0, 0.4], 0.005);
        let mut post = face([1.0, 1.0, 0.0]);
        post.extend(face([1.0, -1.0, 0.0]));
        let (share, count) = wholeness(&found(&post, [0.0, y, 1.1], voxel_size), &EVERYWHERE);
        assert!(share <= 0.7 && count >= 2, "at {x}, {y} m, voxels of {voxel_size} m: {share} of {count}");
    }
}

#[test]
fn a_strip_of_one_row_of_voxels_is_whole() {
    // Between two doors: nowhere more than a row of voxels, in some of them little of it.
    for i in 0..16 {
        let y = 0.01 * f64::from(i);
        let strip = rectangle([2.03, y, 0.0], [Z, [0.1, 1.0, 0.0]], [2.0, 0.1], 0.005);
        let (share, _) = wholeness(&found(&strip, [0.0, 0.1, 1.1], 0.08), &EVERYWHERE);
        assert!(share >= 0.9, "strip from {y} m on: {share}");
    }
}

#[test]
fn the_scatter_of_a_far_wall_is_no_plane_along_the_sight() {
    // The noise of a Kinect at 5.8 m (m).
    const SIGMA: f64 = 0.06;
    let from = [0.0, 2.0, 1.1];
    let mut random = random();
    // The last rows of the wall lie in blocks of their own, which end at y = 0.4 m.
    for i in 0..8 {
        let end = 0.42 + 0.02 * f64::from(i);
        let wall = rectangle([5.6, end - 1.4, 0.02], [Y, Z], [1.4, 2.0], 0.005);
        let scattered = (0..5)
            .flat_map(|_| wall.clone())
            .map(|point| point + (point - Vector3::from(from)).normalize() * SIGMA * normal(&mut random));
        let (share, _) = wholeness(&found(&scattered.collect::<Vec<_>>(), from, 0.05), &EVERYWHERE);
        assert!(share >= 0.998, "wall up to {end} m: {share}");
    }
}

/// How far ahead of the sensor the wall below is (m).
const AHEAD: f64 = 2.16;

/// A Kinect's image of a wall at this `x` (m), ahead of it in the direction of +x, when it is turned by `turned` (rad). In depth each
/// point is off by an `error` (m).
fn image_of_wall(x: f64, turned: f64, mut error: impl FnMut() -> f64) -> Vec<Vector3<f64>> {
    let tangent = |i: i32, count: i32| 0.0073 * (f64::from(i) - 0.5 * f64::from(count - 1));
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turned);
    let pixels = (0..72).flat_map(|row| (0..96).map(move |column| (row, column)));
    let point = |(row, column)| {
        let ray = turn * Vector3::new(1.0, tangent(column, 96), tangent(row, 72));
        Vector3::new(x - AHEAD, 0.0, 1.1) + ray * (AHEAD / ray.x + error())
    };
    pixels.map(point).collect()
}

/// What is found of a wall through a border of voxels, when 100 scans were taken in whose poses sway along its normal by `sway` to
/// either side (m): the share of its voxels that is in no cluster, and that in the largest one.
fn swaying(params: Params, sway: f64, random: &mut impl FnMut() -> f64) -> [f64; 2] {
    let mut map = Consistent::new(params);
    for number in 1..=100 {
        let phase = 0.02 * PI * f64::from(number);
        let (x, turned) = (4.0 + sway * phase.sin(), 0.25 * (3.3 * phase).sin());
        let image = image_of_wall(x, turned, || 0.0075 * normal(random));
        look(&mut map, number.into(), &image, [x - AHEAD, 0.0, 1.1], turned);
    }
    let (snapshot, bounds) = (map.snapshot(), [3.0..5.0, -3.0..3.0, 0.0..3.0]);
    let clusters = clusters_in(&snapshot, &bounds);
    let in_none = clusters.get(&0).copied().unwrap_or(0);
    [in_none as f64 / clusters.values().sum::<usize>() as f64, wholeness(&snapshot, &bounds).0]
}

#[test]
fn a_wall_that_swaying_poses_spread_over_layers_of_voxels_is_in_clusters() {
    let mut random = random();
    for (voxel_size, sway) in [(0.08, 0.06), (0.05, 0.04), (0.05, 0.12)] {
        for (noise, clearing) in [NoiseModel::KinectV1, NoiseModel::None]
            .into_iter()
            .flat_map(|noise| [false, true].map(|clearing| (noise, clearing)))
        {
            let params = Params::default().with_voxel_size(voxel_size).unwrap();
            let params = params.with_noise_model(noise).with_clearing(clearing);
            let [share, _] = swaying(params, sway, &mut random);
            assert!(
                share <= 0.05,
                "{share} of voxels of {voxel_size} m, {sway} m, {noise}, clearing {clearing}"
            );
        }
    }
}

#[test]
fn a_wall_is_whole_where_it_is_told_by_how_much_poses_sway() {
    let mut random = random();
    // And the largest share that one cluster has of it at most where it is not told, but for one that is whole then too.
    for (voxel_size, sway, untold) in
        [(0.08, 0.04, None), (0.08, 0.08, Some(0.8)), (0.05, 0.04, None), (0.05, 0.07, None)]
    {
        for noise in [NoiseModel::KinectV1, NoiseModel::None] {
            let params = Params::default().with_voxel_size(voxel_size).unwrap().with_noise_model(noise);
            // The standard deviation of a sine.
            let told = params.with_pose_sigma(sway * 0.5_f64.sqrt()).unwrap();
            let [_, whole] = swaying(told, sway, &mut random);
            assert!(whole >= 0.95, "{whole} of voxels of {voxel_size} m, {sway} m, {noise}");
            if let Some(most) = untold {
                let [_, largest] = swaying(params, sway, &mut random);
                assert!(largest <= most, "{largest} of voxels of {voxel_size} m, {sway} m, {noise}, untold");
            }
        }
    }
}

#[test]
fn the_edge_of_a_board_does_not_tilt_its_top() {
    // The edge faces the sensor and has sixteen times the points of the top, which it sees at a grazing angle.
    for (i, voxel_size) in (0..16).flat_map(|i| [0.05, 0.08].map(|voxel_size| (i, voxel_size))) {
        let (x, z) = (2.0 + 0.013 * f64::from(i), 0.717 + 0.005 * f64::from(i));
        let mut board = rectangle([x, -0.6, z], [X, Y], [0.7, 1.2], 0.01);
        board.extend(rectangle([x, -0.6, z - 0.025], [Y, Z], [1.2, 0.025], 0.0025));
        let snapshot = found(&board, [0.0, 0.1, 1.1], voxel_size);
        let top = snapshot.clusters.iter().max_by_key(|cluster| cluster.voxel_count).unwrap();
        let tilt = top.normal.z.acos().to_degrees();
        assert!(tilt < 1.0, "board at {x}, {z} m, voxels of {voxel_size} m: {tilt} degrees");
    }
}

#[test]
fn a_panel_within_a_layer_of_voxels_is_one_surface_from_whatever_side_it_is_seen() {
    for (i, thickness) in (0..5).flat_map(|i| [0.0, 0.01, 0.02].map(|thickness| (i, thickness))) {
        // A layer is from x = 2.0 to 2.08 m.
        let x = 2.02 + 0.01 * f64::from(i);
        let face = |at| rectangle([at, -0.52, 0.6], [Y, Z], [1.0, 1.0], 0.01);
        let (front, back) = (face(x - 0.5 * thickness), face(x + 0.5 * thickness));
        let mut map = Consistent::new(Params::default().with_voxel_size(0.08).unwrap());
        // Longer from behind, so that what was seen last does not decide.
        for number in 1..=30 {
            // Past the middle of it, so that it is looked at from the right and from the left.
            let y = 0.2 * f64::from(number % 10 - 5);
            match number {
                1..=10 => look(&mut map, number.into(), &front, [x - 1.5, y, 1.1], 0.0),
                _ => look(&mut map, number.into(), &back, [x + 1.5, y, 1.1], PI),
            }
        }
        // All that was seen is published once the sensor has turned away.
        (31..=45).for_each(|number| look(&mut map, number, &[], [x + 1.5, 0.0, 1.1], 0.0));
        let snapshot = map.snapshot();
        let (share, count) = wholeness(&snapshot, &EVERYWHERE);
        assert!(share >= 0.98 && count == 1, "{thickness} m at {x} m: {share} of {count}");
        assert!(snapshot.clusters[0].normal.x < -0.99, "{:?}", snapshot.clusters[0].normal);
    }
}

#[test]
fn a_wall_whose_face_noise_from_behind_has_hit_first_faces_who_sees_it() {
    let mut random = random();
    for (share, seconds) in
        [0.1, 0.5, 0.9].into_iter().flat_map(|share| [1, 5].map(|seconds| (share, seconds)))
    {
        // Where the face lies in a layer of voxels, which begins at x = 2 m; the other face is 10 cm behind it.
        let face = 2.0 + 0.08 * share;
        let mut seen = |from: [f64; 3], at: f64| -> Vec<_> {
            let distance = (from[0] - at).abs();
            // What a Kinect has of noise and between two pixels (m).
            let (sigma, step) = (0.0012 + 0.0019 * (distance - 0.4_f64).powi(2), distance / 525.0);
            let from = Vector3::from(from);
            let points = rectangle([at, -0.52, 0.6], [Y, Z], [1.0, 1.0], step).into_iter();
            points.map(|point| point + (point - from).normalize() * sigma * normal(&mut random)).collect()
        };
        let mut map = Consistent::new(Params::default().with_voxel_size(0.08).unwrap());
        let (behind, before) = ([face + 5.1, 0.0, 1.1], [face - 2.0, 0.0, 1.1]);
        let looks = 30 * seconds;
        (1..=looks).for_each(|number| look(&mut map, number, &seen(behind, face + 0.1), behind, PI));
        (looks + 1..=looks + 6).for_each(|number| look(&mut map, number, &seen(before, face), before, 0.0));
        (looks + 7..=looks + 21).for_each(|number| look(&mut map, number, &[], before, PI));
        let snapshot = map.snapshot();
        let bounds = [2.0..2.08, -0.44..0.4, 0.72..1.52];
        let clusters = clusters_in(&snapshot, &bounds);
        let largest = snapshot.clusters.iter().max_by_key(|cluster| clusters.get(&cluster.id.get())).unwrap();
        let (most, _) = wholeness(&snapshot, &bounds);
        let [normal, which] = [largest.normal.x, share];
        assert!(most >= 0.98 && normal < -0.98, "face at {which}, {seconds} s from behind: {most}, {normal}");
    }
}

#[test]
fn a_panel_that_is_seen_from_behind_now_and_then_faces_that_side_in_the_end() {
    let panel = rectangle([2.05, -0.52, 0.6], [Y, Z], [1.0, 1.0], 0.01);
    let (before, behind) = ([0.55, 0.0, 1.1], [3.55, 0.0, 1.1]);
    let mut map = Consistent::new(Params::default().with_voxel_size(0.08).unwrap());
    let mut number = 0;
    let mut looks = |count: i64, points: &[Vector3<f64>], from: [f64; 3], turned: f64| {
        (0..count).for_each(|i| look(&mut map, number + i, points, from, turned));
        number += count;
        map.snapshot()
    };
    looks(2, &panel, before, 0.0);
    // In between it is at rest.
    let facing = [1, 2, 3, 4].map(|_| {
        looks(5, &panel, behind, PI);
        looks(70, &[], behind, 0.0).clusters[0].normal.x
    });
    assert!(
        facing[2] < -0.99 && facing[3] > 0.99,
        "after 5, 10, 15 and 20 looks for 2 from the front: {facing:?}"
    );
}

#[test]
fn a_floor_that_is_seen_from_opposite_ends_of_a_room_faces_up() {
    // At 3 m a ray meets it at 20 degrees, and noise scatters it by more than a quarter of a voxel along the ray.
    let mut random = random();
    let mut map = Consistent::new(Params::default().with_voxel_size(0.05).unwrap());
    let floor = rectangle([2.03, -0.5, 0.021], [X, Y], [1.0, 1.0], 0.01);
    for number in 1..=20 {
        let (x, turned) = if number % 2 == 0 { (-0.5, 0.0) } else { (5.5, PI) };
        let from = Vector3::new(x, 0.0, 1.1);
        let scattered: Vec<_> = floor
            .iter()
            .map(|point| point + (point - from).normalize() * 0.014 * normal(&mut random))
            .collect();
        look(&mut map, number, &scattered, from.into(), turned);
    }
    let snapshot = map.snapshot();
    let (share, count) = wholeness(&snapshot, &EVERYWHERE);
    assert!(share >= 0.98 && count == 1, "{share} of {count}");
    assert!(snapshot.clusters[0].normal.z > 0.99, "{:?}", snapshot.clusters[0].normal);
}

#[test]
fn what_scatters_beyond_an_edge_is_no_part_of_the_outline() {
    // Within one block of eight voxels; those beyond the edge have 28 or 25 points each, the wall's 20,000 or 64.
    let sliver = rectangle([2.03, 0.48, 0.0], [Y, Z], [0.02, 0.56], 0.0075);
    // What was seen for a short time before all the rest was looked at for long is as much of the wall.
    let seen_before = rectangle([2.03, 0.48, 0.0], [Y, Z], [0.08, 0.56], 0.016);
    let cases = [
        (&sliver, 0.00056, 0.48),
        (&seen_before, 0.00056, 0.56),
        (&sliver, 0.01, 0.5),
        (&seen_before, 0.01, 0.56),
    ];
    // From 2 m, and from where noise is as thick as a voxel.
    for (sensor, (beyond, step, width)) in [0.0, -2.5].into_iter().flat_map(|x| cases.map(|case| (x, case))) {
        let mut points = rectangle([2.03, 0.0, 0.0], [Y, Z], [0.48, 0.56], step);
        points.extend(beyond);
        let snapshot = found(&points, [sensor, 0.25, 0.3], 0.08);
        let [wall] = &snapshot.clusters[..] else { panic!("{:?}", snapshot.clusters) };
        assert_eq!(wall.voxel_count, 49, "with those beyond the edge");
        let (area, expected) = (wall.area.unwrap(), width * 0.56);
        let off = (area - expected).abs();
        assert!(off < 0.03 * expected, "points {step} m apart from {sensor} m: {area} of {expected} m2");
    }
}

/// How a board of 1 x 0.8 m, 3 m ahead, is told of that a lidar passes with eight lines 10 cm apart, one for each row of voxels,
/// fifteen times: how far its normal is off, by its standard deviations, the larger of these (rad), and the confidence of its class.
fn board_in_lines(uniform: &mut impl FnMut() -> f64) -> (f64, f64, f32) {
    let params = Params::default().with_voxel_size(0.1).unwrap().with_noise_model(NoiseModel::None);
    let mut map = Consistent::new(params.with_min_points(5).unwrap());
    for number in 1..=15 {
        let lines = (0..8).flat_map(|line| (0..100).map(move |at| (line, at)));
        let point = |(line, at)| {
            let [y, z] = [0.01 * f64::from(at) - 0.495, 0.1 * f64::from(line) + 0.05];
            Vector3::new(3.05 + 0.02 * normal(uniform), y, z)
        };
        let points: Vec<_> = lines.map(point).collect();
        look(&mut map, number, &points, [0.0, 0.0, 0.4], 0.0);
    }
    let snapshot = map.snapshot();
    let board = snapshot.clusters.iter().max_by_key(|cluster| cluster.voxel_count).unwrap();
    let [x, y] =
        [0, 1].map(|axis| board.pose.rotation.to_rotation_matrix().matrix().column(axis).into_owned());
    let off = Vector3::new(-1.0, 0.0, 0.0);
    let off = [-off.dot(&y), off.dot(&x)];
    let covariance = board.plane_covariance.unwrap();
    let sigmas = [0, 1].map(|turn| covariance[(turn, turn)].sqrt());
    let worst = (off[0] / sigmas[0]).abs().max((off[1] / sigmas[1]).abs());
    (worst, sigmas[0].max(sigmas[1]), board.class_confidence)
}

#[test]
fn what_is_seen_in_single_lines_is_known_as_well_as_its_points_say() {
    let mut uniform = random();
    for _ in 0..8 {
        let (off, sigma, confidence) = board_in_lines(&mut uniform);
        assert!(off < 3.0 && sigma < 0.02 && confidence > 0.8, "{off} sigmas of {sigma}, {confidence}");
    }
}
