//! How good a clustering is, held against the simulator's truth.
//!
//! One way: labelled scans -> `TruthMap` -> `Truth` (the true surfaces, and which voxels are scored) -> with what a method
//! `Found` -> `Quality` of one [`Run`] -> `Pooled` over several runs -> a [`Table`].
//!
//! **A true surface** is a 6-connected component of the dense voxels most of whose points belong to it; rectangles that
//! touch within half a voxel of one plane count as one. It is *seen* when 0.5 m^2 of its 2 cm cells were hit by a
//! noise-free ray in range and lie by a voxel that became dense; the others count in no area. **Scored** are voxels with
//! 80 % or more of their points on one surface and the mean of the points within 2 sigma of it. A scored voxel that is in
//! no cluster is a cluster of its own.
//!
//! **Where poses are told wrong** all of that is of the points as they are told: a surface may become thick, or fall into layers
//! where two sights of it lie a voxel apart, and each layer is a piece. Sigma then holds what the pose adds at the point's distance
//! besides the sensor's noise, so that what it has moved stays scored, and a cell looks as much further for its voxels, straight before
//! and behind. Without that only those voxels would be scored that the errors have spared. Planes, areas and seen cells are the true
//! ones, and NEES asks whether a method knows how wrong it is.
//!
//! Pure; lengths are metres, angles degrees where a field says so. The truth costs O(points) a scan and O(voxels + cells)
//! at the end, a score O(voxels) for each method.

mod confidence;
mod failures;
mod found;
mod laboratory;
mod maps;
mod measure;
mod pieces;
mod plane;
mod pooled;
mod score;
mod table;
#[cfg(test)]
mod tests;
mod told;
mod touching;
mod truth;
mod way;

pub use laboratory::{Laboratory, Run};
pub use table::Table;
pub use way::Way;
