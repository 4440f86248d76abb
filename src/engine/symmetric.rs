//! Symmetric 3 x 3 matrices by the six entries that differ: xx, xy, xz, yy, yz, zz.

use nalgebra::{Matrix3, Vector3};

/// Row and column of each entry.
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// n . (matrix n), summed in another order than [`Symmetric3::quadratic_form`].
pub(super) fn quadratic(matrix: &Matrix3<f64>, n: &Vector3<f64>) -> f64 {
    n.dot(&(matrix * n))
}

/// A symmetric 3 x 3 matrix by its entries xx, xy, xz, yy, yz, zz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Symmetric3(pub(super) [f64; 6]);

impl Symmetric3 {
    /// A matrix that is symmetric, of which the upper triangle is read.
    pub(super) fn of(matrix: &Matrix3<f64>) -> Self {
        Self(PAIRS.map(|at| matrix[at]))
    }

    pub(super) fn matrix(self) -> Matrix3<f64> {
        let Self([xx, xy, xz, yy, yz, zz]) = self;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }

    pub(super) fn trace(self) -> f64 {
        let Self([xx, _, _, yy, _, zz]) = self;
        xx + yy + zz
    }

    /// n . (M n): of a covariance, where n is of unit length, the variance along it.
    pub(super) fn quadratic_form(self, n: &Vector3<f64>) -> f64 {
        let Self([xx, xy, xz, yy, yz, zz]) = self;
        n.x * (xx * n.x + 2.0 * (xy * n.y + xz * n.z)) + n.y * (yy * n.y + 2.0 * yz * n.z) + zz * n.z * n.z
    }

    /// n . (adj(M) n): of a covariance, where n is of unit length, the product of the two principal variances across it.
    pub(super) fn adjugate_form(self, n: &Vector3<f64>) -> f64 {
        let Self([xx, xy, xz, yy, yz, zz]) = self;
        let adjugate = Self([
            yy * zz - yz * yz,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xx * zz - xz * xz,
            xy * xz - xx * yz,
            xx * yy - xy * xy,
        ]);
        adjugate.quadratic_form(n)
    }

    /// A lower bound of the smallest eigenvalue of a positive semidefinite matrix; tight where the other two are equal.
    ///
    /// The smallest is the determinant by the product of the others, and their product is at most the square of their mean.
    pub(super) fn eigenvalue_lower_bound(self) -> f64 {
        let Self([xx, xy, xz, yy, yz, zz]) = self;
        let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
        let trace = self.trace();
        let bound = |least: f64| {
            let others = 0.5 * (trace - least);
            determinant / (others * others)
        };
        if determinant <= 0.0 { 0.0 } else { bound(bound(0.0)) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Matrix3x2, Rotation3};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_area_across_is_the_determinant_of_what_is_across(
            entries in prop::array::uniform6(-1.0..1.0), n in prop::array::uniform3(0.1..1.0),
        ) {
            let n = Vector3::from(n).normalize();
            let u = n.cross(&Vector3::x()).normalize();
            let across = Matrix3x2::from_columns(&[u, n.cross(&u)]);
            let seen: Matrix2<f64> = across.transpose() * Symmetric3(entries).matrix() * across;
            prop_assert!((Symmetric3(entries).adjugate_form(&n) - seen.determinant()).abs() < 1e-12);
        }

        #[test]
        fn the_least_eigenvalue_is_not_below_its_bound(
            values in prop::array::uniform3(prop_oneof![Just(0.0), 1e-6..1.0]), turn in prop::array::uniform3(-3.0..3.0),
        ) {
            let turn = Rotation3::from_scaled_axis(turn.into()).into_inner();
            let matrix = turn * Matrix3::from_diagonal(&values.into()) * turn.transpose();
            let bound = Symmetric3::of(&matrix).eigenvalue_lower_bound();
            let least = values.into_iter().fold(f64::INFINITY, f64::min);
            prop_assert!((0.0..=least + 1e-12).contains(&bound), "{bound} {values:?}");
        }
    }

    #[test]
    fn the_bound_is_the_least_eigenvalue_where_the_others_are_alike() {
        let bound = Symmetric3([2.0, 0.0, 0.0, 0.5, 0.0, 2.0]).eigenvalue_lower_bound();
        assert!((0.45..=0.5).contains(&bound), "{bound}");
        assert_eq!(Symmetric3([0.0; 6]).eigenvalue_lower_bound(), 0.0);
    }
}
