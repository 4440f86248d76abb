//! The smallest rectangle around some points in a plane.

use nalgebra::{
    Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, UnitVector3, Vector2, Vector3,
};

/// A rectangle of any turn.
#[derive(Clone, Copy, Debug)]
struct Rectangle {
    middle: Vector2<f64>,
    /// Unit direction of the longer side.
    along: Vector2<f64>,
    /// The longer and the shorter side.
    sides: [f64; 2],
}

/// The smallest rectangle around what `points` are seen along the normal, in the plane through `place`: a pose (+z = normal,
/// +x = the longer side) at its middle, and its sides (m).
pub(crate) fn rectangle_around(
    points: &[Point3<f64>],
    place: &Point3<f64>,
    normal: &UnitVector3<f64>,
) -> (Isometry3<f64>, [f64; 2]) {
    let z = normal.into_inner();
    let across = if z.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let u = (across - z * z.dot(&across)).normalize();
    let v = z.cross(&u);
    let flat: Vec<_> = points.iter().map(|p| p - place).map(|d| Vector2::new(u.dot(&d), v.dot(&d))).collect();
    let rectangle = smallest_rectangle(flat);
    let in_space = |flat: Vector2<f64>| u * flat.x + v * flat.y;
    let x = in_space(rectangle.along);
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    let middle = Translation3::from(place + in_space(rectangle.middle));
    (Isometry3::from_parts(middle, UnitQuaternion::from_rotation_matrix(&turn)), rectangle.sides)
}

/// The rectangle of least area around `points`; one of its sides lies along an edge of their convex hull (Freeman and
/// Shapira, CACM 18, 1975). Costs O(n log n + h^2) for h points on the hull.
fn smallest_rectangle(points: Vec<Vector2<f64>>) -> Rectangle {
    let hull = convex_hull(points);
    let edges = hull.iter().zip(hull.iter().cycle().skip(1)).filter_map(|(a, b)| (b - a).try_normalize(0.0));
    let rectangles = edges.map(|along| around(&hull, along));
    let area = |rectangle: &Rectangle| rectangle.sides[0] * rectangle.sides[1];
    rectangles.min_by(|a, b| area(a).total_cmp(&area(b))).unwrap_or_else(|| around(&hull, Vector2::x()))
}

fn around(points: &[Vector2<f64>], along: Vector2<f64>) -> Rectangle {
    let across = Vector2::new(-along.y, along.x);
    let extent = |axis: &Vector2<f64>| {
        let all = points.iter().map(|point| axis.dot(point));
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), a| (least.min(a), most.max(a)))
    };
    let [a, b] = [extent(&along), extent(&across)];
    let middle = along * f64::midpoint(a.0, a.1) + across * f64::midpoint(b.0, b.1);
    let [length, width] = [a.1 - a.0, b.1 - b.0];
    if length >= width {
        Rectangle { middle, along, sides: [length, width] }
    } else {
        Rectangle { middle, along: across, sides: [width, length] }
    }
}

/// Counter-clockwise, by Andrew's monotone chain.
fn convex_hull(mut points: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let mut hull = Vec::with_capacity(points.len() + 1);
    half_hull(points.iter(), &mut hull);
    half_hull(points.iter().rev(), &mut hull);
    if hull.is_empty() { points } else { hull }
}

/// Adds one half without its last point, with which the other half begins.
fn half_hull<'a>(points: impl Iterator<Item = &'a Vector2<f64>>, hull: &mut Vec<Vector2<f64>>) {
    let start = hull.len();
    for &point in points {
        while let [.., a, b] = hull[start..]
            && (b - a).perp(&(point - a)) <= 0.0
        {
            hull.pop();
        }
        hull.push(point);
    }
    hull.pop();
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_holds_all_points_and_no_turn_of_a_degree_is_smaller(
            points in proptest::collection::vec((-5.0..5.0, -5.0..5.0), 1..27),
        ) {
            let points: Vec<_> = points.into_iter().map(|(x, y)| Vector2::new(x, y)).collect();
            let found = smallest_rectangle(points.clone());
            let across = Vector2::new(-found.along.y, found.along.x);
            for point in &points {
                let from_middle = point - found.middle;
                prop_assert!(from_middle.dot(&found.along).abs() <= 0.5 * found.sides[0] + 1e-9);
                prop_assert!(from_middle.dot(&across).abs() <= 0.5 * found.sides[1] + 1e-9);
            }
            for degree in 0..90 {
                let turn = f64::from(degree).to_radians();
                let naive = around(&points, Vector2::new(turn.cos(), turn.sin()));
                prop_assert!(found.sides[0] * found.sides[1] <= naive.sides[0] * naive.sides[1] + 1e-9);
            }
        }
    }

    #[test]
    fn a_point_and_a_line_have_boxes_too() {
        let a = Vector2::new(1.0, 2.0);
        assert_eq!(smallest_rectangle(vec![a, a]).sides, [0.0, 0.0]);
        let line = smallest_rectangle(vec![a, a + Vector2::new(3.0, 4.0), a + Vector2::new(1.5, 2.0)]);
        assert!((line.sides[0] - 5.0).abs() < 1e-12 && line.sides[1] < 1e-12);
    }
}
