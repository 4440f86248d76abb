//! What scenes are built of: boxes, walls with openings, door leaves, tables, chairs.
//!
//! Faces that no camera could see, against a wall or on the floor, are left out. A level face that looks up is
//! [`SurfaceClass::Horizontal`], an upright one [`SurfaceClass::Wall`]; below [`THIN`] in either direction both are
//! [`SurfaceClass::Unknown`], as is what looks down.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::surface::{Hole, Shape, Surface};
use crate::engine::SurfaceClass;

/// Shortest edge of a face that is more than the edge of a board or a leg (m).
const THIN: f64 = 0.1;

/// Where something stands: moved to (x, y, z), turned by `yaw` (rad) about z.
pub(super) fn at([x, y, z]: [f64; 3], yaw: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Isometry3::from_parts(Translation3::new(x, y, z), turn)
}

/// Surfaces that are moved `by` a pose in the fixed frame.
pub(super) fn moved(mut surfaces: Vec<Surface>, by: &Isometry3<f64>) -> Vec<Surface> {
    surfaces.iter_mut().for_each(|surface| surface.rest = by * surface.rest);
    surfaces
}

/// The surfaces without those of the named faces, such as `bottom`.
pub(super) fn without(mut surfaces: Vec<Surface>, faces: &[&str]) -> Vec<Surface> {
    surfaces.retain(|surface| !faces.iter().any(|face| surface.name.ends_with(&format!("/{face}"))));
    surfaces
}

/// An axis-aligned box, from which the six rectangles around it are made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuboid {
    /// Smallest coordinates (m).
    pub(super) min: [f64; 3],
    /// Largest coordinates (m).
    pub(super) max: [f64; 3],
}

impl Cuboid {
    /// Of this length (x), width (y) and height (z), in the middle of the floor at the origin.
    pub(super) fn standing([length, width, height]: [f64; 3]) -> Self {
        let (x, y) = (0.5 * length, 0.5 * width);
        Self { min: [-x, -y, 0.0], max: [x, y, height] }
    }

    /// The faces of a thing that is seen from outside, named `name/front` (+x), `back`, `left` (+y), `right`, `top`
    /// and `bottom`.
    pub(super) fn outside(self, name: &str) -> Vec<Surface> {
        let names = [["back", "front"], ["right", "left"], ["bottom", "top"]];
        self.faces(1.0, names.map(|pair| pair.map(|face| format!("{name}/{face}"))))
    }

    /// The faces of a room that is seen from inside, named by the compass with north = +y.
    pub(super) fn inside(self) -> Vec<Surface> {
        let names = [["west wall", "east wall"], ["south wall", "north wall"], ["floor", "ceiling"]];
        self.faces(-1.0, names.map(|pair| pair.map(str::to_owned)))
    }

    /// The faces at the low and the high end of x, y and z; normals point out of the box for `side` = 1, else into it.
    fn faces(self, side: f64, names: [[String; 2]; 3]) -> Vec<Surface> {
        let ends = names.into_iter().enumerate().flat_map(|(axis, pair)| {
            pair.into_iter().zip([-1.0, 1.0]).map(move |(name, end)| (axis, end, name))
        });
        ends.map(|(axis, end, name)| self.face(axis, end, side, name)).collect()
    }

    fn face(self, axis: usize, end: f64, side: f64, name: String) -> Surface {
        let extent = Vector3::from(self.max) - Vector3::from(self.min);
        let mut middle = Vector3::from(self.min) + 0.5 * extent;
        middle[axis] += 0.5 * end * extent[axis];

        let mut normal = Vector3::zeros();
        normal[axis] = end * side;
        let x = if axis == 2 { Vector3::x() } else { Vector3::z().cross(&normal) };
        let y = normal.cross(&x);
        let size = [x, y].map(|edge| edge.dot(&extent).abs());
        let class = match (axis, end * side > 0.0) {
            (2, true) if side < 0.0 => SurfaceClass::Floor,
            (2, false) if side < 0.0 => SurfaceClass::Ceiling,
            _ if size.iter().any(|&size| size < THIN) => SurfaceClass::Unknown,
            (2, true) => SurfaceClass::Horizontal,
            (2, false) => SurfaceClass::Unknown,
            _ => SurfaceClass::Wall,
        };
        Surface::new(name, class, facing(middle, [x, y, normal]), Shape::rectangle(size))
    }
}

/// The pose of a surface by its middle and its three axes.
fn facing(middle: Vector3<f64>, axes: [Vector3<f64>; 3]) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&axes));
    Isometry3::from_parts(middle.into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

/// An upright rectangle over the floor from one point to another, seen from the right of that way; its x is along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Upright {
    pub(super) from: [f64; 2],
    pub(super) to: [f64; 2],
    /// Lower and upper end (m).
    pub(super) z: [f64; 2],
}

impl Upright {
    fn along(&self) -> Vector3<f64> {
        Vector3::new(self.to[0] - self.from[0], self.to[1] - self.from[1], 0.0)
    }

    fn length(&self) -> f64 {
        self.along().norm()
    }

    /// A face with openings.
    pub(super) fn face(self, name: &str, class: SurfaceClass, openings: &[Opening]) -> Surface {
        let (along, up) = (self.along().normalize(), Vector3::z());
        let [low, high] = self.z;
        let size = [self.length(), high - low];
        let middle = Vector3::new(
            0.5 * (self.from[0] + self.to[0]),
            0.5 * (self.from[1] + self.to[1]),
            0.5 * (low + high),
        );
        let [half_x, middle_z] = [0.5 * size[0], middle.z];
        let hole = |opening: &Opening| Hole {
            low: [opening.from - half_x, opening.z[0] - middle_z],
            high: [opening.to - half_x, opening.z[1] - middle_z],
        };
        let shape = Shape::Rectangle { size, holes: openings.iter().map(hole).collect() };
        Surface::new(name, class, facing(middle, [along, up, along.cross(&up)]), shape)
    }
}

/// A doorway or a window in a wall.
#[derive(Clone, Copy, Debug)]
pub(super) struct Opening {
    /// Begin, along the wall (m).
    pub(super) from: f64,
    /// End, along the wall (m).
    pub(super) to: f64,
    /// Lower and upper end (m).
    pub(super) z: [f64; 2],
}

/// The faces within openings of a wall: jambs, lintel and, above the floor, sill; `wall` is its right face and
/// `thickness` reaches to the left.
pub(super) fn reveals(name: &str, wall: Upright, thickness: f64, openings: &[Opening]) -> Vec<Surface> {
    let along = wall.along().normalize();
    let left = Vector3::z().cross(&along);
    let from = Vector3::new(wall.from[0], wall.from[1], 0.0);
    let mut surfaces = Vec::new();
    for (number, opening) in (1..).zip(openings) {
        let middle = |s: f64, z: f64| from + along * s + 0.5 * thickness * left + z * Vector3::z();
        let [low, high] = opening.z;
        let (width, height) = (opening.to - opening.from, high - low);
        let (s, z) = (0.5 * (opening.from + opening.to), 0.5 * (low + high));
        let up = Vector3::z();
        let mut add = |part: &str, class, middle, axes: [Vector3<f64>; 3], size| {
            let name = format!("{name} {number}/{part}");
            surfaces.push(Surface::new(name, class, facing(middle, axes), Shape::rectangle(size)));
        };
        let upright = if thickness < THIN { SurfaceClass::Unknown } else { SurfaceClass::Wall };
        add("first jamb", upright, middle(opening.from, z), [left, up, along], [thickness, height]);
        add("second jamb", upright, middle(opening.to, z), [-left, up, -along], [thickness, height]);
        add("lintel", SurfaceClass::Unknown, middle(s, high), [along, -left, -up], [width, thickness]);
        if low > 0.0 {
            let class = if thickness < THIN { SurfaceClass::Unknown } else { SurfaceClass::Horizontal };
            add("sill", class, middle(s, low), [along, left, up], [width, thickness]);
        }
    }
    surfaces
}

/// A wall with two sides and openings; `name` is followed by the names of its right and left side.
pub(super) struct TwoSided<'a> {
    pub(super) right: &'a str,
    pub(super) left: &'a str,
    /// The right face.
    pub(super) face: Upright,
    /// To the left of the right face (m).
    pub(super) thickness: f64,
    /// Upper end of the left face (m).
    pub(super) left_height: f64,
}

impl TwoSided<'_> {
    /// Both faces and the reveals.
    pub(super) fn surfaces(&self, openings: &[Opening]) -> Vec<Surface> {
        let left = Vector3::z().cross(&self.face.along().normalize()) * self.thickness;
        let across = |[x, y]: [f64; 2]| [x + left.x, y + left.y];
        let back = Upright {
            from: across(self.face.to),
            to: across(self.face.from),
            z: [self.face.z[0], self.left_height],
        };
        let length = self.face.length();
        let mirrored = |opening: &Opening| Opening {
            from: length - opening.to,
            to: length - opening.from,
            z: opening.z,
        };
        let mirrored: Vec<_> = openings.iter().map(mirrored).collect();
        let mut surfaces = vec![
            self.face.face(self.right, SurfaceClass::Wall, openings),
            back.face(self.left, SurfaceClass::Wall, &mirrored),
        ];
        surfaces.extend(reveals(&format!("{} doorway", self.right), self.face, self.thickness, openings));
        surfaces
    }
}

/// Thickness of a door leaf (m).
const LEAF: f64 = 0.039;

/// A door leaf that hangs at `hinge`; closed it would point to `closed` (rad), and it stands open by `open` (rad,
/// counter-clockwise). Its sides are `left` and `right` of the way from the hinge.
pub(super) fn door_leaf(name: &str, hinge: [f64; 2], closed: f64, open: f64, size: [f64; 2]) -> Vec<Surface> {
    let [width, height] = size;
    let leaf = Cuboid { min: [0.0, -0.5 * LEAF, 0.008], max: [width, 0.5 * LEAF, height] };
    let mut surfaces = without(leaf.outside(name), &["bottom", "top", "back"]);
    if open.abs() >= 15.0_f64.to_radians() {
        let sides = surfaces.iter_mut().filter(|surface| surface.class == SurfaceClass::Wall);
        sides.for_each(|surface| surface.class = SurfaceClass::Door);
    }
    moved(surfaces, &at([hinge[0], hinge[1], 0.0], closed + open))
}

/// A board on four legs, in the middle of the floor at the origin; `size` is length, width and height.
pub(super) fn table(name: &str, size: [f64; 3], board: f64, leg: f64) -> Vec<Surface> {
    let Cuboid { min: [x0, y0, _], max: [x1, y1, top] } = Cuboid::standing(size);
    let underside = top - board;
    let mut surfaces = Cuboid { min: [x0, y0, underside], max: [x1, y1, top] }.outside(name);
    let legs = [x0, x1 - leg].into_iter().flat_map(|x| [y0, y1 - leg].map(|y| [x, y]));
    for (number, [x, y]) in (1..).zip(legs) {
        let leg = Cuboid { min: [x, y, 0.0], max: [x + leg, y + leg, underside] };
        surfaces.extend(without(leg.outside(&format!("{name} leg {number}")), &["bottom", "top"]));
    }
    surfaces
}

/// A chair that looks along +x, in the middle of the floor at the origin.
pub(super) fn chair(name: &str) -> Vec<Surface> {
    let mut surfaces = table(&format!("{name} seat"), [0.43, 0.42, 0.457], 0.028, 0.034);
    let back = Cuboid { min: [-0.215, -0.20, 0.49], max: [-0.187, 0.20, 0.873] };
    surfaces.extend(back.outside(&format!("{name} back")));
    surfaces
}

/// An upright cylinder with a lid, in the middle of the floor at the origin.
pub(super) fn cylinder(name: &str, radius: f64, height: f64) -> Vec<Surface> {
    let middle = Isometry3::translation(0.0, 0.0, 0.5 * height);
    let lid = Isometry3::translation(0.0, 0.0, height);
    let lid_class = if 2.0 * radius < THIN { SurfaceClass::Unknown } else { SurfaceClass::Horizontal };
    vec![
        Surface::new(
            format!("{name}/side"),
            SurfaceClass::Curved,
            middle,
            Shape::Cylinder { radius, height },
        ),
        Surface::new(format!("{name}/top"), lid_class, lid, Shape::Disc { radius }),
    ]
}

/// A ball that lies on the floor at the origin.
pub(super) fn ball(name: &str, radius: f64) -> Surface {
    let middle = Isometry3::translation(0.0, 0.0, radius);
    Surface::new(name, SurfaceClass::Curved, middle, Shape::Sphere { radius })
}

/// A rectangle that rises along `yaw` (rad) by `tilt` (rad) from the level, seen from above.
pub(super) fn incline(name: &str, middle: [f64; 3], yaw: f64, tilt: f64, size: [f64; 2]) -> Surface {
    let lean = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -tilt);
    let degrees = tilt.to_degrees().abs();
    let class = match degrees {
        _ if size.iter().any(|&size| size < THIN) => SurfaceClass::Unknown,
        _ if degrees <= 10.0 => SurfaceClass::Horizontal,
        _ if tilt.abs() >= FRAC_PI_2 - 10.0_f64.to_radians() => SurfaceClass::Wall,
        _ => SurfaceClass::Slope,
    };
    Surface::new(name, class, at(middle, yaw) * lean, Shape::rectangle(size))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn middle(surface: &Surface) -> Vector3<f64> {
        surface.pose().translation.vector
    }

    #[test]
    fn the_faces_of_a_box_point_outwards_and_those_of_a_room_inwards() {
        let cuboid = Cuboid { min: [1.0, -0.5, 0.0], max: [2.0, 0.5, 3.0] };
        let centre = Vector3::new(1.5, 0.0, 1.5);
        for face in cuboid.outside("box") {
            assert!(face.normal().dot(&(middle(&face) - centre)) > 0.4, "{}", face.name());
        }
        for face in cuboid.inside() {
            assert!(face.normal().dot(&(middle(&face) - centre)) < -0.4, "{}", face.name());
        }
    }

    #[test]
    fn the_faces_of_a_box_cover_its_area() {
        let cuboid = Cuboid { min: [1.0, -0.5, 0.0], max: [2.0, 0.5, 3.0] };
        let area = |face: &Surface| face.shape().half_ranges().iter().map(|half| 2.0 * half).product::<f64>();
        let area: f64 = cuboid.outside("box").iter().map(area).sum();
        assert!((area - (2.0 * 1.0 + 4.0 * 3.0)).abs() < 1e-12);
    }

    #[test]
    fn a_wall_is_seen_from_the_right_of_its_way_and_its_reveals_from_the_opening() {
        let wall = TwoSided {
            right: "south side",
            left: "north side",
            face: Upright { from: [0.0, 1.0], to: [4.0, 1.0], z: [0.0, 2.5] },
            thickness: 0.12,
            left_height: 2.3,
        };
        let surfaces = wall.surfaces(&[Opening { from: 1.0, to: 2.0, z: [0.0, 2.0] }]);
        let expected = [
            ("south side", [2.0, 1.0, 1.25], [0.0, -1.0, 0.0]),
            ("north side", [2.0, 1.12, 1.15], [0.0, 1.0, 0.0]),
            ("south side doorway 1/first jamb", [1.0, 1.06, 1.0], [1.0, 0.0, 0.0]),
            ("south side doorway 1/second jamb", [2.0, 1.06, 1.0], [-1.0, 0.0, 0.0]),
            ("south side doorway 1/lintel", [1.5, 1.06, 2.0], [0.0, 0.0, -1.0]),
        ];
        assert_eq!(surfaces.len(), expected.len());
        for (surface, (name, place, normal)) in surfaces.iter().zip(expected) {
            assert_eq!(surface.name(), name);
            assert!((middle(surface) - Vector3::from(place)).norm() < 1e-12, "{name}");
            assert!((surface.normal().into_inner() - Vector3::from(normal)).norm() < 1e-12, "{name}");
        }
    }

    #[test]
    fn a_leaf_is_a_door_from_fifteen_degrees_on() {
        for (degrees, class) in
            [(14.0_f64, SurfaceClass::Wall), (15.0, SurfaceClass::Door), (-90.0, SurfaceClass::Door)]
        {
            let leaf = door_leaf("leaf", [0.0, 0.0], 0.0, degrees.to_radians(), [0.9, 2.0]);
            assert_eq!(leaf.iter().filter(|surface| surface.class() == class).count(), 2, "{degrees}");
        }
    }
}
