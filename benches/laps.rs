//! What a scan costs on the first lap of a closed loop and on the third, when the map has long been there.
//!
//! The laboratory, three laps, every sixth scan, in mode `paper` and in mode `consistent`, each scan given to one after the
//! other. For each lap the median of each mode and how many times as long `consistent` takes; then the third lap's median
//! of `consistent` by the first's, at the same views with other noise. Some three minutes, most of them the simulator's; with
//! `--test` laps of a few scans, which show that it runs.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use cfodi::engine::{Engine, Params, Scan, Stamp};
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::robot::{Robot, SPEED};
use cfodi::sim::{Drive, Scene};

/// Every how-manieth scan is taken.
const STEP: usize = 6;
const LAPS: u32 = 3;

fn main() {
    let scene = Scene::named("lab").unwrap();
    let seconds = Robot::new(&scene).path().length() / SPEED;
    let is_test = std::env::args().any(|argument| argument == "--test");
    let scans = if is_test { 18 } else { (seconds * f64::from(SCANS_PER_SECOND)).round() as u32 };
    let drive = Drive::new(scene, 1, Stamp::from_nanos(0));
    for voxel_size in [0.08, 0.05] {
        let modes = [Params::paper(), Params::default()];
        let mut engines = modes.map(|params| Engine::new(params.with_voxel_size(voxel_size).unwrap()));
        println!("voxels of {voxel_size} m, laps of {seconds:.0} s");
        let medians: Vec<_> = (0..LAPS)
            .map(|lap| {
                let mut times = [Vec::new(), Vec::new()];
                for index in (lap * scans..(lap + 1) * scans).step_by(STEP) {
                    let scan = drive.labelled_scan(index).scan;
                    for (engine, times) in engines.iter_mut().zip(&mut times) {
                        times.push(time(engine, &scan));
                    }
                }
                let [paper, consistent] = times.map(median);
                let ratio = consistent.div_duration_f64(paper);
                println!(
                    "lap {}: paper {paper:.1?}, consistent {consistent:.1?}, {ratio:.2} times as long",
                    lap + 1
                );
                consistent
            })
            .collect();
        let ratio = medians[medians.len() - 1].div_duration_f64(medians[0]);
        println!("consistent: the last lap takes {ratio:.2} times as long as the first\n");
    }
}

fn time(engine: &mut Engine, scan: &Scan) -> Duration {
    let begin = Instant::now();
    drop(black_box(engine.insert(scan)));
    begin.elapsed()
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort_unstable();
    times[times.len() / 2]
}
