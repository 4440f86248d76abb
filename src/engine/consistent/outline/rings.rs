//! Several closed lines in one piece of memory.

use nalgebra::Vector2;

/// Rings, the last vertex of each joins its first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rings {
    vertices: Vec<Vector2<f64>>,
    /// Where each ring ends, and the number of columns within it.
    ends: Vec<(usize, i64)>,
}

impl Rings {
    pub(crate) fn clear(&mut self) {
        self.vertices.clear();
        self.ends.clear();
    }

    /// Adds a vertex to the ring that is being drawn.
    pub(crate) fn push(&mut self, vertex: Vector2<f64>) {
        self.vertices.push(vertex);
    }

    /// The vertices of the ring that is being drawn.
    pub(crate) fn drawn(&self) -> &[Vector2<f64>] {
        &self.vertices[self.start(self.ends.len())..]
    }

    /// Takes the last vertex back.
    pub(crate) fn pop(&mut self) {
        self.vertices.pop();
    }

    /// Closes the ring that is being drawn; `columns` is the number of columns within it, below 0 for a hole.
    pub(crate) fn end(&mut self, columns: i64) {
        self.ends.push((self.vertices.len(), columns));
    }

    pub(crate) const fn len(&self) -> usize {
        self.ends.len()
    }

    /// The vertices of a ring.
    pub(crate) fn ring(&self, number: usize) -> &[Vector2<f64>] {
        &self.vertices[self.start(number)..self.ends[number].0]
    }

    /// Number of columns within a ring; below 0 that of a hole, around which it runs clockwise.
    pub(crate) fn columns(&self, number: usize) -> i64 {
        self.ends[number].1
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &[Vector2<f64>]> {
        (0..self.len()).map(|number| self.ring(number))
    }

    fn start(&self, number: usize) -> usize {
        number.checked_sub(1).map_or(0, |before| self.ends[before].0)
    }
}

/// Twice the area of a ring, above 0 where it runs counter-clockwise.
pub(crate) fn doubled_area(ring: &[Vector2<f64>]) -> f64 {
    edges(ring).map(|(a, b)| a.perp(b)).sum()
}

/// The edges of a ring, from the first vertex on.
pub(crate) fn edges(ring: &[Vector2<f64>]) -> impl Iterator<Item = (&Vector2<f64>, &Vector2<f64>)> {
    ring.iter().zip(ring.iter().skip(1).chain(ring.first()))
}
