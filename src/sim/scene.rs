//! What stands in a simulated world: flat, finite, one-sided rectangles, and the route a robot takes among them.
//!
//! A scene is data in the fixed frame (`odom`), z up. Rectangles are one-sided because a real surface is seen from one
//! side only; it halves the work of the rays, and gives every surface a true normal to compare an estimate with.
//! [`Scene::cast`] is the plain definition of what a ray meets; the Kinect uses a faster form that is tested against it.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, UnitVector3, Vector3};

use super::path::Route;

/// How far beyond its edge a rectangle still stops a ray (m), so that no ray slips through where two of them meet.
pub(super) const EDGE_SLACK: f64 = 1e-9;

/// A flat surface with four right angles, visible from the side its +z points to.
#[derive(Clone, Debug, PartialEq)]
pub struct Rectangle {
    name: String,
    fixed_from_local: Isometry3<f64>,
    size: [f64; 2],
}

impl Rectangle {
    /// What it is, unique within a scene, such as `floor` or `table/top`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its middle in the fixed frame; +z = normal, x and y along the edges.
    pub const fn pose(&self) -> &Isometry3<f64> {
        &self.fixed_from_local
    }

    /// Full extents along the pose's x and y (m).
    pub const fn size(&self) -> [f64; 2] {
        self.size
    }

    /// Towards the side it is seen from.
    pub fn normal(&self) -> UnitVector3<f64> {
        self.fixed_from_local * Vector3::z_axis()
    }

    /// Distance from `point` to the nearest point of the rectangle (m).
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let local = self.fixed_from_local.inverse_transform_point(point);
        let [beyond_x, beyond_y] = [0, 1].map(|i| (local[i].abs() - 0.5 * self.size[i]).max(0.0));
        Vector3::new(beyond_x, beyond_y, local.z).norm()
    }

    /// How many `direction`s from `origin` the ray meets the front of the rectangle; `None` where it does not.
    fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let origin = self.fixed_from_local.inverse_transform_point(origin);
        let direction = self.fixed_from_local.inverse_transform_vector(direction);
        if origin.z <= 0.0 || direction.z >= 0.0 {
            return None;
        }
        let length = -origin.z / direction.z;
        let met = origin + direction * length;
        let inside = |i: usize| met[i].abs() <= 0.5 * self.size[i] + EDGE_SLACK;
        (inside(0) && inside(1)).then_some(length)
    }
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Scene::rectangles`].
    pub rectangle: usize,
    /// Length of the ray, in multiples of its direction.
    pub length: f64,
}

/// Surfaces and a route among them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    rectangles: Vec<Rectangle>,
    route: Route,
}

impl Scene {
    pub(super) const fn new(rectangles: Vec<Rectangle>, route: Route) -> Self {
        Self { rectangles, route }
    }

    /// All surfaces.
    pub fn rectangles(&self) -> &[Rectangle] {
        &self.rectangles
    }

    /// Where a robot drives in this scene; it starts at the origin of the fixed frame.
    pub const fn route(&self) -> &Route {
        &self.route
    }

    /// The first surface that the ray from `origin` along `direction` meets.
    pub fn cast(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let hits = self.rectangles.iter().enumerate().filter_map(|(rectangle, surface)| {
            surface.cast(origin, direction).map(|length| Hit { rectangle, length })
        });
        hits.min_by(|a, b| a.length.total_cmp(&b.length))
    }

    /// The surface nearest to `point` and the distance to it (m); `None` in an empty scene.
    pub fn nearest(&self, point: &Point3<f64>) -> Option<(&Rectangle, f64)> {
        let distances = self.rectangles.iter().map(|rectangle| (rectangle, rectangle.distance(point)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1))
    }
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
    /// The faces of a thing that is seen from outside, named `name/front` (+x), `back`, `left` (+y), `right`, `top`
    /// and `bottom`.
    pub(super) fn outside(self, name: &str) -> Vec<Rectangle> {
        let names = [["back", "front"], ["right", "left"], ["bottom", "top"]];
        self.faces(1.0, names.map(|pair| pair.map(|face| format!("{name}/{face}"))))
    }

    /// The faces of a room that is seen from inside, named by the compass with north = +y.
    pub(super) fn inside(self) -> Vec<Rectangle> {
        let names = [["west wall", "east wall"], ["south wall", "north wall"], ["floor", "ceiling"]];
        self.faces(-1.0, names.map(|pair| pair.map(str::to_owned)))
    }

    /// The faces at the low and the high end of x, y and z; normals point out of the box for `side` = 1, else into it.
    fn faces(self, side: f64, names: [[String; 2]; 3]) -> Vec<Rectangle> {
        let ends = names.into_iter().enumerate().flat_map(|(axis, pair)| {
            pair.into_iter().zip([-1.0, 1.0]).map(move |(name, end)| (axis, end, name))
        });
        ends.map(|(axis, end, name)| self.face(axis, end, side, name)).collect()
    }

    fn face(self, axis: usize, end: f64, side: f64, name: String) -> Rectangle {
        let extent = Vector3::from(self.max) - Vector3::from(self.min);
        let mut middle = Vector3::from(self.min) + 0.5 * extent;
        middle[axis] += 0.5 * end * extent[axis];

        let mut normal = Vector3::zeros();
        normal[axis] = end * side;
        let x = if axis == 2 { Vector3::x() } else { Vector3::z().cross(&normal) };
        let y = normal.cross(&x);
        let size = [x, y].map(|edge| edge.dot(&extent).abs());

        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, normal]));
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        Rectangle { name, fixed_from_local: Isometry3::from_parts(middle.into(), rotation), size }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box() -> Vec<Rectangle> {
        Cuboid { min: [1.0, -0.5, 0.0], max: [2.0, 0.5, 3.0] }.outside("box")
    }

    #[test]
    fn the_faces_of_a_box_point_outwards_and_those_of_a_room_inwards() {
        let cuboid = Cuboid { min: [1.0, -0.5, 0.0], max: [2.0, 0.5, 3.0] };
        let middle = Vector3::new(1.5, 0.0, 1.5);
        for face in cuboid.outside("box") {
            assert!(face.normal().dot(&(face.pose().translation.vector - middle)) > 0.4, "{}", face.name());
        }
        for face in cuboid.inside() {
            assert!(face.normal().dot(&(face.pose().translation.vector - middle)) < -0.4, "{}", face.name());
        }
    }

    #[test]
    fn the_faces_of_a_box_cover_its_area() {
        let area: f64 = unit_box().iter().map(|face| face.size()[0] * face.size()[1]).sum();
        assert!((area - (2.0 * 1.0 + 4.0 * 3.0)).abs() < 1e-12);
    }

    #[test]
    fn a_ray_ends_at_the_first_front_it_meets_and_passes_backs() {
        let scene = Scene::new(unit_box(), Route::default());
        let hit = scene.cast(&Point3::new(0.0, 0.1, 1.0), &Vector3::new(0.5, 0.0, 0.0)).unwrap();
        assert_eq!(scene.rectangles()[hit.rectangle].name(), "box/back");
        assert!((hit.length - 2.0).abs() < 1e-12);
        assert_eq!(scene.cast(&Point3::new(1.5, 0.1, 1.0), &Vector3::x()), None, "from inside the box");
        assert_eq!(scene.cast(&Point3::new(0.0, 0.6, 1.0), &Vector3::x()), None, "beside the box");
        assert_eq!(scene.cast(&Point3::new(0.0, 0.1, 1.0), &-Vector3::x()), None, "away from the box");
    }

    #[test]
    fn the_distance_to_a_rectangle_counts_from_its_edge() {
        let top = unit_box().into_iter().find(|face| face.name() == "box/top").unwrap();
        assert!((top.distance(&Point3::new(1.5, 0.0, 3.25)) - 0.25).abs() < 1e-12);
        assert!((top.distance(&Point3::new(5.0, 0.0, 7.0)) - 5.0).abs() < 1e-12);
    }
}
