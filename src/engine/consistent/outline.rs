//! A cluster's outline: the polygon around its footprint and its holes, on its plane.
//!
//! The rings of the footprint end where the points do ([`self::rim`]), are drawn with few vertices at the same area
//! ([`self::simplify`]) and are lifted onto the plane along the footprint's axis. No ring crosses itself or another,
//! holes lie within the boundary ([`self::apart`]), and the area is that of the polygon less the holes. Costs O(r log r)
//! for r columns at the rim, however many holes there are. Lengths in m.

mod apart;
mod border;
pub(super) mod footprint;
mod rim;
mod rings;
mod simplify;
mod trace;
mod within;

use nalgebra::{Point3, UnitVector3, Vector2};

use self::apart::Comparing;
use self::footprint::{Column, Footprint};
use self::rings::{Rings, doubled_area};
use self::simplify::Simplifying;
use self::trace::{Tracing, rings};
use self::within::Within;

/// Holes of fewer columns are filled: a column or two within a surface are usually not yet dense.
const LEAST_HOLE: u32 = 4;
/// How far a ring may be moved for the sake of fewer vertices, in voxels.
const TOLERANCE: f64 = 0.5;
/// How often the tolerance is halved before a ring is left as it was traced.
const ATTEMPTS: usize = 3;

/// The plane `normal . x + d = 0`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneEquation {
    pub(crate) normal: UnitVector3<f64>,
    pub(crate) d: f64,
}

/// The outline of a cluster, fixed frame.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outline {
    /// Counter-clockwise seen from where the normal points; the last vertex joins the first. Of several parts that do
    /// not even touch at a corner, the one with most area.
    pub(crate) boundary: Vec<Point3<f64>>,
    /// Clockwise.
    pub(crate) holes: Vec<Vec<Point3<f64>>>,
    /// Area of the boundary less its holes (m^2).
    pub(crate) area: f64,
}

/// Memory to draw outlines in, one after another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drawing {
    tracing: Tracing,
    traced: Rings,
    /// The traced rings that run around a part, with the area of each less its holes (voxels^2), and those of holes.
    parts: Vec<usize>,
    areas: Vec<f64>,
    holes: Vec<usize>,
    /// The traced rings of the outline, the boundary first.
    kept: Vec<usize>,
    simplifying: Simplifying,
    /// The kept ones with few vertices.
    fewer: Rings,
    comparing: Comparing,
    within: Within,
}

impl Outline {
    /// The outline of `footprint` on `plane`, which does not hold the footprint's axis; `None` of no columns.
    pub(crate) fn new(
        footprint: &Footprint,
        plane: &PlaneEquation,
        voxel_size: f64,
        drawing: &mut Drawing,
    ) -> Option<Self> {
        Self::with(footprint, plane, voxel_size, LEAST_HOLE, TOLERANCE, drawing)
    }

    fn with(
        footprint: &Footprint,
        plane: &PlaneEquation,
        voxel_size: f64,
        least_hole: u32,
        tolerance: f64,
        drawing: &mut Drawing,
    ) -> Option<Self> {
        let origin = rings(footprint, &mut drawing.tracing, &mut drawing.traced)?;
        drawing.keep(least_hole)?;
        drawing.simplify(tolerance);
        let lift = Lift::new(footprint, plane, voxel_size, origin);
        let area: f64 = drawing.fewer.iter().map(|ring| 0.5 * doubled_area(ring)).sum();
        let mut rings = drawing.fewer.iter().map(|ring| lift.ring(ring));
        Some(Self { boundary: rings.next()?, holes: rings.collect(), area: area * lift.area })
    }
}

impl Drawing {
    /// Chooses the largest part as the boundary, and its holes; `None` where there is no part.
    fn keep(&mut self, least_hole: u32) -> Option<()> {
        let Self { traced, parts, holes, kept, .. } = self;
        let least_hole = i64::from(least_hole.max(1));
        let all = || (0..traced.len()).map(|number| (number, traced.columns(number)));
        parts.clear();
        parts.extend(all().filter(|(_, columns)| *columns >= 0).map(|(number, _)| number));
        holes.clear();
        holes.extend(all().filter(|(_, columns)| *columns <= -least_hole).map(|(number, _)| number));
        kept.clear();
        if let [part] = parts[..] {
            kept.push(part);
            kept.extend_from_slice(holes);
            return Some(());
        }
        self.keep_largest()
    }

    /// The same of several parts, of which some may stand in holes of others.
    fn keep_largest(&mut self) -> Option<()> {
        let Self { traced, parts, holes, areas, kept, within, .. } = self;
        let area = |number: &usize| 0.5 * doubled_area(traced.ring(*number));
        areas.clear();
        areas.extend(parts.iter().map(area));
        within.ask(holes.iter().map(|hole| traced.ring(*hole)));
        let owners = within.innermost(parts.iter().map(|part| traced.ring(*part)));
        for (hole, owner) in holes.iter().zip(owners) {
            // A hole is clockwise: its area is below 0.
            owner.iter().for_each(|&part| areas[part as usize] += area(hole));
        }
        // Of equal parts the first.
        let largest = (0..parts.len()).max_by(|&a, &b| areas[a].total_cmp(&areas[b]).then(b.cmp(&a)))?;
        kept.push(parts[largest]);
        let own = holes.iter().zip(owners).filter(|(_, owner)| **owner == Some(largest as u32));
        kept.extend(own.map(|(hole, _)| *hole));
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
            if self.comparing.are_apart(&self.fewer) {
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
    plane: PlaneEquation,
    voxel_size: f64,
    /// The axis of projection and the two others.
    axes: [usize; 3],
    /// Whether counter-clockwise in columns is clockwise seen from where the normal points.
    is_turned: bool,
    /// Area of a column's piece of the plane (m^2).
    area: f64,
}

impl Lift {
    fn new(footprint: &Footprint, plane: &PlaneEquation, voxel_size: f64, origin: Column) -> Self {
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

#[cfg(test)]
mod tests;
