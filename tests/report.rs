//! Whole reports: of a simulated drive for the browser test (`tests/report/test_report.py`), of a real recording.
#![cfg(all(feature = "bag", feature = "sim"))]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod support;

use std::path::{Path, PathBuf};
use std::time::Instant;

use cfodi::cloud::{CloudFilter, Optical, decode};
use cfodi::config::{Config, parameters};
use cfodi::engine::{Engine, Params, Scan, Stamp};
use cfodi::export::write_whole;
use cfodi::report::{Facts, Figure, Story, Taken, write_report};
use cfodi::sim::{Drive, Scene};

/// Takes the scans through an engine as a replay does, and leaves the page in a folder.
fn report(scans: impl Iterator<Item = Scan>, folder: &Path, title: &str) -> u64 {
    let begin = Instant::now();
    let (mut story, mut engine) = (Story::new(), Engine::new(Params::default()));
    let (mut count, mut points) = (0, 0);
    for scan in scans {
        let before = Instant::now();
        let update = engine.insert(&scan);
        let engine_ms = 1000.0 * before.elapsed().as_secs_f64();
        let valid = scan.points.len() as u64;
        (count, points) = (count + 1, points + valid);
        story.scan(&update, &Taken { points: valid, engine_ms, sensor: scan.sensor_origin() });
        if story.wants_moment() {
            story.moment(&engine.snapshot());
        }
    }
    story.finish(&engine.snapshot());
    let values = parameters().into_iter().map(|p| (p.name.to_owned(), p.default.to_string()));
    let facts = Facts {
        title: title.to_owned(),
        fixed_frame: Config::new([]).unwrap().fixed_frame,
        parameters: values.collect(),
        scans: count,
        skipped: [("tf_too_early".to_owned(), 2), ("bad_stamp".to_owned(), 1)].into(),
        points,
        wall_seconds: begin.elapsed().as_secs_f64(),
        notes: vec!["The file ends within a message: what was read up to there is shown.".to_owned()],
        figures: vec![figure()],
    };
    std::fs::create_dir_all(folder).unwrap();
    let page = folder.join("index.html");
    write_whole(&page, |out| write_report(out, &story, &facts)).unwrap();
    let bytes = std::fs::metadata(&page).unwrap().len();
    let (voxels, clusters) = (engine.snapshot().voxels.len(), engine.snapshot().clusters.len());
    eprintln!("{}: {count} scans, {voxels} voxels, {clusters} clusters, {bytes} bytes", page.display());
    bytes
}

/// Text, a line and a script, of which the script must not run.
fn figure() -> Figure {
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 400 160\"><rect width=\"400\" height=\"160\" \
        fill=\"#fff\"/><path d=\"M20 140 120 90 220 110 380 20\" fill=\"none\" stroke=\"#0b62a8\"/>\
        <text x=\"20\" y=\"24\">a figure</text><script>alert(1)</script></svg>";
    Figure { title: "A figure".into(), svg: svg.into(), caption: "Handed in by the caller.".into() }
}

/// `CFODI_REPORT_DIR`, or a folder of the test's own below the build's.
fn folder(name: &str) -> PathBuf {
    std::env::var_os("CFODI_REPORT_DIR")
        .map_or_else(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join(name), PathBuf::from)
}

#[test]
#[ignore = "writes the page for the browser test"]
fn a_report_of_the_simulated_drive() {
    let filter = CloudFilter { optical: Optical::Yes, ..Config::new([]).unwrap().filter };
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(1_700_000_000_000_000_000));
    let scans = (0..450).step_by(5).map(|index| {
        let cloud = decode(&drive.step(index).cloud, &filter).unwrap();
        Scan { stamp: cloud.stamp, fixed_from_sensor: drive.fixed_from_optical(index), points: cloud.points }
    });
    report(scans, &folder("report-drive"), "simulated drive");
}

#[test]
fn a_report_of_the_cabinet_is_of_a_size_to_be_sent() {
    let test = "a_report_of_the_cabinet_is_of_a_size_to_be_sent";
    let Some(recording) = support::recording("tum_fr3_cabinet58", test) else { return };
    let bytes = report(recording.scans(1), &folder("report-cabinet"), "tum_fr3_cabinet58");
    assert!((200_000..4_000_000).contains(&bytes), "{bytes} bytes");
}
