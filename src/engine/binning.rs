//! The arithmetic that decides which voxel a point falls into: the same for every method, to the last bit.

use nalgebra::{Matrix3, Point3, Vector3};

/// p = R x + t, each term rounded on its own so that every processor finds the same voxel.
pub(crate) fn map(rotation: &Matrix3<f64>, translation: &Vector3<f64>, [x, y, z]: [f64; 3]) -> Point3<f64> {
    let axis = |i: usize| rotation[(i, 0)] * x + rotation[(i, 1)] * y + rotation[(i, 2)] * z + translation[i];
    Point3::new(axis(0), axis(1), axis(2))
}

/// The floor of an index; far outside the grid it saturates there. (`f64::floor` is a call on plain x86-64.)
pub(crate) fn floor(value: f64) -> i32 {
    let truncated = value as i32;
    truncated.saturating_sub(i32::from(value < f64::from(truncated)))
}
