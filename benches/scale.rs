//! What a scan and the map cost against the size of the map, up to 10 million dense voxels of 8 cm.
//!
//! A building of storeys, rooms and a corridor each (`scale/building`) grows by eighteen views of each place in turn. At each
//! size a depth camera drives into two rooms that the map has known since its beginning, and into the next two that it does
//! not: a hundred scans each, always on the same way, whose median and 99th percentile are told, and the resident memory by
//! dense voxel. One room of the two is shut, so that its surfaces are the same at every size; through the door of the other its
//! floor is one with that of the storey, and a cluster costs its rim where it changes.
//!
//! How much longer a scan takes in the last map than in the first is told of drives in the two by turns, for from minute to minute
//! a shared machine is not equally fast: of [`TURNS`] pairs for each kind of room the median.
//!
//! Then the longest scan while the map grew, step by step beside what is usual for the same view elsewhere, and the longest
//! binning; and what all of the map costs who wants it. Takes six minutes and 5 GB; with `--test`
//! seconds. A path as argument is where the figure goes, `target/scale.svg` else.
#![allow(missing_docs, clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

#[path = "scale/building.rs"]
mod building;
#[path = "scale/camera.rs"]
mod camera;
#[path = "scale/figure.rs"]
mod figure;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use cfodi::engine::{ClusterId, Engine, Frozen, Params, Update};
use cfodi::memory::resident_mb;

use crate::building::{Place, View};
use crate::camera::Camera;

// As the node does.
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

const SIZES: [u32; 5] = [10_000, 100_000, 1_000_000, 3_000_000, 10_000_000];
/// Scans of a drive before those that count: what the views before have left to be published has been by then.
const LEAD: usize = 30;
const COUNTED: usize = 100;
/// Drives in the first map and in the last, by turns.
const TURNS: usize = 5;
/// What the last line is about.
const BEYOND: f64 = 1e8;

/// Of the scans of a drive (ms).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    pub(crate) median: f64,
    pub(crate) p99: f64,
}

/// The map at one size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// Dense ones.
    pub(crate) voxels: u32,
    pub(crate) bytes: f64,
    /// In rooms seen before, with a shut and with an open door, and in new ones.
    pub(crate) times: [Times; 4],
}

/// A scan by which the map grew.
#[derive(Clone, Debug)]
struct Growing {
    /// The same for like views of like places.
    kind: usize,
    voxels: u32,
    steps: Steps,
}

/// What binning, clustering and describing took (ms).
type Steps = [f64; 3];

struct Bench {
    engine: Engine,
    camera: Camera,
    /// Voxels by cluster, as one knows them who hears the updates.
    told: BTreeMap<ClusterId, u32>,
    dense: u32,
    /// Bytes before the map.
    before: f64,
    /// The next view by which the map grows.
    next: usize,
    growing: Vec<Growing>,
    /// Scans of a drive that count.
    counted: usize,
}

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let is_test = arguments.iter().any(|argument| argument == "--test");
    let path = arguments.iter().find(|argument| !argument.starts_with("--"));
    let path = path
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/scale.svg"), PathBuf::from);
    let sizes: &[u32] = if is_test { &[10_000, 60_000] } else { &SIZES };
    let counted = if is_test { 10 } else { COUNTED };
    let mut bench = Bench::new(counted);
    println!(
        "a scan, median and p99 (ms), of rooms seen before with the door shut, open; of new ones, shut, open; freezing, the scan after"
    );
    println!("{:>12} {:>12} {:>8} {:>6} {:>8}", "dense voxels", "with points", "clusters", "MB", "B/voxel");
    let rows: Vec<_> = sizes.iter().map(|&size| bench.row(size)).collect();
    let mut first = Bench::new(counted);
    first.grow_to(sizes[0]);
    tell_ratios(&mut first, &mut bench);
    bench.tell_longest("scan", |steps| steps.iter().sum());
    bench.tell_longest("binning", |steps| steps[0]);
    tell_whole(&mut bench);
    tell_beyond(&rows[rows.len() - 1]);
    if is_test {
        assert_eq!(bench.engine.snapshot().voxels.len(), bench.dense as usize, "the updates tell all");
    }
    figure::draw(&rows, &path).unwrap();
    println!("{}", path.display());
}

/// What is made of a frozen map, beside the engine.
fn tell_whole(bench: &mut Bench) {
    for _ in 0..3 {
        let (map, [freezing, _]) = bench.freeze();
        let begin = Instant::now();
        let snapshot = map.snapshot();
        let (voxels, making) = (snapshot.voxels.len(), ms(begin));
        drop(snapshot);
        let begin = Instant::now();
        drop(map.save());
        let saving = ms(begin);
        println!(
            "{voxels} dense voxels, frozen in {freezing:.1} ms: a snapshot in {making:.0}, a map to save in {saving:.0} ms"
        );
    }
}

fn ms(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e3
}

impl Bench {
    /// A map of the first two rooms, so that these are seen before.
    fn new(counted: usize) -> Self {
        let mut camera = Camera::new();
        drop(camera.scan(&Place(0).view(0)));
        let engine = Engine::new(Params::default());
        let (told, growing) = (BTreeMap::new(), Vec::new());
        let mut bench =
            Self { engine, camera, told, dense: 0, before: resident(), next: 0, growing, counted };
        for room in Place::rooms(0) {
            bench.drive(room);
        }
        bench
    }

    fn grow_to(&mut self, size: u32) {
        while self.dense < size {
            self.grow();
        }
    }

    /// Grows to this size and drives.
    fn row(&mut self, size: u32) -> Row {
        self.grow_to(size);
        let voxels = self.dense;
        let bytes = resident() - self.before;
        print!("{voxels:12} {:12} {:8}", self.engine.voxel_count(), self.told.len());
        print!(" {:6.0} {:8.0}", bytes / 1e6, bytes / f64::from(voxels));
        let times = self.drives(0);
        times.iter().for_each(|times| print!(" {:8.2} {:6.2}", times.median, times.p99));
        let (_, [freezing, after]) = self.freeze();
        println!(" {freezing:8.2} {after:6.2}");
        Row { voxels, bytes, times }
    }

    /// Drives in rooms seen before, with a shut and with an open door, and in new ones, which each turn has of its own.
    fn drives(&mut self, turn: usize) -> [Times; 4] {
        let next = self.next.div_ceil(Place::KINDS * Place::VIEWS).max(1);
        let [[a, b], [c, d]] = [0, next + turn].map(Place::rooms);
        [a, b, c, d].map(|room| self.drive(room))
    }

    fn drive(&mut self, room: Place) -> Times {
        let scans = (0..LEAD + self.counted).map(|image| self.time(&room.drive(image)));
        let mut times: Vec<f64> = scans.skip(LEAD).collect();
        times.sort_by(f64::total_cmp);
        Times { median: times[times.len() / 2], p99: times[(times.len() * 99).div_ceil(100) - 1] }
    }

    fn time(&mut self, view: &View) -> f64 {
        self.insert(view).iter().sum()
    }

    fn grow(&mut self) {
        let view = Place(self.next / Place::VIEWS).view(self.next % Place::VIEWS);
        let steps = self.insert(&view);
        let kind = self.next % (Place::KINDS * Place::VIEWS);
        self.growing.push(Growing { kind, voxels: self.dense, steps });
        self.next += 1;
    }

    fn insert(&mut self, view: &View) -> Steps {
        let scan = self.camera.scan(view);
        let mut last = Instant::now();
        let mut steps = Vec::with_capacity(3);
        let update = self.engine.insert_observed(&scan, |_| {
            let begin = std::mem::replace(&mut last, Instant::now());
            steps.push((last - begin).as_secs_f64() * 1e3);
        });
        self.follow(&update);
        steps.try_into().unwrap()
    }

    fn follow(&mut self, update: &Update) {
        for id in &update.removed {
            self.told.remove(id);
        }
        let told = update.changed.iter().map(|changed| (changed.cluster.id, changed.cluster.voxel_count));
        self.told.extend(told);
        self.dense = self.told.values().sum::<u32>() + update.unclustered_voxels;
    }

    /// The map frozen after a drive, and how long that and the scan after it took, which copies what it changes.
    fn freeze(&mut self) -> (Frozen, [f64; 2]) {
        let [room, _] = Place::rooms(0);
        self.drive(room);
        let begin = Instant::now();
        let map = self.engine.freeze();
        let freezing = ms(begin);
        (map, [freezing, self.time(&room.drive(LEAD + self.counted))])
    }

    /// The scan by which the map grew that `took` longest, beside what is usual for its view.
    fn tell_longest(&self, of: &str, took: impl Fn(&Steps) -> f64) {
        let longest = self.growing.iter().max_by(|a, b| took(&a.steps).total_cmp(&took(&b.steps)));
        let Some(longest) = longest else { return };
        let like: Vec<_> = self.growing.iter().filter(|growing| growing.kind == longest.kind).collect();
        let median = |took: &dyn Fn(&Steps) -> f64| {
            let mut times: Vec<_> = like.iter().map(|growing| took(&growing.steps)).collect();
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        let (most, usual) = (took(&longest.steps), median(&took));
        let more = 100.0 * (1.0 - usual / most);
        println!(
            "longest {of} while growing: {most:.1} ms, {more:.0} % of it beyond what is usual, at {} voxels, of {} scans",
            longest.voxels,
            self.growing.len()
        );
        for (step, name) in ["binning", "clustering", "describing"].into_iter().enumerate() {
            println!("  {name} {:.1} ms, usually {:.1}", longest.steps[step], median(&|steps| steps[step]));
        }
    }
}

fn tell_ratios(first: &mut Bench, last: &mut Bench) {
    let sizes = [last.dense, first.dense];
    let mut ratios = [const { Vec::new() }; 4];
    for turn in 1..=TURNS {
        let (small, large) = (first.drives(turn), last.drives(turn));
        for ((ratios, small), large) in ratios.iter_mut().zip(small).zip(large) {
            ratios.push(large.median / small.median);
        }
    }
    let told = ratios.map(|mut ratios| {
        ratios.sort_by(f64::total_cmp);
        format!("{:.2} ({:.2} to {:.2})", ratios[TURNS / 2], ratios[0], ratios[TURNS - 1])
    });
    println!(
        "medians at {} by those at {}, of {TURNS} drives by turns: {}",
        sizes[0],
        sizes[1],
        told.join(", ")
    );
}

fn tell_beyond(row: &Row) {
    let bytes = row.bytes / f64::from(row.voxels);
    println!(
        "100 million would need {:.0} GB; u32 numbers voxels, blocks and patches up to 4.29 billion, and a single surface \
         may have 2^27 voxels",
        bytes * BEYOND / 1e9
    );
}

/// Bytes that the process has in memory; 0 where the system does not tell.
fn resident() -> f64 {
    resident_mb().unwrap_or_default() * 1e6
}
