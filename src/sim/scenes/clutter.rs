//! A hall full of boxes, leaning boards, cylinders and balls, laid out by a fixed seed.

use nalgebra::{Point2, Point3};
use rand::rngs::Xoshiro256PlusPlus;
use rand::{RngExt, SeedableRng};

use crate::sim::parts::{Cuboid, at, ball, cylinder, incline, moved, without};
use crate::sim::path::{Path, Route};
use crate::sim::scene::Scene;
use crate::sim::surface::Surface;

/// Ends of the hall (m); the robot starts at (0, 0).
const MIN: [f64; 3] = [-2.27, -2.43, 0.0];
const MAX: [f64; 3] = [8.13, 5.57, 2.83];
/// Number of things.
const THINGS: usize = 46;
/// From the middle of a thing to the robot's way, and to the middle of another thing (m).
const CLEAR: [f64; 2] = [0.93, 0.77];

impl Scene {
    /// A hall of 10.4 x 8 m with 46 things on its floor.
    pub(super) fn clutter() -> Self {
        let corners = [[0.0, 0.0], [5.97, 0.0], [5.97, 3.17], [-0.67, 3.17], [-0.67, 0.0]].map(Point2::from);
        let route = Route { corners: corners.to_vec(), radius: 0.6 };
        let mut surfaces = Cuboid { min: MIN, max: MAX }.inside();
        // A seed of its own: the scene is the same whatever decides the noise.
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(46);
        for (number, [x, y]) in (1..).zip(places(&route, &mut rng)) {
            let yaw = rng.random_range(0.0..std::f64::consts::TAU);
            surfaces.extend(moved(thing(number, &mut rng), &at([x, y, 0.0], yaw)));
        }
        Self::new(surfaces, route)
    }
}

/// Where things stand: off the way, off the walls and off each other.
fn places(route: &Route, rng: &mut Xoshiro256PlusPlus) -> Vec<[f64; 2]> {
    let path = Path::new(route);
    let way: Vec<_> =
        (0..400).map(|i| path.pose_at(path.length() * f64::from(i) / 400.0).translation.vector).collect();
    let mut places: Vec<[f64; 2]> = Vec::new();
    // Many tries, of which most are refused; what finds no place any more is left out.
    for _ in 0..20_000 {
        let mut within = |i: usize| rng.random_range(MIN[i] + 0.47..MAX[i] - 0.47);
        let place = Point2::new(within(0), within(1));
        let off_way = way.iter().all(|at| (place.coords - at).norm() > CLEAR[0]);
        let off_things = places.iter().all(|&[x, y]| (place - Point2::new(x, y)).norm() > CLEAR[1]);
        if off_way && off_things && places.len() < THINGS {
            places.push([place.x, place.y]);
        }
    }
    places
}

/// Boxes, boards, cylinders and balls in turn, within 0.5 m of the origin.
fn thing(number: usize, rng: &mut Xoshiro256PlusPlus) -> Vec<Surface> {
    let mut between = |low: f64, high: f64| rng.random_range(low..high);
    match number % 5 {
        0 => vec![ball(&format!("ball {number}"), between(0.12, 0.31))],
        1 | 3 => {
            let size = [between(0.21, 0.63), between(0.21, 0.57), between(0.17, 1.07)];
            without(Cuboid::standing(size).outside(&format!("box {number}")), &["bottom"])
        }
        2 => cylinder(&format!("cylinder {number}"), between(0.09, 0.29), between(0.23, 1.13)),
        _ => {
            let (tilt, length) = (between(20.0, 70.0_f64).to_radians(), between(0.47, 0.83));
            let middle = Point3::new(0.0, 0.0, 0.5 * length * tilt.sin());
            vec![incline(&format!("board {number}"), middle.into(), 0.0, tilt, [length, between(0.31, 0.67)])]
        }
    }
}
