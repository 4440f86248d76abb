//! What a method has found, held against the truth, for each surface and each cluster.

use std::collections::BTreeMap;

use super::confidence::StatedClass;
use super::failures::failures;
use super::found::{Found, FoundCluster};
use super::pieces::{TrueSurface, Truth};
use super::plane::{is_another, nees};
use crate::engine::{MIN_RELIABLE_VOXELS, VoxelKey};
use crate::rand_index::adjusted_rand_index;

/// How one method did in one run.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// The seen surfaces, in the order of [`Truth::surfaces`].
    pub surfaces: Vec<SurfaceScore>,
    /// The clusters that hold a scored voxel, by number.
    pub clusters: Vec<ClusterScore>,
    /// Adjusted Rand index over the scored voxels; those in no cluster are each a cluster of their own; `None` without any.
    pub rand_index: Option<f64>,
    /// Of the scans at which it was looked at the share on which the partition was what the method's definition gives from scratch.
    pub as_from_scratch: Option<f64>,
    /// Which of the things that a method may leave out it computes.
    pub computes: Computes,
    /// What does not hold, in words.
    pub failures: Vec<String>,
}

/// What a method computes for at least one cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Computes {
    /// Areas.
    pub area: bool,
    /// Classes.
    pub class: bool,
    /// Covariances of planes.
    pub certainty: bool,
}

/// A seen surface and the cluster that holds most of its scored voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceScore {
    /// Its name.
    pub name: String,
    /// Area that was seen (m^2).
    pub seen_area: f64,
    /// Whether it has a plane to be found.
    pub has_plane: bool,
    /// Whether it is that plane alone, not several close to it.
    pub is_one_plane: bool,
    /// Number of scored voxels.
    pub scored: u32,
    /// Those of them that are in a cluster.
    pub clustered: u32,
    /// The clusters that hold some of them, and how many, the most first.
    pub holders: Vec<(u64, u32)>,
    /// Seen area whose class was found (m^2): each of its clusters has the share of the area that it has of the scored voxels.
    pub class_right: f64,
    /// How sure its clusters are of their classes.
    pub stated: Vec<StatedClass>,
    /// How the cluster that holds the most describes it; `None` where none of them is in a cluster.
    pub described: Option<Described>,
}

/// A cluster's description, held against the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Described {
    /// Between the normals (degrees), 0 to 180; `None` where the surface is bent.
    pub angle: Option<f64>,
    /// Distance of the true plane from the found one at the middle of the seen cells (m); `None` where the surface is bent.
    pub offset: Option<f64>,
    /// (found - seen) / seen area, of one that is bent in the cluster's plane.
    pub area_error: Option<f64>,
    /// Normalised estimation error squared of the plane, 3 degrees of freedom; `None` where the truth is not one plane, or not this.
    pub nees: Option<f64>,
    /// Standard deviation of the plane's offset (m).
    pub offset_sigma: Option<f64>,
}

/// A cluster that holds scored voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct ClusterScore {
    /// Its number.
    pub number: u64,
    /// All its voxels.
    pub voxels: u32,
    /// Those that are scored.
    pub scored: u32,
    /// Whether one of them is of a seen surface.
    pub of_seen: bool,
    /// Its scored voxels by surface, the most first.
    pub surfaces: Vec<(String, u32)>,
}

impl SurfaceScore {
    /// Share of the scored voxels that the cluster which holds the most of them holds.
    pub fn wholeness(&self) -> f64 {
        self.holders.first().map_or(0.0, |(_, count)| f64::from(*count) / f64::from(self.scored))
    }

    /// Whether the cluster that holds the most describes another surface: see [`is_another`].
    pub(super) fn is_described_as_another(&self) -> bool {
        self.described.and_then(|described| described.angle).is_some_and(is_another)
    }
}

impl ClusterScore {
    /// Share of the scored voxels that belong to another surface than most of them.
    pub fn impurity(&self) -> f64 {
        self.surfaces.first().map_or(0.0, |(_, count)| 1.0 - f64::from(*count) / f64::from(self.scored))
    }

    /// Whether it is large enough to be relied on.
    pub const fn is_large(&self) -> bool {
        self.voxels >= MIN_RELIABLE_VOXELS
    }
}

impl Truth {
    /// Holds what a method has found against the truth.
    pub(super) fn score(&self, found: &Found) -> Quality {
        let cluster_of: BTreeMap<VoxelKey, u64> =
            found.voxels.iter().filter_map(|(key, cluster)| Some((*key, (*cluster)?))).collect();
        let mut quality = Quality {
            surfaces: self.surface_scores(found, &cluster_of),
            clusters: self.cluster_scores(&cluster_of),
            rand_index: self.rand_index(&cluster_of),
            as_from_scratch: None,
            computes: Computes {
                area: found.clusters.values().any(|cluster| cluster.area.is_some()),
                class: found.clusters.values().any(|cluster| cluster.class.is_some()),
                certainty: found.clusters.values().any(|cluster| cluster.certainty.is_some()),
            },
            failures: Vec::new(),
        };
        quality.failures = failures(&quality);
        quality
    }

    fn surface_scores(&self, found: &Found, cluster_of: &BTreeMap<VoxelKey, u64>) -> Vec<SurfaceScore> {
        let mut counts: Vec<BTreeMap<u64, u32>> = vec![BTreeMap::new(); self.surfaces.len()];
        for (key, surface) in &self.scored {
            if let Some(cluster) = cluster_of.get(key) {
                *counts[*surface].entry(*cluster).or_default() += 1;
            }
        }
        let seen = self.surfaces.iter().zip(counts).filter(|(surface, _)| surface.is_seen());
        let scores = seen.map(|(surface, counts)| {
            let holders = most_first(counts);
            let cluster = holders.first().and_then(|(number, _)| found.clusters.get(number));
            let held = holders.iter().filter_map(|(number, count)| {
                Some((found.clusters.get(number)?, f64::from(*count) / f64::from(surface.scored)))
            });
            SurfaceScore {
                name: surface.name.clone(),
                seen_area: surface.seen_area,
                has_plane: surface.plane.is_some(),
                is_one_plane: surface.plane.is_some() && surface.is_one_plane,
                scored: surface.scored,
                clustered: holders.iter().map(|(_, count)| count).sum(),
                class_right: held
                    .clone()
                    .map(|(cluster, share)| surface.area_of(cluster.class) * share)
                    .sum(),
                stated: held
                    .filter_map(|(cluster, share)| {
                        let (area, right) = (surface.seen_area, surface.area_of(cluster.class));
                        Some(StatedClass {
                            confidence: cluster.confidence?,
                            area: area * share,
                            right: right * share,
                        })
                    })
                    .collect(),
                described: cluster.map(|cluster| describe(surface, cluster)),
                holders,
            }
        });
        scores.collect()
    }

    fn cluster_scores(&self, cluster_of: &BTreeMap<VoxelKey, u64>) -> Vec<ClusterScore> {
        let mut voxels: BTreeMap<u64, u32> = BTreeMap::new();
        cluster_of.values().for_each(|cluster| *voxels.entry(*cluster).or_default() += 1);
        let mut counts: BTreeMap<u64, BTreeMap<usize, u32>> = BTreeMap::new();
        for (key, surface) in &self.scored {
            if let Some(cluster) = cluster_of.get(key) {
                *counts.entry(*cluster).or_default().entry(*surface).or_default() += 1;
            }
        }
        let scores = counts.into_iter().map(|(number, counts)| ClusterScore {
            number,
            voxels: voxels[&number],
            scored: counts.values().sum(),
            of_seen: counts.keys().any(|surface| self.surfaces[*surface].is_seen()),
            surfaces: most_first(counts)
                .into_iter()
                .map(|(surface, count)| (self.surfaces[surface].name.clone(), count))
                .collect(),
        });
        scores.collect()
    }

    fn rand_index(&self, cluster_of: &BTreeMap<VoxelKey, u64>) -> Option<f64> {
        // A voxel in no cluster has a name that no other voxel has.
        let pairs = self.scored.iter().map(|(key, surface)| {
            let cluster = cluster_of.get(key).copied();
            (*surface, (cluster, cluster.is_none().then_some(*key)))
        });
        let pairs: Vec<_> = pairs.collect();
        (!pairs.is_empty()).then(|| adjusted_rand_index(&pairs))
    }
}

fn most_first<K: Ord>(counts: BTreeMap<K, u32>) -> Vec<(K, u32)> {
    let mut counts: Vec<_> = counts.into_iter().collect();
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    counts
}

fn describe(surface: &TrueSurface, cluster: &FoundCluster) -> Described {
    let stated = cluster.certainty.as_ref();
    let angle = surface.plane.map(|plane| cluster.plane.angle(&plane));
    let exact = surface.plane.filter(|_| surface.is_one_plane && !angle.is_some_and(is_another));
    Described {
        angle,
        offset: surface.plane.zip(surface.middle).map(|(plane, middle)| {
            // The middle of cells on several rectangles may lie beside their plane.
            let on_truth = middle - plane.normal * plane.height(&middle);
            cluster.plane.height(&on_truth).abs()
        }),
        area_error: cluster.area.map(|area| area / surface.area_on(&cluster.plane) - 1.0),
        nees: exact.zip(stated).map(|(plane, stated)| nees(&plane, &cluster.plane, stated)),
        offset_sigma: stated.map(|stated| stated.covariance[(2, 2)].sqrt()),
    }
}
