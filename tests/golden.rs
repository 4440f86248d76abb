//! The wire types against bytes that real ROS 2 has made: `golden/README.md` lists every field of every message.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::path::Path;

use byteorder::LittleEndian;
use cfodi::msg::clusters::SurfaceClusterArray;
use cfodi::msg::ros::{
    CameraInfo, Clock, CompressedImage, Image, MarkerArray, PointCloud2, TfMessage, TriggerRequest,
    TriggerResponse,
};
use cfodi::msg::twins::{Detection3DArray, PolygonInstanceStamped};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// The rows (field, value) under the heading of a file.
fn table(file: &str) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(folder().join("README.md")).unwrap();
    let section = text.split("\n## ").find(|section| section.starts_with(file)).unwrap().to_owned();
    let rows = section.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| field"));
    rows.map(|row| {
        let cells: Vec<_> = row.trim_matches('|').splitn(2, " | ").map(str::trim).collect();
        (cells[0].to_owned(), cells[1].to_owned())
    })
    .collect()
}

/// The value at a path such as `clusters[0].plane.coef`.
fn at<'a>(message: &'a Value, path: &str) -> &'a Value {
    path.split(['.', '[']).fold(message, |value, step| match step.strip_suffix(']') {
        Some(index) => &value[index.parse::<usize>().unwrap()],
        None => &value[step],
    })
}

/// Whether two values are equal as numbers, however they are written.
fn same(found: &Value, expected: &Value) -> bool {
    match (found, expected) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (Value::Number(a), Value::Number(b)) => a == b || a.as_f64() == b.as_f64(),
        _ => found == expected,
    }
}

fn hold<M: Serialize + DeserializeOwned>(file: &str) {
    let bytes = std::fs::read(folder().join(file)).unwrap();
    assert_eq!(bytes[..4], [0, 1, 0, 0]);
    let body = &bytes[4..];
    let (message, read) = cdr_encoding::from_bytes::<M, LittleEndian>(body).unwrap();
    assert!(body.len() - read < 4, "{file}: {read} of {} bytes read", body.len());
    let mut written = cdr_encoding::to_vec::<M, LittleEndian>(&message).unwrap();
    written.resize(body.len(), 0);
    assert_eq!(written, body, "{file}");
    let json = serde_json::to_value(&message).unwrap();
    for (path, text) in table(file) {
        // The table is written by Python.
        let json_text = text.replace("True", "true").replace("False", "false");
        let expected: Value = serde_json::from_str(&json_text).unwrap();
        assert!(same(at(&json, &path), &expected), "{file}: {path} is {}, not {text}", at(&json, &path));
    }
}

#[test]
fn surface_clusters_are_those_of_real_ros() {
    assert!(table("surface_cluster_array.cdr").len() > 100);
    hold::<SurfaceClusterArray>("surface_cluster_array.cdr");
    hold::<SurfaceClusterArray>("surface_cluster_array_empty.cdr");
}

#[test]
fn clouds_markers_transforms_and_clock_are_those_of_real_ros() {
    hold::<PointCloud2>("point_cloud2.cdr");
    hold::<MarkerArray>("marker_array.cdr");
    hold::<TfMessage>("tf_message.cdr");
    hold::<Clock>("clock.cdr");
}

#[test]
fn images_and_cameras_are_those_of_real_ros() {
    hold::<Image>("image.cdr");
    hold::<CameraInfo>("camera_info.cdr");
    hold::<CompressedImage>("compressed_image.cdr");
}

#[test]
fn the_twins_of_clusters_are_those_of_real_ros() {
    hold::<Detection3DArray>("detection3d_array.cdr");
    hold::<PolygonInstanceStamped>("polygon_instance_stamped.cdr");
}

#[test]
fn trigger_calls_are_those_of_real_ros() {
    hold::<TriggerRequest>("trigger_request.cdr");
    hold::<TriggerResponse>("trigger_response.cdr");
}
