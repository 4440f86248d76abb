//! Steps up to a landing, and a ramp beside them, at the end of a hall; the robot drives towards them and past them.

use nalgebra::Point2;

use crate::engine::SurfaceClass;
use crate::sim::parts::{Cuboid, at, incline, moved, without};
use crate::sim::path::Route;
use crate::sim::scene::Scene;
use crate::sim::surface::Surface;

/// Ends of the hall (m), stated before the robot's start is made the origin.
const MIN: [f64; 3] = [-1.73, -5.17, 0.0];
const MAX: [f64; 3] = [6.87, 7.43, 3.07];
/// Height and depth of a step (m).
const STEP: [f64; 2] = [0.171, 0.287];
const STEPS: u32 = 5;
/// Southern end of the first step, and western and eastern end of the flight (m).
const FLIGHT_SOUTH: f64 = 3.63;
const FLIGHT: [f64; 2] = [0.83, 3.17];
/// Western and eastern end of the ramp (m).
const RAMP: [f64; 2] = [3.39, 5.27];
/// Between the flight, the ramp and the hall (m).
const PARAPET: f64 = 0.22;

impl Scene {
    /// A hall of 8.6 x 12.6 m with five steps, a ramp of 18 degrees and a landing behind them.
    pub(super) fn stairs() -> Self {
        let mut surfaces = Cuboid { min: MIN, max: MAX }.inside();
        let top = STEP[0] * f64::from(STEPS);
        let flight_north = FLIGHT_SOUTH + STEP[1] * f64::from(STEPS - 1);
        for number in 1..=STEPS {
            surfaces.extend(step(number));
        }
        let parapet = |name: &str, x: f64| {
            let size = Cuboid { min: [x, FLIGHT_SOUTH - 0.34, 0.0], max: [x + PARAPET, MAX[1], top + 0.613] };
            without(size.outside(name), &["bottom", "left"])
        };
        surfaces.extend(parapet("west parapet", FLIGHT[0] - PARAPET));
        surfaces.extend(parapet("middle parapet", FLIGHT[1]));
        surfaces.extend(parapet("east parapet", RAMP[1]));
        surfaces.extend(ramp(top));
        let landing = Cuboid { min: [FLIGHT[0], flight_north, 0.0], max: [FLIGHT[1], MAX[1], top] };
        let mut landing = landing.outside("landing");
        landing.retain(|face| face.name() == "landing/top");
        surfaces.extend(landing);
        let podium = Cuboid::standing([1.37, 1.13, 0.287]).outside("podium");
        surfaces.extend(moved(without(podium, &["bottom"]), &at([5.23, -0.41, 0.0], 0.19)));
        let corners =
            [[3.27, -2.93], [3.27, 2.47], [-0.43, 2.47], [-0.43, -3.97], [3.27, -3.97]].map(Point2::from);
        Self::new(surfaces, Route { corners: corners.to_vec(), radius: 0.6 }).seen_from_the_start()
    }
}

/// Riser and tread; the last tread is the landing.
#[cfg(test)]
impl Scene {
    /// A corridor of 2 m whose floor, at the border of two layers of voxels, goes over into a ramp that begins at x = `foot` (m). The robot
    /// drives towards it from 3 m before x = 0 to 1 m before it, at first.
    pub(crate) fn ramp(degrees: f64, foot: f64) -> Self {
        let (tilt, length) = (degrees.to_radians(), 3.0);
        let corridor = Cuboid { min: [-4.0, -1.0, 0.0], max: [foot + length * tilt.cos(), 1.0, 3.5] };
        let mut surfaces = corridor.inside();
        let middle = [foot + 0.5 * length * tilt.cos(), 0.0, 0.5 * length * tilt.sin()];
        surfaces.push(incline("ramp", middle, 0.0, tilt, [length, 2.0]));
        let corners = [[-3.3, 0.0], [-0.7, 0.0], [-0.7, 0.7], [-3.3, 0.7]].map(Point2::from);
        Self::new(surfaces, Route { corners: corners.to_vec(), radius: 0.3 })
    }
}

fn step(number: u32) -> Vec<Surface> {
    let [rise, depth] = STEP;
    let (south, low) = (FLIGHT_SOUTH + depth * f64::from(number - 1), rise * f64::from(number - 1));
    let step = Cuboid { min: [FLIGHT[0], south, low], max: [FLIGHT[1], south + depth, low + rise] };
    let mut faces = step.outside(&format!("step {number}"));
    faces.retain(|face| face.name().ends_with("/right") || (face.name().ends_with("/top") && number < STEPS));
    faces
}

/// Up to the height of the landing, and level from there.
fn ramp(top: f64) -> Vec<Surface> {
    let tilt = 18.0_f64.to_radians();
    let (run, width) = (top / tilt.tan(), RAMP[1] - RAMP[0]);
    let middle = [0.5 * (RAMP[0] + RAMP[1]), FLIGHT_SOUTH + 0.5 * run, 0.5 * top];
    let north = std::f64::consts::FRAC_PI_2;
    let slope = incline("ramp", middle, north, tilt, [run.hypot(top), width]);
    let landing = Cuboid { min: [RAMP[0], FLIGHT_SOUTH + run, 0.0], max: [RAMP[1], MAX[1], top] };
    let mut surfaces = landing.outside("ramp landing");
    surfaces.retain(|face| face.class() == SurfaceClass::Horizontal);
    surfaces.push(slope);
    surfaces
}
