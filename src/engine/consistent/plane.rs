//! The plane of a voxel, of some or of a patch.

use nalgebra::{UnitVector3, Vector3};

/// A plane in space, with the side it is seen from. Where its point is from, and in which units, is for who has it to say.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) point: Vector3<f64>,
    /// Towards the side it was seen from.
    pub(super) normal: UnitVector3<f64>,
}
