//! What the grid remembers of a voxel as it was published, and whether it has become another since.
//!
//! A voxel that has been seen for long gets more points and hardly any news. It has drifted when the mean of its points has
//! moved, or when nearer views have made its noise less; it is looked at each time its weight has doubled, so that this
//! costs next to nothing.

use serde::{Deserialize, Serialize};

use super::sums::Sums;

/// What a voxel was when its block was published last; all zero while it never was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Wide")]
pub(super) struct Published {
    /// Mean of its points from its corner, in [`PARTS`] of its edge.
    mean: [u16; 3],
    points: u32,
    weight: u32,
    /// Weight at which it was last looked at whether it has drifted.
    looked_at: u32,
    /// It has drifted.
    drifted: bool,
}

/// The same as it may have been saved, when sums were halved later.
#[derive(Deserialize)]
struct Wide {
    mean: [u16; 3],
    points: u64,
    weight: u64,
    looked_at: u64,
    drifted: bool,
}

impl From<Wide> for Published {
    fn from(Wide { mean, points, weight, looked_at, drifted }: Wide) -> Self {
        let beyond = (weight | points | looked_at).max(1).ilog2().saturating_sub(u32::BITS - 1);
        let [points, weight, looked_at] = [points, weight, looked_at].map(|sum| (sum >> beyond) as u32);
        Self { mean, points, weight, looked_at, drifted }
    }
}

/// How far the mean of a voxel's points moves before it has drifted, in voxels.
const DRIFT: f64 = 0.1;
/// Part of its published noise (as a variance) below which it has drifted as well.
const SHARPER: f64 = 0.6;

/// Parts of a voxel's edge in which the places of means are kept.
pub(super) const PARTS: f64 = 65536.0;

/// An offset from the voxel's corner in these parts.
pub(super) fn in_parts(offset: f64) -> u16 {
    (offset * PARTS) as u16
}

impl Published {
    pub(super) fn of(sums: &Sums) -> Self {
        let mean = sums.mean().map(in_parts).into();
        Self { mean, points: sums.points, weight: sums.weight, looked_at: sums.weight, drifted: false }
    }

    /// Whether it can have been noted.
    pub(super) const fn is_possible(&self) -> bool {
        self.points <= self.weight
    }

    /// Whether it was published as a dense voxel.
    pub(super) const fn is_known(&self) -> bool {
        self.weight > 0
    }

    /// Whether the weight has doubled since it was looked at last.
    pub(super) const fn is_doubled(&self, sums: &Sums) -> bool {
        sums.weight / 2 >= self.looked_at
    }

    /// The voxel's sums have been halved so often: what they have doubled since is to be seen nevertheless.
    pub(super) const fn note_halved(&mut self, halvings: u32) {
        self.looked_at = if halvings < u32::BITS { self.looked_at >> halvings } else { 0 };
    }

    /// Looks whether its points have moved, or are known much better; `true` the first time they are.
    pub(super) fn has_begun_to_drift(&mut self, sums: &Sums) -> bool {
        self.looked_at = sums.weight;
        let mean = sums.mean();
        let moved = (0..3).any(|i| (mean[i] - f64::from(self.mean[i]) / PARTS).abs() > DRIFT);
        let noise = |points: u32, weight: u32| f64::from(points) / f64::from(weight);
        let sharper = noise(sums.points, sums.weight) < SHARPER * noise(self.points, self.weight);
        let begins = !self.drifted && (moved || sharper);
        self.drifted |= begins;
        begins
    }
}
