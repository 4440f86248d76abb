//! The total least squares plane (Definitions 3 and 5): the eigenvector of the smallest eigenvalue of a covariance.

use nalgebra::{Matrix3, SymmetricEigen, UnitVector3, Vector3};

/// Ratio below which an eigenvalue counts as zero (reading R4).
const DEGENERATE: f64 = 1e-6;

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
        let eigen = SymmetricEigen::new(*covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let [l0, l1, l2] = order.map(|i| eigen.eigenvalues[i]);
        if l1 <= DEGENERATE * l2 || l1 - l0 <= DEGENERATE * l2 {
            return None;
        }
        let normal = UnitVector3::new_normalize(eigen.eigenvectors.column(order[0]).into_owned());
        // Rounding may leave the eigenvalue of a perfect plane a hair below zero.
        Some(Self { normal, curvature: l0.max(0.0) / (l0 + l1 + l2) })
    }
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
    fn a_right_angle_counts_as_the_same_half_space() {
        let x = Vector3::x_axis();
        assert_eq!(turned(x, &Vector3::y()), x);
        assert_eq!(turned(x, &-Vector3::x()), -x);
    }
}
