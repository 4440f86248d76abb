//! Real Kinect recordings for tests and benchmarks, read where they lie.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

mod left_out;

use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};

use cfodi::engine::{Isometry3, Points, Scan, Stamp};
use cfodi::msg::ros::{CameraInfo, Header, Image, PointCloud2, PointField};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

/// A folder of depth PNGs with poses and intrinsics.
pub struct Recording {
    folder: PathBuf,
    rows: Vec<Row>,
    camera: Camera,
}

#[derive(Clone)]
pub struct Row {
    pub stamp: Stamp,
    file: String,
    pub map_from_optical: Isometry3<f64>,
}

struct Camera {
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    depth_units_per_m: f32,
}

/// The recording of this name, or `None` where there are no recordings; then `test` of the caller's file counts as left out.
#[track_caller]
pub fn recording(name: &str, test: &str) -> Option<Recording> {
    let data = std::env::var_os("CFODI_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let folder = data.join(name);
    if !folder.join("poses.csv").is_file() {
        let file = Path::new(std::panic::Location::caller().file()).file_name().unwrap().display();
        left_out::leave_out(&format!("{file}::{test}"), "no recordings (set CFODI_DATA)");
        return None;
    }
    Some(Recording::open(folder))
}

impl Recording {
    fn open(folder: PathBuf) -> Self {
        let poses = fs::read_to_string(folder.join("poses.csv")).unwrap();
        let rows = poses.lines().skip(1).map(Row::parse).collect();
        let camera = Camera::parse(&fs::read_to_string(folder.join("camera.json")).unwrap());
        Self { folder, rows, camera }
    }

    /// The text of a file beside the depth images.
    pub fn read(&self, file: &str) -> String {
        fs::read_to_string(self.folder.join(file)).unwrap()
    }

    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// All points of a row in the optical frame, row-major; NaN where the depth is unknown.
    pub fn cloud(&self, row: &Row) -> Vec<[f32; 3]> {
        let (depth, width) = read_png(&self.folder.join(&row.file));
        let c = &self.camera;
        let point = |(i, &d): (usize, &u16)| {
            let z = if d == 0 || d == u16::MAX { f32::NAN } else { f32::from(d) / c.depth_units_per_m };
            let (u, v) = ((i % width) as f32, (i / width) as f32);
            [(u - c.cx) * z / c.fx, (v - c.cy) * z / c.fy, z]
        };
        depth.iter().enumerate().map(point).collect()
    }

    /// A row as a driver's message: organised, 16 bytes a point, in `camera_depth_optical_frame`.
    pub fn message(&self, row: &Row) -> PointCloud2 {
        let points = self.cloud(row);
        let bytes = points.iter().flat_map(|p| [p[0], p[1], p[2], 0.0]).flat_map(f32::to_le_bytes);
        let fields = ["x", "y", "z"].into_iter().zip([0, 4, 8]);
        PointCloud2 {
            header: Header { stamp: row.stamp.into(), frame_id: "camera_depth_optical_frame".to_owned() },
            height: 480,
            width: 640,
            fields: fields.map(|(name, at)| PointField::single(name, at, PointField::FLOAT32)).collect(),
            is_bigendian: false,
            point_step: 16,
            row_step: 16 * 640,
            data: bytes.collect(),
            all_finite: false,
        }
    }

    /// The depths of a row in whole millimetres, row-major; 0 where unknown.
    pub fn millimetres(&self, row: &Row) -> Vec<u16> {
        let (depth, _) = read_png(&self.folder.join(&row.file));
        let per_unit = 1000.0 / self.camera.depth_units_per_m;
        let known = |d: u16| if d == u16::MAX { 0 } else { (f32::from(d) * per_unit).round() as u16 };
        depth.into_iter().map(known).collect()
    }

    /// A row as a driver's depth image: `16UC1`, in `camera_depth_optical_frame`.
    pub fn image(&self, row: &Row) -> Image {
        Image {
            header: Header { stamp: row.stamp.into(), frame_id: "camera_depth_optical_frame".to_owned() },
            height: 480,
            width: 640,
            encoding: "16UC1".to_owned(),
            is_bigendian: 0,
            step: 2 * 640,
            data: self.millimetres(row).into_iter().flat_map(u16::to_le_bytes).collect(),
        }
    }

    /// The points of whole millimetres `z` in the optical frame with 0.4 <= z <= 6 m, by the plain formula.
    pub fn points_of_millimetres(&self, millimetres: &[u16]) -> Vec<[f32; 3]> {
        let c = &self.camera;
        let known = millimetres.iter().enumerate().filter(|(_, d)| (400..=6000).contains(*d));
        let point = |(i, &d): (usize, &u16)| {
            let (z, u, v) = (f32::from(d) / 1000.0, (i % 640) as f32, (i / 640) as f32);
            [(u - c.cx) * z / c.fx, (v - c.cy) * z / c.fy, z]
        };
        known.map(point).collect()
    }

    /// What a driver says about the camera.
    pub fn camera_info(&self) -> CameraInfo {
        let [fx, fy, cx, cy] =
            [self.camera.fx, self.camera.fy, self.camera.cx, self.camera.cy].map(f64::from);
        let k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        CameraInfo { height: 480, width: 640, k, ..CameraInfo::default() }
    }

    /// The valid points of a row with 0.4 <= z <= 6 m.
    pub fn scan(&self, row: &Row) -> Scan {
        let mut points = self.cloud(row);
        points.retain(|&[_, _, z]| (0.4..=6.0).contains(&f64::from(z)));
        Scan { stamp: row.stamp, fixed_from_sensor: row.map_from_optical, points: Points::F32(points) }
    }

    /// Every `step`-th row.
    pub fn scans(&self, step: usize) -> impl Iterator<Item = Scan> {
        self.rows.iter().step_by(step).map(|row| self.scan(row))
    }
}

impl Row {
    fn parse(line: &str) -> Self {
        let cells: Vec<_> = line.split(',').collect();
        let number = |i: usize| cells[i].trim().parse::<f64>().unwrap();
        let turn = Quaternion::new(number(8), number(5), number(6), number(7));
        Self {
            stamp: Stamp::from_nanos(cells[0].parse().unwrap()),
            file: cells[1].to_owned(),
            map_from_optical: Isometry3::from_parts(
                Translation3::new(number(2), number(3), number(4)),
                UnitQuaternion::from_quaternion(turn),
            ),
        }
    }
}

impl Camera {
    fn parse(json: &str) -> Self {
        let after = |key: &str| &json[json.find(key).unwrap() + key.len()..];
        let numbers = |text: &str| -> Vec<f32> {
            let cells = text.split(|c: char| !c.is_ascii_digit() && c != '.').filter(|cell| !cell.is_empty());
            cells.take(9).map(|cell| cell.parse().unwrap()).collect()
        };
        let k = numbers(after("\"K\""));
        let depth_units_per_m = numbers(after("\"depth_scale_per_m\""))[0];
        Self { fx: k[0], fy: k[4], cx: k[2], cy: k[5], depth_units_per_m }
    }
}

fn read_png(path: &Path) -> (Vec<u16>, usize) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Grayscale, png::BitDepth::Sixteen));
    let depth = bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    (depth, info.width as usize)
}
