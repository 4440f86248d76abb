//! Whether rings are apart: no edge meets another, and all lie within the first.
//!
//! Edges are cut into pieces by bands across the plane, and each is held against those beside it in its band, so that what
//! lies elsewhere costs nothing, however many rings there are and however long an edge is. Costs O(n log n) for n pieces
//! where no more than some edges lie in any part of a band. Lengths in columns.

use nalgebra::Vector2;

use super::rings::{Rings, edges};
use super::within::Within;
use crate::engine::binning::floor;

/// Height of a band: the outline of a table lies in one or two, so that it has hardly more pieces than edges.
const BAND: f64 = 16.0;
/// How far an edge reaches beyond its ends and to its sides, so that rounding hides none from another that it meets.
const MARGIN: f64 = 1e-6;

/// Memory to compare rings in, one set after another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Comparing {
    edges: Vec<Edge>,
    pieces: Vec<Piece>,
    within: Within,
}

impl Comparing {
    /// Whether no edge of these rings meets another but at its ends, and all rings lie within the first.
    pub(crate) fn are_apart(&mut self, rings: &Rings) -> bool {
        self.cut(rings);
        self.meeting().next().is_none() && self.are_within_the_first(rings)
    }

    /// Finds the edges of all rings and their pieces, in the order of these.
    fn cut(&mut self, rings: &Rings) {
        let Self { edges: all, pieces, .. } = self;
        all.clear();
        pieces.clear();
        for (ring, vertices) in rings.iter().enumerate() {
            let of = vertices.len();
            for (place, (&a, &b)) in edges(vertices).enumerate() {
                let edge = Edge { ring, place, of, ends: [a, b] };
                edge.pieces(all.len() as u32, pieces);
                all.push(edge);
            }
        }
        pieces.sort_unstable_by(|a, b| a.band.cmp(&b.band).then(a.least.total_cmp(&b.least)));
    }

    /// The edges that meet; the same two more than once where they come together in several bands.
    fn meeting(&self) -> impl Iterator<Item = [u32; 2]> {
        let edge = |number: u32| &self.edges[number as usize];
        let pairs = self.pieces.iter().enumerate().flat_map(|(i, piece)| {
            let beside = self.pieces[i + 1..].iter().take_while(|other| piece.reaches(other));
            beside.map(|other| [piece.edge, other.edge])
        });
        pairs.filter(move |&[a, b]| edge(a).meets(edge(b)))
    }

    /// Whether all lie within the first; no edge meets another.
    fn are_within_the_first(&mut self, rings: &Rings) -> bool {
        self.within.ask(rings.iter().skip(1));
        self.within.innermost(rings.iter().take(1)).iter().all(Option::is_some)
    }
}

/// The part of an edge in a band.
#[derive(Clone, Copy, Debug)]
struct Piece {
    band: i32,
    /// From where to where it reaches along the band.
    least: f64,
    most: f64,
    edge: u32,
}

impl Piece {
    /// Whether it reaches to where another, later one begins.
    fn reaches(&self, later: &Self) -> bool {
        later.band == self.band && later.least <= self.most
    }
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
    fn pieces(&self, edge: u32, pieces: &mut Vec<Piece>) {
        let [a, b] = self.ends;
        let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
        let [first, last] = [low.y - MARGIN, high.y + MARGIN].map(|y| floor(y / BAND));
        if first == last {
            pieces.push(Piece { band: first, least: a.x.min(b.x), most: a.x.max(b.x), edge });
            return;
        }
        let along = high - low;
        for band in first..=last {
            let bottom = BAND * f64::from(band);
            let [from, to] = [bottom - MARGIN, bottom + BAND + MARGIN].map(|y| {
                // Of no height, whatever part: the edge lies at the end of the band, all of it in both.
                let part = (y - low.y) / along.y.max(f64::MIN_POSITIVE);
                low.x + part.clamp(0.0, 1.0) * along.x
            });
            pieces.push(Piece { band, least: from.min(to) - MARGIN, most: from.max(to) + MARGIN, edge });
        }
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
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;

    fn rings(of: &[Vec<[f64; 2]>]) -> Rings {
        let mut rings = Rings::default();
        for ring in of {
            ring.iter().for_each(|&[x, y]| rings.push(Vector2::new(x, y)));
            rings.end(0);
        }
        rings
    }

    /// Every pair of edges by itself.
    fn pairs(edges: &[Edge]) -> BTreeSet<[u32; 2]> {
        let all = (0..edges.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
        all.filter(|&[a, b]| edges[a].meets(&edges[b])).map(|pair| pair.map(|edge| edge as u32)).collect()
    }

    /// Whole numbers, so that vertices lie on edges, edges on each other, and both on the ends of bands; and others.
    fn any_rings() -> impl Strategy<Value = Vec<Vec<[f64; 2]>>> {
        let whole = (-40..40i32).prop_map(f64::from);
        let length = prop_oneof![whole, (-3..3i32).prop_map(|band| BAND * f64::from(band)), -40.0..40.0f64];
        let vertex = [length.clone(), length];
        proptest::collection::vec(proptest::collection::vec(vertex, 3..8), 1..12)
    }

    proptest! {
        #[test]
        fn the_edges_that_meet_are_those_that_do_so_pair_by_pair(of in any_rings()) {
            let mut comparing = Comparing::default();
            comparing.cut(&rings(&of));
            let found: BTreeSet<_> = comparing.meeting().map(|[a, b]| [a.min(b), a.max(b)]).collect();
            prop_assert_eq!(found, pairs(&comparing.edges));
        }
    }

    fn square([x, y]: [f64; 2], side: f64) -> Vec<[f64; 2]> {
        vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]]
    }

    #[test]
    fn rings_are_apart_that_lie_within_the_first_and_meet_at_no_point() {
        let are_apart = |of: &[Vec<[f64; 2]>]| Comparing::default().are_apart(&rings(of));
        let floor = square([0.0, 0.0], 100.0);
        let holes = [square([2.0, 2.0], 20.0), square([40.0, 3.0], 0.2), square([22.5, 2.0], 0.1)];
        let all = |other: Vec<[f64; 2]>| [&[floor.clone()][..], &holes, &[other]].concat();
        assert!(are_apart(&[]) && are_apart(&holes[..1]) && are_apart(&all(square([50.0, 50.0], 9.0))));
        for other in [
            // Beside the first, one of them so narrow that no middle of a column lies in it; across it; touching a hole.
            square([120.0, 5.0], 9.0),
            square([120.6, 5.0], 0.2),
            square([90.0, 5.0], 20.0),
            square([22.0, 22.0], 5.0),
        ] {
            assert!(!are_apart(&all(other)));
        }
    }

    #[test]
    fn a_ring_whose_foremost_vertex_lies_on_the_middle_of_a_column_is_entered_there_and_left() {
        let floor = vec![[50.0, 0.0], [100.0, 50.0], [50.0, 100.0], [0.5, 50.0]];
        let with = |at| Comparing::default().are_apart(&rings(&[floor.clone(), square(at, 1.0)]));
        assert_eq!([[40.0, 50.0], [0.2, 60.0], [0.2, 20.0]].map(with), [true, false, false]);
    }
}
