//! Eigenvalues and the plane's normal of a covariance in closed form: a third of the time that iterations take.
//!
//! The characteristic polynomial of a symmetric 3 x 3 matrix has three real roots, found by trigonometry (O. K. Smith,
//! "Eigenvalues of a symmetric 3 x 3 matrix", Communications of the ACM 4, 1961); the eigenvector is orthogonal to the rows
//! of what is left when the eigenvalue is taken off the diagonal. Where two eigenvalues nearly meet, that says nothing, and
//! nalgebra's iteration does the work.

use nalgebra::{Matrix3, Vector3};

use crate::engine::plane::ascending;
use crate::engine::symmetric::quadratic;

/// Share of the spread by which the smallest eigenvalue must differ from the next.
const LEAST_GAP: f64 = 1e-4;

/// Variances of points, ascending, and the unit direction of the smallest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eigen {
    pub(super) variances: [f64; 3],
    pub(super) normal: Vector3<f64>,
}

impl Eigen {
    pub(super) fn of(covariance: &Matrix3<f64>) -> Self {
        Self::closed(covariance).unwrap_or_else(|| Self::iterated(covariance))
    }

    fn closed(covariance: &Matrix3<f64>) -> Option<Self> {
        let middle = covariance.trace() / 3.0;
        let rest = covariance - Matrix3::from_diagonal_element(middle);
        let scale = (rest.norm_squared() / 6.0).sqrt();
        if scale <= f64::EPSILON * middle.abs() {
            return None;
        }
        let half = (0.5 * (rest / scale).determinant()).clamp(-1.0, 1.0);
        let cosine = (half.acos() / 3.0).cos();
        // That of an angle larger by a third of a turn; the angle is no more than a sixth of one.
        let later = -0.5 * cosine - (0.75 * (1.0 - cosine * cosine)).max(0.0).sqrt();
        let [most, least] = [cosine, later].map(|cosine| middle + 2.0 * scale * cosine);
        if 3.0 * middle - most - 2.0 * least <= LEAST_GAP * scale {
            return None;
        }
        let left = covariance - Matrix3::from_diagonal_element(least);
        let [x, y, z] = [0, 1, 2].map(|row| left.row(row).transpose());
        let candidates = [x.cross(&y), x.cross(&z), y.cross(&z)];
        let longest = candidates.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
        Some(Self::along(covariance, longest.try_normalize(0.0)?))
    }

    /// The variances where the normal is known: where the other two are nearly one, the arc cosine leaves half the digits of
    /// them, and those of the plane all.
    fn along(covariance: &Matrix3<f64>, normal: Vector3<f64>) -> Self {
        let across = normal.cross(&Vector3::ith(normal.iamin(), 1.0)).normalize();
        let [u, v] = [across, normal.cross(&across)];
        let [on_u, on_v] = [covariance * u, covariance * v];
        let (mean, half) = (0.5 * (u.dot(&on_u) + v.dot(&on_v)), 0.5 * (u.dot(&on_u) - v.dot(&on_v)));
        let beside = v.dot(&on_u);
        let radius = (half * half + beside * beside).sqrt();
        let variances = [quadratic(covariance, &normal), mean - radius, mean + radius];
        Self { variances, normal }
    }

    fn iterated(covariance: &Matrix3<f64>) -> Self {
        let (variances, normal) = ascending(covariance);
        Self { variances, normal }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_closed_form_is_the_iteration(
            variances in prop::array::uniform3(prop_oneof![Just(0.0), 1e-9..1e-3, 1e-3..10.0]),
            turn in prop::array::uniform3(-3.0..3.0),
        ) {
            let turn = Rotation3::from_scaled_axis(turn.into()).into_inner();
            let covariance = turn * Matrix3::from_diagonal(&variances.into()) * turn.transpose();
            let [closed, iterated] = [Eigen::of(&covariance), Eigen::iterated(&covariance)];
            let most = iterated.variances[2];
            for (a, b) in closed.variances.into_iter().zip(iterated.variances) {
                prop_assert!((a - b).abs() <= 1e-12 * most, "{closed:?} {iterated:?}");
            }
            prop_assert!((closed.normal.norm() - 1.0).abs() < 1e-12);
            let gap = (iterated.variances[1] - iterated.variances[0]) / most.max(f64::MIN_POSITIVE);
            if gap > 1e-3 {
                let sine = closed.normal.cross(&iterated.normal).norm();
                prop_assert!(sine <= 1e-9 / gap, "{sine} {closed:?} {iterated:?}");
            }
        }
    }

    #[test]
    fn a_ball_and_a_point_have_some_normal() {
        for covariance in [Matrix3::identity(), Matrix3::zeros()] {
            let eigen = Eigen::of(&covariance);
            assert!((eigen.normal.norm() - 1.0).abs() < 1e-12, "{eigen:?}");
        }
    }
}
