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
        for first in (0..n).step_by(LANES) {
            let (edges, ranks) = self.propose(first);
            edges.into_iter().zip(ranks).for_each(|(edge, rank)| *self.queue.of(edge) = rank);
        }
        self.queue.begin();
    }

    fn vertex(&self, index: u32) -> &Vertex {
        &self.vertices[index as usize]
    }

    /// Notes what may be done to an edge and the next ones; returns these and how far each would move the ring.
    fn propose(&mut self, first: u32) -> ([u32; LANES], [Rank; LANES]) {
        let mut at = self.vertex(first).before;
        let around = [(); LANES + 3].map(|()| {
            let next = self.vertex(at).next;
            std::mem::replace(&mut at, next)
        });
        let vertices = around.map(|index| self.vertex(index));
        let replaced = replacements(&vertices.map(|vertex| vertex.at));
        let edges = std::array::from_fn(|lane| around[lane + 1]);
        let ranks = std::array::from_fn(|lane| {
            // The new edges run through the middle of the old ones, so that moves add up to less than their sum.
            let [a, b, c] = [0, 1, 2].map(|i| vertices[lane + i].moved);
            let moved = 0.5 * a.max(b).max(c) + replaced.farthest[lane].sqrt();
            if moved <= self.tolerance { moved.to_bits() } else { NEVER }
        });
        for (lane, &edge) in edges.iter().enumerate() {
            self.vertices[edge as usize].proposal = Vector2::new(replaced.at.x[lane], replaced.at.y[lane]);
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

/// Which edge ranks first, found by having them compete in pairs, the winners in pairs again: a change costs the
/// height of the tree.
#[derive(Clone, Debug, Default)]
struct Tournament {
    /// The winner of all at 1; those of 2 k and 2 k + 1 meet for the place k. The edges are the last half.
    ranks: Vec<Rank>,
    half: usize,
}

impl Tournament {
    fn clear(&mut self, edges: usize) {
        self.half = edges.next_power_of_two();
        self.ranks.clear();
        self.ranks.resize(2 * self.half, NEVER);
    }

    /// The rank of an edge; to be changed by hand only until the tournament begins.
    fn of(&mut self, edge: u32) -> &mut Rank {
        &mut self.ranks[self.half + edge as usize]
    }

    fn begin(&mut self) {
        for place in (1..self.half).rev() {
            self.ranks[place] = self.ranks[2 * place].min(self.ranks[2 * place + 1]);
        }
    }

    /// Without a question whether a rank has changed: all of these are settled level by level.
    fn set<const N: usize>(&mut self, edges: [(u32, Rank); N]) {
        let mut places = edges.map(|(edge, rank)| {
            *self.of(edge) = rank;
            self.half + edge as usize
        });
        for _ in 0..self.half.ilog2() {
            for place in &mut places {
                *place /= 2;
                self.ranks[*place] = self.ranks[2 * *place].min(self.ranks[2 * *place + 1]);
            }
        }
    }

    /// The edge that ranks first, the lowest of equals, and its rank.
    fn first(&self) -> Option<(u32, Rank)> {
        let rank = self.ranks[1];
        let mut place = 1;
        while place < self.half {
            place = 2 * place + usize::from(self.ranks[2 * place] != rank);
        }
        (rank != NEVER).then_some(((place - self.half) as u32, rank))
    }
}

/// Edges that are looked at together: what one of them waits for, the others do not, and the processor does two or four steps
/// at once.
const LANES: usize = 4;

type Lanes = [f64; LANES];

/// A point or a vector in each lane.
#[derive(Clone, Copy)]
struct Points {
    x: Lanes,
    y: Lanes,
}

#[inline]
fn each(of: impl Fn(usize) -> f64) -> Lanes {
    std::array::from_fn(of)
}

#[inline]
fn least(a: &Lanes, b: &Lanes) -> Lanes {
    each(|i| if a[i] < b[i] { a[i] } else { b[i] })
}

impl Points {
    fn each(of: impl Fn(usize) -> Vector2<f64>) -> Self {
        Self { x: each(|i| of(i).x), y: each(|i| of(i).y) }
    }

    fn minus(&self, other: &Self) -> Self {
        Self { x: each(|i| self.x[i] - other.x[i]), y: each(|i| self.y[i] - other.y[i]) }
    }

    /// `self + along * part`.
    fn plus(&self, along: &Self, part: &Lanes) -> Self {
        let [x, y] = [(&self.x, &along.x), (&self.y, &along.y)].map(|(a, b)| each(|i| a[i] + b[i] * part[i]));
        Self { x, y }
    }

    fn perp(&self, other: &Self) -> Lanes {
        each(|i| self.x[i] * other.y[i] - self.y[i] * other.x[i])
    }

    fn dot(&self, other: &Self) -> Lanes {
        each(|i| self.x[i] * other.x[i] + self.y[i] * other.y[i])
    }

    /// `self` where it holds, else `other`.
    fn or(&self, other: &Self, holds: [bool; LANES]) -> Self {
        let pick = |a: &Lanes, b: &Lanes| each(|i| if holds[i] { a[i] } else { b[i] });
        Self { x: pick(&self.x, &other.x), y: pick(&self.y, &other.y) }
    }
}

/// The vertices that would take the place of two, and the squares of how far the line then lies from where it was, at most;
/// more than any where there is no such vertex.
struct Replacements {
    at: Points,
    farthest: Lanes,
}

/// What takes the place of `b` and `c` between `a` and `d` without a change of area, of any four that follow each other.
///
/// Whatever might be needed is found without asking.
fn replacements(vertices: &[Vector2<f64>; LANES + 3]) -> Replacements {
    let [a, b, c, d] = [0, 1, 2, 3].map(|from| Points::each(|lane| vertices[lane + from]));
    let (base, ab, ac) = (d.minus(&a), b.minus(&a), c.minus(&a));
    let [of_b, of_c] = [ab.perp(&base), ac.perp(&base)];
    // Twice the area of a, b, c, d, with the sign of these heights.
    let of_abc = ab.perp(&ac);
    let area = each(|i| of_abc[i] + of_c[i]);
    let on_ab: [bool; LANES] = std::array::from_fn(|i| {
        let is_same_side = of_b[i] * of_c[i] >= 0.0;
        if is_same_side { of_b[i].abs() > of_c[i].abs() } else { area[i] * of_b[i] > 0.0 }
    });
    // From here on the vertex lies on the line from a through b: the other way round is the same.
    let height = each(|i| if on_ab[i] { of_b[i] } else { of_c[i] });
    let [a, b, c, d] = [a.or(&d, on_ab), b.or(&c, on_ab), c.or(&b, on_ab), d.or(&a, on_ab)];
    // Of no height where all four lie on a line, or else there is no such vertex.
    let part = each(|i| if height[i] == 0.0 { 1.0 } else { area[i] / height[i] });
    let ab = b.minus(&a);
    let at = a.plus(&ab, &part);
    let off = farthest(&[a, b, c, d], &at, &part);
    let is_none: [bool; LANES] = std::array::from_fn(|i| height[i] == 0.0 && area[i] != 0.0);
    Replacements { at, farthest: each(|i| if is_none[i] { f64::INFINITY } else { off[i] }) }
}

/// The square of how far a, `at`, d lies from a, b, c, d at most; `at` is that part of the way from a to b.
#[inline]
fn farthest([a, b, c, d]: &[Points; 4], at: &Points, part: &Lanes) -> Lanes {
    let of_c = least(&squared_distance(c, a, at), &squared_distance(c, at, d));
    let of_b = squared_distance(b, at, d);
    let of_new = least(&squared_distance(at, b, c), &squared_distance(at, c, d));
    let [to_a, from_a] = [b.minus(a), at.minus(a)].map(|way| way.dot(&way));
    each(|i| {
        let is_before = part[i] < 0.0;
        // Where it lies beyond b, b lies on the new line; where it lies before b, it lies on the old one.
        let b = if part[i] > 1.0 { 0.0 } else { of_b[i] };
        let b = if is_before && to_a[i] < b { to_a[i] } else { b };
        let new = if part[i] > 1.0 || is_before { of_new[i] } else { 0.0 };
        let new = if is_before && from_a[i] < new { from_a[i] } else { new };
        of_c[i].max(b).max(new)
    })
}

/// From a point to the line from `a` to `b`, its ends included.
#[inline]
fn squared_distance(point: &Points, a: &Points, b: &Points) -> Lanes {
    let (along, from) = (b.minus(a), point.minus(a));
    let (length, dot) = (along.dot(&along), from.dot(&along));
    // Of no length, whatever part: it is 0 of that.
    let part = each(|i| -(dot[i] / length[i].max(f64::MIN_POSITIVE)).clamp(0.0, 1.0));
    let off = from.plus(&along, &part);
    off.dot(&off)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::consistent::rings::doubled_area;

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
