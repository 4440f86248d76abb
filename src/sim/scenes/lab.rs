//! A laboratory as in section V of the paper: walls, doors, tables, chairs, a ceiling, and a piece of corridor.
//!
//! Stated in the building's own frame, x east and y north, and then moved to where the robot starts: its first stretch
//! is not parallel to the walls, so no wall is parallel to the axes of the fixed frame. The loop leads through both
//! doorways; at 0.3 m/s the paper's 217 s are three laps. The camera looks down by 4 degrees only, since with 15 the
//! ceiling would nowhere be in the picture.

use nalgebra::Point2;

use crate::engine::SurfaceClass;
use crate::sim::parts::{
    Cuboid, Opening, TwoSided, Upright, at, ball, chair, cylinder, door_leaf, moved, reveals, table, without,
};
use crate::sim::path::Route;
use crate::sim::scene::Scene;
use crate::sim::surface::{Shape, Surface};

/// West, south, east end of the building (m).
const WEST: f64 = -1.63;
const SOUTH: f64 = -2.43;
const EAST: f64 = 8.27;
/// Northern end of the laboratory; the wall to the corridor is behind it (m).
const LAB_NORTH: f64 = 3.47;
/// Northern end of the corridor (m).
const NORTH: f64 = 5.43;
/// Of the wall between laboratory and corridor, and of the outer ones in their doorways (m).
const THICKNESS: f64 = 0.12;
/// Of the laboratory's ceiling (m).
const HEIGHT: f64 = 2.47;
/// Of the corridor's ceiling (m).
const CORRIDOR_HEIGHT: f64 = 2.31;
/// Lower end of the lintels (m).
const LINTEL: f64 = 2.07;

impl Scene {
    /// A laboratory of 9.9 x 5.9 m with a corridor of 1.84 m along its north side.
    pub(super) fn lab() -> Self {
        let mut surfaces = shell();
        surfaces.extend(middle_wall());
        surfaces.extend(east_closet());
        surfaces.extend(office());
        surfaces.extend(south_wall());
        surfaces.extend(furniture());
        Self::new(surfaces, route()).with_camera_pitch(4.0_f64.to_radians()).seen_from_the_start()
    }
}

fn route() -> Route {
    // Rises by `SLOPE` along the south side, so that the first stretch is parallel to no wall.
    const SLOPE: f64 = 0.0547;
    let south = |x: f64| [x, 0.1 + SLOPE * (x - 1.2)];
    let corners = [south(1.2), south(6.87), [6.83, 4.49], [-0.12, 4.53], south(-0.13)];
    Route { corners: corners.map(Point2::from).to_vec(), radius: 0.5 }
}

/// Floor, ceilings and the walls without doors.
fn shell() -> Vec<Surface> {
    let whole = Cuboid { min: [WEST, SOUTH, 0.0], max: [EAST + 1.31, NORTH + 1.27, HEIGHT] }.inside();
    let floor = whole.into_iter().filter(|surface| surface.class() == SurfaceClass::Floor);
    let ceiling = |name: &str, [y0, y1]: [f64; 2], z: f64| {
        let room = Cuboid { min: [WEST, y0, 0.0], max: [EAST, y1, z] }.inside();
        room.into_iter().filter(|surface| surface.class() == SurfaceClass::Ceiling).map({
            let name = name.to_owned();
            move |mut surface| {
                surface.name.clone_from(&name);
                surface
            }
        })
    };
    let corridor_south = LAB_NORTH + THICKNESS;
    let wall = |name: &str, from: [f64; 2], to: [f64; 2], height: f64| {
        Upright { from, to, z: [0.0, height] }.face(name, SurfaceClass::Wall, &[])
    };
    let mut surfaces: Vec<_> = floor.collect();
    surfaces.extend(ceiling("lab ceiling", [SOUTH, LAB_NORTH], HEIGHT));
    surfaces.extend(ceiling("corridor ceiling", [corridor_south, NORTH], CORRIDOR_HEIGHT));
    surfaces.extend([
        wall("lab west wall", [WEST, SOUTH], [WEST, LAB_NORTH], HEIGHT),
        wall("corridor west wall", [WEST, corridor_south], [WEST, NORTH], CORRIDOR_HEIGHT),
        wall("corridor east wall", [EAST, NORTH], [EAST, corridor_south], CORRIDOR_HEIGHT),
    ]);
    surfaces
}

/// Between laboratory and corridor, with the two doorways that the robot takes and their leaves.
fn middle_wall() -> Vec<Surface> {
    let doorway = |from: f64, to: f64| Opening { from: from - WEST, to: to - WEST, z: [0.0, LINTEL] };
    let wall = TwoSided {
        right: "lab north wall",
        left: "corridor south wall",
        face: Upright { from: [WEST, LAB_NORTH], to: [EAST, LAB_NORTH], z: [0.0, HEIGHT] },
        thickness: THICKNESS,
        left_height: CORRIDOR_HEIGHT,
    };
    let mut surfaces = wall.surfaces(&[doorway(-0.67, 0.41), doorway(6.29, 7.41)]);
    let leaf = |name, hinge, closed: f64, open: f64, width| {
        door_leaf(name, hinge, closed.to_radians(), open.to_radians(), [width, 2.05])
    };
    // At its western jamb, into the laboratory; at its eastern one, into the corridor.
    surfaces.extend(leaf("west door", [-0.69, LAB_NORTH - 0.03], 0.0, -88.0, 1.05));
    surfaces.extend(leaf("east door", [7.42, LAB_NORTH + THICKNESS + 0.03], 180.0, -79.0, 1.09));
    surfaces
}

/// The laboratory's east wall with a door that is ajar, and a closet behind it.
fn east_closet() -> Vec<Surface> {
    let wall = Upright { from: [EAST, LAB_NORTH], to: [EAST, SOUTH], z: [0.0, HEIGHT] };
    let doorway = Opening { from: LAB_NORTH - 2.16, to: LAB_NORTH - 1.21, z: [0.0, LINTEL] };
    let mut surfaces = vec![wall.face("lab east wall", SurfaceClass::Wall, &[doorway])];
    surfaces.extend(reveals("closet doorway", wall, THICKNESS, &[doorway]));
    let inside = Cuboid { min: [EAST + THICKNESS, 0.83, 0.0], max: [EAST + 1.31, 2.57, 2.23] };
    surfaces.extend(alcove("closet", inside, "west wall"));
    let (closed, open) = (90.0_f64.to_radians(), 35.0_f64.to_radians());
    surfaces.extend(door_leaf("closet door", [EAST - 0.03, 1.22], closed, open, [0.93, 2.05]));
    surfaces
}

/// The corridor's north wall with a door that is open by 22 degrees, and a piece of the office behind it.
fn office() -> Vec<Surface> {
    let wall = Upright { from: [WEST, NORTH], to: [EAST, NORTH], z: [0.0, CORRIDOR_HEIGHT] };
    let doorway = Opening { from: 2.03 - WEST, to: 2.97 - WEST, z: [0.0, LINTEL] };
    let mut surfaces = vec![wall.face("corridor north wall", SurfaceClass::Wall, &[doorway])];
    surfaces.extend(reveals("office doorway", wall, THICKNESS, &[doorway]));
    let inside = Cuboid { min: [1.58, NORTH + THICKNESS, 0.0], max: [3.47, NORTH + 1.27, 2.27] };
    surfaces.extend(alcove("office", inside, "south wall"));
    let open = 22.0_f64.to_radians();
    surfaces.extend(door_leaf("office door", [2.04, NORTH + 0.09], 0.0, open, [0.92, 2.05]));
    surfaces
}

/// A small room behind a doorway, without the wall that the doorway is in; the floor is that of the building.
fn alcove(name: &str, inside: Cuboid, open_side: &str) -> Vec<Surface> {
    let mut surfaces = inside.inside();
    surfaces.retain(|surface| surface.name() != open_side && surface.class() != SurfaceClass::Floor);
    surfaces.iter_mut().for_each(|surface| surface.name = format!("{name} {}", surface.name));
    surfaces
}

/// The south wall, with a door that is closed and flush.
fn south_wall() -> Vec<Surface> {
    /// How far the door lies behind the wall (m).
    const RECESS: f64 = 0.006;
    let wall = Upright { from: [EAST, SOUTH], to: [WEST, SOUTH], z: [0.0, HEIGHT] };
    let doorway = Opening { from: EAST - 5.71, to: EAST - 4.77, z: [0.0, LINTEL] };
    let behind = SOUTH - RECESS;
    // A little larger than the doorway, so that nobody looks past it at an angle.
    let door = Upright { from: [5.73, behind], to: [4.75, behind], z: [0.0, LINTEL + 0.02] };
    vec![
        wall.face("lab south wall", SurfaceClass::Wall, &[doorway]),
        door.face("flush door", SurfaceClass::Wall, &[]),
    ]
}

fn furniture() -> Vec<Surface> {
    let mut surfaces = Vec::new();
    let mut put = |things: Vec<Surface>, x: f64, y: f64, degrees: f64| {
        surfaces.extend(moved(things, &at([x, y, 0.0], degrees.to_radians())));
    };
    put(table("table 1", [1.62, 0.83, 0.743], 0.027, 0.047), 3.93, -1.03, 11.0);
    put(table("table 2", [1.27, 0.68, 0.717], 0.023, 0.043), 2.63, 1.43, -8.0);
    put(chair("chair 1"), 4.21, -1.83, 97.0);
    put(chair("chair 2"), 3.67, 1.77, 201.0);
    put(chair("chair 3"), 1.37, -1.33, -83.0);
    put(table("bench", [2.13, 0.69, 0.823], 0.036, 0.058), 1.43, SOUTH + 0.353, 0.0);
    let cupboard = Cuboid::standing([1.03, 0.44, 1.83]).outside("cupboard");
    put(without(cupboard, &["bottom", "right"]), 7.43, SOUTH + 0.22, 0.0);
    let crate_box = Cuboid::standing([0.47, 0.39, 0.363]).outside("crate");
    put(without(crate_box, &["bottom"]), 7.77, 2.81, 31.0);
    let cabinet = Cuboid::standing([0.93, 0.41, 0.923]).outside("cabinet");
    put(without(cabinet, &["bottom", "left"]), 4.43, NORTH - 0.205, 0.0);
    put(shelf(), EAST - 0.177, -0.39, 180.0);
    put(cylinder("bin", 0.171, 0.413), -1.17, -1.93, 0.0);
    put(vec![ball("ball", 0.217)], 0.83, -0.59, 0.0);
    let pillar = cylinder("pillar", 0.209, HEIGHT);
    put(
        pillar.into_iter().filter(|part| matches!(part.shape(), Shape::Cylinder { .. })).collect(),
        5.23,
        1.27,
        0.0,
    );
    surfaces
}

/// An open shelf against a wall at -x: two sides, a back and four boards.
fn shelf() -> Vec<Surface> {
    const BOARD: f64 = 0.022;
    let [x, y] = [0.177, 0.673];
    let panel =
        |name: &str, y0: f64| Cuboid { min: [-x, y0, 0.0], max: [x, y0 + BOARD, 1.427] }.outside(name);
    let mut surfaces = without(panel("shelf right side", -y), &["bottom", "back"]);
    surfaces.extend(without(panel("shelf left side", y - BOARD), &["bottom", "back"]));
    for (number, z) in (1..).zip([0.113, 0.527, 0.953, 1.405]) {
        let board = Cuboid { min: [-x, -y + BOARD, z], max: [x, y - BOARD, z + BOARD] };
        surfaces.extend(without(board.outside(&format!("shelf board {number}")), &["back", "left", "right"]));
    }
    surfaces
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::engine::Stamp;
    use crate::sim::drive::SCANS_PER_SECOND;
    use crate::sim::robot::SPEED;
    use crate::sim::{Drive, Path, SeenCells};

    #[test]
    fn the_paper_s_217_seconds_are_three_laps() {
        let lap = Path::new(Scene::lab().route()).length();
        assert!((217.0 * SPEED / lap - 3.0).abs() < 0.02, "{lap} m a lap");
    }

    #[test]
    fn most_of_what_is_large_is_seen_within_four_metres_in_a_lap() {
        let scene = Scene::lab();
        let drive = Drive::new(scene.clone(), 1, Stamp::from_nanos(0));
        let mut seen = SeenCells::new(&scene, 4.0);
        for index in (0..73 * SCANS_PER_SECOND).step_by(20) {
            seen.add(&drive, index);
        }
        let mut areas: BTreeMap<SurfaceClass, f64> = BTreeMap::new();
        for surface in scene.surfaces() {
            *areas.entry(surface.class()).or_default() += seen.area(surface.label());
        }
        let least = [
            (SurfaceClass::Floor, 40.0),
            (SurfaceClass::Ceiling, 10.0),
            (SurfaceClass::Wall, 40.0),
            (SurfaceClass::Door, 5.0),
            (SurfaceClass::Horizontal, 2.0),
            (SurfaceClass::Curved, 1.0),
        ];
        for (class, least) in least {
            assert!(areas[&class] > least, "{} m^2 of {}", areas[&class], class.name());
        }
    }
}
