//! Which directions a box covers: its silhouette on each face of the cube around the sensor.

use std::ops::Range;

use nalgebra::{Point3, Vector3};

/// A face of the cube: +x, -x, +y, -y, +z, -z.
///
/// Columns and rows run along the other two axes in the order x, y, z, with their signs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Face(usize);

impl Face {
    /// The face of this number, 0 to 5.
    pub(super) const fn new(index: usize) -> Self {
        Self(index)
    }

    pub(super) fn all() -> impl Iterator<Item = Self> {
        (0..6).map(Self)
    }

    pub(super) const fn index(self) -> usize {
        self.0
    }

    const fn axis(self) -> usize {
        self.0 / 2
    }

    const fn sign(self) -> f64 {
        if self.0.is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    /// The axes of the columns and of the rows.
    pub(super) const fn across(self) -> [usize; 2] {
        match self.axis() {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    /// How far a box reaches from its centre along the face's axis.
    pub(super) fn half_depth(self, half: &Vector3<f64>) -> f64 {
        half[self.axis()]
    }

    /// The point at a depth where the tangents of its direction are `across`.
    pub(super) fn point(self, across: [f64; 2], depth: f64) -> Point3<f64> {
        let mut point = Point3::origin();
        point[self.axis()] = self.sign() * depth;
        for (axis, tangent) in self.across().into_iter().zip(across) {
            point[axis] = tangent * depth;
        }
        point
    }
}

/// The cells of a face in which a box may be seen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Silhouette {
    pub(super) columns: Range<usize>,
    pub(super) rows: Range<usize>,
    /// Smallest depth of the box; 0 where it reaches behind the sensor.
    pub(super) near: f64,
    /// Largest depth of the box.
    pub(super) far: f64,
}

impl Silhouette {
    /// `None` where the box is not seen on this face; `count` is the number of cells along the face's edge.
    pub(super) fn new(face: Face, centre: &Point3<f64>, half: &Vector3<f64>, count: usize) -> Option<Self> {
        let (depth, reach) = (face.sign() * centre[face.axis()], face.half_depth(half));
        let (near, far) = ((depth - reach).max(0.0), depth + reach);
        if far <= 0.0 {
            return None;
        }
        let [columns, rows] = face.across().map(|axis| {
            // The outermost directions are those of the near side, unless that side is beyond the axis.
            let (low, high) = (centre[axis] - half[axis], centre[axis] + half[axis]);
            let smallest = low / if low < 0.0 { near } else { far };
            let largest = high / if high <= 0.0 { far } else { near };
            cells(smallest, largest, count as f64)
        });
        (!columns.is_empty() && !rows.is_empty()).then_some(Self { columns, rows, near, far })
    }
}

/// The cells between two tangents; `count` of them from -1 to 1.
fn cells(smallest: f64, largest: f64, count: f64) -> Range<usize> {
    let cell = |tangent: f64| 0.5 * count * (tangent + 1.0);
    // A cast ends at 0 for what is less.
    let start = cell(smallest) as usize;
    let end = (cell(largest) + 1.0).min(count) as usize;
    start..end
}
