//! The room with what does not stand still: a person who walks, a door that opens and closes, and a box that is taken
//! away.

use std::sync::Arc;

use nalgebra::{Isometry3, Point2};

use super::room;
use crate::engine::SurfaceClass;
use crate::sim::motion::Motion;
use crate::sim::parts::{Cuboid, at, ball, cylinder, door_leaf, moved, without};
use crate::sim::path::{Path, Route};
use crate::sim::scene::Scene;
use crate::sim::surface::{Moving, Surface};

/// When the box is taken away (s).
const TAKEN_AWAY: f64 = 12.0;
/// How fast the person walks (m/s).
const WALK: f64 = 0.7;

impl Scene {
    /// The room with a person, a door in front of the west wall and a box that is there for 12 s.
    pub(super) fn moving() -> Self {
        let mut surfaces = room::surfaces();
        surfaces.extend(with(person(), walk()));
        let hinge = [-1.31, -2.43];
        let mut door = door_leaf("door", hinge, 0.0, 0.0, [0.93, 2.03]);
        // It stands free, even when it is closed.
        let sides = door.iter_mut().filter(|face| face.class == SurfaceClass::Wall);
        sides.for_each(|face| face.class = SurfaceClass::Door);
        let swing = Motion::Swing { hinge, angle: 75.0_f64.to_radians(), period: 16.0 };
        surfaces.extend(with(door, swing));
        let thing = without(Cuboid::standing([0.57, 0.43, 0.513]).outside("box"), &["bottom"]);
        let thing = moved(thing, &at([3.47, -1.37, 0.0], 0.41));
        surfaces.extend(with(thing, Motion::TakenAway { at: TAKEN_AWAY }));
        Self::new(surfaces, room::route())
    }
}

/// The surfaces of a thing that moves.
fn with(mut surfaces: Vec<Surface>, motion: Motion) -> Vec<Surface> {
    let motion = Arc::new(motion);
    for surface in &mut surfaces {
        surface.moving = Some(Moving { frame: Isometry3::identity(), motion: Arc::clone(&motion) });
    }
    surfaces
}

/// A trunk on legs as one cylinder, and a head.
fn person() -> Vec<Surface> {
    let mut surfaces = cylinder("person", 0.213, 1.473);
    surfaces.extend(moved(vec![ball("person/head", 0.117)], &at([0.0, 0.0, 1.497], 0.0)));
    surfaces
}

/// To and fro south of the robot's way.
fn walk() -> Motion {
    let corners = [[4.63, -1.03], [1.27, -1.03], [1.27, -1.97], [4.63, -1.97]].map(Point2::from);
    Motion::Walk { path: Path::new(&Route { corners: corners.to_vec(), radius: 0.3 }), speed: WALK }
}
