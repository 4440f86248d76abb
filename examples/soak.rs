//! Hours of driving through the engine alone, as fast as it goes: `tests/soak.sh accelerated --hours 2 --max-voxels 100000`.
//!
//! A lap of a simulated scene, driven again and again, each time some way further along x with `--further`, as through a
//! building without an end. A reader that knows nothing but the updates is held against the map every ten seconds of the
//! drive. Prints a line a minute of it, or less often, and ends with status 1 where an invariant does not hold or where
//! memory grows although `--max-voxels` bounds the map.
#![allow(clippy::print_stdout, reason = "a table is what it is for")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;
use std::time::Instant;

use cfodi::engine::{Cluster, ClusterId, Engine, Params, Scan, Snapshot, Stamp, Update};
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::robot::{Robot, SPEED};
use cfodi::sim::{Drive, Scene};
use clap::Parser;
use nalgebra::{Translation3, Vector3};

/// Scans between two looks at the whole map.
const LOOK: u64 = 300;

/// Scans after which memory is to be level: the map has reached its bound.
const SETTLED: u64 = 900;

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
    /// By how much memory may grow once it is level, in %
    #[arg(long, default_value_t = 5.0)]
    growth: f64,
}

fn main() -> anyhow::Result<ExitCode> {
    let options = Options::parse();
    let params = Params::default().with_max_voxels(options.max_voxels)?;
    let views = views(&options)?;
    let rendered = resident_mb();
    let scans = (options.hours * 3600.0 * f64::from(SCANS_PER_SECOND)).round() as u64;
    let row = (scans / 30).max(LOOK);
    let (mut engine, mut reader, mut times, mut level) =
        (Engine::new(params), Reader::default(), Vec::new(), None);
    println!(
        "{:>8} {:>8} {:>8} {:>9} {:>8} {:>8} {:>11}",
        "minutes", "voxels", "clusters", "map [MB]", "p50 [ms]", "p99 [ms]", "violations"
    );
    for number in 0..scans {
        let scan = scan(&views, number, options.further);
        let begin = Instant::now();
        let update = engine.insert(&scan);
        times.push(begin.elapsed().as_secs_f64() * 1e3);
        reader.update(&update);
        if number % LOOK == LOOK - 1 {
            reader.compare(&engine.snapshot());
        }
        if number % row == row - 1 {
            let map = resident_mb() - rendered;
            if number >= SETTLED {
                level.get_or_insert(map);
            }
            tell(number, &engine, &reader, map, &mut times);
        }
    }
    let growth = level.map_or(0.0, |level| (resident_mb() - rendered - level) / (rendered + level) * 100.0);
    println!("memory since it had settled: {growth:+.1} % of the process");
    reader.violations.iter().take(TOLD).for_each(|violation| println!("WRONG: {violation}"));
    let grows = options.max_voxels > 0 && growth > options.growth;
    if grows {
        println!("WRONG: memory has grown by {growth:.1} %");
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

/// What the updates alone tell of the map.
#[derive(Default)]
struct Reader {
    clusters: BTreeMap<ClusterId, Cluster>,
    gone: BTreeSet<ClusterId>,
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
            self.gone.insert(*id);
        }
        for changed in &update.changed {
            let cluster = &changed.cluster;
            let id = cluster.id;
            self.hold(!self.gone.contains(&id), || format!("update {number}: {id:?} is used again"));
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
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kilobytes.unwrap_or_default() / 1e3
}
