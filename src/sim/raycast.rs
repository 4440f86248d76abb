//! First surface in every pixel of a pinhole camera in a scene, and its depth.
//!
//! A pixel's ray has the direction d = (x, y, 1), so that its length is the depth z and its inverse w = 1/z is affine in
//! (x, y) on every plane. Each surface is brought into the camera's frame once a scan and drawn into a buffer of
//! inverse depths, where the largest wins. Of a row of pixels only those between the edges of a flat surface are
//! visited, and each costs three affine functions and comparisons, without a division; a bent surface costs a root.
//! Equal for every pixel to the plain definition of what a ray meets (`plain`), which the tests hold it to.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, Vector3};

use super::kinect::Kinect;
use super::scene::Scene;
use super::surface::{EDGE_SLACK, Hole, Shape};

/// Nearest depth at which a corner can be projected (m).
const NEAR: f64 = 1e-3;

/// What is first in each pixel, row-major.
pub(super) struct View {
    /// 1/z (1/m); 0 where there is nothing.
    pub(super) inverse_depths: Vec<f64>,
    /// Label of the surface; 0 where there is none.
    pub(super) labels: Vec<u32>,
    /// By label - 1; `None` for surfaces that surely are not seen.
    drawn: Vec<Option<Drawn>>,
}

impl View {
    /// What the camera sees, `seconds` after the start.
    pub(super) fn new(
        scene: &Scene,
        camera: &Kinect,
        fixed_from_optical: &Isometry3<f64>,
        seconds: f64,
    ) -> Self {
        let optical_from_fixed = fixed_from_optical.inverse();
        let xs: Vec<f64> = (0..camera.width).map(|column| camera.direction_x(column)).collect();
        let mut inverse_depths = vec![0.0; camera.pixels()];
        let mut labels = vec![0; camera.pixels()];
        let drawn = scene.surfaces().iter().map(|surface| {
            let pose = optical_from_fixed * surface.pose_at(seconds)?;
            let drawn = Drawn::new(surface.shape(), &pose)?;
            let (columns, rows) = extent(surface.shape(), &pose, camera);
            for row in rows {
                let y = camera.direction_y(row);
                let columns = drawn.columns(y, camera, &columns);
                let pixels = row * camera.width + columns.start..row * camera.width + columns.end;
                let into = Row {
                    label: surface.label(),
                    y,
                    xs: &xs[columns],
                    inverse_depths: &mut inverse_depths[pixels.clone()],
                    labels: &mut labels[pixels],
                };
                drawn.draw(into);
            }
            Some(drawn)
        });
        let drawn = drawn.collect();
        Self { inverse_depths, labels, drawn }
    }

    /// Cosine of the angle between the surface's normal in a pixel and the ray `d` = (x, y, 1) to it where it is below
    /// `limit`; `None` where it is not, and without a surface.
    pub(super) fn cosine_below(&self, limit: f64, pixel: usize, d: &Vector3<f64>) -> Option<f64> {
        let index = (self.labels[pixel] as usize).checked_sub(1)?;
        let w = self.inverse_depths[pixel];
        // Cosine times |d|: most pixels are done with before a root is drawn.
        let along = match self.drawn[index].as_ref()? {
            Drawn::Flat(flat) => flat.height * w,
            Drawn::Round(round) => {
                let from_middle = d / w - round.middle;
                let outwards = from_middle - round.axis * round.axis.dot(&from_middle);
                -outwards.dot(d) / outwards.norm()
            }
        };
        let length = d.norm_squared();
        (along * along < limit * limit * length).then(|| along / length.sqrt())
    }
}

/// Pixels of a row to draw into.
struct Row<'a> {
    label: u32,
    /// y of the row's direction.
    y: f64,
    /// x of the pixels' directions.
    xs: &'a [f64],
    inverse_depths: &'a mut [f64],
    labels: &'a mut [u32],
}

impl Row<'_> {
    /// Keeps the larger inverse depth, with its label, in each pixel; `met` gives that of a pixel's ray or, where the
    /// ray passes, one that is not above 0.
    fn keep_larger(self, met: impl Fn(f64) -> f64) {
        let pixels = self.inverse_depths.iter_mut().zip(self.labels).zip(self.xs);
        for ((nearest, label), &x) in pixels {
            let w = met(x);
            if w > *nearest {
                *nearest = w;
                *label = self.label;
            }
        }
    }
}

/// A surface as the camera sees it.
enum Drawn {
    Flat(Flat),
    Round(Round),
}

impl Drawn {
    /// `None` where only the back of the surface could be seen.
    fn new(shape: &Shape, pose: &Isometry3<f64>) -> Option<Self> {
        match shape {
            Shape::Rectangle { holes, .. } => Flat::new(shape, pose, holes, None).map(Self::Flat),
            Shape::Disc { radius } => Flat::new(shape, pose, &[], Some(*radius)).map(Self::Flat),
            Shape::Cylinder { radius, height } => {
                Round::new(pose, pose * Vector3::z(), *radius, 0.5 * height).map(Self::Round)
            }
            Shape::Sphere { radius } => {
                Round::new(pose, Vector3::zeros(), *radius, f64::INFINITY).map(Self::Round)
            }
        }
    }

    /// Those of `columns` in which the surface may be seen, in a row of direction y.
    fn columns(&self, y: f64, camera: &Kinect, columns: &Range<usize>) -> Range<usize> {
        match self {
            Self::Flat(flat) => flat.columns(y, camera, columns),
            Self::Round(_) => columns.clone(),
        }
    }

    fn draw(&self, row: Row<'_>) {
        match self {
            Self::Flat(flat) => flat.draw(row),
            Self::Round(round) => round.draw(row),
        }
    }
}

/// A flat surface in the camera's frame.
struct Flat {
    /// Of the camera above the surface (m).
    height: f64,
    /// w = `inverse_depth` . d
    inverse_depth: Vector3<f64>,
    /// For each edge e of half length h and the middle m: the offset of a ray's end from the middle along e, times w,
    /// is `offset` . d, and inside while its size is at most h w.
    offsets: [Vector3<f64>; 2],
    half: [f64; 2],
    holes: Vec<Hole>,
    /// Of a disc (m).
    radius: Option<f64>,
}

impl Flat {
    fn new(shape: &Shape, pose: &Isometry3<f64>, holes: &[Hole], radius: Option<f64>) -> Option<Self> {
        let middle = pose.translation.vector;
        let normal = pose * Vector3::z();
        let height = -normal.dot(&middle);
        if height <= 0.0 {
            return None;
        }
        let inverse_depth = -normal / height;
        let edges = [pose * Vector3::x(), pose * Vector3::y()];
        let offsets = edges.map(|edge| edge - edge.dot(&middle) * inverse_depth);
        let [half_u, half_v, _] = shape.half_extents().map(|half| half + EDGE_SLACK);
        let radius = radius.map(|radius| radius + EDGE_SLACK);
        Some(Self { height, inverse_depth, offsets, half: [half_u, half_v], holes: holes.to_vec(), radius })
    }

    /// The columns between its edges, one more at either side against rounding.
    fn columns(&self, y: f64, camera: &Kinect, columns: &Range<usize>) -> Range<usize> {
        let [half_u, half_v] = self.half;
        let ([u, v], w) = (self.offsets, self.inverse_depth);
        let inside = [w, w * half_u - u, w * half_u + u, w * half_v - v, w * half_v + v];
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for edge in inside {
            // Inside where at + slope x >= 0.
            let (at, slope) = (edge.y * y + edge.z, edge.x);
            if slope > 0.0 {
                low = low.max(-at / slope);
            } else if slope < 0.0 {
                high = high.min(-at / slope);
            }
        }
        let column = |x: f64| camera.fx * x + camera.cx;
        // A cast from a negative number gives 0.
        let start = ((column(low) - 1.0) as usize).clamp(columns.start, columns.end);
        let end = ((column(high) + 2.0) as usize).clamp(start, columns.end);
        start..end
    }

    fn draw(&self, row: Row<'_>) {
        let y = row.y;
        let at_row = |coefficients: &Vector3<f64>| coefficients.y * y + coefficients.z;
        let (w_row, w_x) = (at_row(&self.inverse_depth), self.inverse_depth.x);
        let (u_row, u_x) = (at_row(&self.offsets[0]), self.offsets[0].x);
        let (v_row, v_x) = (at_row(&self.offsets[1]), self.offsets[1].x);
        let [half_u, half_v] = self.half;
        let met = |x: f64| {
            let w = w_row + w_x * x;
            let (u, v) = (u_row + u_x * x, v_row + v_x * x);
            // A negative w, behind the camera, fails these comparisons.
            let inside = u.abs() <= half_u * w && v.abs() <= half_v * w;
            (if inside { w } else { 0.0 }, u, v)
        };
        if let Some(radius) = self.radius {
            row.keep_larger(|x| {
                let (w, u, v) = met(x);
                if u * u + v * v <= (radius * w).powi(2) { w } else { 0.0 }
            });
        } else if self.holes.is_empty() {
            row.keep_larger(|x| met(x).0);
        } else {
            row.keep_larger(|x| {
                let (w, u, v) = met(x);
                let passes = |hole: &Hole| {
                    let within = |c: f64, i: usize| {
                        c > (hole.low[i] + EDGE_SLACK) * w && c < (hole.high[i] - EDGE_SLACK) * w
                    };
                    within(u, 0) && within(v, 1)
                };
                if self.holes.iter().any(passes) { 0.0 } else { w }
            });
        }
    }
}

/// A ball or, with an axis, the side of a cylinder in the camera's frame.
struct Round {
    middle: Vector3<f64>,
    /// Of length 1; 0 for a ball.
    axis: Vector3<f64>,
    /// The middle, along the axis (m).
    middle_along: f64,
    /// Square of the distance from the axis to the camera, less that of the radius (m^2).
    outside: f64,
    half_height: f64,
}

impl Round {
    fn new(pose: &Isometry3<f64>, axis: Vector3<f64>, radius: f64, half_height: f64) -> Option<Self> {
        let middle = pose.translation.vector;
        let middle_along = axis.dot(&middle);
        let outside = middle.norm_squared() - middle_along * middle_along - radius * radius;
        let half_height = half_height + EDGE_SLACK;
        (outside > 0.0).then_some(Self { middle, axis, middle_along, outside, half_height })
    }

    /// The inverse of the smaller root of |t d - middle|^2 = radius^2, both less their parts along the axis.
    fn draw(&self, row: Row<'_>) {
        let y = row.y;
        row.keep_larger(|x| {
            let d = Vector3::new(x, y, 1.0);
            let along = self.axis.dot(&d);
            let a = d.norm_squared() - along * along;
            let b = self.middle.dot(&d) - along * self.middle_along;
            let discriminant = b * b - a * self.outside;
            if b <= 0.0 || discriminant < 0.0 {
                return 0.0;
            }
            let w = (b + discriminant.sqrt()) / self.outside;
            if (along - self.middle_along * w).abs() <= self.half_height * w { w } else { 0.0 }
        });
    }
}

/// Columns and rows outside of which a surface is surely not seen.
///
/// The whole image where the box around it reaches behind the camera: its outline is then not that of its corners.
fn extent(shape: &Shape, pose: &Isometry3<f64>, camera: &Kinect) -> (Range<usize>, Range<usize>) {
    let [x, y, z] = shape.half_extents();
    let signs = [-1.0, 1.0];
    let corners = signs.map(|i| signs.map(|j| signs.map(|k| pose * Point3::new(i * x, j * y, k * z))));
    let corners = corners.as_flattened().as_flattened();
    if corners.iter().any(|corner| corner.z < NEAR) {
        return (0..camera.width, 0..camera.height);
    }
    let columns = corners.iter().map(|corner| camera.fx * corner.x / corner.z + camera.cx);
    let rows = corners.iter().map(|corner| camera.fy * corner.y / corner.z + camera.cy);
    (pixels_between(columns, camera.width), pixels_between(rows, camera.height))
}

/// The whole pixels from the smallest to the largest coordinate, one more at either end against rounding.
fn pixels_between(coordinates: impl Iterator<Item = f64>, count: usize) -> Range<usize> {
    let (smallest, largest) =
        coordinates.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
    // A cast from a negative number gives 0.
    let start = ((smallest - 1.0) as usize).min(count);
    let end = ((largest + 2.0) as usize).min(count).max(start);
    start..end
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::sim::Robot;

    fn assert_equals_plain_casting(scene: &Scene, fixed_from_optical: &Isometry3<f64>, seconds: f64) {
        let camera = Kinect::v1();
        let origin = Point3::from(fixed_from_optical.translation.vector);
        let view = View::new(scene, &camera, fixed_from_optical, seconds);
        let (mut compared, mut others) = (0, 0);
        for row in (0..camera.height).step_by(3) {
            for column in (0..camera.width).step_by(3) {
                let ray = Vector3::new(camera.direction_x(column), camera.direction_y(row), 1.0);
                let hit = scene.cast(&origin, &(fixed_from_optical * ray), seconds);
                let (plain, label) = hit.map_or((0.0, 0), |hit| (1.0 / hit.length, hit.label));
                let pixel = row * camera.width + column;
                let fast = view.inverse_depths[pixel];
                assert!((fast - plain).abs() < 1e-9, "1/z of ({column}, {row}): {fast} is not {plain}");
                compared += 1;
                others += i32::from(view.labels[pixel] != label);
            }
        }
        // Where two surfaces meet, either may be said to be the first.
        assert!(others * 1000 < compared, "{others} of {compared} labels differ");
    }

    #[test]
    fn every_pixel_of_every_scene_s_drive_equals_plain_casting() {
        for name in Scene::NAMES {
            let scene = Scene::named(name).unwrap();
            let robot = Robot::new(&scene);
            for i in 0..6 {
                let seconds = f64::from(i) * 9.4;
                assert_equals_plain_casting(&scene, &robot.optical_pose(seconds), seconds);
            }
        }
    }

    #[test]
    fn every_pixel_equals_plain_casting_however_the_camera_is_turned() {
        for scene in [Scene::room(), Scene::named("clutter").unwrap()] {
            for i in 0..12 {
                let (roll, pitch, yaw) = (f64::from(i), 0.7 * f64::from(i), 1.9 * f64::from(i));
                let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
                let place = Vector3::new(2.0, 0.5, 0.2 + 0.2 * f64::from(i));
                assert_equals_plain_casting(&scene, &Isometry3::from_parts(place.into(), rotation), 0.0);
            }
        }
    }

    #[test]
    fn outside_of_the_room_nothing_faces_the_camera_but_furniture() {
        let far = Isometry3::translation(0.0, 0.0, -3.0);
        let view = View::new(&Scene::room(), &Kinect::v1(), &far, 0.0);
        assert!(view.inverse_depths.contains(&0.0) && view.labels.contains(&0));
        assert_equals_plain_casting(&Scene::room(), &far, 0.0);
    }

    #[test]
    fn the_cosine_of_incidence_is_that_of_the_normal_at_the_ray_s_end() {
        let scene = Scene::named("clutter").unwrap();
        let camera = Kinect::v1();
        let pose = Robot::new(&scene).optical_pose(3.0);
        let view = View::new(&scene, &camera, &pose, 3.0);
        for pixel in (0..camera.pixels()).step_by(101) {
            let Some(surface) = scene.surface(view.labels[pixel]) else { continue };
            let (row, column) = (pixel / camera.width, pixel % camera.width);
            let ray = Vector3::new(camera.direction_x(column), camera.direction_y(row), 1.0);
            let met = pose * Point3::from(ray / view.inverse_depths[pixel]);
            let local = surface.pose().inverse_transform_point(&met).coords;
            let normal = match surface.shape() {
                Shape::Rectangle { .. } | Shape::Disc { .. } => Vector3::z(),
                Shape::Cylinder { .. } => Vector3::new(local.x, local.y, 0.0).normalize(),
                Shape::Sphere { .. } => local.normalize(),
            };
            let expected = -(surface.pose() * normal).dot(&(pose * ray.normalize()));
            let cosine = view.cosine_below(1.1, pixel, &ray).unwrap();
            assert!((cosine - expected).abs() < 1e-9, "{}: {cosine} is not {expected}", surface.name());
            assert_eq!(view.cosine_below(0.5, pixel, &ray).is_some(), cosine < 0.5);
        }
    }
}
