//! The built-in scene: a furnished room with a loop around the table.
//!
//! Walls lie off the multiples of the default voxel size, as they would in a real room; the floor is at z = 0, as a
//! robot's odometry has it, and so at the border of two voxel layers.

use nalgebra::Point2;

use crate::sim::parts::{Cuboid, at, moved, table};
use crate::sim::path::Route;
use crate::sim::scene::Scene;
use crate::sim::surface::Surface;

/// West, south and floor end of the room (m); the robot starts at (0, 0).
const ROOM_MIN: [f64; 3] = [-1.5, -2.6, 0.0];
/// East, north and ceiling end of the room (m).
const ROOM_MAX: [f64; 3] = [6.5, 3.4, 2.6];

/// Middle of the table (m).
const TABLE_MIDDLE: [f64; 2] = [3.0, 1.1];
/// Length, width and height of the table (m).
const TABLE_SIZE: [f64; 3] = [1.4, 0.8, 0.75];
/// Thickness of its board (m).
const TABLE_BOARD: f64 = 0.03;
/// Edge of the square section of a leg (m).
const LEG: f64 = 0.05;

/// A cupboard against the east wall.
const CUPBOARD: Cuboid = Cuboid { min: [6.05, -1.9, 0.0], max: [6.5, -0.7, 1.8] };

impl Scene {
    /// A room of 8 x 6 x 2.6 m with a table (1.4 x 0.8 m, 0.75 m high, four thin legs) and a cupboard.
    pub fn room() -> Self {
        Self::new(surfaces(), route())
    }
}

/// All that stands in the room.
pub(super) fn surfaces() -> Vec<Surface> {
    let mut surfaces = Cuboid { min: ROOM_MIN, max: ROOM_MAX }.inside();
    surfaces.extend(CUPBOARD.outside("cupboard"));
    let [x, y] = TABLE_MIDDLE;
    surfaces.extend(moved(table("table", TABLE_SIZE, TABLE_BOARD, LEG), &at([x, y, 0.0], 0.0)));
    surfaces
}

/// Once around the table.
pub(super) fn route() -> Route {
    let corners = [[0.0, 0.0], [5.3, 0.0], [5.3, 2.3], [-0.6, 2.3], [-0.6, 0.0]].map(Point2::from);
    Route { corners: corners.to_vec(), radius: 0.6 }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use nalgebra::{Point3, Vector3};
    use rand::rngs::Xoshiro256PlusPlus;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, UnitSphere};

    use super::*;

    #[test]
    fn every_ray_inside_the_room_ends_at_a_surface() {
        let scene = Scene::room();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
        for _ in 0..20_000 {
            let mut inside = |i: usize| rng.random_range(ROOM_MIN[i] + 0.01..ROOM_MAX[i] - 0.01);
            let origin = Point3::new(inside(0), inside(1), inside(2));
            let direction = Vector3::from(UnitSphere.sample(&mut rng));
            assert!(scene.cast(&origin, &direction, 0.0).is_some(), "{origin} {direction}");
        }
    }

    #[test]
    fn every_ray_to_an_edge_or_a_corner_of_the_room_ends_there() {
        let scene = Scene::room();
        let origin = Point3::new(0.1, 0.2, 1.0);
        for ([x, y], z) in
            [[-1.5, 1.0], [1.7, 3.4], [-1.5, -2.6], [6.5, 3.4]].map(|edge| (edge, [0.0, 1.3, 2.6]))
        {
            for z in z {
                let hit = scene.cast(&origin, &(Point3::new(x, y, z) - origin), 0.0).unwrap();
                assert!((hit.length - 1.0).abs() < 1e-6, "({x}, {y}, {z}): {hit:?}");
            }
        }
    }

    #[test]
    fn the_surfaces_have_names_of_their_own_and_the_stated_heights() {
        let scene = Scene::room();
        let names: BTreeSet<_> = scene.surfaces().iter().map(Surface::name).collect();
        assert_eq!(names.len(), scene.surfaces().len());
        for (name, height) in [("floor", 0.0), ("table/top", 0.75), ("cupboard/top", 1.8), ("ceiling", 2.6)] {
            let surface = scene.surfaces().iter().find(|surface| surface.name() == name).unwrap();
            assert!((surface.pose().translation.z - height).abs() < 1e-12, "{name}");
        }
    }
}
