//! Fewer vertices for a ring, at the same area.
//!
//! The two ends of an edge are drawn together into one vertex on a neighbouring edge's line, so that the ring's area
//! stays exactly what it was and bevelled corners become sharp again (Kronenfeld, Stanislawski, Buttenfield and
//! Brockmeyer, "Simplification of polylines by segment collapse", Int. J. Cartography 6, 2020). The edge that moves the
//! ring least goes first. Costs O(n log n) for n vertices.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Vector2;

/// A ring keeps this many vertices.
const LEAST: usize = 4;

/// A ring without those vertices that can go when it may move by `tolerance`.
pub(crate) fn simplified(ring: &[Vector2<f64>], tolerance: f64) -> Vec<Vector2<f64>> {
    let mut collapsing = Collapsing::new(ring, tolerance);
    while collapsing.left > LEAST && collapsing.step() {}
    collapsing.finish()
}

/// Twice the area of a ring, above 0 where it runs counter-clockwise.
pub(crate) fn doubled_area(ring: &[Vector2<f64>]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| a.perp(b)).sum()
}

/// A proposal to draw the ends of an edge together.
#[derive(Clone, Copy)]
struct Collapse {
    at: Vector2<f64>,
    moved: f64,
}

/// How far an edge would move the ring, then the edge, then its version: of edges that move it equally far, the first one
/// counts.
type Ranked = Reverse<(u64, u32, u32)>;

/// A vertex, and the edge from there to the next.
struct Vertex {
    at: Vector2<f64>,
    before: u32,
    next: u32,
    /// Counts what happened to the edge's surroundings, so that older proposals are known.
    version: u32,
    /// How far the edge may lie from the ring as it was.
    moved: f64,
    /// The newest proposal for the edge.
    proposal: Collapse,
}

const GONE: u32 = u32::MAX;

/// A ring in which every vertex knows its neighbours.
struct Collapsing {
    vertices: Vec<Vertex>,
    queue: BinaryHeap<Ranked>,
    left: usize,
    tolerance: f64,
}

impl Collapsing {
    fn new(ring: &[Vector2<f64>], tolerance: f64) -> Self {
        let n = ring.len() as u32;
        let none = Collapse { at: Vector2::zeros(), moved: f64::INFINITY };
        let vertex = |(i, at): (u32, &Vector2<f64>)| Vertex {
            at: *at,
            before: (i + n - 1) % n,
            next: (i + 1) % n,
            version: 0,
            moved: 0.0,
            proposal: none,
        };
        let vertices: Vec<_> = (0..).zip(ring).map(vertex).collect();
        let mut new = Self { vertices, queue: BinaryHeap::new(), left: ring.len(), tolerance };
        let proposals: Vec<_> = (0..n).filter_map(|edge| new.propose(edge)).collect();
        new.queue = BinaryHeap::from(proposals);
        new
    }

    fn vertex(&self, index: u32) -> &Vertex {
        &self.vertices[index as usize]
    }

    /// Notes what may be done to an edge and returns its rank; `None` where it would move the ring too far.
    fn propose(&mut self, edge: u32) -> Option<Ranked> {
        let collapse = self.collapse(edge)?;
        let here = &mut self.vertices[edge as usize];
        here.proposal = collapse;
        // Floats that are not negative have the order of their bits.
        Some(Reverse((collapse.moved.to_bits(), edge, here.version)))
    }

    fn collapse(&self, edge: u32) -> Option<Collapse> {
        let b = self.vertex(edge);
        let [a, c] = [b.before, b.next].map(|index| self.vertex(index));
        // The new edges run through the middle of the old ones, so that moves add up to less than their sum.
        let before = 0.5 * a.moved.max(b.moved).max(c.moved);
        let left = self.tolerance - before;
        let (at, step) = replacement([a.at, b.at, c.at, self.vertex(c.next).at], left)?;
        let moved = before + step;
        (moved <= self.tolerance).then_some(Collapse { at, moved })
    }

    /// Does the best proposal that still holds; false when there is none.
    fn step(&mut self) -> bool {
        while let Some(Reverse((_, edge, version))) = self.queue.pop() {
            let here = &mut self.vertices[edge as usize];
            if version != here.version {
                continue;
            }
            let (Collapse { at, moved }, i, k) = (here.proposal, here.before, here.next);
            // Vertex k is gone, and its edge with it.
            let gone = &mut self.vertices[k as usize];
            gone.version = GONE;
            let l = gone.next;
            let here = &mut self.vertices[edge as usize];
            (here.at, here.next, here.moved) = (at, l, moved);
            self.vertices[l as usize].before = edge;
            self.vertices[i as usize].moved = moved;
            self.left -= 1;
            for near in [self.vertex(i).before, i, edge, l] {
                self.vertices[near as usize].version += 1;
                let ranked = self.propose(near);
                self.queue.extend(ranked);
            }
            return true;
        }
        false
    }

    /// The vertices that are left, without repetitions.
    fn finish(self) -> Vec<Vector2<f64>> {
        let left = self.vertices.into_iter().filter(|vertex| vertex.version != GONE);
        let mut ring: Vec<_> = left.map(|vertex| vertex.at).collect();
        let is_same = |a: &mut Vector2<f64>, b: &mut Vector2<f64>| (*a - *b).norm() < 1e-9;
        ring.dedup_by(is_same);
        if let [first, .., last] = &mut ring[..]
            && is_same(first, last)
        {
            ring.pop();
        }
        ring
    }
}

/// The vertex that takes the place of `b` and `c` between `a` and `d` without a change of area, and how far the line then
/// lies from where it was, at most; `None` where that is more than `left`.
fn replacement([a, b, c, d]: [Vector2<f64>; 4], left: f64) -> Option<(Vector2<f64>, f64)> {
    let base = d - a;
    let [height_b, height_c] = [(b - a).perp(&base), (c - a).perp(&base)];
    // Twice the area of a, b, c, d, with the sign of these heights.
    let area = (b - a).perp(&(c - a)) + (c - a).perp(&base);
    let on_ab =
        if height_b * height_c >= 0.0 { height_b.abs() > height_c.abs() } else { area * height_b > 0.0 };
    // From here on the vertex lies on the line from a through b: the other way round is the same.
    let ([a, b, c, d], height) = if on_ab { ([a, b, c, d], height_b) } else { ([d, c, b, a], height_c) };
    let part = if height == 0.0 {
        // All four lie on a line.
        (area == 0.0).then_some(1.0)?
    } else {
        area / height
    };
    let at = a + (b - a) * part;
    let of_c = squared_distance(c, a, at).min(squared_distance(c, at, d));
    let is_near = of_c <= left * left;
    if !is_near {
        return None;
    }
    // Where it lies beyond b, b lies on the new line; where it lies before b, it lies on the old one.
    let of_b = if part >= 1.0 { 0.0 } else { squared_distance(b, a, at).min(squared_distance(b, at, d)) };
    let of_new = if (0.0..=1.0).contains(&part) {
        0.0
    } else {
        squared_distance(at, a, b).min(squared_distance(at, b, c)).min(squared_distance(at, c, d))
    };
    Some((at, of_c.max(of_b).max(of_new).sqrt()))
}

/// From a point to the line from `a` to `b`, its ends included.
fn squared_distance(point: Vector2<f64>, a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let part = if length > 0.0 { ((point - a).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (point - a - along * part).norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(vertices: &[[f64; 2]]) -> Vec<Vector2<f64>> {
        vertices.iter().map(|&[x, y]| Vector2::new(x, y)).collect()
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
