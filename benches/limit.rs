//! scratch version
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout)]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

#[path = "../tests/support/mod.rs"]
mod support;
use std::hint::black_box;
use std::time::{Duration, Instant};
use cfodi::cloud::{Camera, CloudFilter, Optical, decode, decode_depth};
use cfodi::engine::{Engine, Params, Scan, Stamp, Points};
use cfodi::sim::{Drive, Scene};

const FILTER: CloudFilter = CloudFilter { min_range: 0.4, max_range: 6.0, optical: Optical::Auto, max_points: 4_000_000 };

fn read(data: &[u8]) -> u64 {
    data.chunks_exact(8).map(|w| u64::from_le_bytes(w.try_into().unwrap())).fold(0, u64::wrapping_add)
}
fn median(v: &mut [Duration]) -> Duration { v.sort_unstable(); v[v.len()/2] }
fn ms(d: Duration) -> f64 { d.as_secs_f64()*1e3 }

fn main() {
    let which = std::env::args().nth(1).unwrap_or_default();
    let drive: Vec<_> = if which == "lab" {
        let drive = Drive::new(Scene::named("lab").unwrap(), 1, Stamp::from_nanos(0));
        let from = std::env::args().nth(2).map_or(0, |a| a.parse().unwrap_or(0));
        (from..from+90).map(|i| (drive.step(i).cloud, None, drive.fixed_from_optical(i))).collect()
    } else {
        let recording = support::recording(if which == "rpy" {"tum_rpy179"} else {"tum_fr3_cabinet58"}, "x").unwrap();
        recording.rows().iter().map(|row| (recording.message(row), Some(recording.image(row)), row.map_from_optical)).take(90).collect()
    };
    let info = support::recording("tum_fr3_cabinet58", "x").unwrap().camera_info();
    let camera = Camera::from_info(&info).unwrap();
    let mut cold: Vec<_> = (0..3).flat_map(|_| drive.iter().map(|d| { let t = Instant::now(); black_box(read(&d.0.data)); t.elapsed() }).collect::<Vec<_>>()).collect();
    let cold = median(&mut cold);
    println!("cold read {:.3} ms of {} bytes", ms(cold), drive[0].0.data.len());
    for size in [0.08, 0.05] {
        for depth in [false, true] {
            if depth && drive[0].1.is_none() { continue; }
            let mut engine = Engine::new(Params::default().with_voxel_size(size).unwrap());
            for lap in 0..3 {
                let mut all = vec![]; let mut dec = vec![]; let mut steps = [vec![], vec![], vec![]];
                let mut points = 0;
                for (cloud, image, pose) in &drive {
                    let begin = Instant::now();
                    let c = if depth { decode_depth(image.as_ref().unwrap(), &camera, &FILTER) } else { decode(cloud, &FILTER) }.unwrap();
                    let scan = Scan { stamp: c.stamp, fixed_from_sensor: *pose, points: c.points };
                    let decoded = Instant::now();
                    points += scan.points.len();
                    let mut last = decoded; let mut i = 0;
                    drop(black_box(engine.insert_observed(&scan, |_| { let n = Instant::now(); steps[i].push(n - last); last = n; i += 1; })));
                    all.push(begin.elapsed());
                    dec.push(decoded - begin);
                }
                let first = all[0];
                let m = median(&mut all);
                println!("{size} {} lap {lap}: median {:.2} ms = {:.1} x cold; p99 {:.2} max {:.2} ({:.1}x) first {:.2} ({:.1}x); decode {:.2} bin {:.2} partials(clear+publish) {:.2} globals {:.2}; {} points {} voxels",
                    if depth {"depth"} else {"cloud"}, ms(m), ms(m)/ms(cold), ms(all[all.len()*99/100]), ms(*all.last().unwrap()), ms(*all.last().unwrap())/ms(m), ms(first), ms(first)/ms(m), ms(median(&mut dec)), ms(median(&mut steps[0])), ms(median(&mut steps[1])), ms(median(&mut steps[2])), points/drive.len(), engine.voxel_count());
            }
        }
    }
}
