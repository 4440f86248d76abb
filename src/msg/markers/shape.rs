//! A marker for each thing that is shown.
//!
//! What one can look through is drawn by viewers after all else, from the farthest to the nearest by the places of the markers'
//! poses; so a polygon's pose is the middle of its box, and its points are given from there. That keeps its shape too where
//! the map is far from its origin, for viewers reckon in 32 bits.

use nalgebra::Point3;

use super::shown::Shown;
use super::{CLUSTERS, NAMES, NORMALS, OUTLINES, SURFACES, UNCLUSTERED};
use crate::colour::cluster_colour;
use crate::engine::{Cluster, ClusterId, ClusterState, DenseVoxel, SurfaceClass};
use crate::msg::clusters::point;
use crate::msg::ros::{ColorRgba, Header, Marker, Point, Vector3};

/// Opacity of surfaces: what is behind one stays visible. Paler where it cannot be relied on yet.
const RELIABLE: f32 = 0.7;
const TENTATIVE: f32 = 0.25;

/// Length of a cluster's normal, in voxels.
const NORMAL: f64 = 4.0;

/// What all markers of a message have in common.
pub(super) struct Style<'a> {
    pub(super) header: &'a Header,
    pub(super) voxel_size: f64,
}

impl Style<'_> {
    /// The filled polygon; `None` where there is nothing to fill: a list without points is an error to viewers.
    pub(super) fn surface(
        &self,
        slot: i32,
        cluster: &Cluster,
        triangles: &[[Point3<f64>; 3]],
    ) -> Option<Marker> {
        (!triangles.is_empty()).then(|| Marker {
            scale: Vector3 { x: 1.0, y: 1.0, z: 1.0 },
            color: colour(Some(cluster.id), opacity(cluster)),
            points: triangles.as_flattened().iter().map(|corner| from_middle(cluster, corner)).collect(),
            // Shown by no viewer, and read by those who look for a cluster.
            text: cluster.id.to_string(),
            ..self.around(cluster, SURFACES, slot, Marker::TRIANGLE_LIST)
        })
    }

    /// The edges of boundary and holes. A list, for one marker can hold one strip only.
    pub(super) fn outline(&self, slot: i32, cluster: &Cluster) -> Marker {
        let is_tentative = cluster.state == ClusterState::Tentative;
        let rings = std::iter::once(&cluster.boundary).chain(&cluster.holes);
        let edges = rings.flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
        Marker {
            scale: Vector3 { x: 0.2 * self.voxel_size, y: 0.0, z: 0.0 },
            color: colour(Some(cluster.id), if is_tentative { 2.0 * TENTATIVE } else { 1.0 }),
            points: edges.flat_map(|(from, to)| [from, to].map(|end| from_middle(cluster, end))).collect(),
            ..self.around(cluster, OUTLINES, slot, Marker::LINE_LIST)
        }
    }

    /// A marker with its points given from the middle of the cluster's box.
    fn around(&self, cluster: &Cluster, ns: &str, slot: i32, kind: i32) -> Marker {
        let mut marker = marker(self.header, ns, slot, kind);
        marker.pose.position = point(&cluster.pose.translation.vector.into());
        marker
    }

    /// Id and class, before the tip of its normal; `None` of a cluster that cannot be relied on: there are many of these,
    /// small and short-lived.
    pub(super) fn name(&self, slot: i32, cluster: &Cluster) -> Option<Marker> {
        if cluster.state == ClusterState::Tentative {
            return None;
        }
        let mut name = marker(self.header, NAMES, slot, Marker::TEXT_VIEW_FACING);
        let before = cluster.normal.into_inner() * ((NORMAL + 1.0) * self.voxel_size);
        name.pose.position = point(&(cluster.centroid + before));
        name.scale.z = self.height(cluster);
        name.color = ColorRgba { r: 1.0, g: 1.0, b: 1.0, a: 1.0 };
        name.text = match cluster.class {
            SurfaceClass::Unknown => cluster.id.to_string(),
            class => format!("{} {}", cluster.id, class.name()),
        };
        Some(name)
    }

    /// Height of a name (m): a dozen characters are as long as the surface at most, within what can be read.
    fn height(&self, cluster: &Cluster) -> f64 {
        let fitting = (cluster.size.x / 6.0).min(cluster.size.y / 2.0);
        fitting.clamp(self.voxel_size, 4.0 * self.voxel_size)
    }

    /// The voxels of a cluster without a boundary.
    pub(super) fn cubes(&self, slot: i32, id: ClusterId, voxels: &[&DenseVoxel]) -> Marker {
        Marker {
            color: colour(Some(id), 1.0),
            text: id.to_string(),
            ..self.cube_list(CLUSTERS, slot, voxels)
        }
    }

    /// The voxels in no cluster.
    pub(super) fn unclustered(&self, voxels: &[&DenseVoxel]) -> Option<Marker> {
        let cubes = || Marker { color: colour(None, 1.0), ..self.cube_list(UNCLUSTERED, 0, voxels) };
        (!voxels.is_empty()).then(cubes)
    }

    fn cube_list(&self, ns: &str, id: i32, voxels: &[&DenseVoxel]) -> Marker {
        // A little smaller than a voxel, so that single cubes can be told apart.
        let edge = 0.9 * self.voxel_size;
        Marker {
            scale: Vector3 { x: edge, y: edge, z: edge },
            points: voxels.iter().map(|voxel| point(&voxel.centre)).collect(),
            ..marker(self.header, ns, id, Marker::CUBE_LIST)
        }
    }

    /// The normals of clusters with a boundary, and those of the voxels of the others.
    pub(super) fn normals(&self, shown: &Shown) -> Option<Marker> {
        let of_cluster = |cluster: &&Cluster| {
            segment(&cluster.centroid, cluster.normal.into_inner() * (NORMAL * self.voxel_size))
        };
        let of_voxel =
            |voxel: &&DenseVoxel| Some(segment(&voxel.centre, voxel.normal?.into_inner() * self.voxel_size));
        let members = shown.heaps.iter().flat_map(|(_, voxels)| voxels);
        let segments = shown.polygons.iter().map(of_cluster).chain(members.filter_map(of_voxel));
        let points: Vec<Point> = segments.flatten().collect();
        (!points.is_empty()).then(|| Marker {
            scale: Vector3 { x: 0.1 * self.voxel_size, y: 0.0, z: 0.0 },
            color: ColorRgba { r: 1.0, g: 1.0, b: 1.0, a: 1.0 },
            points,
            ..marker(self.header, NORMALS, 0, Marker::LINE_LIST)
        })
    }
}

/// Not locked to its frame, though it then goes where viewers show another frame and know no transform of its stamp any more:
/// RViz makes what is locked anew in every picture, all of its points.
pub(super) fn marker(header: &Header, ns: &str, id: i32, kind: i32) -> Marker {
    Marker { header: header.clone(), ns: ns.to_owned(), id, kind, action: Marker::ADD, ..Marker::default() }
}

fn from_middle(cluster: &Cluster, corner: &Point3<f64>) -> Point {
    point(&(corner - cluster.pose.translation.vector))
}

fn segment(from: &Point3<f64>, along: nalgebra::Vector3<f64>) -> [Point; 2] {
    [point(from), point(&(from + along))]
}

fn colour(id: Option<ClusterId>, a: f32) -> ColorRgba {
    let [r, g, b] = cluster_colour(id).map(|c| f32::from(c) / 255.0);
    ColorRgba { r, g, b, a }
}

/// Opacity of a surface. A floor hides nothing of interest; but its middle can be nearer than that of the table above it,
/// through which it would then be seen.
fn opacity(cluster: &Cluster) -> f32 {
    match (cluster.state, cluster.class) {
        (ClusterState::Tentative, _) => TENTATIVE,
        (_, SurfaceClass::Floor) => 1.0,
        _ => RELIABLE,
    }
}
