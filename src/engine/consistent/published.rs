//! What the grid remembers of a voxel as it was published, and whether it has become another since.
//!
//! A voxel that has been seen for long gets more points and hardly any news. It has drifted when the mean of its points has
//! moved, or when nearer views have made its noise less; it is looked at each time its weight has doubled, so that this
//! costs next to nothing.

use serde::{Deserialize, Serialize};

use super::sums::Sums;

/// What a voxel was when its block was published last; all zero while it never was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Published {
    /// Mean of its points from its corner, in 1/65536 of its edge.
    mean: [u16; 3],
    points: u64,
    weight: u64,
    /// Weight at which it was last looked at whether it has drifted.
    looked_at: u64,
    /// It has drifted.
    drifted: bool,
}

/// How far the mean of a voxel's points moves before it has drifted, in voxels.
const DRIFT: f64 = 0.1;
/// Part of its published noise (as a variance) below which it has drifted as well.
const SHARPER: f64 = 0.6;

impl Published {
    pub(super) fn of(sums: &Sums) -> Self {
        let mean = sums.mean().map(|offset| (offset * 65536.0) as u16).into();
        Self { mean, points: sums.points, weight: sums.weight, looked_at: sums.weight, drifted: false }
    }

    /// Whether it can have been noted.
    pub(super) const fn is_possible(&self) -> bool {
        let most = 1 << 40;
        self.points <= self.weight && self.weight <= most && self.looked_at <= most
    }

    /// Whether it was published as a dense voxel.
    pub(super) const fn is_known(&self) -> bool {
        self.weight > 0
    }

    /// Whether the weight has doubled since it was looked at last.
    pub(super) const fn is_doubled(&self, sums: &Sums) -> bool {
        sums.weight >= 2 * self.looked_at
    }

    /// Looks whether its points have moved, or are known much better; `true` the first time they are.
    pub(super) fn has_begun_to_drift(&mut self, sums: &Sums) -> bool {
        self.looked_at = sums.weight;
        let mean = sums.mean();
        let moved = (0..3).any(|i| (mean[i] - f64::from(self.mean[i]) / 65536.0).abs() > DRIFT);
        let noise = |points: u64, weight: u64| points as f64 / weight as f64;
        let sharper = noise(sums.points, sums.weight) < SHARPER * noise(self.points, self.weight);
        let begins = !self.drifted && (moved || sharper);
        self.drifted |= begins;
        begins
    }
}
