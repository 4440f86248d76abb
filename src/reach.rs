//! How far a map reaches, and what is said of points beyond it.

use crate::engine::GRID_REACH;

/// Points that were handed to the engine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Points {
    pub(crate) all: u64,
    pub(crate) beyond_grid: u64,
}

impl Points {
    pub(crate) const fn add(&mut self, other: Self) {
        self.all += other.all;
        self.beyond_grid += other.beyond_grid;
    }
}

/// How far a map reaches, in words.
#[derive(Clone, Debug)]
pub(crate) struct Reach {
    fixed_frame: String,
    /// From the origin (m).
    metres: f64,
}

impl Reach {
    /// Of a map in this frame, with voxels of this size (m).
    pub(crate) fn new(fixed_frame: String, voxel_size: f64) -> Self {
        Self { fixed_frame, metres: f64::from(GRID_REACH) * voxel_size }
    }

    /// What is to be said of points beyond it.
    pub(crate) fn line(&self, Points { all, beyond_grid }: Points) -> String {
        let Self { fixed_frame, metres } = self;
        format!(
            "points beyond the grid, which reaches {metres:.0} m from the origin of `{fixed_frame}`, are left out, \
             {beyond_grid} of {all}: take a fixed_frame that begins near the robot, as that of odometry does, or a larger voxel_size"
        )
    }
}
