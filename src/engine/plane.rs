//! The total least squares plane (Definitions 3 and 5): the eigenvector of the smallest eigenvalue of a covariance.

use nalgebra::{Matrix3, SymmetricEigen, UnitVector3, Vector3};

/// Ratio below which an eigenvalue counts as zero (reading R4).
pub(crate) const DEGENERATE: f64 = 1e-6;

/// A plane through the mean of the points it was fitted to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneFit {
    /// Unit normal of either sign.
    pub(crate) normal: UnitVector3<f64>,
    /// Smallest eigenvalue over the sum: 0 (flat) to 1/3.
    pub(crate) curvature: f64,
}

impl PlaneFit {
    /// Fits `count` points of this covariance (of any scale); `None` where they span no plane (reading R4).
    pub(crate) fn new(count: u32, covariance: &Matrix3<f64>) -> Option<Self> {
        if count < 3 {
            return None;
        }
        let ([l0, l1, l2], normal) = ascending(covariance);
        if l1 <= DEGENERATE * l2 || l1 - l0 <= DEGENERATE * l2 {
            return None;
        }
        let normal = UnitVector3::new_normalize(normal);
        // Rounding may leave the eigenvalue of a perfect plane a hair below zero.
        Some(Self { normal, curvature: l0.max(0.0) / (l0 + l1 + l2) })
    }
}

/// Eigenvalues of a covariance, ascending, and the direction of the least, of either sign; it is of unit length but for rounding.
pub(crate) fn ascending(covariance: &Matrix3<f64>) -> ([f64; 3], Vector3<f64>) {
    let eigen = SymmetricEigen::new(*covariance);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    (order.map(|i| eigen.eigenvalues[i]), eigen.eigenvectors.column(order[0]).into_owned())
}

/// The direction in which points of this covariance spread least, in the half space of `towards`; a right angle counts as the same
/// half. It is of unit length but for rounding.
pub(crate) fn normal_towards(covariance: &Matrix3<f64>, towards: &Vector3<f64>) -> Vector3<f64> {
    let eigen = SymmetricEigen::new(*covariance);
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}

/// `vector`, or its opposite where that lies in the half space of `towards`; a right angle counts as the same half.
pub(crate) fn turned(vector: UnitVector3<f64>, towards: &Vector3<f64>) -> UnitVector3<f64> {
    if vector.dot(towards) < 0.0 { -vector } else { vector }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(points: &[[f64; 3]]) -> Option<PlaneFit> {
        let n = points.len() as f64;
        let mean = points.iter().map(|&p| Vector3::from(p)).sum::<Vector3<f64>>() / n;
        let covariance =
            points.iter().map(|&p| Vector3::from(p) - mean).map(|d| d * d.transpose()).sum::<Matrix3<f64>>();
        PlaneFit::new(points.len() as u32, &(covariance / n))
    }

    #[test]
    fn definition_3_the_normal_is_that_of_the_total_least_squares_plane() {
        let tilted: Vec<_> =
            (0..25).map(|i| [f64::from(i % 5), f64::from(i / 5), 0.5 * f64::from(i % 5)]).collect();
        let plane = fit(&tilted).unwrap();
        assert!(plane.normal.cross(&Vector3::new(-0.5, 0.0, 1.0).normalize()).norm() < 1e-12);
        assert!(plane.curvature < 1e-12);
    }

    #[test]
    fn fewer_than_three_points_a_line_and_a_ball_span_no_plane() {
        assert!(fit(&[[0.0; 3], [1.0, 0.0, 0.0]]).is_none());
        assert!(fit(&[[0.0; 3], [1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [3.0, 6.0, 9.0]]).is_none());
        let octahedron = [1.0, -1.0]
            .iter()
            .flat_map(|&s| [[s, 0.0, 0.0], [0.0, s, 0.0], [0.0, 0.0, s]])
            .collect::<Vec<_>>();
        assert!(fit(&octahedron).is_none());
        assert!(fit(&[[0.0; 3]; 5]).is_none());
    }

    #[test]
    fn a_normal_is_that_of_the_least_eigenvalue_and_faces_the_side_that_is_asked_for() {
        let covariance = Matrix3::from_diagonal(&Vector3::new(3.0, 0.5, 2.0));
        let (values, least) = ascending(&covariance);
        assert_eq!((values, least.abs()), ([0.5, 2.0, 3.0], Vector3::y()));
        for towards in [Vector3::new(1.0, 2.0, 0.0), Vector3::new(1.0, -2.0, 0.0)] {
            assert_eq!(normal_towards(&covariance, &towards), towards.y.signum() * Vector3::y());
        }
    }

    #[test]
    fn a_right_angle_counts_as_the_same_half_space() {
        let x = Vector3::x_axis();
        assert_eq!(turned(x, &Vector3::y()), x);
        assert_eq!(turned(x, &-Vector3::x()), -x);
    }
}
