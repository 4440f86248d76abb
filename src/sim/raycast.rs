//! Depth of every pixel of a pinhole camera in a scene.
//!
//! A pixel's ray has the direction d = (x, y, 1), so that its length is the depth z and its inverse w = 1/z is affine in
//! (x, y) on every plane. Each rectangle is brought into the camera's frame once a scan and drawn into a buffer of
//! inverse depths, where the largest wins; a pixel costs three affine functions and three comparisons, without a
//! division or a branch. Equal to [`Scene::cast`] for every pixel, which the tests hold it to.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, Vector3};

use super::kinect::Kinect;
use super::scene::{EDGE_SLACK, Rectangle, Scene};

/// Nearest depth at which a corner can be projected (m).
const NEAR: f64 = 1e-3;

/// 1/z of the first surface in each pixel (1/m), row-major; 0 where there is none.
pub(super) fn inverse_depths(
    scene: &Scene,
    camera: &Kinect,
    fixed_from_optical: &Isometry3<f64>,
) -> Vec<f64> {
    let optical_from_fixed = fixed_from_optical.inverse();
    let directions: Vec<f64> = (0..camera.width).map(|column| camera.direction_x(column)).collect();
    let mut inverse_depths = vec![0.0; camera.pixels()];
    for rectangle in scene.rectangles() {
        let Some(seen) = Seen::new(rectangle, &optical_from_fixed) else { continue };
        let (columns, rows) = seen.extent(camera);
        for row in rows {
            let pixels = &mut inverse_depths[row * camera.width..][columns.clone()];
            seen.draw_row(camera.direction_y(row), &directions[columns.clone()], pixels);
        }
    }
    inverse_depths
}

/// A rectangle as the camera sees it.
struct Seen {
    corners: [Point3<f64>; 4],
    /// w = `inverse_depth` . d
    inverse_depth: Vector3<f64>,
    /// For each edge e of half length h and the middle m: the offset of a ray's end from the middle along e, times w,
    /// is `offset` . d, and inside while its size is at most h w.
    offsets: [Vector3<f64>; 2],
    half: [f64; 2],
}

impl Seen {
    /// `None` where only the back of the rectangle could be seen.
    fn new(rectangle: &Rectangle, optical_from_fixed: &Isometry3<f64>) -> Option<Self> {
        let pose = optical_from_fixed * rectangle.pose();
        let middle = pose.translation.vector;
        let normal = pose * Vector3::z();
        let height = -normal.dot(&middle);
        if height <= 0.0 {
            return None;
        }
        let inverse_depth = -normal / height;
        let edges = [pose * Vector3::x(), pose * Vector3::y()];
        let offsets = edges.map(|edge| edge - edge.dot(&middle) * inverse_depth);
        let [half_x, half_y] = rectangle.size().map(|size| 0.5 * size);
        let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]]
            .map(|[x, y]| pose * Point3::new(x * half_x, y * half_y, 0.0));
        let half = [half_x + EDGE_SLACK, half_y + EDGE_SLACK];
        Some(Self { corners, inverse_depth, offsets, half })
    }

    /// Columns and rows outside of which the rectangle is surely not seen.
    ///
    /// The whole image where it reaches behind the camera: its outline is then not that of its corners.
    fn extent(&self, camera: &Kinect) -> (Range<usize>, Range<usize>) {
        if self.corners.iter().any(|corner| corner.z < NEAR) {
            return (0..camera.width, 0..camera.height);
        }
        let columns = self.corners.map(|corner| camera.fx * corner.x / corner.z + camera.cx);
        let rows = self.corners.map(|corner| camera.fy * corner.y / corner.z + camera.cy);
        (pixels_between(columns, camera.width), pixels_between(rows, camera.height))
    }

    /// Keeps the larger inverse depth in each pixel of a row of direction y; `xs` are the pixels' directions.
    fn draw_row(&self, y: f64, xs: &[f64], pixels: &mut [f64]) {
        let at_row = |coefficients: &Vector3<f64>| coefficients.y * y + coefficients.z;
        let (w_row, w_x) = (at_row(&self.inverse_depth), self.inverse_depth.x);
        let (u_row, u_x) = (at_row(&self.offsets[0]), self.offsets[0].x);
        let (v_row, v_x) = (at_row(&self.offsets[1]), self.offsets[1].x);
        let [half_u, half_v] = self.half;
        for (pixel, &x) in pixels.iter_mut().zip(xs) {
            let w = w_row + w_x * x;
            let (u, v) = (u_row + u_x * x, v_row + v_x * x);
            // A negative w, behind the camera, fails the first two comparisons.
            let seen = u.abs() <= half_u * w && v.abs() <= half_v * w && w > *pixel;
            *pixel = if seen { w } else { *pixel };
        }
    }
}

/// The whole pixels from the smallest to the largest coordinate, one more at either end against rounding.
fn pixels_between(coordinates: [f64; 4], count: usize) -> Range<usize> {
    let smallest = coordinates.into_iter().fold(f64::INFINITY, f64::min);
    let largest = coordinates.into_iter().fold(f64::NEG_INFINITY, f64::max);
    // A cast from a negative number gives 0.
    let start = ((smallest - 1.0) as usize).min(count);
    let end = ((largest + 2.0) as usize).min(count);
    start..end
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::sim::Robot;

    fn assert_equals_plain_casting(scene: &Scene, fixed_from_optical: &Isometry3<f64>) {
        let camera = Kinect::v1();
        let origin = Point3::from(fixed_from_optical.translation.vector);
        let inverse_depths = inverse_depths(scene, &camera, fixed_from_optical);
        for row in (0..camera.height).step_by(3) {
            for column in (0..camera.width).step_by(3) {
                let ray = Vector3::new(camera.direction_x(column), camera.direction_y(row), 1.0);
                let hit = scene.cast(&origin, &(fixed_from_optical * ray));
                let plain = hit.map_or(0.0, |hit| 1.0 / hit.length);
                let fast = inverse_depths[row * camera.width + column];
                assert!((fast - plain).abs() < 1e-9, "1/z of ({column}, {row}): {fast} is not {plain}");
            }
        }
    }

    #[test]
    fn every_pixel_of_the_drive_equals_plain_casting() {
        let scene = Scene::room();
        let robot = Robot::new(scene.route());
        for i in 0..10 {
            assert_equals_plain_casting(&scene, &robot.optical_pose(f64::from(i) * 5.4));
        }
    }

    #[test]
    fn every_pixel_equals_plain_casting_however_the_camera_is_turned() {
        let scene = Scene::room();
        for i in 0..12 {
            let (roll, pitch, yaw) = (f64::from(i), 0.7 * f64::from(i), 1.9 * f64::from(i));
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let place = Vector3::new(2.0, 0.5, 0.2 + 0.2 * f64::from(i));
            assert_equals_plain_casting(&scene, &Isometry3::from_parts(place.into(), rotation));
        }
    }

    #[test]
    fn outside_of_the_room_nothing_faces_the_camera_but_furniture() {
        let far = Isometry3::translation(0.0, 0.0, -3.0);
        let inverse_depths = inverse_depths(&Scene::room(), &Kinect::v1(), &far);
        assert!(inverse_depths.contains(&0.0));
        assert_equals_plain_casting(&Scene::room(), &far);
    }
}
