//! Rectangles that count as one surface: those that touch and lie within half a voxel of one plane. Holes in them do not
//! matter: what closes one is part of the same plane, or is too far from it.
//!
//! Two rectangles are joined when they face the same way to within 15 degrees, one lies within half a voxel of the other's
//! plane, and the gap between them along that plane is at most a voxel, so that no empty voxel fits into it: their voxels
//! touch. Were the gap taken in space, the half voxel would say nothing. Back to back is not joined: the two sides of a board are seen from different places. Joining is
//! transitive. Costs O(n^2) for n rectangles, once.

use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};

use crate::sim::{Shape, Surface};

/// Largest angle between the normals (rad), 15 degrees: what a narrow jamb may be turned from the leaf beside it.
const ANGLE: f64 = std::f64::consts::PI / 12.0;

/// Which surfaces count as one; a group is named by the index of its first surface. Only rectangles are ever joined.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// Of each surface; labels count from 1.
    group: Vec<u32>,
}

/// A surface with four corners.
struct Rectangle {
    index: usize,
    pose: Isometry3<f64>,
    /// Counter-clockwise seen from the front.
    corners: [Point3<f64>; 4],
}

impl Rectangle {
    fn new(index: usize, surface: &Surface) -> Option<Self> {
        let Shape::Rectangle { size, .. } = surface.shape() else { return None };
        let [x, y] = size.map(|side| 0.5 * side);
        let pose = surface.pose();
        let corners = [[x, y], [-x, y], [-x, -y], [x, -y]].map(|[x, y]| pose * Point3::new(x, y, 0.0));
        Some(Self { index, pose, corners })
    }

    fn normal(&self) -> Vector3<f64> {
        self.pose.rotation * Vector3::z()
    }
}

impl Groups {
    pub(super) fn new(surfaces: &[Surface], voxel_size: f64) -> Self {
        let mut group: Vec<u32> = (0..surfaces.len() as u32).collect();
        let rectangles =
            surfaces.iter().enumerate().filter_map(|(index, surface)| Rectangle::new(index, surface));
        let rectangles: Vec<_> = rectangles.collect();
        for (place, a) in rectangles.iter().enumerate() {
            for b in &rectangles[..place] {
                let (of_a, of_b) = (group[a.index], group[b.index]);
                let (high, low) = (of_a.max(of_b), of_a.min(of_b));
                if high != low && are_one(a, b, voxel_size) {
                    group.iter_mut().filter(|group| **group == high).for_each(|group| *group = low);
                }
            }
        }
        Self { group }
    }

    /// `None` for a label that no surface has.
    pub(super) fn of_label(&self, label: u32) -> Option<u32> {
        self.group.get((label as usize).checked_sub(1)?).copied()
    }

    /// Indices of the surfaces of a group.
    pub(super) fn members(&self, group: u32) -> impl Iterator<Item = usize> {
        self.group.iter().enumerate().filter(move |(_, of)| **of == group).map(|(index, _)| index)
    }
}

fn are_one(a: &Rectangle, b: &Rectangle, voxel_size: f64) -> bool {
    let parallel = a.normal().angle(&b.normal()) <= ANGLE;
    let half = 0.5 * voxel_size;
    // 1e-9 m: a gap of exactly a voxel, however it was rounded.
    parallel && (within(a, b, half) || within(b, a, half)) && gap(a, b) <= voxel_size + 1e-9
}

/// Whether all of `b` lies within `reach` of the plane of `a`.
fn within(a: &Rectangle, b: &Rectangle, reach: f64) -> bool {
    // 1e-9 m: a distance of exactly half a voxel is within it, however it was rounded.
    b.corners.iter().all(|corner| a.pose.inverse_transform_point(corner).z.abs() <= reach + 1e-9)
}

/// Distance of two rectangles along the plane of the first.
fn gap(a: &Rectangle, b: &Rectangle) -> f64 {
    let flat =
        |rectangle: &Rectangle| rectangle.corners.map(|corner| a.pose.inverse_transform_point(&corner).xy());
    let (a, b) = (flat(a), flat(b));
    if inside(&a, &b[0]) || inside(&b, &a[0]) {
        return 0.0;
    }
    let pairs = sides(&a).flat_map(|side| sides(&b).map(move |other| (side, other)));
    pairs.map(|(side, other)| side_distance(side, other)).fold(f64::INFINITY, f64::min)
}

type Side = [Point2<f64>; 2];

fn sides(corners: &[Point2<f64>; 4]) -> impl Iterator<Item = Side> {
    let corners = *corners;
    (0..4).map(move |i| [corners[i], corners[(i + 1) % 4]])
}

/// Whether the corners, which go round counter-clockwise, have the point on their left all the way.
fn inside(corners: &[Point2<f64>; 4], point: &Point2<f64>) -> bool {
    sides(corners).all(|[from, to]| (to - from).perp(&(point - from)) >= 0.0)
}

fn side_distance([a, b]: Side, [c, d]: Side) -> f64 {
    let across = |[from, to]: Side, p: Point2<f64>, q: Point2<f64>| {
        let along = to - from;
        along.perp(&(p - from)) * along.perp(&(q - from)) < 0.0
    };
    if across([a, b], c, d) && across([c, d], a, b) {
        return 0.0;
    }
    let ends = [(a, [c, d]), (b, [c, d]), (c, [a, b]), (d, [a, b])];
    ends.into_iter().map(|(end, side)| to_side(end, side)).fold(f64::INFINITY, f64::min)
}

fn to_side(point: Point2<f64>, [from, to]: Side) -> f64 {
    let along: Vector2<f64> = to - from;
    let share = (point - from).dot(&along) / along.norm_squared();
    (point - (from + along * share.clamp(0.0, 1.0))).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::SurfaceClass;
    use crate::sim::{Route, Scene};

    /// A level rectangle at a place, turned about x (rad).
    fn level(size: [f64; 2], place: [f64; 3], turn: f64) -> Surface {
        let pose = Isometry3::new(Vector3::from(place), Vector3::x() * turn);
        Surface::new("", SurfaceClass::Floor, pose, Shape::Rectangle { size, holes: Vec::new() })
    }

    fn groups(surfaces: Vec<Surface>) -> Groups {
        Groups::new(Scene::new(surfaces, Route::default()).surfaces(), 0.08)
    }

    fn joined(place: [f64; 3], turn: f64) -> bool {
        let groups = groups(vec![level([2.0, 1.0], [0.0; 3], 0.0), level([2.0, 1.0], place, turn)]);
        groups.of_label(1) == groups.of_label(2)
    }

    #[test]
    fn rectangles_are_one_that_touch_within_half_a_voxel_of_one_plane() {
        assert!(joined([2.0, 0.0, 0.0], 0.0), "side by side");
        assert!(joined([2.08, 0.3, 0.0], 0.0), "a gap of a voxel");
        assert!(!joined([2.081, 0.3, 0.0], 0.0), "a gap of more");
        assert!(joined([2.0, 0.0, 0.04], 0.0), "a step of half a voxel");
        assert!(!joined([2.0, 0.0, 0.041], 0.0), "a step of more");
        assert!(joined([0.3, 0.2, 0.03], 0.0), "one above the other");
        assert!(!joined([0.3, 0.2, 0.0], std::f64::consts::PI), "back to back");
        assert!(joined([0.0, 1.0, 0.0], 0.079), "turned, and within half a voxel");
        assert!(!joined([0.0, 1.0, 0.0], 0.081), "turned further");
        assert!(!joined([2.06, 1.06, 0.0], 0.0), "85 mm from corner to corner");
    }

    #[test]
    fn crossing_and_enclosed_rectangles_touch() {
        let rectangle = |size| Rectangle::new(0, &level(size, [0.0; 3], 0.0)).unwrap();
        let first = rectangle([2.0, 1.0]);
        for other in [rectangle([0.2, 9.0]), rectangle([0.2, 0.1])] {
            assert_eq!([gap(&first, &other), gap(&other, &first)], [0.0; 2]);
        }
    }

    #[test]
    fn joining_is_transitive_and_unknown_labels_have_no_group() {
        let row = [0.0, 4.0, 2.0].map(|x| level([2.0, 1.0], [x, 0.0, 0.0], 0.0));
        let ball =
            Surface::new("", SurfaceClass::Curved, Isometry3::identity(), Shape::Sphere { radius: 0.1 });
        let groups = groups(row.into_iter().chain([ball]).collect());
        let of = [0, 1, 2, 3, 4, 5].map(|label| groups.of_label(label));
        assert_eq!(of, [None, Some(0), Some(0), Some(0), Some(3), None]);
        assert_eq!(groups.members(0).collect::<Vec<_>>(), [0, 1, 2]);
    }
}
