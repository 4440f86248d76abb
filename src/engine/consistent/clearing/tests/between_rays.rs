//! Sensors whose rays are farther apart than directions are: lidars, and cameras of few pixels.

use std::f64::consts::TAU;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Rotation3};

use super::*;
use crate::engine::consistent::noise::NoiseModel;

/// Voxels that a thing has while it is there, and after it has been away for `away` scans; `scan` gives points (m), as seen
/// from a sensor that stands still, x forward, of the thing or, where it is away, of the wall behind it.
fn left_of_a_thing(params: &Params, away: u64, scan: impl Fn(u64, bool) -> Points) -> [usize; 2] {
    left_in(params, away, scan, |point| point.coords.amax() < 3.5 && point.coords.norm() > 1.5)
}

/// The same of the voxels whose means lie where `is_near` says.
fn left_in(
    params: &Params,
    away: u64,
    scan: impl Fn(u64, bool) -> Points,
    is_near: impl Fn(&Point3<f64>) -> bool,
) -> [usize; 2] {
    const STAYS: u64 = 12;
    let mut grid = Grid::new(params);
    let (mut clearing, mut binned) = (Clearing::new(), Binned::default());
    let mut left = Vec::new();
    for sequence in 1..=STAYS + away {
        let fixed_from_sensor = Isometry3::translation(0.003, 0.002, 0.001);
        let scan =
            Scan { stamp: Stamp::default(), fixed_from_sensor, points: scan(sequence, sequence <= STAYS) };
        grid.bin(&scan, sequence, &mut binned);
        clearing.clear(&mut grid, &scan, sequence);
        if sequence == STAYS || sequence == STAYS + away {
            let voxels = |block: &Block| {
                let is_of_thing =
                    |voxel: &&Voxel| grid.is_dense(voxel) && is_near(&grid.centre(block, voxel));
                block.voxels().iter().filter(is_of_thing).count()
            };
            left.push(grid.blocks().map(|(_, block)| voxels(block)).sum());
        }
    }
    [left[0], left[1]]
}

/// A lidar that turns, its `lines` spread over `degrees`, the whole raised by `raised` degrees; in another phase in each scan. A
/// wall is 6 m away all round, and in 3 m a thing of 0.8 x 1.2 m.
fn lidar(lines: u32, degrees: f64, raised: f64) -> impl Fn(u64, bool) -> Points {
    let ray = move |line: u32, step: u32, phase: f64| {
        let up = (degrees * (f64::from(line) / f64::from(lines - 1) - 0.5) + raised).to_radians();
        let around = 0.2 * (f64::from(step) + phase).to_radians();
        Vector3::new(around.cos() * up.cos(), around.sin() * up.cos(), up.sin())
    };
    move |number, is_there| {
        let end = |ray: Vector3<f64>| {
            let at = ray * (3.0 / ray.x);
            let is_thing = is_there && ray.x > 0.0 && at.y.abs() < 0.4 && at.z.abs() < 0.6;
            let end = if is_thing { at } else { ray * (6.0 / ray.x.abs().max(ray.y.abs())) };
            end.map(|c| c as f32).into()
        };
        let phase = (number as f64 * 0.618).fract();
        let rays = (0..lines).flat_map(|line| (0..1800).map(move |step| ray(line, step, phase)));
        Points::F32(rays.map(end).collect())
    }
}

#[test]
fn what_a_lidar_looks_through_goes() {
    let params = Params::default().with_voxel_size(0.1).unwrap().with_min_points(3).unwrap();
    let params = params.with_noise_model(NoiseModel::None);
    for (lines, degrees) in [(16, 30.0), (32, 40.0), (64, 45.0), (128, 45.0)] {
        let [there, left] = left_of_a_thing(&params, 60, lidar(lines, degrees, 0.0));
        assert!(there > 20 && left * 10 < there, "{lines} lines: {left} of {there} voxels are left");
    }
}

/// A lidar that turns, 64 lines over 45 degrees and `columns` rays in each; in another phase in each scan where it `drifts`. A wall is
/// 4.5 m away all round, and 3 m away at a `bearing` (degrees) a thing of 0.3 x 0.8 x 1.1 m.
fn lidar_round(columns: u32, bearing: f64, drifts: bool) -> impl Fn(u64, bool) -> Points {
    let ahead = Rotation3::from_axis_angle(&Vector3::z_axis(), -bearing.to_radians());
    let half = Vector3::new(0.15, 0.4, 0.55);
    let end = move |ray: Vector3<f64>, is_there: bool| {
        let turned = ahead * ray;
        let sides = Vector3::from_fn(|axis, _| {
            let centre = [3.0, 0.0, 0.0][axis];
            (centre - half[axis] * turned[axis].signum()) / turned[axis]
        });
        let at = turned * sides.max();
        let is_within = (0..3).all(|axis| (at[axis] - [3.0, 0.0, 0.0][axis]).abs() < half[axis] + 1e-9);
        let length =
            if is_there && turned.x > 0.0 && is_within { sides.max() } else { 4.5 / ray.xy().norm() };
        (ray * length).map(|c| c as f32).into()
    };
    move |number, is_there| {
        let phase = if drifts { (number as f64 * 0.618).fract() } else { 0.5 };
        let ray = move |line: u32, column: u32| {
            let up = (45.0 * (f64::from(line) / 63.0 - 0.5)).to_radians();
            let around = TAU * (f64::from(column) + phase) / f64::from(columns);
            Vector3::new(around.cos() * up.cos(), around.sin() * up.cos(), up.sin())
        };
        let rays = (0..64).flat_map(|line| (0..columns).map(move |column| ray(line, column)));
        Points::F32(rays.map(|ray| end(ray, is_there)).collect())
    }
}

#[test]
fn what_a_lidar_looks_through_goes_at_every_bearing() {
    let params = Params::default().with_min_points(3).unwrap().with_noise_model(NoiseModel::None);
    let mut kept = Vec::new();
    for (columns, drifts) in
        [(900, false), (900, true), (1024, false), (1024, true), (1800, false), (1800, true)]
    {
        for bearing in [0.0, 22.0, 34.0, 40.0, 45.0] {
            let is_near = |point: &Point3<f64>| point.coords.xy().norm() < 3.8;
            let [there, left] = left_in(&params, 60, lidar_round(columns, bearing, drifts), is_near);
            if there < 50 || left * 10 > there {
                kept.push((columns, drifts, bearing, left, there));
            }
        }
    }
    assert!(kept.is_empty(), "{kept:?}");
}

#[test]
fn what_lies_between_the_lines_of_a_lidar_stays() {
    let params = Params::default().with_voxel_size(0.02).unwrap().with_min_points(3).unwrap();
    let params = params.with_noise_model(NoiseModel::None);
    // Lines 10 cm apart there, and then 5 cm above those that have measured it.
    let (seeing, passing) = (lidar(16, 30.0, 0.0), lidar(16, 30.0, 1.0));
    let scan = |number, is_there| if is_there { seeing(number, true) } else { passing(number, false) };
    let [there, left] = left_of_a_thing(&params, 60, scan);
    assert!(there > 20 && left == there, "{left} of {there} voxels are left");
}

/// A floor that some lines end before and others pass over, and a board in the air that they pass over and under.
#[test]
fn a_floor_and_a_board_between_the_lines_of_a_lidar_stay() {
    let params = Params::default().with_voxel_size(0.1).unwrap().with_noise_model(NoiseModel::None);
    let jitter = |i: u64| ((i as f64 * 0.618).fract() - 0.5) * 0.01;
    let level = |height: f64, number: u64| {
        let places = (0..60_u64).flat_map(|x| (0..40_u64).map(move |y| (x, y)));
        let point = move |(x, y): (u64, u64)| {
            let at = [5.0 + 0.05 * x as f64, 0.05 * y as f64 - 1.0, height + jitter(number + 7 * x + y)];
            at.map(|c| c as f32)
        };
        places.map(point).collect::<Vec<_>>()
    };
    let ahead = [(16, 30.0, 0.0, 1800), (32, 31.0, 0.0, 1800)];
    let aslant = [(16, 30.0, 45.0, 1024), (32, 31.0, 45.0, 1024)];
    for (lines, degrees, bearing, columns) in ahead.into_iter().chain(aslant) {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), f64::to_radians(bearing));
        let turned = |points: Vec<[f32; 3]>| {
            let turned =
                |point: [f32; 3]| (turn * Vector3::from(point.map(f64::from))).map(|c| c as f32).into();
            Points::F32(points.into_iter().map(turned).collect())
        };
        for height in [-0.65, -0.25] {
            let end = |ray: Vector3<f64>| {
                let wall = ray * (12.0 / ray.x.abs().max(ray.y.abs()));
                let floor = ray * (-0.65 / ray.z.min(-1e-9));
                let board = ray * (height / ray.z.min(-1e-9));
                let is_board = (5.0..8.0).contains(&board.x) && board.y.abs() < 1.0;
                let floor = if floor.norm() < wall.norm() { floor } else { wall };
                (if is_board { board } else { floor }).map(|c| c as f32).into()
            };
            let ends = |number: u64| {
                let rays = (0..lines).flat_map(|line| (0..columns).map(move |step| (line, step)));
                let ray = move |(line, step): (u32, u32)| {
                    let up = (degrees * (f64::from(line) / f64::from(lines - 1) - 0.5)).to_radians();
                    let around =
                        TAU * (f64::from(step) + (number as f64 * 0.618).fract()) / f64::from(columns);
                    Vector3::new(around.cos() * up.cos(), around.sin() * up.cos(), up.sin())
                };
                rays.map(ray).map(end).collect::<Vec<[f32; 3]>>()
            };
            let scan = |number, is_there| turned(if is_there { level(height, number) } else { ends(number) });
            // Not its rim, where points of the floor beside it come in, and where a line passes the board within half a degree.
            let is_within = |point: &Point3<f64>| {
                let point = turn.inverse() * point;
                (point.z - height).abs() < 0.04 && (5.5..7.0).contains(&point.x) && point.y.abs() < 0.8
            };
            let [there, left] = left_in(&params, 70, scan, is_within);
            // Of the board goes what a line grazes that ends on it farther on.
            let most = if height < -0.5 { 0 } else { there / 8 };
            assert!(
                there > 200 && there - left <= most,
                "{lines} lines, {height} m, {bearing} degrees: {left} of {there} are left"
            );
        }
    }
}

#[test]
fn what_a_camera_of_few_pixels_looks_through_goes() {
    for width in [320_u32, 160, 120, 80, 64] {
        let focal = 0.5 * f64::from(width) / 28.5_f64.to_radians().tan();
        let rays =
            |n: u32| (0..n).map(|i| ((f64::from(i) + 0.5 - 0.5 * f64::from(n)) / focal) as f32).collect();
        let rays = Arc::new(Rays { x: rays(width), y: rays(width * 3 / 4) });
        let scan = |_, is_there: bool| {
            let is_thing = |x: &f32, y: &f32| is_there && x.abs() < 0.15 && y.abs() < 0.15;
            let depth = |x: &f32, y: &f32| if is_thing(x, y) { 2.0 } else { 4.0 };
            let depths = rays.y.iter().flat_map(|y| rays.x.iter().map(move |x| depth(x, y)));
            Points::Depths(Depths::new(Arc::clone(&rays), depths.collect()).unwrap())
        };
        let params = Params::default().with_min_points(3).unwrap();
        let [there, left] = left_of_a_thing(&params, 60, scan);
        assert!(there > 5 && left * 5 < there, "{width} pixels: {left} of {there} voxels are left");
    }
}
