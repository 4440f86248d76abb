//! The built-in scene: a furnished room with a loop around the table.
//!
//! Walls lie off the multiples of the default voxel size, as they would in a real room; the floor is at z = 0, as a
//! robot's odometry has it, and so at the border of two voxel layers.

use nalgebra::Point2;

use super::path::Route;
use super::scene::{Cuboid, Rectangle, Scene};

/// West, south and floor end of the room (m); the robot starts at (0, 0).
const ROOM_MIN: [f64; 3] = [-1.5, -2.6, 0.0];
/// East, north and ceiling end of the room (m).
const ROOM_MAX: [f64; 3] = [6.5, 3.4, 2.6];

/// Middle of the table (m).
const TABLE_MIDDLE: [f64; 2] = [3.0, 1.1];
/// Length and width of the table (m).
const TABLE_SIZE: [f64; 2] = [1.4, 0.8];
/// Height of its upper side (m).
const TABLE_HEIGHT: f64 = 0.75;
/// Thickness of its board (m).
const TABLE_BOARD: f64 = 0.03;
/// Edge of the square section of a leg (m).
const LEG: f64 = 0.05;

/// A cupboard against the east wall.
const CUPBOARD: Cuboid = Cuboid { min: [6.05, -1.9, 0.0], max: [6.5, -0.7, 1.8] };

impl Scene {
    /// A room of 8 x 6 x 2.6 m with a table (1.4 x 0.8 m, 0.75 m high, four thin legs) and a cupboard.
    pub fn room() -> Self {
        let mut rectangles = Cuboid { min: ROOM_MIN, max: ROOM_MAX }.inside();
        rectangles.extend(CUPBOARD.outside("cupboard"));
        rectangles.extend(table());
        let corners = [[0.0, 0.0], [5.3, 0.0], [5.3, 2.3], [-0.6, 2.3], [-0.6, 0.0]].map(Point2::from);
        Self::new(rectangles, Route { corners: corners.to_vec(), radius: 0.6 })
    }
}

fn table() -> Vec<Rectangle> {
    let low = [0, 1].map(|i| TABLE_MIDDLE[i] - 0.5 * TABLE_SIZE[i]);
    let high = [0, 1].map(|i| TABLE_MIDDLE[i] + 0.5 * TABLE_SIZE[i]);
    let underside = TABLE_HEIGHT - TABLE_BOARD;
    let board = Cuboid { min: [low[0], low[1], underside], max: [high[0], high[1], TABLE_HEIGHT] };
    let mut rectangles = board.outside("table");

    let legs = [low[0], high[0] - LEG].into_iter().flat_map(|x| [low[1], high[1] - LEG].map(|y| [x, y]));
    for (number, [x, y]) in (1..).zip(legs) {
        let leg = Cuboid { min: [x, y, 0.0], max: [x + LEG, y + LEG, underside] };
        rectangles.extend(leg.outside(&format!("table leg {number}")));
    }
    rectangles
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
            assert!(scene.cast(&origin, &direction).is_some(), "{origin} {direction}");
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
                let hit = scene.cast(&origin, &(Point3::new(x, y, z) - origin)).unwrap();
                assert!((hit.length - 1.0).abs() < 1e-6, "({x}, {y}, {z}): {hit:?}");
            }
        }
    }

    #[test]
    fn the_surfaces_have_names_of_their_own_and_the_stated_heights() {
        let scene = Scene::room();
        let names: BTreeSet<&str> = scene.rectangles().iter().map(Rectangle::name).collect();
        assert_eq!(names.len(), scene.rectangles().len());
        for (name, height) in [("floor", 0.0), ("table/top", 0.75), ("cupboard/top", 1.8), ("ceiling", 2.6)] {
            let surface = scene.rectangles().iter().find(|surface| surface.name() == name).unwrap();
            assert!((surface.pose().translation.z - height).abs() < 1e-12, "{name}");
        }
    }
}
