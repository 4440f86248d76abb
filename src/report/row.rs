//! A cluster's fields as a row of JSON.

use serde_json::{Value, json};

use crate::msg::clusters::SurfaceCluster;
use crate::msg::ros::{Polygon, Time};

/// Names of the fields in the order of a [`row`]: those of `SurfaceCluster.msg`, the pose in two.
///
/// Without `merged_from`, which is empty in a snapshot: the page has the merges by scan.
pub(super) const FIELDS: [&str; 20] = [
    "id",
    "revision",
    "state",
    "surface_class",
    "class_confidence",
    "first_seen",
    "last_seen",
    "plane",
    "position",
    "orientation",
    "size",
    "centroid",
    "point_covariance",
    "plane_covariance",
    "rms_error",
    "area",
    "voxel_count",
    "point_count",
    "boundary",
    "holes",
];

/// The fields as a JSON array; what is unknown (NaN) is `null`, `u64` are strings, lengths have seven digits.
pub(super) fn row(cluster: &SurfaceCluster) -> Box<str> {
    // Taken apart by name, so that a new field of the message cannot be forgotten here.
    let SurfaceCluster {
        id,
        revision,
        state,
        surface_class,
        class_confidence,
        merged_from: _,
        first_seen,
        last_seen,
        plane,
        pose,
        size,
        centroid,
        point_covariance,
        plane_covariance,
        rms_error,
        area,
        voxel_count,
        point_count,
        boundary,
        holes,
    } = cluster;
    let (place, turn) = (pose.position, pose.orientation);
    let values: [Value; FIELDS.len()] = [
        json!(id.to_string()),
        json!(revision),
        json!(state),
        json!(surface_class),
        number(f64::from(*class_confidence)),
        time(*first_seen),
        time(*last_seen),
        numbers(&plane.coef),
        numbers(&[place.x, place.y, place.z]),
        numbers(&[turn.x, turn.y, turn.z, turn.w]),
        numbers(&[size.x, size.y, size.z]),
        numbers(&[centroid.x, centroid.y, centroid.z]),
        numbers(point_covariance),
        numbers(plane_covariance),
        number(f64::from(*rms_error)),
        number(f64::from(*area)),
        json!(voxel_count),
        json!(point_count.to_string()),
        polygon(boundary),
        Value::Array(holes.iter().map(polygon).collect()),
    ];
    Value::from(values.to_vec()).to_string().into_boxed_str()
}

/// Seconds and nanoseconds.
pub(super) fn time(time: Time) -> Value {
    json!([time.sec, time.nanosec])
}

/// Rounded to seven digits, which is what a page shows and half the bytes.
pub(super) fn number(value: f64) -> Value {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(f64::NAN);
    // Whole numbers go without a fraction, and minus nothing is nothing.
    if rounded.fract() == 0.0 && rounded.abs() < 1e9 { json!(rounded as i64) } else { json!(rounded) }
}

/// `null` where every number is unknown.
fn numbers(values: &[f64]) -> Value {
    if values.iter().all(|value| value.is_nan()) {
        return Value::Null;
    }
    values.iter().map(|&value| number(value)).collect()
}

fn polygon(polygon: &Polygon) -> Value {
    polygon.points.iter().map(|p| numbers(&[p.x, p.y, p.z].map(f64::from))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_unknown_is_null_and_what_is_long_is_a_string() {
        let cluster = SurfaceCluster {
            id: u64::MAX,
            plane_covariance: [f64::NAN; 9],
            rms_error: 0.1,
            area: f32::NAN,
            first_seen: Time { sec: 3, nanosec: 5 },
            ..SurfaceCluster::default()
        };
        let values: Vec<Value> = serde_json::from_str(&row(&cluster)).unwrap();
        let field = |name| &values[FIELDS.iter().position(|&field| field == name).unwrap()];
        assert_eq!(field("id"), "18446744073709551615");
        assert_eq!(field("first_seen"), &json!([3, 5]));
        assert_eq!(field("plane_covariance"), &Value::Null);
        assert_eq!(field("area"), &Value::Null);
        assert_eq!(field("rms_error"), &json!(0.1));
        assert_eq!(field("point_count"), "0");
        assert_eq!(field("boundary"), &json!([]));
    }

    #[test]
    fn numbers_have_seven_digits() {
        let text = |value| number(value).to_string();
        assert_eq!(text(1.0 / 3.0), "0.3333333");
        assert_eq!(text(-1_234.567_89), "-1234.568");
        assert_eq!(text(-0.0), "0");
        assert_eq!(text(f64::INFINITY), "null");
    }
}
