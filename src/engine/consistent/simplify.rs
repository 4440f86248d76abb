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

/// Of edges that move the ring equally far, the first one counts.
type Ranked = Reverse<(u64, usize, u32)>;

/// A ring in which every vertex knows its neighbours; edge `i` runs from vertex `i` to `next[i]`.
struct Collapsing {
    vertices: Vec<Vector2<f64>>,
    before: Vec<usize>,
    next: Vec<usize>,
    /// How far an edge may lie from the ring as it was.
    moved: Vec<f64>,
    /// The newest proposal for an edge.
    place: Vec<Collapse>,
    /// Counts what happened to an edge's surroundings, so that older proposals are known.
    version: Vec<u32>,
    queue: BinaryHeap<Ranked>,
    left: usize,
    tolerance: f64,
}

impl Collapsing {
    fn new(ring: &[Vector2<f64>], tolerance: f64) -> Self {
        let n = ring.len();
        let mut new = Self {
            vertices: ring.to_vec(),
            before: (0..n).map(|i| (i + n - 1) % n).collect(),
            next: (0..n).map(|i| (i + 1) % n).collect(),
            moved: vec![0.0; n],
            place: vec![Collapse { at: Vector2::zeros(), moved: f64::INFINITY }; n],
            version: vec![0; n],
            queue: BinaryHeap::with_capacity(2 * n),
            left: n,
            tolerance,
        };
        (0..n).for_each(|edge| new.propose(edge));
        new
    }

    fn propose(&mut self, edge: usize) {
        if let Some(collapse) = self.collapse(edge)
            && collapse.moved <= self.tolerance
        {
            self.place[edge] = collapse;
            // Floats that are not negative have the order of their bits.
            self.queue.push(Reverse((collapse.moved.to_bits(), edge, self.version[edge])));
        }
    }

    fn collapse(&self, edge: usize) -> Option<Collapse> {
        let [i, k] = [self.before[edge], self.next[edge]];
        let l = self.next[k];
        let [a, b, c, d] = [i, edge, k, l].map(|index| self.vertices[index]);
        let at = replacement(a, b, c, d)?;
        let of_old = |p| squared_distance(p, a, at).min(squared_distance(p, at, d));
        let of_new =
            squared_distance(at, a, b).min(squared_distance(at, b, c)).min(squared_distance(at, c, d));
        let step = of_old(b).max(of_old(c)).max(of_new).sqrt();
        let before = self.moved[i].max(self.moved[edge]).max(self.moved[k]);
        // The new edges run through the middle of the old ones, so that moves add up to less than their sum.
        let moved = 0.5 * before + step;
        moved.is_finite().then_some(Collapse { at, moved })
    }

    /// Does the best proposal that still holds; false when there is none.
    fn step(&mut self) -> bool {
        while let Some(Reverse((_, edge, version))) = self.queue.pop() {
            if version != self.version[edge] {
                continue;
            }
            let Collapse { at, moved } = self.place[edge];
            let [i, k] = [self.before[edge], self.next[edge]];
            let l = self.next[k];
            self.vertices[edge] = at;
            self.next[edge] = l;
            self.before[l] = edge;
            // Vertex k is gone, and its edge with it.
            self.version[k] = u32::MAX;
            self.moved[i] = moved;
            self.moved[edge] = moved;
            self.left -= 1;
            for near in [self.before[i], i, edge, l] {
                self.version[near] += 1;
                self.propose(near);
            }
            return true;
        }
        false
    }

    /// The vertices that are left, without repetitions.
    fn finish(self) -> Vec<Vector2<f64>> {
        let gone = |index: &usize| self.version[*index] == u32::MAX;
        let mut ring: Vec<_> =
            (0..self.vertices.len()).filter(|i| !gone(i)).map(|i| self.vertices[i]).collect();
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

/// The vertex that takes the place of `b` and `c` between `a` and `d` without a change of area.
fn replacement(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>, d: Vector2<f64>) -> Option<Vector2<f64>> {
    let base = d - a;
    let [height_b, height_c] = [(b - a).perp(&base), (c - a).perp(&base)];
    // Twice the area of a, b, c, d, with the sign of these heights.
    let area = (b - a).perp(&(c - a)) + (c - a).perp(&base);
    let on_ab =
        if height_b * height_c >= 0.0 { height_b.abs() > height_c.abs() } else { area * height_b > 0.0 };
    let (from, to, height) = if on_ab { (a, b, height_b) } else { (d, c, height_c) };
    if height == 0.0 {
        // All four lie on a line.
        return (area == 0.0).then_some(b);
    }
    Some(from + (to - from) * (area / height))
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
