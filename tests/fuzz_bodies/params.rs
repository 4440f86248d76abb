//! Parameters: any text as a parameter file, or as a command line.

use std::fs;

use cfodi::args::Environment;
use cfodi::args::Setup;
use cfodi::engine::Mode;

use super::bytes::Bytes;
use super::mcap::with_folder;

/// The first byte says what the others are.
pub fn run(bytes: &[u8]) {
    let mut bytes = Bytes::new(bytes);
    match bytes.below(4) {
        0 => with_folder(|folder| {
            let file = folder.join("params.yaml");
            fs::write(&file, bytes.rest()).expect("written");
            check(&["--ros-args", "--params-file", file.to_str().expect("text")].map(str::to_owned), None);
        }),
        1 => {
            let value = String::from_utf8_lossy(bytes.rest()).into_owned();
            check(&["--ros-args".to_owned(), "-p".to_owned(), value], None);
        }
        2 => check(&[], Some(&String::from_utf8_lossy(bytes.rest()))),
        _ => {
            let text = String::from_utf8_lossy(bytes.rest()).into_owned();
            let words: Vec<_> = text.split('\n').map(str::to_owned).collect();
            // A file that the words name may be one that has no end, or that waits.
            if !words.iter().any(|word| word == "--params-file") {
                check(&words, None);
            }
        }
    }
}

/// What holds of whatever was taken.
fn check(args: &[String], domain: Option<&str>) {
    let environment = Environment { domain: domain.map(str::to_owned), ..Environment::default() };
    let setup = match Setup::parse(args, &environment, "cfodi") {
        Ok((setup, _)) => setup,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let config = setup.config();
    assert!(setup.domain <= 232);
    assert!(!config.fixed_frame.is_empty() && config.fixed_frame.len() <= 256);
    assert!(config.filter.min_range <= config.filter.max_range && config.filter.max_range <= 1e6);
    assert!((1..=1 << 24).contains(&config.filter.max_points));
    assert!((4096..=1 << 30).contains(&config.receive_buffer));
    assert!(config.tf_timeout.as_secs() <= 60 && config.publish_period.as_millis() >= 10);
    let engine = &config.engine;
    assert!(engine.voxel_size() > 0.0 && engine.voxel_size().is_finite());
    assert!((1..=8).contains(&engine.depth()) && engine.keep_radius() >= 0.0);
    assert!(engine.pose_sigma() <= engine.voxel_size() || engine.mode() == Mode::Paper);
    for name in ["points", "depth/image", "~/clusters", "/tf"] {
        if let Ok(resolved) = setup.resolve(name) {
            assert!(resolved.starts_with('/'), "{resolved}");
        }
    }
}
