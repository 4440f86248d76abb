//! A cluster's outline: the polygon around its footprint and its holes, on its plane.
//!
//! The rings of the footprint end where the points do ([`super::rim`]), are drawn with few vertices at the same area
//! ([`super::simplify`]) and are lifted onto the plane along the footprint's axis. No ring crosses itself or another,
//! holes lie within the boundary, and the area is that of the polygon less the holes. Costs O(r log r) for r columns at
//! the rim. Lengths in m.

use nalgebra::{Point3, UnitVector3, Vector2};

use super::footprint::{Column, Footprint};
use super::rings::{Rings, doubled_area, edges, lies_within};
use super::simplify::Simplifying;
use super::trace::{Tracing, rings};

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
    /// How far a ring may be moved for the sake of fewer vertices, in voxels.
    pub(crate) tolerance: f64,
}

impl Default for Detail {
    fn default() -> Self {
        Self { least_hole: 4, tolerance: 0.5 }
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
}

/// Memory to draw outlines in, one after another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drawing {
    tracing: Tracing,
    traced: Rings,
    /// The traced rings of the outline, the boundary first.
    kept: Vec<usize>,
    simplifying: Simplifying,
    /// The kept ones with few vertices.
    fewer: Rings,
    edges: Vec<Edge>,
}

impl Outline {
    /// The outline of `footprint` on `plane`, which does not hold the footprint's axis; `None` of no columns.
    pub(crate) fn new(
        footprint: &Footprint,
        plane: &Plane,
        voxel_size: f64,
        detail: &Detail,
        drawing: &mut Drawing,
    ) -> Option<Self> {
        let origin = rings(footprint, &mut drawing.tracing, &mut drawing.traced)?;
        drawing.keep(detail.least_hole)?;
        drawing.simplify(detail.tolerance);
        let lift = Lift::new(footprint, plane, voxel_size, origin);
        let area: f64 = drawing.fewer.iter().map(|ring| 0.5 * doubled_area(ring)).sum();
        let mut rings = drawing.fewer.iter().map(|ring| lift.ring(ring));
        Some(Self { boundary: rings.next()?, holes: rings.collect(), area: area * lift.area })
    }
}

impl Drawing {
    /// Chooses the largest part as the boundary, and its holes; `None` where there is no part.
    fn keep(&mut self, least_hole: u32) -> Option<()> {
        let Self { traced, kept, .. } = self;
        let is_part = |&number: &usize| traced.columns(number) >= 0;
        let area = |number: usize| 0.5 * doubled_area(traced.ring(number));
        let mut largest = None;
        for part in (0..traced.len()).filter(is_part) {
            let area = area(part);
            // Of equal parts the first.
            if largest.is_none_or(|(_, most)| area > most) {
                largest = Some((part, area));
            }
        }
        let (boundary, _) = largest?;
        kept.clear();
        kept.push(boundary);
        let others = (0..traced.len()).filter(is_part).filter(|part| *part != boundary);
        let is_alone = others.clone().next().is_none();
        let is_large = |&number: &usize| traced.columns(number) <= -i64::from(least_hole);
        for hole in (0..traced.len()).filter(|number| !is_part(number)).filter(is_large) {
            // A part may stand in a hole of the boundary and have holes of its own.
            let is_in = |ring: usize| lies_within(traced.ring(hole)[0], traced.ring(ring));
            if is_alone || is_in(boundary) && !others.clone().any(is_in) {
                kept.push(hole);
            }
        }
        Some(())
    }

    /// Draws the kept rings with as few vertices as `tolerance` allows without one that crosses itself or another.
    fn simplify(&mut self, mut tolerance: f64) {
        for _ in 0..ATTEMPTS {
            self.fewer.clear();
            for &number in &self.kept {
                self.simplifying.draw(self.traced.ring(number), tolerance, &mut self.fewer);
                self.fewer.end(self.traced.columns(number));
            }
            if are_apart(&self.fewer, &mut self.edges) {
                return;
            }
            tolerance *= 0.5;
        }
        self.fewer.clear();
        for &number in &self.kept {
            self.traced.ring(number).iter().for_each(|vertex| self.fewer.push(*vertex));
            self.fewer.end(self.traced.columns(number));
        }
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

/// Whether no edge of these rings meets another but at its ends, and all rings lie within the first.
fn are_apart(rings: &Rings, memory: &mut Vec<Edge>) -> bool {
    memory.clear();
    for (ring, vertices) in rings.iter().enumerate() {
        let of = vertices.len();
        let edge = |(place, (&a, &b))| Edge { ring, place, of, ends: [a, b] };
        memory.extend(edges(vertices).enumerate().map(edge));
    }
    memory.sort_unstable_by(|a, b| a.least().total_cmp(&b.least()));
    for (i, edge) in memory.iter().enumerate() {
        let most = edge.ends[0].x.max(edge.ends[1].x);
        if memory[i + 1..].iter().take_while(|other| other.least() <= most).any(|other| edge.meets(other)) {
            return false;
        }
    }
    rings.iter().skip(1).all(|hole| lies_within(hole[0], rings.ring(0)))
}

/// One edge of several rings.
#[derive(Clone, Debug)]
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

#[cfg(test)]
mod tests;
