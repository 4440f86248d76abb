//! A cluster's outline: the polygon around its footprint and its holes, on its plane.
//!
//! The rings of the footprint end where the points do ([`super::rim`]), are drawn with few vertices at the same area
//! ([`super::simplify`]) and are lifted onto the plane along the footprint's axis. No ring crosses itself or another,
//! holes lie within the boundary, and the area is that of the polygon less the holes. Costs O(r log r) for r columns at
//! the rim. Lengths in m.

use nalgebra::{Point3, UnitVector3, Vector2};

use super::footprint::{Column, Footprint};
use super::simplify::{doubled_area, simplified};
use super::trace::{Ring, rings};

/// How often the tolerance is halved before a ring is left as it was traced.
const ATTEMPTS: usize = 3;

/// The plane `normal . x + d = 0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) normal: UnitVector3<f64>,
    pub(crate) d: f64,
}

/// What an outline leaves out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Detail {
    /// Holes of fewer columns are filled: a column or two within a surface are usually not yet dense.
    pub(crate) least_hole: u32,
    /// Points from which on a voxel is dense: a surface reaches a little further than its dense voxels.
    pub(crate) min_points: u32,
    /// How far a ring may be moved for the sake of fewer vertices, in voxels.
    pub(crate) tolerance: f64,
}

impl Default for Detail {
    fn default() -> Self {
        Self { least_hole: 4, min_points: 15, tolerance: 0.5 }
    }
}

/// The outline of a cluster, fixed frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outline {
    /// Counter-clockwise seen from where the normal points; the last vertex joins the first. Of several parts that do
    /// not even touch at a corner, the largest.
    pub(crate) boundary: Vec<Point3<f64>>,
    /// Clockwise.
    pub(crate) holes: Vec<Vec<Point3<f64>>>,
    /// Of the boundary less its holes (m^2).
    pub(crate) area: f64,
    /// Of the other parts (m^2), their holes not taken off; 0 where the boundary goes around all.
    pub(crate) area_left_out: f64,
}

impl Outline {
    /// The outline of `footprint` on `plane`, which does not hold the footprint's axis; `None` of no columns.
    pub(crate) fn new(
        footprint: &Footprint,
        plane: &Plane,
        voxel_size: f64,
        detail: &Detail,
    ) -> Option<Self> {
        let origin = footprint.rim().next()?;
        let (holes, mut parts): (Vec<Ring>, Vec<Ring>) =
            rings(footprint, origin, detail.min_points).into_iter().partition(|ring| ring.columns < 0);
        let areas: Vec<f64> = parts.iter().map(|ring| 0.5 * doubled_area(&ring.vertices)).collect();
        // Of equal parts the first.
        let largest = (0..parts.len()).rev().max_by(|&a, &b| areas[a].total_cmp(&areas[b]))?;
        let boundary = parts.swap_remove(largest);
        let mut kept = vec![boundary.vertices];
        for hole in holes {
            let counts = hole.columns.unsigned_abs() >= u64::from(detail.least_hole);
            // A part may stand in a hole of the boundary and have holes of its own.
            let is_in = |ring: &Vec<Vector2<f64>>| lies_within(hole.vertices[0], ring);
            if counts
                && (parts.is_empty() || is_in(&kept[0]) && !parts.iter().any(|part| is_in(&part.vertices)))
            {
                kept.push(hole.vertices);
            }
        }
        let kept = with_few_vertices(kept, detail.tolerance);

        let lift = Lift::new(footprint, plane, voxel_size, origin);
        let area: f64 = kept.iter().map(|ring| 0.5 * doubled_area(ring)).sum();
        let all: f64 = areas.iter().sum();
        let mut rings = kept.iter().map(|ring| lift.ring(ring));
        Some(Self {
            boundary: rings.next()?,
            holes: rings.collect(),
            area: area * lift.area,
            area_left_out: (all - areas[largest]) * lift.area,
        })
    }
}

/// From columns to the plane.
struct Lift {
    origin: Column,
    plane: Plane,
    voxel_size: f64,
    /// The axis of projection and the two others.
    axes: [usize; 3],
    /// Whether counter-clockwise in columns is clockwise seen from where the normal points.
    is_turned: bool,
    /// Of a column's piece of the plane (m^2).
    area: f64,
}

impl Lift {
    fn new(footprint: &Footprint, plane: &Plane, voxel_size: f64, origin: Column) -> Self {
        let axis = footprint.axis().index();
        let [u, v] = footprint.axis().others();
        let along = plane.normal[axis];
        // x to z is the one pair that turns against its axis.
        let is_turned = (along < 0.0) != (axis == 1);
        let area = voxel_size * voxel_size / along.abs();
        Self { origin, plane: *plane, voxel_size, axes: [axis, u, v], is_turned, area }
    }

    fn ring(&self, ring: &[Vector2<f64>]) -> Vec<Point3<f64>> {
        let mut points: Vec<_> = ring.iter().map(|vertex| self.point(vertex)).collect();
        if self.is_turned {
            points.reverse();
        }
        points
    }

    fn point(&self, vertex: &Vector2<f64>) -> Point3<f64> {
        let [axis, u, v] = self.axes;
        let normal = &self.plane.normal;
        let mut point = Point3::origin();
        point[u] = (f64::from(self.origin[0]) + vertex.x) * self.voxel_size;
        point[v] = (f64::from(self.origin[1]) + vertex.y) * self.voxel_size;
        point[axis] = -(self.plane.d + normal[u] * point[u] + normal[v] * point[v]) / normal[axis];
        point
    }
}

/// Rings with as few vertices as `tolerance` allows without one that crosses itself or another.
fn with_few_vertices(rings: Vec<Vec<Vector2<f64>>>, tolerance: f64) -> Vec<Vec<Vector2<f64>>> {
    let mut tolerance = tolerance;
    for _ in 0..ATTEMPTS {
        let fewer: Vec<_> = rings.iter().map(|ring| simplified(ring, tolerance)).collect();
        if are_apart(&fewer) {
            return fewer;
        }
        tolerance *= 0.5;
    }
    rings
}

/// Whether no edge of these rings meets another but at its ends, and all rings lie within the first.
pub(super) fn are_apart(rings: &[Vec<Vector2<f64>>]) -> bool {
    let mut edges = Vec::new();
    for (ring, vertices) in rings.iter().enumerate() {
        let n = vertices.len();
        edges.extend((0..n).map(|i| Edge {
            ring,
            place: i,
            of: n,
            ends: [vertices[i], vertices[(i + 1) % n]],
        }));
    }
    edges.sort_by(|a, b| a.least().total_cmp(&b.least()));
    for (i, edge) in edges.iter().enumerate() {
        let most = edge.ends[0].x.max(edge.ends[1].x);
        if edges[i + 1..].iter().take_while(|other| other.least() <= most).any(|other| edge.meets(other)) {
            return false;
        }
    }
    rings.iter().skip(1).all(|hole| lies_within(hole[0], &rings[0]))
}

/// One edge of several rings.
struct Edge {
    ring: usize,
    /// Its number in the ring, and how many there are.
    place: usize,
    of: usize,
    ends: [Vector2<f64>; 2],
}

impl Edge {
    fn least(&self) -> f64 {
        self.ends[0].x.min(self.ends[1].x)
    }

    /// Whether the two have a point in common that is not the vertex between them.
    fn meets(&self, other: &Self) -> bool {
        let [a, b] = self.ends;
        let [c, d] = other.ends;
        if self.ring == other.ring {
            let is_next = (self.place + 1) % self.of == other.place;
            let is_before = (other.place + 1) % self.of == self.place;
            if is_next || is_before {
                // Neighbours meet again only where the ring turns back onto itself.
                let (along, on) = if is_next { (b - a, d - c) } else { (d - c, b - a) };
                return along.perp(&on) == 0.0 && along.dot(&on) < 0.0;
            }
        }
        let side = |p: Vector2<f64>, q: Vector2<f64>, r: Vector2<f64>| (q - p).perp(&(r - p));
        let overlap = |axis: usize| {
            a[axis].min(b[axis]) <= c[axis].max(d[axis]) && c[axis].min(d[axis]) <= a[axis].max(b[axis])
        };
        overlap(0)
            && overlap(1)
            && side(a, b, c) * side(a, b, d) <= 0.0
            && side(c, d, a) * side(c, d, b) <= 0.0
    }
}

/// Whether a point lies within a ring (even-odd).
pub(super) fn lies_within(point: Vector2<f64>, ring: &[Vector2<f64>]) -> bool {
    let next = ring.iter().cycle().skip(1);
    let crosses = |(a, b): &(&Vector2<f64>, &Vector2<f64>)| {
        (a.y > point.y) != (b.y > point.y) && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    ring.iter().zip(next).filter(crosses).count() % 2 == 1
}

#[cfg(test)]
mod tests;
