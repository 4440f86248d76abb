//! CFODI to the letter: the paper's method under the readings that make it exact.
//!
//! Scan → grid → normals → partial clusters → global clusters. The modules stand in that order; [`Cfodi::insert`] is
//! the pipeline. It is what the paper's figures are made with, and what the consistent engine is held against.
//!
//! What is always true after [`Cfodi::insert`]: every dense voxel with a normal belongs to exactly one global cluster;
//! the sums of a cluster are exactly those over its voxels' centres; ids count up and are never used again.
//!
//! Beside it stand [`statics`], the paper's baseline that re-clusters everything, and [`oracle`], a slow and plain
//! version of the same definitions that shares types with the engine and no function.

mod describe;
mod extremes;
mod globals;
mod grid;
mod moments;
mod neighbourhood;
mod normals;
pub mod oracle;
mod partial;
mod pipeline;
mod saved;
pub mod statics;

pub use pipeline::Cfodi;
pub(crate) use saved::SavedCfodi;
