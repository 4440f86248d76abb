//! The truth about a simulated drive as JSON: what each label means, and where it is.
//!
//! Places are in the fixed frame (m), of what moves: at the start. A flat surface has its plane a x + b y + c z + d = 0,
//! (a, b, c) the normal towards the side it is seen from, and its outline, counter-clockwise seen from there; a doorway
//! is a notch in the outline, a window one of `holes`. A bent one has its shape instead. 64-bit numbers are texts.
//!
//! What moves goes as a whole, all surfaces of the same `motion` together; t is the time since the first scan (s):
//!
//! - `walk`: at t it is `speed` t along a closed way, and looks along it. The way goes straight from each of `corners` to the next,
//!   which is rounded by an arc of `radius`; it begins where the arc at the first corner ends, and takes `period`.
//! - `swing`: at t it is turned by `angle` / 2 (1 - cos(2 pi t / `period`)) rad from where it was at the start, about the upright
//!   axis through `hinge`, counter-clockwise seen from above.
//! - `taken_away`: it stands still, and from `at` on it is not there.
//!
//! `corners` and `hinge` are x and y in the fixed frame (m).

use cfodi::sim::{Drive, Motion, Route, Shape, Surface};
use nalgebra::{Isometry3, Point3};
use serde_json::{Map, Value, json};

/// All of it.
pub(crate) fn truth(scene: &str, seed: u64, seconds: f64, drive: &Drive) -> Value {
    let surfaces: Vec<_> = drive.scene().surfaces().iter().map(surface).collect();
    json!({ "scene": scene, "seed": seed.to_string(), "seconds": seconds, "surfaces": surfaces })
}

fn surface(surface: &Surface) -> Value {
    let mut about = Map::new();
    about.insert("label".to_owned(), surface.label().into());
    about.insert("name".to_owned(), surface.name().into());
    about.insert("class".to_owned(), surface.class().name().into());
    let pose = surface.pose();
    let middle = xyz(&Point3::from(pose.translation.vector));
    let axis: [f64; 3] = surface.normal().into_inner().into();
    match *surface.shape() {
        Shape::Rectangle { .. } | Shape::Disc { .. } => {
            let normal = surface.normal();
            let d = -normal.dot(&pose.translation.vector);
            about.insert("plane".to_owned(), json!([normal.x, normal.y, normal.z, d]));
            let shape = surface.shape();
            about.insert("polygon".to_owned(), polygon(&pose, &shape.outline()));
            let holes: Vec<_> = shape.inner_holes().iter().map(|hole| polygon(&pose, hole)).collect();
            if !holes.is_empty() {
                about.insert("holes".to_owned(), holes.into());
            }
        }
        Shape::Cylinder { radius, height } => {
            let shape = json!({ "kind": "cylinder", "middle": middle, "axis": axis, "radius": radius, "height": height });
            about.insert("shape".to_owned(), shape);
        }
        Shape::Sphere { radius } => {
            about.insert("shape".to_owned(), json!({ "kind": "sphere", "middle": middle, "radius": radius }));
        }
    }
    if let Some((motion, frame)) = surface.motion().zip(surface.motion_frame()) {
        about.insert("motion".to_owned(), about_motion(motion, frame));
    }
    about.into()
}

fn about_motion(motion: &Motion, fixed_from_motion: &Isometry3<f64>) -> Value {
    let place = |x, y| {
        let place = fixed_from_motion * Point3::new(x, y, 0.0);
        json!([place.x, place.y])
    };
    match motion {
        Motion::Walk { path, speed } => {
            let Route { corners, radius } = path.route();
            let corners: Vec<_> = corners.iter().map(|corner| place(corner.x, corner.y)).collect();
            let period = path.length() / speed;
            json!({ "kind": "walk", "corners": corners, "radius": radius, "speed": speed, "period": period })
        }
        Motion::Swing { hinge: [x, y], angle, period } => {
            json!({ "kind": "swing", "hinge": place(*x, *y), "angle": angle, "period": period })
        }
        Motion::TakenAway { at } => json!({ "kind": "taken_away", "at": at }),
    }
}

fn polygon(pose: &Isometry3<f64>, corners: &[[f64; 2]]) -> Value {
    corners.iter().map(|&[u, v]| xyz(&(pose * Point3::new(u, v, 0.0)))).collect::<Vec<_>>().into()
}

fn xyz(point: &Point3<f64>) -> Value {
    json!([point.x, point.y, point.z])
}
