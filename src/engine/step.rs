//! The steps of the pipeline, for those who time them.

/// The steps of [`Engine::insert`](super::Engine::insert), in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PipelineStep {
    /// Each point has been counted in its voxel.
    Binned,
    /// Newly dense voxels have their normals; in `paper` alone.
    Normals,
    /// They are grown into partial clusters; in `consistent`, what is due is published and the clusters are those of it.
    Partials,
    /// Those are merged into the global ones; in `consistent`, what changed is described.
    Globals,
}
