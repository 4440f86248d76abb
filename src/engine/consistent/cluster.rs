//! What is kept of a cluster while its voxels come and go.

mod sums;

use std::sync::Arc;

use nalgebra::{Matrix3, UnitVector3, Vector3};

use serde::{Deserialize, Serialize};

use self::sums::ClusterSums;
use super::outline::footprint::{Axis, Content, Footprint};
use super::patch::Weight;
use super::state::State;
use crate::engine::class::SurfaceClass;
use crate::engine::key::{ClusterId, VoxelKey};
use crate::engine::plane::normal_towards;
use crate::engine::scan::Stamp;
use crate::engine::snapshot::{self, ClusterState};
use crate::engine::symmetric::quadratic;

/// One component of patches, and the loose voxels beside them.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub(super) identity: Identity,
    /// Over the voxels of its patches.
    pub(super) sums: ClusterSums,
    /// Voxels of its patches and those beside them.
    pub(super) voxels: u32,
    pub(super) points: u64,
    /// Voxels of its footprint.
    pub(super) outlined: u32,
    pub(super) footprint: Footprint,
    /// The plane through its patches, as [`Cluster::refit`] found it last.
    pub(super) plane: Option<ClusterPlane>,
    /// Its part of the voxels in clusters that are told of.
    pub(super) counted: u32,
    /// As it was told of last.
    pub(super) told: Option<Arc<snapshot::Cluster>>,
    /// As it was told of before this scan; while it is described.
    pub(super) before: Before,
}

/// A voxel as a cluster counts it: whatever is added is removed as the same.
#[derive(Debug)]
pub(super) struct Member<'a> {
    pub(super) key: VoxelKey,
    pub(super) state: &'a State,
    /// It is no part of the footprint.
    pub(super) is_thin: bool,
    /// What it adds to the sums follows from this; `None` for a voxel beside its patch.
    pub(super) share: Option<Share>,
}

/// What a voxel of a patch counts in the sums of its cluster. The sums that it adds are many times as long, and are found where
/// they are added.
#[derive(Debug)]
pub(super) struct Share {
    /// The lower corner of its block.
    pub(super) corner: [i32; 3],
    pub(super) weight: Weight,
    /// The normal of its patch, and the noise along it.
    pub(super) normal: UnitVector3<f64>,
    pub(super) noise: f64,
}

impl Member<'_> {
    fn sums(&self) -> Option<ClusterSums> {
        let Share { corner, weight, normal, noise } = self.share.as_ref()?;
        Some(ClusterSums::of(self.state, *corner, *weight, normal, *noise))
    }
}

/// How a cluster was told of before the scan that it is described after.
#[derive(Clone, Debug, Default)]
pub(super) enum Before {
    #[default]
    New,
    /// Its shape is the same.
    Standing(Standing),
    Other(Arc<snapshot::Cluster>),
}

/// What is told of a cluster that may change while its voxels do not, and so does not follow from these: it is saved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Standing {
    state: ClusterState,
    pub(super) class: SurfaceClass,
    class_confidence: f32,
    last_seen: Stamp,
}

impl Standing {
    pub(super) const fn of(told: &snapshot::Cluster) -> Self {
        let snapshot::Cluster { state, class, class_confidence, last_seen, .. } = *told;
        Self { state, class, class_confidence, last_seen }
    }

    /// Whether it can have been told.
    pub(super) fn is_possible(&self) -> bool {
        (0.0..=1.0).contains(&self.class_confidence)
    }

    /// Tells it of a cluster.
    pub(super) const fn restore(&self, told: &mut snapshot::Cluster) {
        let Self { state, class, class_confidence, last_seen } = *self;
        (told.state, told.class, told.class_confidence, told.last_seen) =
            (state, class, class_confidence, last_seen);
    }
}

impl Before {
    /// What it was taken for.
    pub(super) fn class(&self) -> SurfaceClass {
        match self {
            Self::New => SurfaceClass::Unknown,
            Self::Standing(standing) => standing.class,
            Self::Other(told) => told.class,
        }
    }

    /// Whether it was told of just like this.
    pub(super) fn is(&self, told: &snapshot::Cluster) -> bool {
        match self {
            Self::New => false,
            Self::Standing(before) => *before == Standing::of(told),
            Self::Other(before) => **before == *told,
        }
    }
}

/// Part of its voxels from which on a cluster has lost something. Below, voxels at its rim come and go.
const LOST: f64 = 0.1;

/// What a cluster keeps when its voxels are others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Identity {
    /// `None` while it is too small to be told of, or has no shape.
    pub(super) id: Option<ClusterId>,
    pub(super) revision: u32,
    pub(super) first_seen: Stamp,
    pub(super) last_seen: Stamp,
    /// The scan in which it last had more voxels than ever since it lost [`LOST`] of them.
    pub(super) grown: u64,
    pub(super) most_voxels: u32,
    /// Ids taken in during the newest scan that changed it.
    pub(super) merged_from: Vec<ClusterId>,
}

/// The plane of a cluster, in voxels.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClusterPlane {
    pub(super) point: Vector3<f64>,
    pub(super) normal: UnitVector3<f64>,
    /// Inverse variance at `point`. That of its turn follows by `covariance` where voxels count the same part all over it.
    pub(super) information: f64,
    pub(super) covariance: Matrix3<f64>,
    /// Mean variance of the points along their patches' normals that is noise.
    pub(super) noise: f64,
}

impl ClusterPlane {
    /// Mean square distance of the voxels' means to the plane, in voxels^2.
    pub(super) fn mean_square(&self) -> f64 {
        quadratic(&self.covariance, &self.normal).max(0.0)
    }
}

impl Identity {
    pub(super) fn new(stamp: Stamp) -> Self {
        Self {
            id: None,
            revision: 0,
            first_seen: stamp,
            last_seen: stamp,
            grown: 0,
            most_voxels: 0,
            merged_from: Vec::new(),
        }
    }

    /// Notes how many voxels it has after this scan.
    pub(super) fn count(&mut self, voxels: u32, sequence: u64) {
        if voxels > self.most_voxels {
            (self.most_voxels, self.grown) = (voxels, sequence);
        } else if f64::from(voxels) < (1.0 - LOST) * f64::from(self.most_voxels) {
            self.most_voxels = voxels;
        }
    }

    /// One that is new, of voxels that were another's.
    pub(super) fn part_of(other: &Self) -> Self {
        Self { last_seen: other.last_seen, ..Self::new(other.first_seen) }
    }

    /// It was seen whenever another one was.
    pub(super) fn was_seen_with(&mut self, other: &Self) {
        self.first_seen = self.first_seen.min(other.first_seen);
        self.last_seen = self.last_seen.max(other.last_seen);
    }

    /// Takes in what another one was.
    pub(super) fn take_in(&mut self, other: &Self) {
        self.was_seen_with(other);
        self.merged_from.extend(other.id);
    }
}

impl Cluster {
    pub(super) fn new(identity: Identity) -> Self {
        let footprint = Footprint::new(Axis::dominant(&Vector3::z_axis()));
        Self {
            identity,
            sums: ClusterSums::default(),
            voxels: 0,
            points: 0,
            outlined: 0,
            footprint,
            plane: None,
            counted: 0,
            told: None,
            before: Before::New,
        }
    }

    /// Finds its plane after its voxels have changed.
    pub(super) fn refit(&mut self) {
        self.plane = self.fit();
    }

    /// The plane through its patches; `None` where there is none.
    fn fit(&self) -> Option<ClusterPlane> {
        if self.sums.is_empty() {
            return None;
        }
        let covariance = self.sums.covariance();
        let normal = UnitVector3::new_normalize(normal_towards(&covariance, &self.sums.side()));
        let (point, information, noise) = (self.sums.mean(), self.sums.information(), self.sums.noise());
        Some(ClusterPlane { point, normal, information, covariance, noise })
    }

    pub(super) fn add(&mut self, member: &Member) {
        let Member { key, state, is_thin, .. } = member;
        self.voxels += 1;
        self.points += u64::from(state.count);
        if !is_thin {
            self.outlined += 1;
            self.footprint.add(self.footprint.axis().column(*key), &content(state, self.footprint.axis()));
        }
        if let Some(sums) = member.sums() {
            self.sums.add(&sums);
        }
    }

    pub(super) fn remove(&mut self, member: &Member) {
        let Member { key, state, is_thin, .. } = member;
        self.voxels -= 1;
        self.points -= u64::from(state.count);
        if !is_thin {
            self.outlined -= 1;
            self.footprint.remove(self.footprint.axis().column(*key), &content(state, self.footprint.axis()));
        }
        if let Some(sums) = member.sums() {
            self.sums.remove(&sums);
        }
    }

    /// Whether it can be described: it has a plane, and voxels to draw an outline around.
    pub(super) const fn has_shape(&self) -> bool {
        self.plane.is_some() && self.outlined > 0
    }
}

/// What a voxel contributes to its column, however many points it has.
pub(super) fn content(state: &State, axis: Axis) -> Content {
    let (within, covariance) = (state.offset(), state.covariance());
    let others = axis.others();
    let square = |i: usize| covariance[(i, i)].max(0.0) + within[i] * within[i];
    Content::of(others.map(|i| within[i]), others.map(square))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::patch::examples::states;

    /// The plane of a cluster of level voxels, the four rows along y below this height and the four beyond it a voxel higher, all seen
    /// from this direction, with these normals of their patches.
    fn plane_of_a_step(towards: &Vector3<f64>, normals: [UnitVector3<f64>; 2]) -> (Cluster, ClusterPlane) {
        let mut cluster = Cluster::new(Identity::new(Stamp::from_nanos(0)));
        for (normal, rows, height) in [(normals[0], 0..4, 2.3), (normals[1], 4..8, 3.3)] {
            let weight = Weight { most: 1.0, part: 1.0 };
            for state in states(1.0, towards, rows, |_| height) {
                cluster.sums.add(&ClusterSums::of(&state, [0; 3], weight, &normal, 0.0));
            }
        }
        cluster.refit();
        let plane = cluster.plane.unwrap();
        (cluster, plane)
    }

    #[test]
    fn what_is_seen_at_a_grazing_angle_faces_the_side_that_its_patches_do() {
        let up = Vector3::z_axis();
        // Within the step's plane, and on the upper side of both patches.
        let towards = Vector3::new(0.0, 1.0, 0.1).normalize();
        let (cluster, plane) = plane_of_a_step(&towards, [up, up]);
        assert!(plane.normal.dot(&towards) < -0.01, "what this is about: {:?}", plane.normal);
        assert!(plane.normal.dot(&cluster.sums.normal()) > 0.9, "{:?}", plane.normal);
    }

    #[test]
    fn where_patches_cancel_out_or_lie_across_the_plane_it_faces_the_sensor() {
        let [x, y] = [Vector3::x_axis(), Vector3::y_axis()];
        for normals in [[y, -y], [x, x]] {
            for towards in [Vector3::z(), -Vector3::z()] {
                let (_, plane) = plane_of_a_step(&towards, normals);
                assert!(plane.normal.dot(&towards) > 0.9, "{:?} of {normals:?}", plane.normal);
            }
        }
    }

    #[test]
    fn what_has_lost_a_part_and_wins_it_back_grows_and_what_flickers_at_its_rim_does_not() {
        let mut identity = Identity::new(Stamp::from_nanos(0));
        let mut grown = |voxels, sequence| {
            identity.count(voxels, sequence);
            identity.grown
        };
        assert_eq!([grown(5000, 1), grown(4600, 2), grown(4990, 3), grown(5001, 4)], [1, 1, 1, 4]);
        assert_eq!([grown(3000, 5), grown(2900, 6), grown(3001, 7), grown(3001, 8)], [4, 4, 7, 7]);
    }
}
