//! Whole experiments with a scripted clock: the files, and those of too few scans.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::TempDir;

use super::clustering::Quality;
use super::*;
use crate::engine::{Isometry3, Points, Stamp};

/// A folder of the test's own, removed at its end.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// For an experiment to make.
    fn place(&self) -> PathBuf {
        self.0.path().join("figures")
    }

    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.place()).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// A clock that goes on by 1 to 7 ms whenever it is read.
fn scripted_clock() -> impl FnMut() -> Duration {
    let (mut now, mut reads) = (Duration::ZERO, 0);
    move || {
        reads += 1;
        now += Duration::from_millis(1 + reads * reads % 7);
        now
    }
}

/// A floor of 1 x 1 m that moves on by half a metre a scan.
fn floor(number: u16) -> Scan {
    let x0 = 0.5 * f32::from(number);
    let points = (0..10_000_u16).map(|i| [x0 + f32::from(i % 100) * 0.01, f32::from(i / 100) * 0.01, -1.0]);
    Scan {
        stamp: Stamp::from_nanos(i64::from(number) * 500_000_000),
        fixed_from_sensor: Isometry3::identity(),
        points: Points::F32(points.collect()),
    }
}

fn results(scans: impl IntoIterator<Item = Scan>) -> Results {
    let mut experiment = Experiment::new(Params::paper(), scripted_clock());
    scans.into_iter().for_each(|scan| experiment.scan(&scan));
    experiment.finish()
}

/// Panics where tags are not closed in their order, or a `<` or a quote is left over.
fn assert_well_formed(svg: &str) {
    let mut open = Vec::new();
    for piece in svg.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("a tag that ends");
        assert!(!text.contains('"') || !text.contains('='), "{text}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split([' ', '/']).find(|word| !word.is_empty()).unwrap();
        if let Some(closed) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(closed));
        } else if !tag.ends_with('/') && !tag.starts_with(['?', '!']) {
            open.push(name);
        }
    }
    assert!(open.is_empty() && svg.contains("xmlns=\"http://www.w3.org/2000/svg\""), "{open:?}");
}

/// Panics where a text reaches beyond its picture, with letters as broad as those of usual fonts are on average at most.
fn assert_texts_lie_within(svg: &str, name: &str) {
    let attribute = |tag: &str, name: &str| {
        let (_, rest) = tag.split_once(&format!(" {name}=\""))?;
        Some(rest.split_once('"')?.0.to_owned())
    };
    let number = |tag: &str, name: &str| attribute(tag, name)?.parse::<f64>().ok();
    let (_, picture) = svg.split_once("<svg").unwrap();
    let size = ["width", "height"].map(|side| number(picture, side).unwrap());
    let mut texts = 0;
    for text in svg.split("<text").skip(1) {
        let (tag, rest) = text.split_once('>').unwrap();
        let (letters, _) = rest.split_once('<').unwrap();
        let length = letters.trim().chars().count() as f64 * 0.6 * number(tag, "font-size").unwrap();
        let along = usize::from(attribute(tag, "transform").is_some());
        let place = number(tag, ["x", "y"][along]).unwrap();
        let begin = match attribute(tag, "text-anchor").as_deref() {
            Some("end") => place - length,
            Some("middle") => place - 0.5 * length,
            _ => place,
        };
        let ends = [begin, begin + length];
        assert!(ends[0] >= 0.0 && ends[1] <= size[along], "{name}: {ends:?} of {}: {letters}", size[along]);
        texts += 1;
    }
    assert!(texts > 10, "{name}: {texts} texts");
}

fn assert_is_table(path: &Path, lines: usize) {
    let text = fs::read_to_string(path).unwrap();
    let columns: Vec<_> = text.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(columns.len(), lines + 1, "{}", path.display());
    assert!(columns.iter().all(|&count| count == columns[0]), "{}", path.display());
}

fn assert_is_picture(path: &Path) {
    let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap())).read_info();
    let mut reader = reader.unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    assert!(pixels.iter().any(|&value| value != 255), "{} is white", path.display());
}

const TABLES: [&str; 4] = ["effects.csv", "scans.csv", "summary.json", "throughput.csv"];
const CHARTS: [&str; 5] = ["figure3a.svg", "figure3b.svg", "figure3c.svg", "figure3d.svg", "growth.svg"];
const EFFECTS: [&str; 4] = [
    "effects_depth.svg",
    "effects_max_normal_angle.svg",
    "effects_min_vicinity.svg",
    "effects_voxel_size.svg",
];
const PICTURES: [&str; 4] = ["figure2_a.png", "figure2_b.png", "figure2_c.png", "figure2_d.png"];

fn sorted(names: &[&[&str]]) -> Vec<String> {
    let mut names: Vec<_> = names.concat().into_iter().map(str::to_owned).collect();
    names.sort();
    names
}

#[cfg(feature = "sim")]
#[test]
fn a_simulated_drive_gives_all_files_well_formed_and_the_same_on_a_second_run() {
    use crate::cloud::{CloudFilter, decode};
    use crate::sim::{Drive, Scene};

    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(0));
    let scan = |index| {
        let cloud = decode(&drive.step(index).cloud, &CloudFilter::DEFAULT).unwrap();
        let fixed_from_sensor = drive.fixed_from_optical(index);
        Scan { stamp: cloud.stamp, fixed_from_sensor, points: cloud.points }
    };
    let scans: Vec<_> = (0..5).map(|i| scan(20 * i)).collect();
    let folders = [Folder::new(), Folder::new()];
    for folder in &folders {
        assert!(results(scans.iter().cloned()).write(&folder.place()).is_empty());
        assert_eq!(folder.names(), sorted(&[&TABLES, &CHARTS, &EFFECTS, &PICTURES]));
    }
    let read = |folder: &Folder, name: &str| fs::read(folder.place().join(name)).unwrap();
    for name in folders[0].names() {
        assert!(read(&folders[0], &name) == read(&folders[1], &name), "{name}");
    }
    let path = |name: &str| folders[0].place().join(name);
    for name in [&CHARTS[..], &EFFECTS].concat() {
        let svg = fs::read_to_string(path(name)).unwrap();
        assert_well_formed(&svg);
        assert_texts_lie_within(&svg, name);
        assert!(!svg.contains("no data") && svg.contains("CFODI"), "{name}");
    }
    PICTURES.iter().for_each(|name| assert_is_picture(&path(name)));
    assert_is_table(&path("scans.csv"), 5);
    assert_is_table(&path("throughput.csv"), 5);
    assert_is_table(&path("effects.csv"), 8 + 6 + 5 + 5);
    let summary: serde_json::Value = serde_json::from_slice(&read(&folders[0], "summary.json")).unwrap();
    assert_eq!(summary["scans"], 5);
    assert!(summary["methods"][0]["clusters_last"].as_u64().unwrap() > 5);
}

#[test]
fn all_methods_agree_on_what_one_scan_shows() {
    let results = results([floor(0)]);
    let [cfodi, consistent, statics] = [0, 1, 2].map(|method| results.records[0].methods[method].quality);
    assert_eq!(cfodi, statics);
    let Quality { dense_voxels, clusters, single_clusters, clustered_voxels, .. } = consistent;
    assert_eq!((dense_voxels, clusters, single_clusters), (cfodi.dense_voxels, 1, 0));
    assert!(10 * clustered_voxels > 9 * dense_voxels, "{consistent:?}");
    assert_eq!((cfodi.clusters, cfodi.large_clusters), (1, 1));
    assert!(cfodi.normal_error.unwrap() < 1e-6);
    assert_eq!(results.summary().methods[0].rand_index_to_static_last, Some(1.0));
}

#[test]
fn times_are_those_of_the_clock_and_stream_time_that_of_the_stamps() {
    let mut experiment = Experiment::new(Params::paper(), {
        // Each read is 1 ms later: four steps and the way back make 5 ms of CFODI, one step less of STATIC, none of the other.
        let mut now = Duration::ZERO;
        move || {
            now += Duration::from_millis(1);
            now
        }
    });
    (0..3).for_each(|number| experiment.scan(&floor(number)));
    let results = experiment.finish();
    for record in &results.records {
        assert_eq!(record.methods.iter().map(|m| m.time.total.as_millis()).collect::<Vec<_>>(), [5, 1, 4]);
        assert_eq!(record.methods[2].time.steps[3], None);
        assert_eq!(record.methods[1].time.steps, [None; 4]);
    }
    assert_eq!(results.seconds(), Some(vec![0.0, 0.5, 1.0]));
    let summary = results.summary();
    assert_eq!((summary.methods[0].ms_median, summary.methods[2].ms_mean), (Some(5.0), Some(4.0)));
    assert_eq!(summary.methods[2].live.share_of_points, Some(1.0));
    assert!(results.effects.iter().all(|effect| effect.cases.iter().all(|c| c.median_ms == Some(5.0))));
}

#[test]
fn without_a_scan_every_figure_says_so_and_there_is_no_picture() {
    let folder = Folder::new();
    let results = results([]);
    assert!(results.write(&folder.place()).is_empty());
    assert_eq!(folder.names(), sorted(&[&TABLES, &CHARTS, &EFFECTS]));
    for name in CHARTS {
        let svg = fs::read_to_string(folder.place().join(name)).unwrap();
        assert_well_formed(&svg);
        assert!(svg.contains("no data"), "{name}");
    }
    for figure in results.figures() {
        assert!(!figure.svg.contains("NaN") && !figure.caption.contains("NaN"), "{}", figure.name);
    }
    assert_is_table(&folder.place().join("scans.csv"), 0);
    let summary = results.summary();
    assert_eq!((summary.scans, summary.methods[0].ms_mean, summary.recorded_s), (0, None, None));
    let text = fs::read_to_string(folder.place().join("summary.json")).unwrap();
    assert!(text.contains("\"clusters_last\": null"));
}

#[test]
fn scans_without_points_have_times_but_no_clusters_and_no_error() {
    let nothing = Scan { points: Points::F32(Vec::new()), ..floor(0) };
    let results = results([nothing.clone(), nothing]);
    let summary = results.summary();
    assert_eq!((summary.scans, summary.points), (2, 0));
    assert_eq!(summary.methods[0].clusters_last, Some(0));
    assert_eq!(summary.methods[0].normal_error_mean_rad, None);
    assert_eq!(summary.methods[0].rand_index_to_static_last, None);
    assert!(summary.methods[0].ms_mean.is_some());
    assert_eq!(summary.methods[0].live.share_of_points, None);
    // Equal stamps say nothing about time: the axis counts scans.
    assert_eq!(results.seconds(), None);
    let figures = results.figures();
    assert!(figures[0].svg.contains("no data") && figures[0].caption.contains("no data"));
    assert!(figures.iter().all(|figure| !figure.svg.contains("NaN")));
}

#[test]
fn what_an_earlier_experiment_left_is_removed() {
    let folder = Folder::new();
    assert!(results((0..5).map(floor)).write(&folder.place()).is_empty());
    assert_eq!(folder.names(), sorted(&[&TABLES, &CHARTS, &EFFECTS, &PICTURES]));
    let mut short = Experiment::new(Params::paper(), scripted_clock()).without_effects();
    short.scan(&floor(0));
    assert!(short.finish().write(&folder.place()).is_empty());
    assert_eq!(folder.names(), sorted(&[&TABLES, &CHARTS, &PICTURES[..1]]));
}

#[test]
fn where_a_file_cannot_be_written_nothing_of_an_earlier_experiment_is_removed() {
    let folder = Folder::new();
    assert!(results((0..5).map(floor)).write(&folder.place()).is_empty());
    let blocked = folder.place().join("summary.json");
    fs::remove_file(&blocked).unwrap();
    fs::create_dir(&blocked).unwrap();
    assert_eq!(results([floor(0)]).write(&folder.place()).len(), 1);
    assert_eq!(folder.names(), sorted(&[&TABLES, &CHARTS, &EFFECTS, &PICTURES]));
}
