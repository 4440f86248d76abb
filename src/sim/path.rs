//! A closed way over the floor without a kink: straight lines joined by arcs.

use nalgebra::{Isometry2, Point2, Rotation2, Vector2};

/// Corners of a closed way and how they are rounded.
///
/// The way begins where the arc at the first corner ends, towards the second. A corner where the way goes straight on is allowed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Route {
    /// The corners in the order they are passed (m); the last one leads back to the first.
    pub corners: Vec<Point2<f64>>,
    /// Radius of the arcs in place of the corners (m); the edges must be long enough for them.
    pub radius: f64,
}

/// A stretch of constant curvature.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start: Point2<f64>,
    /// Direction of travel at the start, counter-clockwise from +x (rad).
    heading: f64,
    /// Turn per way (rad/m), positive to the left, 0 for a straight line.
    curvature: f64,
    /// Along the stretch (m).
    length: f64,
}

impl Piece {
    fn pose_at(&self, distance: f64) -> Isometry2<f64> {
        let heading = self.heading + self.curvature * distance;
        let step = if self.curvature == 0.0 {
            distance * Vector2::new(heading.cos(), heading.sin())
        } else {
            let (before, after) = (self.heading.sin_cos(), heading.sin_cos());
            Vector2::new(after.0 - before.0, before.1 - after.1) / self.curvature
        };
        Isometry2::new((self.start + step).coords, heading)
    }
}

/// A route that can be asked for the place at a distance (m) along it.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    route: Route,
    pieces: Vec<Piece>,
    length: f64,
}

impl Path {
    /// The way along `route`.
    pub fn new(route: &Route) -> Self {
        let corners = &route.corners;
        let ring = |i: usize| corners[i % corners.len()];
        let turns: Vec<f64> = (0..corners.len())
            .map(|i| {
                let before = ring(i) - ring(i + corners.len() - 1);
                Rotation2::rotation_between(&before, &(ring(i + 1) - ring(i))).angle()
            })
            .collect();
        // Length of the edge, at either side of a corner, that the arc takes the place of.
        let cut: Vec<f64> = turns.iter().map(|turn| route.radius * (0.5 * turn).abs().tan()).collect();

        let mut pieces = Vec::with_capacity(2 * corners.len());
        for i in 0..corners.len() {
            let edge = ring(i + 1) - ring(i);
            let heading = edge.y.atan2(edge.x);
            let along = edge.normalize();
            let next = (i + 1) % corners.len();
            let line = edge.norm() - cut[i] - cut[next];
            pieces.push(Piece { start: ring(i) + along * cut[i], heading, curvature: 0.0, length: line });
            let start = ring(i + 1) - along * cut[next];
            let curvature = turns[next].signum() / route.radius;
            pieces.push(Piece { start, heading, curvature, length: turns[next].abs() * route.radius });
        }
        let length = pieces.iter().map(|piece| piece.length).sum();
        Self { route: route.clone(), pieces, length }
    }

    /// What it goes along.
    pub const fn route(&self) -> &Route {
        &self.route
    }

    /// Once around (m).
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// Place and heading after `distance` metres from the start, round and round.
    pub fn pose_at(&self, distance: f64) -> Isometry2<f64> {
        let mut rest = distance.rem_euclid(self.length);
        for piece in &self.pieces {
            if rest < piece.length {
                return piece.pose_at(rest);
            }
            rest -= piece.length;
        }
        // Only rounding leads here: the sum of the pieces is the length.
        self.pieces.first().map_or_else(Isometry2::identity, |piece| piece.pose_at(0.0))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, TAU};

    use super::*;

    fn square() -> Path {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [-2.0, 4.0], [-2.0, 0.0]].map(Point2::from);
        Path::new(&Route { corners: corners.to_vec(), radius: 1.0 })
    }

    #[test]
    fn a_rounded_square_is_as_long_as_its_lines_and_a_circle() {
        assert!((square().length() - (4.0 * 2.0 + TAU)).abs() < 1e-12);
    }

    #[test]
    fn a_quarter_turn_ends_where_the_corner_would_lead() {
        let pose = square().pose_at(1.0 + FRAC_PI_2);
        assert!((pose.translation.vector - Vector2::new(2.0, 1.0)).norm() < 1e-12);
        assert!((pose.rotation.angle() - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn a_path_to_the_right_turns_right() {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, -4.0], [-2.0, -4.0], [-2.0, 0.0]].map(Point2::from);
        let path = Path::new(&Route { corners: corners.to_vec(), radius: 1.0 });
        let pose = path.pose_at(1.0 + FRAC_PI_2 + 0.5);
        assert!((pose.translation.vector - Vector2::new(2.0, -1.5)).norm() < 1e-12);
        assert!((path.length() - (4.0 * 2.0 + TAU)).abs() < 1e-12);
    }

    #[test]
    fn the_way_closes_and_goes_round_again() {
        let path = square();
        for distance in [0.0, 0.3, 2.0, 7.7] {
            let (once, again) = (path.pose_at(distance), path.pose_at(distance + path.length()));
            assert!((once.translation.vector - again.translation.vector).norm() < 1e-9);
            assert!(once.rotation.angle_to(&again.rotation).abs() < 1e-9);
        }
    }
}
