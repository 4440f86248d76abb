//! What the grid remembers of a voxel as it was published, and whether it has become another since.
//!
//! A voxel that has been seen for long gets more points and hardly any news. It has drifted when the mean of its points has
//! moved, or when nearer views have made its noise less; it is looked at each time its weight has doubled, so that this
//! costs next to nothing.

use serde::{Deserialize, Serialize};

use crate::engine::consistent::state::{PARTS, in_parts};
use crate::engine::consistent::sums::Moments;

/// What a voxel was when its block was published last; all zero while it never was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Baseline {
    /// Mean of its points from its corner, in [`PARTS`] of its edge.
    mean: [u16; 3],
    /// It has drifted.
    drifted: bool,
    /// Its points by their weight: the mean variance of their noise, in that of a point of weight 1.
    noise: f32,
    /// Weight at which it was last looked at whether it has drifted.
    looked_at: u32,
}

/// How far the mean of a voxel's points moves before it has drifted, in voxels.
const DRIFT: f64 = 0.1;
/// Part of its published noise (as a variance) below which it has drifted as well.
const SHARPER: f32 = 0.6;

/// Points by weight; above 0, for there is a point.
fn noise_of(moments: &Moments) -> f32 {
    moments.points as f32 / moments.weight as f32
}

impl Baseline {
    pub(crate) fn of(moments: &Moments) -> Self {
        let mean = moments.mean().map(in_parts).into();
        Self { mean, drifted: false, noise: noise_of(moments), looked_at: moments.weight }
    }

    /// Whether it can have been noted.
    pub(crate) fn is_possible(&self) -> bool {
        (0.0..=1.0).contains(&self.noise)
    }

    /// Whether it was published as a dense voxel.
    pub(crate) const fn is_known(&self) -> bool {
        self.noise > 0.0
    }

    /// Whether the weight has doubled since it was looked at last.
    pub(crate) const fn is_doubled(&self, moments: &Moments) -> bool {
        moments.weight / 2 >= self.looked_at
    }

    /// The voxel's weight has been halved so often: what it has doubled since is to be seen nevertheless.
    pub(crate) const fn note_halved(&mut self, halvings: u32) {
        self.looked_at = if halvings < u32::BITS { self.looked_at >> halvings } else { 0 };
    }

    /// Notes whether its points have moved, or are known much better; `true` the first time they are.
    pub(crate) fn note_drift(&mut self, moments: &Moments) -> bool {
        self.looked_at = moments.weight;
        let mean = moments.mean();
        let moved = (0..3).any(|i| (mean[i] - f64::from(self.mean[i]) / PARTS).abs() > DRIFT);
        let sharper = noise_of(moments) < SHARPER * self.noise;
        let begins = !self.drifted && (moved || sharper);
        self.drifted |= begins;
        begins
    }
}
