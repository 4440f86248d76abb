//! How near the engine is to the speed of the memory: the time from the bytes of a message to what its scan has changed,
//! beside a cold read of the cloud.
//!
//! On each of the recordings (`CFODI_DATA`) and on the simulated laboratory at 30 scans a second, in mode `consistent`, on
//! one core (`taskset -c 0 cargo bench --bench limit`). Every drive is driven three times over the same map: the first time
//! reveals it, in the third little is new. The clouds are more than any cache holds, so that each is read from memory;
//! `unorganized` are the same points without rows, `depth` the depth images that the clouds are made from. The steps are
//! `decode`, `bin` (points into voxels), `clusters` (what was seen through is taken out, blocks are published) and
//! `describe`.
//!
//! `--cabinet` measures that recording alone and prints one line for each median, for `benches/peers`; `--test` takes a few
//! scans, which shows that it runs.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "../tests/support/mod.rs"]
mod support;

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfodi::cloud::{Camera, CloudFilter, decode, decode_depth};
use cfodi::engine::{Engine, Isometry3, Params, Points, Scan, Stamp};
use cfodi::msg::ros::{Image, PointCloud2};
use cfodi::sim::{Drive, Scene};
use support::Recording;
use tikv_jemallocator::Jemalloc;

/// That of the program.
#[global_allocator]
static ALLOCATOR: Jemalloc = Jemalloc;

const FILTER: CloudFilter = CloudFilter::DEFAULT;
const SIZES: [f64; 2] = [0.08, 0.05];
const LAPS: usize = 3;
/// Scans of the simulated drive.
const SIMULATED: u32 = 150;

/// One measurement in the forms in which it may come.
struct Measured {
    cloud: PointCloud2,
    /// The same points without rows.
    unorganized: PointCloud2,
    depth: Option<Image>,
    fixed_from_sensor: Isometry3<f64>,
}

impl Measured {
    fn new(cloud: PointCloud2, depth: Option<Image>, fixed_from_sensor: Isometry3<f64>) -> Self {
        let points = cloud.width * cloud.height;
        let row_step = points * cloud.point_step;
        let unorganized = PointCloud2 { height: 1, width: points, row_step, ..cloud.clone() };
        Self { cloud, unorganized, depth, fixed_from_sensor }
    }
}

/// A drive, and the camera of its depth images.
struct Recorded {
    name: &'static str,
    measured: Vec<Measured>,
    camera: Option<Camera>,
}

impl Recorded {
    fn of(name: &'static str, recording: &Recording, scans: usize) -> Self {
        let measured = recording.rows().iter().take(scans).map(|row| {
            Measured::new(recording.message(row), Some(recording.image(row)), row.map_from_optical)
        });
        let camera = Camera::from_info(&recording.camera_info()).unwrap();
        Self { name, measured: measured.collect(), camera: Some(camera) }
    }

    fn laboratory(scans: u32) -> Self {
        let drive = Drive::new(Scene::named("lab").unwrap(), 1, Stamp::from_nanos(0));
        let measured = (0..scans).map(|i| {
            let step = drive.step(i);
            Measured::new(step.cloud, None, drive.fixed_from_optical(i))
        });
        Self { name: "laboratory, simulated, 30 scans a second", measured: measured.collect(), camera: None }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Form {
    Cloud,
    Unorganized,
    Depth,
}

impl Form {
    const ALL: [Self; 3] = [Self::Cloud, Self::Unorganized, Self::Depth];

    const fn name(self) -> &'static str {
        match self {
            Self::Cloud => "cloud",
            Self::Unorganized => "unorganized",
            Self::Depth => "depth",
        }
    }
}

/// Times of one lap, in ms, ascending but for the first scan's.
#[derive(Default)]
struct Lap {
    first: f64,
    all: Vec<f64>,
    decode: Vec<f64>,
    /// `bin`, `clusters`, `describe`.
    steps: [Vec<f64>; 3],
}

impl Lap {
    fn drive(engine: &mut Engine, recorded: &Recorded, form: Form) -> Self {
        let mut lap = Self::default();
        for measured in &recorded.measured {
            lap.scan(engine, measured, recorded.camera.as_ref(), form);
        }
        lap.first = lap.all[0];
        lap.all.sort_unstable_by(f64::total_cmp);
        lap
    }

    fn scan(&mut self, engine: &mut Engine, measured: &Measured, camera: Option<&Camera>, form: Form) {
        let begin = Instant::now();
        let cloud = match form {
            Form::Cloud => decode(&measured.cloud, &FILTER),
            Form::Unorganized => decode(&measured.unorganized, &FILTER),
            Form::Depth => decode_depth(measured.depth.as_ref().unwrap(), camera.unwrap(), &FILTER),
        };
        let cloud = cloud.unwrap();
        let (stamp, points) = (cloud.stamp, cloud.points);
        let scan = Scan { stamp, fixed_from_sensor: measured.fixed_from_sensor, points };
        assert_eq!(matches!(scan.points, Points::Depths(_)), form != Form::Unorganized);
        let decoded = Instant::now();
        let mut done = [decoded; 4];
        let mut steps = 0;
        drop(black_box(engine.insert_observed(&scan, |_| {
            steps += 1;
            done[steps] = Instant::now();
        })));
        self.all.push(ms(begin.elapsed()));
        self.decode.push(ms(decoded - begin));
        for (step, (from, to)) in self.steps.iter_mut().zip(done.iter().zip(&done[1..])) {
            step.push(ms(*to - *from));
        }
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Median time of summing the bytes of a cloud that is in no cache (ms).
fn cold_read(recorded: &Recorded) -> f64 {
    let read = |measured: &Measured| {
        let begin = Instant::now();
        let words = measured.cloud.data.as_chunks().0.iter().map(|word| u64::from_le_bytes(*word));
        black_box(words.fold(0, u64::wrapping_add));
        ms(begin.elapsed())
    };
    median(&(0..LAPS).flat_map(|_| recorded.measured.iter().map(read)).collect::<Vec<_>>())
}

/// Laps from an empty map on.
fn laps(count: usize, recorded: &Recorded, form: Form, voxel_size: f64) -> Vec<Lap> {
    let mut engine = Engine::new(Params::default().with_voxel_size(voxel_size).unwrap());
    (0..count).map(|_| Lap::drive(&mut engine, recorded, form)).collect()
}

fn forms(recorded: &Recorded) -> impl Iterator<Item = Form> {
    Form::ALL.into_iter().filter(|form| *form != Form::Depth || recorded.camera.is_some())
}

fn report(recorded: &Recorded) {
    let cold = cold_read(recorded);
    let bytes = recorded.measured[0].cloud.data.len();
    println!(
        "{}: {} scans; a cloud of {bytes} bytes is read in {cold:.3} ms",
        recorded.name,
        recorded.measured.len()
    );
    println!(
        "voxel  form         lap  median ms  x read   p99 x median  first x median   decode    bin  clusters  describe"
    );
    for size in SIZES {
        for form in forms(recorded) {
            for (number, lap) in (1..).zip(laps(LAPS, recorded, form, size)) {
                let middle = median(&lap.all);
                let p99 = lap.all[lap.all.len() * 99 / 100];
                let [bin, clusters, describe] = lap.steps.map(|step| median(&step));
                println!(
                    "{size} m {:12} {number}   {middle:10.2} {:7.1}   {:12.1} {:15.1} {:8.2} {bin:6.2} {clusters:9.2} \
                     {describe:9.2}",
                    form.name(),
                    middle / cold,
                    p99 / middle,
                    lap.first / middle,
                    median(&lap.decode),
                );
            }
        }
    }
    println!();
}

/// The first lap on the cabinet recording: what `benches/peers` compares.
fn report_to_peers(recorded: &Recorded) {
    println!("cold_read median_ms {:.4}", cold_read(recorded));
    for size in SIZES {
        for form in forms(recorded) {
            let lap = &laps(1, recorded, form, size)[0];
            println!("ours {size} {} median_ms {:.4}", form.name(), median(&lap.all));
        }
    }
}

fn main() {
    let has = |argument: &str| std::env::args().any(|given| given == argument);
    let scans = if has("--test") { 3 } else { usize::MAX };
    let recorded = |name: &'static str| {
        let recording = support::recording(name, "the bench on a recording")?;
        Some(Recorded::of(name, &recording, scans))
    };
    let cabinet = recorded("tum_fr3_cabinet58");
    if has("--cabinet") {
        return cabinet.iter().for_each(report_to_peers);
    }
    cabinet.iter().for_each(report);
    drop(cabinet);
    recorded("tum_rpy179").iter().for_each(report);
    report(&Recorded::laboratory(if has("--test") { 3 } else { SIMULATED }));
}
