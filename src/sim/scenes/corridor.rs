//! A long corridor with doors at both sides, there and back.

use nalgebra::Point2;

use crate::engine::SurfaceClass;
use crate::sim::parts::{Cuboid, Opening, Upright, at, chair, cylinder, door_leaf, moved, reveals, without};
use crate::sim::path::Route;
use crate::sim::scene::Scene;
use crate::sim::surface::Surface;

/// Ends of the corridor (m); the robot starts at (0, 0).
const MIN: [f64; 3] = [-2.17, -0.93, 0.0];
const MAX: [f64; 3] = [24.31, 1.87, 2.53];
/// Of the leaves and doorways (m).
const DOOR: [f64; 2] = [0.94, 2.07];
/// From the wall to the end of a niche (m).
const NICHE: f64 = 1.13;

impl Scene {
    /// A corridor of 26.5 x 2.8 m with niches behind open doors, closed flush doors and a few things.
    pub(super) fn corridor() -> Self {
        let [east, north, height] = MAX;
        let [west, south, _] = MIN;
        let mut surfaces = Cuboid { min: MIN, max: MAX }.inside();
        surfaces.retain(|surface| ["west wall", "east wall"].contains(&surface.name()));
        // Floor and ceiling are those of the niches too.
        let wide = Cuboid { min: [west, south - NICHE, 0.0], max: [east, north + NICHE, height] }.inside();
        surfaces.extend(wide.into_iter().filter(|surface| surface.class() != SurfaceClass::Wall));
        surfaces.extend(side("south", [east, south], [west, south]));
        surfaces.extend(side("north", [west, north], [east, north]));
        let bench = Cuboid::standing([1.57, 0.37, 0.443]).outside("bench");
        surfaces.extend(moved(without(bench, &["bottom", "left"]), &at([8.33, north - 0.185, 0.0], 0.0)));
        surfaces.extend(moved(cylinder("bin", 0.163, 0.617), &at([15.63, south + 0.19, 0.0], 0.0)));
        surfaces.extend(moved(chair("chair"), &at([19.07, north - 0.31, 0.0], -1.43)));
        let corners =
            [[0.0, 0.0], [22.93, 0.0], [22.93, 0.94], [-0.97, 0.94], [-0.97, 0.0]].map(Point2::from);
        Self::new(surfaces, Route { corners: corners.to_vec(), radius: 0.46 })
    }
}

/// One long wall: every 6 m a doorway with an open leaf and a niche, and between them closed doors, 5 mm behind it.
fn side(name: &str, from: [f64; 2], to: [f64; 2]) -> Vec<Surface> {
    let wall = Upright { from, to, z: [0.0, MAX[2]] };
    let heading = (to[0] - from[0]).signum();
    let place = |s: f64, behind: f64| [from[0] + heading * s, from[1] + heading * behind];
    let doorway = |s: f64| Opening { from: s, to: s + DOOR[0], z: [0.0, DOOR[1]] };
    let starts = [3.37, 9.41, 15.29, 21.53];
    let (open, closed): (Vec<f64>, Vec<f64>) = (starts[..2].to_vec(), starts[2..].to_vec());
    let openings: Vec<_> = starts.iter().map(|&s| doorway(s)).collect();
    let mut surfaces = vec![wall.face(&format!("{name} wall"), SurfaceClass::Wall, &openings)];
    for (number, &s) in (1..).zip(&closed) {
        // A little larger than the doorway, so that nobody looks past it at an angle.
        let ends = [place(s - 0.02, 0.005), place(s + DOOR[0] + 0.02, 0.005)];
        let door = Upright { from: ends[0], to: ends[1], z: [0.0, DOOR[1] + 0.02] };
        surfaces.push(door.face(&format!("{name} closed door {number}"), SurfaceClass::Wall, &[]));
    }
    let passable: Vec<_> = open.iter().map(|&s| doorway(s)).collect();
    surfaces.extend(reveals(&format!("{name} doorway"), wall, 0.12, &passable));
    for ((number, &s), degrees) in (1..).zip(&open).zip([27.0_f64, 71.0]) {
        let niche = [(s - 0.31, 0.12), (s - 0.31, NICHE), (s + 1.37, NICHE), (s + 1.37, 0.12)];
        for (part, ends) in ["first side", "end", "second side"].iter().zip(niche.windows(2)) {
            let [from, to] = [ends[0], ends[1]].map(|(s, behind)| place(s, behind));
            let face = Upright { from, to, z: [0.0, MAX[2]] };
            surfaces.push(face.face(&format!("{name} niche {number} {part}"), SurfaceClass::Wall, &[]));
        }
        // The leaf hangs at the far end of the doorway and opens away from the corridor.
        let hinge = place(s, 0.09);
        let closed = if heading > 0.0 { 0.0 } else { std::f64::consts::PI };
        let leaf = [DOOR[0] - 0.01, DOOR[1] - 0.01];
        surfaces.extend(door_leaf(
            &format!("{name} door {number}"),
            hinge,
            closed,
            degrees.to_radians(),
            leaf,
        ));
    }
    surfaces
}
