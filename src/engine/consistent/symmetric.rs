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

/// The same of a matrix by its entries.
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

pub(super) fn symmetric([xx, xy, xz, yy, yz, zz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Matrix3x2};
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
    }
}
