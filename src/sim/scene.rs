//! What stands in a simulated world, and the route a robot takes among it.
//!
//! A scene is data in the fixed frame (`odom`), z up, and a function of time where things move.

use nalgebra::{Isometry3, Vector3};

use super::path::{Path, Route};
use super::robot::CAMERA_PITCH;
use super::surface::{Moving, Surface};

/// Surfaces and a route among them.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    surfaces: Vec<Surface>,
    route: Route,
    camera_pitch: f64,
}

impl Scene {
    /// Numbers the surfaces by their order, from 1.
    pub(crate) fn new(mut surfaces: Vec<Surface>, route: Route) -> Self {
        for (label, surface) in (1..).zip(&mut surfaces) {
            surface.label = label;
        }
        Self { surfaces, route, camera_pitch: CAMERA_PITCH }
    }

    /// Has the camera look down by `pitch` (rad).
    pub(super) fn with_camera_pitch(self, pitch: f64) -> Self {
        Self { camera_pitch: pitch, ..self }
    }

    /// The scene moved so that the route begins at the origin along +x, as a robot's odometry has it.
    pub(super) fn seen_from_the_start(mut self) -> Self {
        let start = Path::new(&self.route).pose_at(0.0).inverse();
        let turn = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), start.rotation.angle());
        let start_3d = Isometry3::from_parts(start.translation.vector.push(0.0).into(), turn);
        for surface in &mut self.surfaces {
            match &mut surface.moving {
                None => surface.rest = start_3d * surface.rest,
                Some(Moving { frame, .. }) => *frame = start_3d * *frame,
            }
        }
        self.route.corners.iter_mut().for_each(|corner| *corner = start * *corner);
        self
    }

    /// All surfaces, by label: the first has label 1.
    pub fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// The surface that points with this label lie on; `None` for 0, which is no surface, and beyond the last.
    pub fn surface(&self, label: u32) -> Option<&Surface> {
        self.surfaces.get((label as usize).checked_sub(1)?)
    }

    /// Where a robot drives in this scene; it starts at the origin of the fixed frame.
    pub const fn route(&self) -> &Route {
        &self.route
    }

    /// How far the robot's camera looks down (rad).
    pub const fn camera_pitch(&self) -> f64 {
        self.camera_pitch
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::sim::parts::Cuboid;

    fn unit_box() -> Scene {
        let cuboid = Cuboid { min: [1.0, -0.5, 0.0], max: [2.0, 0.5, 3.0] };
        Scene::new(cuboid.outside("box"), Route::default())
    }

    #[test]
    fn a_ray_ends_at_the_first_front_it_meets_and_passes_backs() {
        let scene = unit_box();
        let cast = |x, y, z, direction: Vector3<f64>| scene.cast(&Point3::new(x, y, z), &direction, 0.0);
        let hit = cast(0.0, 0.1, 1.0, Vector3::new(0.5, 0.0, 0.0)).unwrap();
        assert_eq!(scene.surface(hit.label).unwrap().name(), "box/back");
        assert!((hit.length - 2.0).abs() < 1e-12);
        assert_eq!(cast(1.5, 0.1, 1.0, Vector3::x()), None, "from inside the box");
        assert_eq!(cast(0.0, 0.6, 1.0, Vector3::x()), None, "beside the box");
        assert_eq!(cast(0.0, 0.1, 1.0, -Vector3::x()), None, "away from the box");
    }

    #[test]
    fn a_label_is_one_more_than_the_index() {
        let scene = unit_box();
        assert!(scene.surface(0).is_none() && scene.surface(7).is_none());
        for (i, surface) in scene.surfaces().iter().enumerate() {
            assert_eq!(surface.label() as usize, i + 1);
            assert_eq!(scene.surface(surface.label()), Some(surface));
        }
    }

    #[test]
    fn the_distance_to_a_rectangle_counts_from_its_edge() {
        let scene = unit_box();
        let top = scene.surfaces().iter().find(|face| face.name() == "box/top").unwrap();
        assert!((top.distance(&Point3::new(1.5, 0.0, 3.25), 0.0).unwrap() - 0.25).abs() < 1e-12);
        assert!((top.distance(&Point3::new(5.0, 0.0, 7.0), 0.0).unwrap() - 5.0).abs() < 1e-12);
    }
}
