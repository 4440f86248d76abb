//! The rings around a set of columns, their vertices where the points really end.
//!
//! Rings are those of marching squares over the columns' middles: a vertex lies between the middles of a column inside
//! and a neighbour outside, strictly between, one on each such pair; columns that touch at a corner are joined there.
//! Therefore no ring crosses itself or another, whatever the points say of where it lies. A column of the rim of which
//! less than half is covered counts as outside, so that the ring may pass through it below its middle, unless that would
//! tear the columns apart or leave nothing of a thin part. Costs O(rim).

use hashbrown::{HashMap, HashSet};
use nalgebra::Vector2;
use rustc_hash::FxBuildHasher;

use super::footprint::{Column, Footprint, beyond};
use super::rim::Cut;

/// A vertex keeps this distance from the middles of columns, in columns.
const CLEARANCE: f64 = 0.02;

/// A closed line around columns, the last vertex joins the first.
#[derive(Clone, Debug)]
pub(crate) struct Ring {
    /// In columns, from the lower corner of the column that was handed in as the origin.
    pub(crate) vertices: Vec<Vector2<f64>>,
    /// Number of columns within; below 0 that of a hole, around which the ring runs clockwise.
    pub(crate) columns: i64,
}

/// All rings of a footprint, in the order of their first columns.
pub(crate) fn rings(footprint: &Footprint, origin: Column, min_points: u32) -> Vec<Ring> {
    let tracer = Tracer::new(footprint, origin, min_points);
    let mut visited = HashSet::with_capacity_and_hasher(footprint.rim().count() * 2, FxBuildHasher);
    let mut rings = Vec::new();
    for start in tracer.starts() {
        if !visited.contains(&start) {
            rings.push(tracer.ring(start, &mut visited));
        }
    }
    rings
}

/// A column inside and the side beyond which lies one outside.
type Edge = (Column, u8);

struct Tracer<'a> {
    footprint: &'a Footprint,
    origin: Column,
    min_points: f64,
    rim: HashMap<Column, OfRim, FxBuildHasher>,
}

/// A column of the rim.
struct OfRim {
    cut: Cut,
    /// It counts as outside.
    is_outside: bool,
    /// It took over what one that counts as outside covers, and stays inside.
    is_kept: bool,
}

impl<'a> Tracer<'a> {
    fn new(footprint: &'a Footprint, origin: Column, min_points: u32) -> Self {
        let of_rim = |column| {
            let cut = footprint.cut(column)?;
            Some((column, OfRim { cut, is_outside: false, is_kept: false }))
        };
        let rim = footprint.rim().filter_map(of_rim).collect();
        let mut tracer = Self { footprint, origin, min_points: f64::from(min_points), rim };
        for column in footprint.rim() {
            if let Some(neighbour) = tracer.may_lie_outside(column) {
                if let Some(here) = tracer.rim.get_mut(&column) {
                    here.is_outside = true;
                }
                // One that has all its neighbours never counts as outside.
                if let Some(neighbour) = tracer.rim.get_mut(&neighbour) {
                    neighbour.is_kept = true;
                }
            }
        }
        tracer
    }

    fn is_inside(&self, column: Column) -> bool {
        self.rim.get(&column).map_or_else(|| self.footprint.contains(column), |here| !here.is_outside)
    }

    fn cut(&self, column: Column) -> Option<&Cut> {
        self.rim.get(&column).map(|here| &here.cut)
    }

    /// The neighbour that takes over a column's covered part, where that is less than half and can be taken over.
    fn may_lie_outside(&self, column: Column) -> Option<Column> {
        let OfRim { cut, is_kept, .. } = self.rim.get(&column)?;
        if *is_kept || cut.fraction >= 0.5 {
            return None;
        }
        let shrunk = |&side: &usize| cut.is_open(side) && !cut.is_open(side ^ 2) && cut.reach[side] < 0.5;
        let inner =
            (0..4).filter(shrunk).map(|side| beyond(column, side ^ 2)).find(|&c| self.is_inside(c))?;
        self.is_simple(column).then_some(inner)
    }

    /// Whether the columns inside around `column` hang together without it (Hilditch's crossing number is 1).
    fn is_simple(&self, column: Column) -> bool {
        const AROUND: [Column; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];
        let ring = AROUND.map(|step| self.is_inside([column[0] + step[0], column[1] + step[1]]));
        let crossings = (0..4).filter(|k| !ring[2 * k] && (ring[2 * k + 1] || ring[(2 * k + 2) % 8]));
        crossings.count() == 1
    }

    /// Every edge once at least, in the order of the rim.
    fn starts(&self) -> impl Iterator<Item = Edge> {
        let of_column = move |column: Column| {
            let is_outside = self.rim.get(&column).is_some_and(|here| here.is_outside);
            (0..4u8).filter_map(move |side| {
                let other = beyond(column, usize::from(side));
                match (is_outside, self.is_inside(other)) {
                    (false, false) => Some((column, side)),
                    (true, true) => Some((other, side ^ 2)),
                    _ => None,
                }
            })
        };
        self.footprint.rim().flat_map(of_column)
    }

    /// Follows the edges counter-clockwise around the columns inside.
    fn ring(&self, start: Edge, visited: &mut HashSet<Edge, FxBuildHasher>) -> Ring {
        let mut ring = Ring { vertices: Vec::new(), columns: 0 };
        let mut edge = start;
        loop {
            visited.insert(edge);
            ring.vertices.push(self.vertex(edge));
            let (column, side) = edge;
            ring.columns += match side {
                0 => i64::from(column[0] - self.origin[0]) + 1,
                2 => -i64::from(column[0] - self.origin[0]),
                _ => 0,
            };
            edge = self.next(edge);
            if edge == start {
                return ring;
            }
        }
    }

    fn next(&self, (column, side): Edge) -> Edge {
        let left = (side + 1) % 4;
        let ahead = beyond(column, usize::from(left));
        let diagonal = beyond(ahead, usize::from(side));
        if self.is_inside(diagonal) {
            (diagonal, left ^ 2)
        } else if self.is_inside(ahead) {
            (ahead, side)
        } else {
            (column, left)
        }
    }

    /// How far the surface is likely to reach into the column beyond an open side: where it reaches that side, it ends
    /// somewhere before the column beyond would have points enough to be dense.
    fn not_dense(&self, cut: &Cut, side: usize) -> f64 {
        const SURE: f64 = 0.1;
        let missing = (self.min_points * cut.fraction / cut.points.max(1.0)).min(1.0);
        0.5 * missing * (1.0 - (1.0 - cut.reach[side]) / SURE).max(0.0)
    }

    /// Where the points end between the middles of the column inside and the one outside.
    fn vertex(&self, (column, side): Edge) -> Vector2<f64> {
        let side = usize::from(side);
        let outer = beyond(column, side);
        let mine = self.cut(column);
        let along = match self.rim.get(&outer).filter(|outer| outer.is_outside).map(|outer| &outer.cut) {
            Some(theirs) if theirs.is_open(side) => 0.5 + theirs.reach[side],
            // The end runs along both columns: it passes the line between their middles where half is covered.
            Some(theirs) => {
                let mine = mine.map_or(1.0, |cut| cut.fraction);
                (mine - 0.5) / (mine - theirs.fraction).max(1e-9)
            }
            None => mine.map_or(1.0, |cut| cut.reach[side] + self.not_dense(cut, side)) - 0.5,
        };
        let along = along.clamp(CLEARANCE, 1.0 - CLEARANCE);
        let step = beyond([0, 0], side);
        let axis = |i: usize| f64::from(column[i] - self.origin[i]) + 0.5 + along * f64::from(step[i]);
        Vector2::new(axis(0), axis(1))
    }
}
