//! Symmetric 3 x 3 matrices by the six entries that differ: xx, xy, xz, yy, yz, zz.

use nalgebra::{Matrix3, Vector3};

/// Row and column of each entry.
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

pub(super) fn upper(matrix: &Matrix3<f64>) -> [f64; 6] {
    PAIRS.map(|at| matrix[at])
}

/// n . (matrix n).
pub(super) fn quadratic(matrix: &Matrix3<f64>, n: &Vector3<f64>) -> f64 {
    n.dot(&(matrix * n))
}

/// n . (matrix n) of a matrix by its entries.
pub(super) fn along([xx, xy, xz, yy, yz, zz]: [f64; 6], n: &Vector3<f64>) -> f64 {
    n.x * (xx * n.x + 2.0 * (xy * n.y + xz * n.z)) + n.y * (yy * n.y + 2.0 * yz * n.z) + zz * n.z * n.z
}

/// The product of the two variances across n: n . (adj(matrix) n).
pub(super) fn area_across([xx, xy, xz, yy, yz, zz]: [f64; 6], n: &Vector3<f64>) -> f64 {
    let adjugate = [
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    ];
    along(adjugate, n)
}

/// What the least eigenvalue of a matrix without negative ones is at least; near it where the other two are alike.
///
/// It is the determinant by the product of the others, and their product is at most the square of their mean.
pub(super) fn least_at_least([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> f64 {
    let determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let trace = xx + yy + zz;
    let bound = |least: f64| {
        let others = 0.5 * (trace - least);
        determinant / (others * others)
    };
    if determinant <= 0.0 { 0.0 } else { bound(bound(0.0)) }
}

pub(super) fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
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
            let seen: Matrix2<f64> = across.transpose() * symmetric(entries) * across;
            prop_assert!((area_across(entries, &n) - seen.determinant()).abs() < 1e-12);
        }

        #[test]
        fn the_least_eigenvalue_is_not_below_its_bound(
            values in prop::array::uniform3(prop_oneof![Just(0.0), 1e-6..1.0]), turn in prop::array::uniform3(-3.0..3.0),
        ) {
            let turn = Rotation3::from_scaled_axis(turn.into()).into_inner();
            let matrix = turn * Matrix3::from_diagonal(&values.into()) * turn.transpose();
            let bound = least_at_least(upper(&matrix));
            let least = values.into_iter().fold(f64::INFINITY, f64::min);
            prop_assert!((0.0..=least + 1e-12).contains(&bound), "{bound} {values:?}");
        }
    }

    #[test]
    fn the_bound_is_the_least_eigenvalue_where_the_others_are_alike() {
        let bound = least_at_least([2.0, 0.0, 0.0, 0.5, 0.0, 2.0]);
        assert!((0.45..=0.5).contains(&bound), "{bound}");
        assert_eq!(least_at_least([0.0; 6]), 0.0);
    }
}
