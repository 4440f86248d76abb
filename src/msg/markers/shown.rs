//! What of a map is drawn: within bounds on one message, the same for the same map.

use std::collections::BTreeMap;

use crate::engine::{Cluster, DenseVoxel, Snapshot};

/// Most cubes of one message: RViz chokes on more. What is beyond is left out and must be said.
pub const MAX_CUBES: usize = 20_000;

/// Most points of surfaces and outlines in one message, 2.4 MB. What does not fit beside larger clusters is left out, which must be
/// said.
pub const MAX_POINTS: usize = 100_000;

/// What is drawn.
#[derive(Default)]
pub(super) struct Shown<'a> {
    /// Clusters with a boundary, by ascending id.
    pub(super) polygons: Vec<&'a Cluster>,
    /// Clusters without one, by ascending id, with their voxels.
    pub(super) heaps: Vec<(&'a Cluster, Vec<&'a DenseVoxel>)>,
    /// Voxels in no cluster, by ascending key.
    pub(super) unclustered: Vec<&'a DenseVoxel>,
}

impl<'a> Shown<'a> {
    pub(super) fn of(snapshot: &'a Snapshot) -> Self {
        let mut shown = Self { polygons: polygons(snapshot), ..Self::default() };
        let mut heaps = BTreeMap::<_, Vec<_>>::new();
        let mut cubes = 0;
        for voxel in &snapshot.voxels {
            match voxel.cluster.map(|id| snapshot.clusters.binary_search_by_key(&id, |cluster| cluster.id)) {
                None => shown.unclustered.push(voxel),
                Some(Ok(place)) if !is_polygon(&snapshot.clusters[place]) => {
                    heaps.entry(place).or_default().push(voxel);
                }
                Some(_) => continue,
            }
            cubes += 1;
            if cubes == MAX_CUBES {
                break;
            }
        }
        shown.heaps = heaps.into_iter().map(|(place, voxels)| (&snapshot.clusters[place], voxels)).collect();
        shown
    }
}

/// A sentence for surfaces and one for cubes, where some are left out.
pub(in crate::msg) fn left_out(snapshot: &Snapshot) -> [Option<String>; 2] {
    let polygons_of_all = snapshot.clusters.iter().filter(|cluster| is_polygon(cluster)).count();
    let drawn = polygons(snapshot).len();
    let surfaces = (drawn < polygons_of_all).then(|| {
        format!(
            "~/markers shows {drawn} of {polygons_of_all} surfaces, the largest that fit into {MAX_POINTS} points"
        )
    });
    let members = snapshot.clusters.iter().filter(|cluster| !is_polygon(cluster));
    let all = members.map(|cluster| cluster.voxel_count as usize).sum::<usize>();
    let all = all + snapshot.unclustered_voxels as usize;
    let cubes =
        (all > MAX_CUBES).then(|| format!("~/markers shows the first {MAX_CUBES} of {all} voxels as cubes"));
    [surfaces, cubes]
}

fn is_polygon(cluster: &Cluster) -> bool {
    cluster.boundary.len() >= 3
}

/// The clusters with a boundary that fit, the largest first; by ascending id.
fn polygons(snapshot: &Snapshot) -> Vec<&Cluster> {
    let mut clusters: Vec<_> = snapshot.clusters.iter().filter(|cluster| is_polygon(cluster)).collect();
    clusters.sort_by(|a, b| b.area.unwrap_or(0.0).total_cmp(&a.area.unwrap_or(0.0)));
    let mut points = 0;
    clusters.retain(|cluster| {
        let with = points + points_of(cluster);
        let fits = with <= MAX_POINTS;
        if fits {
            points = with;
        }
        fits
    });
    clusters.sort_by_key(|cluster| cluster.id);
    clusters
}

/// Points of a cluster's surface and outline, at most: a polygon of n vertices with h holes has n + 2 h - 2 triangles.
fn points_of(cluster: &Cluster) -> usize {
    let vertices = cluster.boundary.len() + cluster.holes.iter().map(Vec::len).sum::<usize>();
    3 * (vertices + 2 * cluster.holes.len() - 2) + 2 * vertices
}
