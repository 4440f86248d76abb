//! One surface of a simulated scene: where it is, what shape it has, and the truth about it.
//!
//! Surfaces are one-sided because a real surface is seen from one side only; it halves the work of the rays, and gives
//! every surface a true normal to compare an estimate with. Flat ones face +z of their own frame, bent ones outwards.
//! Each has coordinates (u, v) on itself that keep areas: x and y of a flat one; of a bent one the way round it and
//! the height along its axis.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Isometry3, Point3, UnitVector3, Vector3};

use super::motion::Motion;
use crate::engine::SurfaceClass;

/// How far beyond its edge a surface still stops a ray (m), so that no ray slips through where two of them meet.
pub(super) const EDGE_SLACK: f64 = 1e-9;

/// A rectangular opening in a rectangle, such as a doorway in a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// Smallest x and y in the surface's frame (m).
    pub low: [f64; 2],
    /// Largest x and y in the surface's frame (m).
    pub high: [f64; 2],
}

impl Hole {
    /// Whether it reaches the lower edge of a rectangle of this size.
    fn is_at_the_foot(&self, size: [f64; 2]) -> bool {
        self.low[1] <= -0.5 * size[1] + EDGE_SLACK
    }

    pub(super) fn contains(&self, u: f64, v: f64) -> bool {
        let within = |i: usize, c: f64| c > self.low[i] + EDGE_SLACK && c < self.high[i] - EDGE_SLACK;
        within(0, u) && within(1, v)
    }
}

/// The form of a surface, around the origin of its frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Flat, with edges along x and y.
    Rectangle {
        /// Full extents along x and y (m).
        size: [f64; 2],
        /// Where a ray passes.
        holes: Vec<Hole>,
    },
    /// Flat and round.
    Disc {
        /// From the middle to the edge (m).
        radius: f64,
    },
    /// The side of an upright cylinder about z, seen from outside.
    Cylinder {
        /// From the axis to the side (m).
        radius: f64,
        /// Full extent along z (m).
        height: f64,
    },
    /// A ball, seen from outside.
    Sphere {
        /// From the middle to the surface (m).
        radius: f64,
    },
}

impl Shape {
    /// A rectangle without holes.
    pub(super) const fn rectangle(size: [f64; 2]) -> Self {
        Self::Rectangle { size, holes: Vec::new() }
    }

    /// Whether it has one normal.
    pub const fn is_flat(&self) -> bool {
        matches!(self, Self::Rectangle { .. } | Self::Disc { .. })
    }

    /// Half of the extents along x, y and z (m).
    pub fn half_extents(&self) -> [f64; 3] {
        match *self {
            Self::Rectangle { size, .. } => [0.5 * size[0], 0.5 * size[1], 0.0],
            Self::Disc { radius } => [radius, radius, 0.0],
            Self::Cylinder { radius, height } => [radius, radius, 0.5 * height],
            Self::Sphere { radius } => [radius; 3],
        }
    }

    /// Half of the ranges of u and v (m).
    pub fn half_ranges(&self) -> [f64; 2] {
        match *self {
            Self::Rectangle { size, .. } => size.map(|size| 0.5 * size),
            Self::Disc { radius } => [radius; 2],
            Self::Cylinder { radius, height } => [PI * radius, 0.5 * height],
            Self::Sphere { radius } => [PI * radius, radius],
        }
    }

    /// (u, v) of a point on the surface.
    pub fn coordinates(&self, local: &Point3<f64>) -> [f64; 2] {
        match *self {
            Self::Rectangle { .. } | Self::Disc { .. } => [local.x, local.y],
            Self::Cylinder { radius, .. } | Self::Sphere { radius } => {
                [radius * local.y.atan2(local.x), local.z]
            }
        }
    }

    /// The point of the surface at (u, v), in the surface's frame.
    pub fn point(&self, [u, v]: [f64; 2]) -> Point3<f64> {
        let round = |radius: f64, distance: f64| {
            let (sin, cos) = (u / radius).sin_cos();
            Point3::new(distance * cos, distance * sin, v)
        };
        match *self {
            Self::Rectangle { .. } | Self::Disc { .. } => Point3::new(u, v, 0.0),
            Self::Cylinder { radius, .. } => round(radius, radius),
            Self::Sphere { radius } => round(radius, (radius * radius - v * v).max(0.0).sqrt()),
        }
    }

    /// Corners of a flat one in its frame, counter-clockwise; a hole at its lower edge is a notch, and a disc has 32. None of
    /// a bent one.
    pub fn outline(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Rectangle { size, holes } => {
                let [x, y] = size.map(|size| 0.5 * size);
                let mut notches: Vec<_> = holes.iter().filter(|hole| hole.is_at_the_foot(*size)).collect();
                notches.sort_by(|a, b| a.low[0].total_cmp(&b.low[0]));
                let notches = notches.iter().flat_map(|Hole { low, high }| {
                    [[low[0], -y], [low[0], high[1]], [high[0], high[1]], [high[0], -y]]
                });
                let foot = std::iter::once([-x, -y]).chain(notches);
                foot.chain([[x, -y], [x, y], [-x, y]]).collect()
            }
            Self::Disc { radius } => {
                let angles = (0..32).map(|i| TAU * f64::from(i) / 32.0);
                angles.map(|angle| [radius * angle.cos(), radius * angle.sin()]).collect()
            }
            Self::Cylinder { .. } | Self::Sphere { .. } => Vec::new(),
        }
    }

    /// Corners of the holes that are no notches of the outline.
    pub fn inner_holes(&self) -> Vec<[[f64; 2]; 4]> {
        let Self::Rectangle { size, holes } = self else { return Vec::new() };
        let inner = holes.iter().filter(|hole| !hole.is_at_the_foot(*size));
        let corners = inner
            .map(|Hole { low: [u0, v0], high: [u1, v1] }| [[*u0, *v0], [*u0, *v1], [*u1, *v1], [*u1, *v0]]);
        corners.collect()
    }

    /// Away from the surface at a point that lies on it or straight before or behind it; some direction in the middle of a bent one.
    fn outwards(&self, local: &Point3<f64>) -> UnitVector3<f64> {
        let away = match self {
            Self::Rectangle { .. } | Self::Disc { .. } => Vector3::z(),
            Self::Cylinder { .. } => Vector3::new(local.x, local.y, 0.0),
            Self::Sphere { .. } => local.coords,
        };
        UnitVector3::try_new(away, f64::EPSILON).unwrap_or_else(Vector3::x_axis)
    }

    /// Whether there is a surface at (u, v), which lies in the ranges of both.
    pub fn reaches(&self, [u, v]: [f64; 2]) -> bool {
        match self {
            Self::Rectangle { holes, .. } => !holes.iter().any(|hole| hole.contains(u, v)),
            Self::Disc { radius } => u.hypot(v) <= *radius,
            Self::Cylinder { .. } | Self::Sphere { .. } => true,
        }
    }

    /// Distance from a point of the surface's frame to the nearest point of the surface (m).
    fn distance(&self, local: &Point3<f64>) -> f64 {
        match self {
            Self::Rectangle { size, holes } => {
                let [beyond_x, beyond_y] = [0, 1].map(|i| (local[i].abs() - 0.5 * size[i]).max(0.0));
                let plain = Vector3::new(beyond_x, beyond_y, local.z).norm();
                let hole = holes.iter().find(|hole| hole.contains(local.x, local.y));
                hole.map_or(plain, |hole| to_edge(hole, *size, local).hypot(local.z))
            }
            Self::Disc { radius } => (local.x.hypot(local.y) - radius).max(0.0).hypot(local.z),
            Self::Cylinder { radius, height } => {
                let beyond = (local.z.abs() - 0.5 * height).max(0.0);
                (local.x.hypot(local.y) - radius).hypot(beyond)
            }
            Self::Sphere { radius } => (local.coords.norm() - radius).abs(),
        }
    }
}

/// From a point within a hole to the nearest edge that is one of the rectangle's material (m).
fn to_edge(hole: &Hole, size: [f64; 2], local: &Point3<f64>) -> f64 {
    let edges = [0, 1].into_iter().flat_map(|i| {
        let low = (hole.low[i] > -0.5 * size[i]).then(|| local[i] - hole.low[i]);
        let high = (hole.high[i] < 0.5 * size[i]).then(|| hole.high[i] - local[i]);
        [low, high]
    });
    edges.flatten().fold(f64::INFINITY, f64::min)
}

/// How a surface moves, seen from the fixed frame.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Moving {
    /// The frame in which the motion is stated.
    pub(super) frame: Isometry3<f64>,
    /// Shared by all surfaces of the thing.
    pub(super) motion: Arc<Motion>,
}

/// A surface with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    pub(super) label: u32,
    pub(super) name: String,
    pub(super) class: SurfaceClass,
    /// Fixed frame from its own, of a moving one: the frame of its rest from its own.
    pub(super) rest: Isometry3<f64>,
    pub(super) shape: Shape,
    pub(super) moving: Option<Moving>,
}

impl Surface {
    /// A surface that stands still; [`super::Scene`] gives it its label.
    pub(crate) fn new(
        name: impl Into<String>,
        class: SurfaceClass,
        pose: Isometry3<f64>,
        shape: Shape,
    ) -> Self {
        Self { label: 0, name: name.into(), class, rest: pose, shape, moving: None }
    }

    /// What the label field of a point on it carries: 1 + its index in the scene.
    pub const fn label(&self) -> u32 {
        self.label
    }

    /// What it is, unique within a scene, such as `floor` or `table/top`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What it is to a planner, from how the scene is built and not as clusters are classified. A wall is what is upright, closed
    /// flush doors and sides of furniture too; a door a leaf that stands open by 15 degrees or more; a slope what faces up at 10 to
    /// 80 degrees from the level, as ramps and leaning boards do. Undersides, legs and edges of boards are unknown.
    pub const fn class(&self) -> SurfaceClass {
        self.class
    }

    /// Its form.
    pub const fn shape(&self) -> &Shape {
        &self.shape
    }

    /// How it moves; `None` where it stands still.
    pub fn motion(&self) -> Option<&Motion> {
        self.moving.as_ref().map(|moving| moving.motion.as_ref())
    }

    /// Fixed frame from the one in which its motion is stated; `None` where it stands still.
    pub fn motion_frame(&self) -> Option<&Isometry3<f64>> {
        self.moving.as_ref().map(|moving| &moving.frame)
    }

    /// Fixed frame from its own (+z = normal, x and y along the edges), `seconds` after the start; `None` when it is not
    /// there.
    pub fn pose_at(&self, seconds: f64) -> Option<Isometry3<f64>> {
        match &self.moving {
            None => Some(self.rest),
            Some(Moving { frame, motion }) => Some(frame * motion.pose(seconds)? * self.rest),
        }
    }

    /// Its pose at the start.
    pub fn pose(&self) -> Isometry3<f64> {
        self.pose_at(0.0).unwrap_or(self.rest)
    }

    /// Towards the side it is seen from, at the start; the axis of one that is bent.
    pub fn normal(&self) -> UnitVector3<f64> {
        self.pose() * Vector3::z_axis()
    }

    /// Its normal at a point that lies on it, at the start.
    pub fn normal_at(&self, point: &Point3<f64>) -> UnitVector3<f64> {
        let pose = self.pose();
        pose * self.shape.outwards(&pose.inverse_transform_point(point))
    }

    /// Distance from `point` to the nearest point of the surface (m); `None` when it is not there.
    pub fn distance(&self, point: &Point3<f64>, seconds: f64) -> Option<f64> {
        Some(self.shape.distance(&self.pose_at(seconds)?.inverse_transform_point(point)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall() -> Shape {
        let doorway = Hole { low: [0.5, -1.2], high: [1.5, 0.8] };
        let window = Hole { low: [-1.5, -0.2], high: [-0.5, 0.6] };
        Shape::Rectangle { size: [4.0, 2.4], holes: vec![doorway, window] }
    }

    #[test]
    fn a_doorway_is_a_notch_of_the_outline_and_a_window_a_hole() {
        let outline = wall().outline();
        let area: f64 = (0..outline.len())
            .map(|i| {
                let ([x0, y0], [x1, y1]) = (outline[i], outline[(i + 1) % outline.len()]);
                0.5 * (x0 * y1 - x1 * y0)
            })
            .sum();
        assert!((area - (4.0 * 2.4 - 1.0 * 2.0)).abs() < 1e-12, "{area} m^2");
        assert_eq!(wall().inner_holes(), [[[-1.5, -0.2], [-1.5, 0.6], [-0.5, 0.6], [-0.5, -0.2]]]);
    }

    #[test]
    fn the_distance_within_a_hole_counts_from_its_edge_and_not_from_the_open_foot() {
        let distance = |x, y, z| wall().distance(&Point3::new(x, y, z));
        assert!((distance(-1.0, 0.5, 0.0) - 0.1).abs() < 1e-12);
        assert!((distance(1.0, -1.1, 0.0) - 0.5).abs() < 1e-12);
        assert!((distance(1.3, -1.1, 0.15) - 0.25).abs() < 1e-12);
        assert!((distance(0.0, 0.0, 0.3) - 0.3).abs() < 1e-12);
    }

    #[test]
    fn points_of_bent_shapes_have_the_coordinates_they_were_made_from() {
        let shapes = [Shape::Cylinder { radius: 0.2, height: 1.0 }, Shape::Sphere { radius: 0.3 }];
        for shape in shapes {
            for (u, v) in [(0.0, 0.0), (0.31, 0.12), (-0.5, -0.2)] {
                let point = shape.point([u, v]);
                let [u_again, v_again] = shape.coordinates(&point);
                assert!((u_again - u).abs() < 1e-12 && (v_again - v).abs() < 1e-12);
                assert!(shape.distance(&point) < 1e-12);
            }
        }
    }
}
