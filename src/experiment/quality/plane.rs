//! Planes and how far a found one is from the true one.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::found::FoundPlane;
use crate::engine::plane::normal_towards;

/// The plane normal . x + offset = 0, facing along its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    /// Unit length.
    pub(super) normal: Vector3<f64>,
    /// Its d (m).
    pub(super) offset: f64,
}

impl Plane {
    /// The plane through a point.
    pub(super) fn through(point: &Point3<f64>, normal: &Vector3<f64>) -> Self {
        let normal = normal.normalize();
        Self { normal, offset: -normal.dot(&point.coords) }
    }

    /// The least squares plane through points, facing along `towards`; `None` below three points.
    pub(super) fn fit(points: &[Point3<f64>], towards: &Vector3<f64>) -> Option<Self> {
        let middle = mean(points).filter(|_| points.len() >= 3)?;
        let spread: Matrix3<f64> = points.iter().map(|point| point - middle).map(|d| d * d.transpose()).sum();
        Some(Self::through(&middle, &normal_towards(&spread, towards)))
    }

    /// Signed distance of a point, positive in front (m).
    pub(super) fn height(&self, point: &Point3<f64>) -> f64 {
        self.normal.dot(&point.coords) + self.offset
    }

    /// Angle to another plane's normal (degrees), 0 to 180.
    pub(super) fn angle(&self, other: &Self) -> f64 {
        self.normal.angle(&other.normal).to_degrees()
    }

    /// As seen from a pose: the turns about its x and y that take its z to the normal (rad), and the way along its z from
    /// its origin to the plane (m).
    fn seen_from(&self, pose: &Isometry3<f64>) -> Vector3<f64> {
        let local = pose.rotation.inverse() * self.normal;
        let along = -self.height(&pose.translation.vector.into()) / local.z;
        Vector3::new((-local.y).atan2(local.z), local.x.atan2(local.z), along)
    }
}

/// From which angle on (degrees) a found plane is held to be that of another surface. What a covariance says is of small turns: to
/// those of tens of degrees it does not apply, and at a right angle a plane has no place along the other's normal.
const ANOTHER: f64 = 45.0;

/// Whether a plane that is turned by `angle` (degrees) is that of another surface, of which the angle tells all.
pub(super) fn is_another(angle: f64) -> bool {
    angle >= ANOTHER
}

/// The normalised estimation error squared of a found plane, which [is not that of another surface](is_another); infinite where its
/// covariance is none.
pub(super) fn nees(truth: &Plane, found: &Plane, stated: &FoundPlane) -> f64 {
    let error = truth.seen_from(&stated.pose) - found.seen_from(&stated.pose);
    let solved = stated.covariance.cholesky().map(|root| error.dot(&root.solve(&error)));
    solved.filter(|nees| nees.is_finite()).unwrap_or(f64::INFINITY)
}

pub(super) fn mean(points: &[Point3<f64>]) -> Option<Point3<f64>> {
    let sum: Vector3<f64> = points.iter().map(|point| point.coords).sum();
    (!points.is_empty()).then(|| Point3::from(sum / points.len() as f64))
}
