//! The seeds of the fuzz targets: small inputs that reach what lies behind the first checks.

use byteorder::{BigEndian, LittleEndian};
use cfodi::engine::{Engine, Isometry3, Mode, Points, Scan, Stamp};
use cfodi::msg::ros::{CameraInfo, CompressedImage, Image, PointCloud2, PointField};
use cfodi::store;
use serde::Serialize;

use super::bags::{self, BagWriter, Layout, OPTICAL, POINTS, header, stamp};
use super::fuzz_bodies::snapshot::params;
use super::mcap_bytes::{MAGIC, channel, chunk, message, whole};

type Seed = (&'static str, String, Vec<u8>);

pub(crate) fn all() -> Vec<Seed> {
    [clouds(), images(), recordings(), parameters(), streams(), maps()].concat()
}

fn le(message: &impl Serialize) -> Vec<u8> {
    cdr_encoding::to_vec::<_, LittleEndian>(message).unwrap()
}

fn clouds() -> Vec<Seed> {
    let points = [[0.5, 0.25, 1.0], [f32::NAN, 0.0, 1.0], [0.0, 0.0, 9.0], [1.5, -0.5, 2.5]];
    let plain = bags::cloud(stamp(0), OPTICAL, &points);
    let doubles = PointCloud2 {
        fields: ["x", "y", "z"]
            .iter()
            .zip([0, 8, 16])
            .map(|(name, at)| PointField::single(name, at, 8))
            .collect(),
        point_step: 24,
        row_step: 48,
        width: 2,
        data: [[1.0_f64, 0.5, 2.0], [1e300, 0.0, 1.0]]
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect(),
        ..plain.clone()
    };
    let rows = PointCloud2 { height: 2, width: 2, row_step: 24, ..plain.clone() };
    let padded = PointCloud2 { row_step: 60, data: [&plain.data[..], &[0xff; 12]].concat(), ..plain.clone() };
    let big = PointCloud2 { is_bigendian: true, ..plain.clone() };
    let empty = PointCloud2 { width: 0, row_step: 0, data: Vec::new(), ..plain.clone() };
    let named = [
        ("plain", &plain),
        ("doubles", &doubles),
        ("rows", &rows),
        ("padded", &padded),
        ("big", &big),
        ("empty", &empty),
    ];
    let mut seeds: Vec<Seed> = named
        .iter()
        .map(|(name, cloud)| ("cloud", (*name).to_owned(), [&[0, 0][..], &le(cloud)].concat()))
        .collect();
    let swapped = cdr_encoding::to_vec::<_, BigEndian>(&plain).unwrap();
    seeds.push(("cloud", "big_endian_cdr".to_owned(), [&[1, 2][..], &swapped].concat()));
    seeds
}

fn png16(width: u32, height: u32) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let pixels: Vec<_> = (0..width * height).flat_map(|i| (500 * i as u16).to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    file
}

fn images() -> Vec<Seed> {
    let small = [3, 3, 2];
    let pixels: Vec<u8> = [0_u16, 500, 65535, 1234, 399, 6001].iter().flat_map(|v| v.to_le_bytes()).collect();
    let image = Image {
        header: header(stamp(0), OPTICAL),
        height: 2,
        width: 3,
        encoding: "16UC1".to_owned(),
        is_bigendian: 0,
        step: 6,
        data: pixels.clone(),
    };
    let png = png16(3, 2);
    let inverse = [&[0; 4][..], &10100.0_f32.to_le_bytes(), &(-1009.0_f32).to_le_bytes(), &png].concat();
    let compressed = |format: &str, data: &[u8]| {
        le(&CompressedImage {
            header: header(stamp(0), OPTICAL),
            format: format.to_owned(),
            data: data.to_vec(),
        })
    };
    let k = [500.0, 0.0, 1.0, 0.0, 500.0, 1.0, 0.0, 0.0, 1.0];
    let info = le(&CameraInfo { width: 3, height: 2, k, ..CameraInfo::default() });
    let half = info.len().div_ceil(2) as u8;
    let padded = [info, vec![0]].concat();
    let with_info = [&[half][..], &padded[..2 * usize::from(half)], &[0], &le(&image)].concat();
    let parts: Vec<(&str, Vec<u8>)> = vec![
        ("raw_cdr", [&small[..], &[0], &le(&image)].concat()),
        ("raw_cdr_with_info", with_info),
        ("compressed_cdr", [&small[..], &[1], &compressed("png", &png)].concat()),
        ("inverse_cdr", [&small[..], &[1], &compressed("32FC1; compressedDepth png", &inverse)].concat()),
        ("raw_pixels", [&small[..], &[2, 0, 0, 0], &pixels].concat()),
        ("raw_floats", [&small[..], &[2, 1, 0, 0], &pixels, &pixels].concat()),
        ("png", [&small[..], &[3, 4], &png].concat()),
        ("inverse_png", [&small[..], &[3, 1], &inverse].concat()),
        (
            "rvl",
            [&small[..], &[3, 5], &[0; 12][..], &6_u32.to_le_bytes(), &[0x11, 0x7a, 0x13, 0x55]].concat(),
        ),
    ];
    parts.into_iter().map(|(name, bytes)| ("depth", name.to_owned(), bytes)).collect()
}

/// Two scans of few points.
fn drive(mut writer: BagWriter) -> Vec<u8> {
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 0.0);
    writer.tf("/tf", stamp(0), "odom", "map", 0.5);
    for i in 0..2 {
        writer.cloud(POINTS, stamp(i), &[[0.1, 0.2, 1.0 + i as f32], [0.3, 0.1, 2.0]]);
    }
    writer.finish()
}

fn recordings() -> Vec<Seed> {
    let layouts =
        [("plain", Layout::Plain), ("chunks", Layout::Chunks), ("zstd", Layout::Zstd), ("lz4", Layout::Lz4)];
    let mut seeds: Vec<(String, Vec<u8>)> = layouts
        .map(|(name, layout)| (name.to_owned(), [&[1][..], &drive(BagWriter::new(layout))].concat()))
        .into();
    let mut each = BagWriter::new(Layout::Plain);
    each.compress_messages = true;
    seeds.push(("messages".to_owned(), [&[1][..], &drive(each)].concat()));
    let bare = whole(&[channel(1, POINTS), message(1, 7, b"\0\x01\0\0abcd")].concat());
    seeds.push(("whole_zstd".to_owned(), [&[1][..], &zstd::encode_all(&bare[..], 3).unwrap()].concat()));
    let inside = [channel(1, POINTS), message(1, 7, b"\0\x01\0\0abcd")].concat();
    seeds.push(("no_crc".to_owned(), [&[1][..], &whole(&chunk("", inside.len() as u64, &inside))].concat()));
    seeds.push(("begin".to_owned(), [&[1][..], MAGIC].concat()));
    let listed =
        b"rosbag2_bagfile_information:\n  storage_identifier: mcap\n  relative_file_paths: [a.mcap]\n  \
        topics_with_message_count:\n  - message_count: 1\n    topic_metadata: {name: /depth/points, type: \
        sensor_msgs/msg/PointCloud2, serialization_format: cdr}\n\0";
    seeds.push(("metadata".to_owned(), [&[0][..], &listed[..], &bare].concat()));
    seeds.into_iter().map(|(name, bytes)| ("mcap", name, bytes)).collect()
}

fn parameters() -> Vec<Seed> {
    let file = "/**:\n  ros__parameters:\n    voxel_size: 0.05\n    mode: paper\n    depth: 3\n    clearing: off\n    \
        max_range: 4\n    network_interfaces: [127.0.0.1]\n/other/*:\n  ros__parameters: {depth: &d 8, min_points: *d}\n";
    let line = "run\n--ros-args\n-r\n__ns:=/robot\n-r\npoints:=/camera/points\n-p\ndepth:=2\n--log-level\ndebug\n--\n--x";
    let seeds = [
        ("file", 0, file),
        ("nested", 0, "a:\n  b:\n    ros__parameters:\n      sensors: {points: {kind: cloud}}\n"),
        (
            "quoted",
            0,
            "/**: {ros__parameters: {fixed_frame: \"a\\u0000b\", optical: 'yes', tf_timeout: .inf}}",
        ),
        ("value", 1, "voxel_size:=1e-3"),
        ("list", 1, "cfodi:network_interfaces:=[\"127.0.0.1\", ::1]"),
        ("domain", 2, "42"),
        ("line", 3, line),
    ];
    seeds
        .map(|(name, first, text)| ("params", name.to_owned(), [&[first][..], text.as_bytes()].concat()))
        .into()
}

/// Saved maps of a few voxels: each as a file, and as what is within one.
fn maps() -> Vec<Seed> {
    let mut seeds = Vec::new();
    for (name, mode, params) in
        [("consistent", 0_u8, params()), ("paper", 1, params().with_mode(Mode::Paper))]
    {
        let mut engine = Engine::new(params);
        for scans in 0..3 {
            let map = engine.freeze();
            let first = [vec![mode], vec![17; 64]].concat();
            let plain = postcard::to_stdvec(&map).unwrap();
            let of = |kind: u8, bytes: &[u8]| [&[kind], &first[..], bytes].concat();
            seeds.push((
                "snapshot",
                format!("{name}_{scans}_file"),
                of(1, &store::pack("odom", &map).unwrap()),
            ));
            seeds.push(("snapshot", format!("{name}_{scans}_map"), of(0, &plain)));
            let corner =
                (0..80).map(|i| [[i % 8, i / 8, 10], [10, i / 8, i % 8]][i % 2].map(|c| c as f32 * 0.1));
            let scan = Scan {
                stamp: Stamp::from_nanos(scans * 33_333_333),
                fixed_from_sensor: Isometry3::translation(0.01, 0.02, 0.03),
                points: Points::F32(corner.collect()),
            };
            engine.insert(&scan);
        }
    }
    seeds
}

/// Bytes without a meaning of their own: each makes another stream of scans.
fn streams() -> Vec<Seed> {
    let stream = |mode: u8, seed: u64| {
        let mut state = seed;
        let mut byte = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        };
        std::iter::once(mode).chain((0..300).map(|_| byte())).collect::<Vec<u8>>()
    };
    let modes = ["paper", "paper_alone", "consistent"].into_iter().zip(0_u8..);
    let each = modes.flat_map(|(name, mode)| (0..4_u64).map(move |seed| (name, mode, seed)));
    each.map(|(name, mode, seed)| ("engine", format!("{name}_{seed}"), stream(mode, 7 + seed))).collect()
}
