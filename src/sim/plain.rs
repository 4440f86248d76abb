//! What a ray meets and what lies nearest to a point, every surface held against it: the oracle of the Kinect's rays, and of what
//! tests ask of a scene.

use nalgebra::{Point3, Vector3};

use super::scene::Scene;
use super::surface::{EDGE_SLACK, Shape, Surface};

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// Label of the surface it meets.
    pub(super) label: u32,
    /// Length of the ray, in multiples of its direction.
    pub(super) length: f64,
}

impl Scene {
    /// The first surface that the ray from `origin` along `direction` meets, `seconds` after the start.
    pub(super) fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, seconds: f64) -> Option<Hit> {
        let hits = self.surfaces().iter().filter_map(|surface| {
            let length = surface.cast(origin, direction, seconds)?;
            Some(Hit { label: surface.label(), length })
        });
        hits.min_by(|a, b| a.length.total_cmp(&b.length))
    }

    /// The surface nearest to `point` and the distance to it (m), `seconds` after the start; `None` in an empty scene.
    pub(super) fn nearest(&self, point: &Point3<f64>, seconds: f64) -> Option<(&Surface, f64)> {
        let distances =
            self.surfaces().iter().filter_map(|surface| Some((surface, surface.distance(point, seconds)?)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

impl Surface {
    /// How many `direction`s from `origin` the ray meets its front; `None` where it does not.
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>, seconds: f64) -> Option<f64> {
        let pose = self.pose_at(seconds)?;
        self.shape().cast(&pose.inverse_transform_point(origin), &pose.inverse_transform_vector(direction))
    }
}

impl Shape {
    /// How many `direction`s from `origin` a ray meets the front; `None` where it does not.
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let meets_flat = || {
            (origin.z > 0.0 && direction.z < 0.0).then(|| {
                let length = -origin.z / direction.z;
                (length, origin + direction * length)
            })
        };
        match self {
            Self::Rectangle { size, holes } => {
                let (length, met) = meets_flat()?;
                let inside = |i: usize| met[i].abs() <= 0.5 * size[i] + EDGE_SLACK;
                let passes = holes.iter().any(|hole| hole.contains(met.x, met.y));
                (inside(0) && inside(1) && !passes).then_some(length)
            }
            Self::Disc { radius } => {
                let (length, met) = meets_flat()?;
                (met.x.hypot(met.y) <= radius + EDGE_SLACK).then_some(length)
            }
            Self::Cylinder { radius, height } => {
                let flat = Vector3::new(1.0, 1.0, 0.0);
                let length = meets_round(
                    &origin.coords.component_mul(&flat),
                    &direction.component_mul(&flat),
                    *radius,
                )?;
                let z = origin.z + length * direction.z;
                (z.abs() <= 0.5 * height + EDGE_SLACK).then_some(length)
            }
            Self::Sphere { radius } => meets_round(&origin.coords, direction, *radius),
        }
    }
}

/// Where a ray enters a ball (or, without its part along the axis, a cylinder) around the origin from outside.
fn meets_round(origin: &Vector3<f64>, direction: &Vector3<f64>, radius: f64) -> Option<f64> {
    let (a, b, c) =
        (direction.norm_squared(), -origin.dot(direction), origin.norm_squared() - radius * radius);
    let discriminant = b * b - a * c;
    (c > 0.0 && b > 0.0 && discriminant >= 0.0).then(|| c / (b + discriminant.sqrt()))
}
