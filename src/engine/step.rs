//! The steps of the pipeline, for those who time them.

/// The steps of [`Engine::insert`](super::Engine::insert), in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PipelineStep {
    /// Each point has been counted in its voxel.
    Binned,
    /// Newly dense voxels have their normals.
    Normals,
    /// They are grown into partial clusters.
    Partials,
    /// Those are merged into the global ones.
    Globals,
}
