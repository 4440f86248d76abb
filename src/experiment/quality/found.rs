//! What a method has found, in plain numbers.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3};

use super::plane::Plane;
use crate::engine::{SurfaceClass, VoxelKey};

/// A clustering of a voxel map.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Found {
    /// The dense voxels, each with the number of its cluster; `None` = in no cluster. A voxel that is missing is in none.
    pub(super) voxels: Vec<(VoxelKey, Option<u64>)>,
    /// The clusters by number.
    pub(super) clusters: BTreeMap<u64, FoundCluster>,
}

/// A cluster. What a method does not compute is `None`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FoundCluster {
    /// Its plane, facing the side it was seen from.
    pub(super) plane: Plane,
    /// Area of the surface (m^2).
    pub(super) area: Option<f64>,
    /// What it is to a planner; [`SurfaceClass::Unknown`] = the method does not know.
    pub(super) class: Option<SurfaceClass>,
    /// Probability that this is right, 0 to 1.
    pub(super) confidence: Option<f64>,
    /// How sure the plane is.
    pub(super) certainty: Option<FoundPlane>,
}

/// How sure a plane is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FoundPlane {
    /// The place and axes that the covariance is about; +z along the plane's normal.
    pub(super) pose: Isometry3<f64>,
    /// Covariance of (turn about pose x, turn about pose y, offset along pose +z at the pose's origin): rad^2, rad m, m^2.
    pub(super) covariance: Matrix3<f64>,
}
