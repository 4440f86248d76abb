//! Hours of driving through the engine alone, as fast as it goes: `tests/soak.sh accelerated --hours 2 --max-voxels 100000`.
//!
//! A lap of a simulated scene, driven again and again, each time some way further along x with `--further`, as through a
//! building without an end. A reader that knows nothing but the updates is held against the map every ten seconds of the
//! drive, and the number of voxels against its bound after every scan. Prints thirty lines, or one every ten seconds where
//! that is less, and ends with status 1 where an invariant does not hold or where memory grows although `--max-voxels`
//! bounds the map.
#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Instant;

use cfodi::engine::{Cluster, ClusterId, Engine, Params, Scan, Snapshot, Stamp, Update};
use cfodi::memory::resident_mb;
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::robot::{Robot, SPEED};
use cfodi::sim::{Drive, Scene};
use clap::Parser;
use nalgebra::{Translation3, Vector3};

/// Scans between two looks at the whole map.
const LOOK: u64 = 300;

/// Scans after which memory is to be level: the map has reached its bound.
const SETTLED: u64 = 900;

/// By how much memory may differ from row to row by chance (MB): two copies of a scan, of 3.7 MB each. They and snapshots
/// are freed all the time, and the allocator gives them back or keeps them. Below 160 MB, 5 % would be less than this.
const SLACK_MB: f64 = 8.0;

/// Violations that are told.
const TOLD: usize = 20;

#[derive(Debug, Parser)]
#[command(name = "tests/soak.sh accelerated")]
struct Options {
    /// How long the drive takes (h)
    #[arg(long, default_value_t = 1.0)]
    hours: f64,
    /// Where it goes
    #[arg(long, default_value = "lab")]
    scene: String,
    /// How far each lap lies beyond the one before (m): the map grows for ever, or at its bound forgets
    #[arg(long, default_value_t = 30.0)]
    further: f64,
    /// Most voxels that hold points; 0 = no bound
    #[arg(long, default_value_t = 100_000)]
    max_voxels: i64,
    /// Views of a lap
    #[arg(long, default_value_t = 150)]
    views: u32,
    /// By how much memory without the views may grow once it is level, in %
    #[arg(long, default_value_t = 5.0)]
    growth: f64,
}

fn main() -> anyhow::Result<ExitCode> {
    let options = Options::parse();
    let params = Params::default().with_max_voxels(options.max_voxels)?;
    let most_voxels = params.max_voxels();
    let views = views(&options)?;
    let scans = (options.hours * 3600.0 * f64::from(SCANS_PER_SECOND)).round() as u64;
    let row = (scans / 30).max(LOOK);
    let mut memory = Memory::after_rendering();
    let (mut engine, mut reader, mut times) = (Engine::new(params), Reader::default(), Vec::new());
    println!(
        "{:>8} {:>8} {:>8} {:>9} {:>8} {:>8} {:>11}",
        "minutes", "voxels", "clusters", "map [MB]", "p50 [ms]", "p99 [ms]", "violations"
    );
    for number in 0..scans {
        let scan = scan(&views, number, options.further);
        let begin = Instant::now();
        let update = engine.insert(&scan);
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        memory.look();
        reader.update(&update);
        reader.count(engine.voxel_count() as u64, most_voxels);
        if number % LOOK == LOOK - 1 {
            reader.compare(&engine.snapshot());
        }
        if number % row == row - 1 || number + 1 == scans {
            let map = memory.end_row(number + 1 >= SETTLED + row);
            tell(number, &engine, &reader, map, &mut times);
        }
    }
    reader.violations.iter().take(TOLD).for_each(|violation| println!("WRONG: {violation}"));
    let grows = !memory.is_level(options.growth) && most_voxels > 0;
    if grows {
        println!("WRONG: memory has grown by more than {SLACK_MB} MB and {} %", options.growth);
    }
    let wrong = grows || !reader.violations.is_empty();
    Ok(if wrong { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Scans from all along one lap.
fn views(options: &Options) -> anyhow::Result<Vec<Scan>> {
    let scene = Scene::named(&options.scene).ok_or_else(|| anyhow::anyhow!("no scene {}", options.scene))?;
    let lap = Robot::new(&scene).path().length() / SPEED * f64::from(SCANS_PER_SECOND);
    let drive = Drive::new(scene, 1, Stamp::from_nanos(0));
    let index = |view: u32| (f64::from(view) * lap / f64::from(options.views)) as u32;
    Ok((0..options.views).map(|view| drive.labelled_scan(index(view)).scan).collect())
}

/// A view again: later, and in a later lap further along.
fn scan(views: &[Scan], number: u64, further: f64) -> Scan {
    let lap = number / views.len() as u64;
    let view = &views[(number % views.len() as u64) as usize];
    let shift = Translation3::from(Vector3::x() * (further * lap as f64));
    Scan {
        stamp: Stamp::from_nanos((number * 1_000_000_000 / u64::from(SCANS_PER_SECOND)) as i64),
        fixed_from_sensor: shift * view.fixed_from_sensor,
        points: view.points.clone(),
    }
}

/// What the process takes beyond what it took when the views were rendered (MB). What rendering has left to the allocator
/// is used again and not counted: a level is rather told too low, and growth too high, than the other way round.
struct Memory {
    rendered: f64,
    /// After each scan of a row; the row's level is their median.
    row: Vec<f64>,
    /// Of the first row that began when it had settled.
    settled: Option<f64>,
    /// Of the highest row from then on.
    highest: f64,
}

impl Memory {
    fn after_rendering() -> Self {
        Self { rendered: resident(), row: Vec::new(), settled: None, highest: f64::NEG_INFINITY }
    }

    /// Always at the same step, for a scan's copy is counted.
    fn look(&mut self) {
        self.row.push(resident() - self.rendered);
    }

    /// The level of a row of which there is at least one scan.
    fn end_row(&mut self, settled: bool) -> f64 {
        self.row.sort_by(f64::total_cmp);
        let level = self.row[self.row.len() / 2];
        self.row.clear();
        if settled {
            self.settled.get_or_insert(level);
            self.highest = self.highest.max(level);
        }
        level
    }

    /// Says whether no row is above the first that had settled by more than `growth` (%) of it and [`SLACK_MB`].
    fn is_level(&self, growth: f64) -> bool {
        let Some(level) = self.settled else {
            println!("memory without the views: it ended before it had settled");
            return true;
        };
        let (grown, allowed) = (self.highest - level, SLACK_MB.max(level * growth / 100.0));
        println!(
            "memory without the views [MB]: {level:.1} when it had settled, {:.1} in the highest row since: \
             {grown:+.1}; {allowed:.1} are allowed where voxels have a bound",
            self.highest
        );
        grown <= allowed
    }
}

/// What the updates alone tell of the map.
#[derive(Default)]
struct Reader {
    clusters: BTreeMap<ClusterId, Cluster>,
    /// By the number of an id, which count up from 1: of a byte each, so that hours of ids are not what makes memory grow.
    gone: Vec<bool>,
    sequence: u64,
    violations: Vec<String>,
}

impl Reader {
    fn update(&mut self, update: &Update) {
        let number = update.sequence;
        self.hold(number == self.sequence + 1, || {
            format!("update {number}: it does not follow the one before")
        });
        self.sequence = number;
        for id in &update.removed {
            let was = self.clusters.remove(id).is_some();
            self.hold(was, || format!("update {number}: {id:?} is gone and was not there"));
            self.note_gone(*id);
        }
        for changed in &update.changed {
            let cluster = &changed.cluster;
            let id = cluster.id;
            self.hold(!self.is_gone(id), || format!("update {number}: {id:?} is used again"));
            let off = (cluster.normal.norm() - 1.0).abs();
            self.hold(off < 1e-9, || {
                format!("update {number}: {id:?} has a normal {off} off a unit's length")
            });
            self.clusters.insert(id, cluster.clone());
        }
        for changed in &update.changed {
            let left = changed.merged_from.iter().find(|id| self.clusters.contains_key(id));
            self.hold(left.is_none(), || format!("update {number}: {left:?} was merged and is still there"));
        }
    }

    fn note_gone(&mut self, id: ClusterId) {
        let number = id.get() as usize;
        self.gone.resize(self.gone.len().max(number + 1), false);
        self.gone[number] = true;
    }

    fn is_gone(&self, id: ClusterId) -> bool {
        self.gone.get(id.get() as usize).is_some_and(|&gone| gone)
    }

    /// Holds the number of voxels against its bound; 0 = none.
    fn count(&mut self, voxels: u64, most: u64) {
        let number = self.sequence;
        self.hold(most == 0 || voxels <= most, || {
            format!("update {number}: {voxels} voxels hold points, of {most} at most")
        });
    }

    fn compare(&mut self, map: &Snapshot) {
        let number = map.sequence;
        let same = self.sequence == number && self.clusters.values().eq(&map.clusters);
        self.hold(same, || format!("snapshot {number}: its clusters are not those of the updates"));
        let counted: u64 = map.clusters.iter().map(|cluster| u64::from(cluster.voxel_count)).sum();
        let all = map.voxels.len() as u64;
        let sum = counted + u64::from(map.unclustered_voxels);
        self.hold(sum == all, || format!("snapshot {number}: {sum} voxels are told of {all}"));
        for cluster in &map.clusters {
            let outline = outlined(&cluster.boundary, cluster)
                + cluster.holes.iter().map(|hole| outlined(hole, cluster)).sum::<f64>();
            // A surface in several parts has the outline of the largest, and the area of all.
            let fits = cluster.area.is_none_or(|area| outline > 0.0 && outline <= area * (1.0 + 1e-9));
            let (id, area) = (cluster.id, cluster.area);
            self.hold(fits, || format!("snapshot {number}: {id:?} has area {area:?}, its outline {outline}"));
        }
    }

    fn hold(&mut self, holds: bool, otherwise: impl FnOnce() -> String) {
        if !holds {
            self.violations.push(otherwise());
        }
    }
}

/// The area of a ring (m^2), below 0 where it goes clockwise about the normal.
fn outlined(ring: &[nalgebra::Point3<f64>], cluster: &Cluster) -> f64 {
    let Some(first) = ring.first() else { return 0.0 };
    let next = ring.iter().cycle().skip(1);
    let turned: Vector3<f64> = ring.iter().zip(next).map(|(a, b)| (a - first).cross(&(b - first))).sum();
    0.5 * turned.dot(&cluster.normal)
}

/// A line of the table.
fn tell(number: u64, engine: &Engine, reader: &Reader, map_mb: f64, times: &mut Vec<f64>) {
    times.sort_by(f64::total_cmp);
    let minutes = (number + 1) as f64 / f64::from(SCANS_PER_SECOND) / 60.0;
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "{minutes:>8.1} {:>8} {:>8} {map_mb:>9.1} {:>8.1} {:>8.1} {:>11}",
        engine.voxel_count(),
        reader.clusters.len(),
        at(0.5),
        at(0.99),
        reader.violations.len()
    );
    times.clear();
}

/// Memory of the process (MB); 0 where the system does not tell.
fn resident() -> f64 {
    resident_mb().unwrap_or_default()
}
