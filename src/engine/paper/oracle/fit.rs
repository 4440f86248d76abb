//! Planes and normals of the oracle.

use nalgebra::{Matrix3, UnitVector3, Vector3};

/// A direction and how far an equally right computation may lie from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Normal {
    pub(super) vector: Vector3<f64>,
    tolerance: f64,
}

impl Normal {
    pub(super) fn unit(self) -> Self {
        Self { vector: self.vector.normalize(), ..self }
    }

    pub(super) fn agree(mine: Option<&Self>, other: Option<&UnitVector3<f64>>) -> bool {
        match (mine, other) {
            (None, None) => true,
            (Some(mine), Some(other)) => mine.vector.angle(other) <= mine.tolerance,
            _ => false,
        }
    }
}

pub(super) fn towards(normal: Normal, direction: &Vector3<f64>) -> Normal {
    let sign = if normal.vector.dot(direction) < 0.0 { -1.0 } else { 1.0 };
    Normal { vector: normal.vector * sign, ..normal }
}

/// The mean of `n` normals of mean `a` and `m` normals of mean `b`.
pub(super) fn mean(a: Normal, n: usize, b: Normal, m: usize) -> Normal {
    let vector = (a.vector * n as f64 + b.vector * m as f64) / (n + m) as f64;
    Normal { vector, tolerance: a.tolerance.max(b.tolerance) }
}

/// The total least squares plane; `None` as reading R4 says.
pub(super) fn fit(centres: &[Vector3<f64>]) -> Option<Normal> {
    if centres.len() < 3 {
        return None;
    }
    let mean = centres.iter().sum::<Vector3<f64>>() / centres.len() as f64;
    let mut matrix = Matrix3::zeros();
    for centre in centres {
        matrix += (centre - mean) * (centre - mean).transpose();
    }
    let mut pairs = jacobi(matrix);
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [(l0, vector), (l1, _), (l2, _)] = pairs;
    let plane = l1 > 1e-6 * l2 && l1 - l0 > 1e-6 * l2;
    plane.then(|| Normal { vector, tolerance: 1e-6 + 1e-13 * l2 / (l1 - l0) })
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix by cyclic Jacobi rotations (Golub and Van Loan, 8.5).
fn jacobi(mut a: Matrix3<f64>) -> [(f64, Vector3<f64>); 3] {
    let mut v = Matrix3::identity();
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[(p, q)] == 0.0 {
                continue;
            }
            let tau = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
            let t = 1.0_f64.copysign(tau) / (tau.abs() + (1.0 + tau * tau).sqrt());
            let c = 1.0 / (1.0 + t * t).sqrt();
            let mut turn = Matrix3::identity();
            turn[(p, p)] = c;
            turn[(q, q)] = c;
            turn[(p, q)] = t * c;
            turn[(q, p)] = -t * c;
            a = turn.transpose() * a * turn;
            v *= turn;
        }
    }
    [0, 1, 2].map(|i| (a[(i, i)], v.column(i).normalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobi_rotations_give_eigenvectors() {
        let matrix = Matrix3::new(4.0, 1.0, -2.0, 1.0, 3.0, 0.5, -2.0, 0.5, 5.0);
        for (value, vector) in jacobi(matrix) {
            assert!((matrix * vector - vector * value).norm() < 1e-12);
        }
    }
}
