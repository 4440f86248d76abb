//! The rings around a set of columns, their vertices where the points really end.
//!
//! Rings are those of marching squares over the columns' middles: a vertex lies between the middles of a column inside
//! and a neighbour outside, strictly between, one on each such pair; columns that touch at a corner are joined there.
//! Therefore no ring crosses itself or another, whatever the points say of where it lies. A column of the rim of which
//! less than half is covered counts as outside, so that the ring may pass through it below its middle, unless that would
//! tear the columns apart or leave nothing of a thin part. Each column of the rim knows its neighbours, which are found by
//! going along three lines of columns at once, so that nothing is looked up. Costs O(tiles + rim).

use nalgebra::Vector2;

use super::border::{self, NONE, OfRim};
use super::footprint::{Column, Footprint, TileRim, beyond};
use super::rings::Rings;

/// A vertex keeps this distance from the middles of columns, in columns.
const CLEARANCE: f64 = 0.02;

/// Memory to trace in.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tracing {
    tiles: Vec<TileRim>,
    ranks: Vec<u64>,
    rim: Vec<OfRim>,
}

/// All rings of a footprint, in the order of their first columns, in columns from the lower corner of the first column
/// of the rim, which is returned; `None` of no columns.
///
/// Each has the number of columns within; below 0 that of a hole, around which the ring runs clockwise.
pub(crate) fn rings(footprint: &Footprint, memory: &mut Tracing, rings: &mut Rings) -> Option<Column> {
    rings.clear();
    let Tracing { tiles, ranks, rim } = memory;
    border::find(footprint, tiles, ranks, rim);
    let origin = rim.first()?.column;
    let mut tracer = Tracer { origin, rim };
    tracer.leave_out();
    for at in 0..tracer.rim.len() as u32 {
        for side in 0..4 {
            if let Some(edge) = tracer.edge(at, side).filter(|edge| !tracer.is_visited(edge)) {
                let columns = tracer.follow(edge, rings);
                rings.end(columns);
            }
        }
    }
    Some(origin)
}

/// A column inside and the side beyond which lies one outside. One of the two at least is at the rim.
#[derive(Clone, Copy, PartialEq)]
struct Edge {
    column: Column,
    side: usize,
    /// Places of the two at the rim, or [`NONE`]; that of the one outside only where it is covered.
    inner: u32,
    outer: u32,
}

struct Tracer<'a> {
    origin: Column,
    rim: &'a mut [OfRim],
}

impl Tracer<'_> {
    /// Counts columns as outside of which less than half is covered.
    fn leave_out(&mut self) {
        for at in 0..self.rim.len() {
            let Some(side) = self.rim[at].may_lie_outside() else { continue };
            self.rim[at].is_outside = true;
            let near = self.rim[at].near;
            for (towards, &near) in near.iter().enumerate().filter(|(_, near)| **near != NONE) {
                self.rim[near as usize].inside &= !(1 << (towards ^ 4));
            }
            // It took over what the other covers; one that has all its neighbours never counts as outside.
            if let Some(neighbour) = self.rim.get_mut(near[2 * side] as usize) {
                neighbour.is_kept = true;
            }
        }
    }

    /// The edge between a column of the rim and what is beyond that side, if there is one.
    fn edge(&self, at: u32, side: usize) -> Option<Edge> {
        let here = &self.rim[at as usize];
        let other = here.near[2 * side];
        match (here.is_outside, here.is_inside(2 * side)) {
            (false, false) => Some(Edge { column: here.column, side, inner: at, outer: other }),
            (true, true) => {
                Some(Edge { column: beyond(here.column, side), side: side ^ 2, inner: other, outer: at })
            }
            _ => None,
        }
    }

    /// Where and as which bit it is noted that a ring runs over an edge.
    fn note(edge: &Edge) -> (usize, u8) {
        if edge.inner == NONE {
            (edge.outer as usize, 1 << (4 + edge.side))
        } else {
            (edge.inner as usize, 1 << edge.side)
        }
    }

    fn is_visited(&self, edge: &Edge) -> bool {
        let (at, bit) = Self::note(edge);
        self.rim[at].visited & bit != 0
    }

    /// Follows the edges counter-clockwise around the columns inside; returns their number.
    fn follow(&mut self, start: Edge, rings: &mut Rings) -> i64 {
        let mut columns = 0;
        let mut edge = start;
        loop {
            let (at, bit) = Self::note(&edge);
            self.rim[at].visited |= bit;
            rings.push(self.vertex(&edge));
            columns += match edge.side {
                0 => i64::from(edge.column[0] - self.origin[0]) + 1,
                2 => -i64::from(edge.column[0] - self.origin[0]),
                _ => 0,
            };
            edge = self.next(&edge);
            if edge == start {
                return columns;
            }
        }
    }

    fn next(&self, edge: &Edge) -> Edge {
        let Edge { column, side, inner, outer } = *edge;
        let left = (side + 1) % 4;
        // The diagonal neighbour and the one ahead, as seen from the column of the two that is at the rim.
        let (here, [diagonal, ahead]) = if inner == NONE {
            (&self.rim[outer as usize], [2 * left, (2 * left + 1) % 8])
        } else {
            (&self.rim[inner as usize], [(2 * left + 7) % 8, 2 * left])
        };
        let in_front = beyond(column, left);
        if here.is_inside(diagonal) {
            let column = beyond(in_front, side);
            Edge { column, side: left ^ 2, inner: here.near[diagonal], outer }
        } else if here.is_inside(ahead) {
            Edge { column: in_front, side, inner: here.near[ahead], outer: here.near[diagonal] }
        } else {
            Edge { column, side: left, inner, outer: here.near[ahead] }
        }
    }

    /// Where the points end between the middles of the column inside and the one outside.
    fn vertex(&self, edge: &Edge) -> Vector2<f64> {
        let Edge { column, side, .. } = *edge;
        let cut = |place: u32| self.rim.get(place as usize).map(|here| &here.cut);
        let mine = cut(edge.inner);
        let along = match cut(edge.outer) {
            Some(theirs) if theirs.is_open(side) => 0.5 + theirs.reach[side],
            // The end runs along both columns: it passes the line between their middles where half is covered.
            Some(theirs) => {
                let mine = mine.map_or(1.0, |cut| cut.fraction);
                (mine - 0.5) / (mine - theirs.fraction).max(1e-9)
            }
            None => mine.map_or(1.0, |cut| cut.reach[side]) - 0.5,
        };
        let along = along.clamp(CLEARANCE, 1.0 - CLEARANCE);
        let step = beyond([0, 0], side);
        let axis = |i: usize| f64::from(column[i] - self.origin[i]) + 0.5 + along * f64::from(step[i]);
        Vector2::new(axis(0), axis(1))
    }
}
