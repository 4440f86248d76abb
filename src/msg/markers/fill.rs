//! Triangles that fill a cluster's boundary less its holes.
//!
//! Found anew for every message: a floor of 500 vertices and 20 holes takes 0.2 ms (`benches/markers.rs`), which nothing that
//! is kept between messages would repay.

use earcut::Earcut;
use nalgebra::{Point3, Vector2};

use crate::engine::Cluster;

/// Twice the area of a triangle (m^2) up to which rounding decides which way round its corners are: those of vertices in a
/// row. They show nothing.
const SLIVER: f64 = 1e-12;

/// Triangles that cover the cluster's polygon once, each counter-clockwise seen from where its normal points: RViz draws
/// both sides of a triangle and lights the one that it is counter-clockwise from.
pub(super) fn triangles(earcut: &mut Earcut<f64>, cluster: &Cluster) -> Vec<[Point3<f64>; 3]> {
    let rings = std::iter::once(&cluster.boundary).chain(&cluster.holes);
    let vertices: Vec<&Point3<f64>> = rings.clone().flatten().collect();
    let flat: Vec<Vector2<f64>> = vertices.iter().map(|vertex| flattened(cluster, vertex)).collect();
    let ends = rings.scan(0, |end, ring| {
        *end += ring.len();
        Some(*end)
    });
    // Where the holes begin: at the end of the ring before.
    let holes: Vec<usize> = ends.take(cluster.holes.len()).collect();
    let mut indices = Vec::new();
    earcut.earcut(flat.iter().map(|vertex| [vertex.x, vertex.y]), &holes, &mut indices);
    let (corners, _) = indices.as_chunks();
    corners
        .iter()
        .filter_map(|&[a, b, c]| turned(&flat, [a, b, c]))
        .map(|corners| corners.map(|i| *vertices[i]))
        .collect()
}

/// A vertex on the axes of the cluster's pose, of which z is the normal.
fn flattened(cluster: &Cluster, vertex: &Point3<f64>) -> Vector2<f64> {
    cluster.pose.inverse_transform_point(vertex).coords.xy()
}

/// These corners counter-clockwise; `None` of a sliver.
fn turned(flat: &[Vector2<f64>], [a, b, c]: [usize; 3]) -> Option<[usize; 3]> {
    let doubled = (flat[b] - flat[a]).perp(&(flat[c] - flat[a]));
    (doubled.abs() > SLIVER).then_some(if doubled < 0.0 { [a, c, b] } else { [a, b, c] })
}
