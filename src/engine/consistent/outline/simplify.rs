//! Fewer vertices for a ring, at the same area.
//!
//! The two ends of an edge are drawn together into one vertex on a neighbouring edge's line, so that the ring's area
//! stays exactly what it was and bevelled corners become sharp again (Kronenfeld, Stanislawski, Buttenfield and
//! Brockmeyer, "Simplification of polylines by segment collapse", Int. J. Cartography 6, 2020). The edge that moves the
//! ring least goes first. Costs O(n log n) for n vertices.

use nalgebra::Vector2;

use super::rings::Rings;

/// A ring keeps this many vertices.
const LEAST: usize = 4;

/// In place of the next vertex of one that is gone.
const GONE: u32 = u32::MAX;

/// How far an edge would move the ring, as the bits of a float, which have its order where it is not negative.
type Rank = u64;

/// The rank of an edge that is not to be drawn together.
const NEVER: Rank = Rank::MAX;

/// A vertex, and the edge from there to the next.
#[derive(Clone, Copy, Debug)]
struct Vertex {
    at: Vector2<f64>,
    before: u32,
    next: u32,
    /// How far the edge may lie from the ring as it was.
    moved: f64,
    /// The vertex that would take the edge's place.
    proposal: Vector2<f64>,
}

/// Rings to be drawn with fewer vertices, one after another in the same memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Simplifying {
    vertices: Vec<Vertex>,
    queue: Tournament,
    left: usize,
    tolerance: f64,
}

impl Simplifying {
    /// Draws a ring without those vertices that can go when it may move by `tolerance`, and leaves it to be closed.
    pub(crate) fn draw(&mut self, ring: &[Vector2<f64>], tolerance: f64, rings: &mut Rings) {
        self.begin(ring, tolerance);
        while self.left > LEAST && self.step() {}
        self.finish(rings);
    }

    fn begin(&mut self, ring: &[Vector2<f64>], tolerance: f64) {
        let n = ring.len() as u32;
        let vertex = |(i, at): (u32, &Vector2<f64>)| Vertex {
            at: *at,
            before: if i == 0 { n - 1 } else { i - 1 },
            next: if i + 1 == n { 0 } else { i + 1 },
            moved: 0.0,
            proposal: *at,
        };
        self.vertices.clear();
        self.vertices.extend((0..).zip(ring).map(vertex));
        (self.left, self.tolerance) = (ring.len(), tolerance);
        self.queue.clear(ring.len());
        for first in (0..n).step_by(EDGES) {
            let (edges, ranks) = self.propose(first);
            edges.into_iter().zip(ranks).for_each(|(edge, rank)| *self.queue.of(edge) = rank);
        }
        self.queue.begin();
    }

    fn vertex(&self, index: u32) -> &Vertex {
        &self.vertices[index as usize]
    }

    /// Notes what may be done to an edge and the next ones; returns these and how far each would move the ring.
    fn propose(&mut self, first: u32) -> ([u32; EDGES], [Rank; EDGES]) {
        let mut at = self.vertex(first).before;
        let mut around = Around::default();
        let places: [_; AROUND] = std::array::from_fn(|i| {
            let vertex = self.vertex(at);
            (around.x[i], around.y[i], around.moved[i]) = (vertex.at.x, vertex.at.y, vertex.moved);
            std::mem::replace(&mut at, vertex.next)
        });
        let replaced = around.replacements();
        let edges = std::array::from_fn(|edge| places[edge + 1]);
        let ranks = replaced.moved.map(|moved| if moved <= self.tolerance { moved.to_bits() } else { NEVER });
        for (place, &edge) in edges.iter().enumerate() {
            self.vertices[edge as usize].proposal = Vector2::new(replaced.x[place], replaced.y[place]);
        }
        (edges, ranks)
    }

    /// Draws the ends of the edge together that moves the ring least, the first of equals; false when there is none.
    fn step(&mut self) -> bool {
        let Some((edge, rank)) = self.queue.first() else { return false };
        let Vertex { before: i, next: k, proposal, .. } = *self.vertex(edge);
        // Vertex k is gone, and its edge with it.
        let l = std::mem::replace(&mut self.vertices[k as usize].next, GONE);
        let moved = f64::from_bits(rank);
        let here = &mut self.vertices[edge as usize];
        (here.at, here.next, here.moved) = (proposal, l, moved);
        self.vertices[l as usize].before = edge;
        self.vertices[i as usize].moved = moved;
        self.left -= 1;
        let ([e, f, g, h], [of_e, of_f, of_g, of_h]) = self.propose(self.vertex(i).before);
        self.queue.set([(k, NEVER), (e, of_e), (f, of_f), (g, of_g), (h, of_h)]);
        true
    }

    /// The vertices that are left, without repetitions.
    fn finish(&self, rings: &mut Rings) {
        let is_same = |a: &Vector2<f64>, b: &Vector2<f64>| (a - b).norm() < 1e-9;
        for vertex in self.vertices.iter().filter(|vertex| vertex.next != GONE) {
            if rings.drawn().last().is_none_or(|last| !is_same(last, &vertex.at)) {
                rings.push(vertex.at);
            }
        }
        if let [first, .., last] = rings.drawn()
            && is_same(first, last)
        {
            rings.pop();
        }
    }
}

/// Edges that compete at once.
const TABLE: usize = 8;

/// Which edge ranks first, found by having them compete in tables, the winners in tables again: a change costs a table in each
/// round. By eights there are a third of the rounds that there are by pairs, and each waits for the one before.
#[derive(Clone, Debug, Default)]
struct Tournament {
    /// Those of the edges, then those of their winners, and so on; the last is one table.
    tables: Vec<[Rank; TABLE]>,
    /// Where the tables of each round begin.
    rounds: Vec<usize>,
}

impl Tournament {
    fn clear(&mut self, edges: usize) {
        self.tables.clear();
        self.rounds.clear();
        let mut left = edges;
        while self.rounds.is_empty() || left > 1 {
            self.rounds.push(self.tables.len());
            left = left.div_ceil(TABLE);
            self.tables.resize(self.tables.len() + left, [NEVER; TABLE]);
        }
    }

    /// The rank of an edge; to be changed by hand only until the tournament begins.
    fn of(&mut self, edge: u32) -> &mut Rank {
        let edge = edge as usize;
        &mut self.tables[edge / TABLE][edge % TABLE]
    }

    fn begin(&mut self) {
        for round in self.rounds.windows(2) {
            for table in 0..round[1] - round[0] {
                settle(&mut self.tables, round, table);
            }
        }
    }

    /// Without a question whether a rank has changed: all of these are settled round by round.
    fn set<const N: usize>(&mut self, edges: [(u32, Rank); N]) {
        let mut places = edges.map(|(edge, rank)| {
            *self.of(edge) = rank;
            edge as usize
        });
        for round in self.rounds.windows(2) {
            for place in &mut places {
                *place /= TABLE;
                settle(&mut self.tables, round, *place);
            }
        }
    }

    /// The edge that ranks first, the lowest of equals, and its rank.
    fn first(&self) -> Option<(u32, Rank)> {
        let rank = winner(self.tables.last()?);
        let mut place = 0;
        for round in self.rounds.iter().rev() {
            let table = &self.tables[round + place];
            let first = (0..TABLE).rev().fold(0, |first, at| if table[at] == rank { at } else { first });
            place = TABLE * place + first;
        }
        (rank != NEVER).then_some((place as u32, rank))
    }
}

/// Notes the winner of a table of one round in the next; `rounds` is where these two begin.
#[inline]
fn settle(tables: &mut [[Rank; TABLE]], rounds: &[usize], table: usize) {
    tables[rounds[1] + table / TABLE][table % TABLE] = winner(&tables[rounds[0] + table]);
}

#[inline]
fn winner(&[a, b, c, d, e, f, g, h]: &[Rank; TABLE]) -> Rank {
    a.min(b).min(c.min(d)).min(e.min(f).min(g.min(h)))
}

/// Edges that are looked at together: those that a step changes.
const EDGES: usize = 4;
/// The vertices that these depend on.
const AROUND: usize = EDGES + 3;

/// Vertices that follow each other, number by number, so that the processor takes those of two edges at once.
#[derive(Default)]
struct Around {
    x: [f64; AROUND],
    y: [f64; AROUND],
    moved: [f64; AROUND],
}

/// The vertices that would take the place of the two of an edge, and how far the ring then lies from where it was, at most; more
/// than any where there is no such vertex.
#[derive(Default)]
struct Replacements {
    x: [f64; EDGES],
    y: [f64; EDGES],
    moved: [f64; EDGES],
}

impl Around {
    /// What takes the place of the second and the third of each four that follow each other. Whatever might be needed is found
    /// without asking.
    fn replacements(&self) -> Replacements {
        let mut replaced = Replacements::default();
        for edge in 0..EDGES {
            let vertex = |i: usize| Point { x: self.x[edge + i], y: self.y[edge + i] };
            let (at, farthest) = replacement([vertex(0), vertex(1), vertex(2), vertex(3)]);
            // The new edges run through the middle of the old ones, so that moves add up to less than their sum.
            let moved = most(most(self.moved[edge], self.moved[edge + 1]), self.moved[edge + 2]);
            replaced.moved[edge] = 0.5 * moved + farthest.sqrt();
            (replaced.x[edge], replaced.y[edge]) = (at.x, at.y);
        }
        replaced
    }
}

/// A point or a vector.
#[derive(Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
}

impl Point {
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y }
    }

    /// `self + along * part`.
    #[inline(always)]
    fn plus(self, along: Self, part: f64) -> Self {
        Self { x: self.x + along.x * part, y: self.y + along.y * part }
    }

    #[inline(always)]
    fn perp(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    #[inline(always)]
    fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// `self` where it holds, else `other`.
    #[inline(always)]
    fn or(self, other: Self, holds: bool) -> Self {
        Self { x: if holds { self.x } else { other.x }, y: if holds { self.y } else { other.y } }
    }
}

/// `f64::min` and `f64::max` but for what is no number, of which there is none here and which costs as much again.
#[inline(always)]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// What takes the place of `b` and `c` between `a` and `d` without a change of area, and the square of how far the line then
/// lies from where it was, at most.
#[inline(always)]
fn replacement([a, b, c, d]: [Point; 4]) -> (Point, f64) {
    let (base, ab, ac) = (d.minus(a), b.minus(a), c.minus(a));
    let (of_b, of_c) = (ab.perp(base), ac.perp(base));
    // Twice the area of a, b, c, d, with the sign of these heights.
    let area = ab.perp(ac) + of_c;
    // On one side of the base the higher one decides, else the one on the side of the area.
    let is_same_side = of_b * of_c >= 0.0;
    let more = if is_same_side { of_b.abs() } else { area * of_b };
    let less = if is_same_side { of_c.abs() } else { 0.0 };
    let on_ab = more > less;
    // From here on the vertex lies on the line from a through b: the other way round is the same.
    let height = if on_ab { of_b } else { of_c };
    let [a, b, c, d] = [a.or(d, on_ab), b.or(c, on_ab), c.or(b, on_ab), d.or(a, on_ab)];
    // Of no height where all four lie on a line, or else there is no such vertex.
    let quotient = area / height;
    let part = if height == 0.0 { 1.0 } else { quotient };
    let at = a.plus(b.minus(a), part);
    let beyond_all = if area == 0.0 { 0.0 } else { f64::INFINITY };
    let least_off = if height == 0.0 { beyond_all } else { 0.0 };
    (at, most(farthest([a, b, c, d], at, part), least_off))
}

/// The square of how far a, `at`, d lies from a, b, c, d at most; `at` is that part of the way from a to b.
#[inline(always)]
fn farthest([a, b, c, d]: [Point; 4], at: Point, part: f64) -> f64 {
    let of_c = least(squared_distance(c, a, at), squared_distance(c, at, d));
    let of_b = squared_distance(b, at, d);
    let of_new = least(squared_distance(at, b, c), squared_distance(at, c, d));
    let [to_a, from_a] = [b.minus(a), at.minus(a)].map(|way| way.dot(way));
    let (is_before, is_beyond) = (part < 0.0, part > 1.0);
    // Where it lies beyond b, b lies on the new line; where it lies before b, it lies on the old one.
    let b = if is_beyond { 0.0 } else { of_b };
    let b = if is_before { least(to_a, b) } else { b };
    let new = if is_beyond { of_new } else { 0.0 };
    let new = if is_before { least(from_a, of_new) } else { new };
    most(most(of_c, b), new)
}

/// From a point to the line from `a` to `b`, its ends included.
#[inline(always)]
fn squared_distance(point: Point, a: Point, b: Point) -> f64 {
    let (along, from) = (b.minus(a), point.minus(a));
    // Of no length, whatever part: it is 0 of that.
    let part = from.dot(along) / most(along.dot(along), f64::MIN_POSITIVE);
    let off = from.plus(along, -least(most(part, 0.0), 1.0));
    off.dot(off)
}

#[cfg(test)]
mod tests {
    use super::super::rings::doubled_area;
    use super::*;

    fn ring(vertices: &[[f64; 2]]) -> Vec<Vector2<f64>> {
        vertices.iter().map(|&[x, y]| Vector2::new(x, y)).collect()
    }

    fn simplified(ring: &[Vector2<f64>], tolerance: f64) -> Vec<Vector2<f64>> {
        let mut rings = Rings::default();
        Simplifying::default().draw(ring, tolerance, &mut rings);
        rings.drawn().to_vec()
    }

    #[test]
    fn bevelled_corners_become_sharp_again_at_the_same_area() {
        let bevelled = ring(&[
            [0.5, 0.0],
            [9.5, 0.0],
            [10.0, 0.5],
            [10.0, 5.5],
            [9.5, 6.0],
            [0.5, 6.0],
            [0.0, 5.5],
            [0.0, 0.5],
        ]);
        let sharp = simplified(&bevelled, 0.5);
        assert_eq!(sharp.len(), 4);
        assert!((doubled_area(&sharp) - doubled_area(&bevelled)).abs() < 1e-12);
        for vertex in sharp {
            let near = |c: f64, ends: [f64; 2]| ends.iter().any(|end| (c - end).abs() < 0.1);
            assert!(near(vertex.x, [0.0, 10.0]) && near(vertex.y, [0.0, 6.0]), "{vertex}");
        }
    }

    #[test]
    fn what_is_larger_than_the_tolerance_stays() {
        let steps = ring(&[[0.0, 0.0], [9.0, 0.0], [9.0, 3.0], [6.0, 3.0], [6.0, 6.0], [0.0, 6.0]]);
        assert_eq!(simplified(&steps, 0.5), steps);
    }
}
