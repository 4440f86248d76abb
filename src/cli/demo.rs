//! `cfodi demo`: a simulated robot drives through a room while the live node clusters what its Kinect sees.
//!
//! Clouds and transforms cross DDS like those of a real driver. Where the system's socket buffer is too small to carry
//! clouds, and over Zenoh, they are handed to the node inside the process instead; the results go out in all cases.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use cfodi::args::security::Security;
use cfodi::args::{Rmw, Setup};
use cfodi::count::count_of;
use cfodi::engine::Snapshot;
use cfodi::export::{View, WholeFile, WriteError, draw, write_ply};
use cfodi::msg::ros::TfMessage;
use cfodi::node::dds::{Dds, Robot, receive_buffer};
use cfodi::node::middleware::{Adding, Middleware, OpenError};
use cfodi::node::process::{ProcessError, live_node};
use cfodi::node::record::{Record, Recorder};
use cfodi::node::resume::begin;
use cfodi::node::rosout::Lines;
use cfodi::node::transport::{Event, Form};
#[cfg(feature = "zenoh")]
use cfodi::node::zenoh::Zenoh;
use cfodi::node::{check_names, now};
use cfodi::say::tell;
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::{Drive, Scene};
use tokio::sync::mpsc::Sender;
use tokio::sync::oneshot;
use tracing::info;

use super::replay::output_topics;
use super::{Wrong, check_home, first_of, say_left_behind};

/// Below four clouds of 640 x 480 x 16 bytes a socket buffer loses clouds.
const ENOUGH: usize = 4 * 640 * 480 * 16;

/// The result bag, in the folder.
const RESULT: &str = "result.mcap";

/// The files of the map, in the folder.
const PICTURES: [&str; 2] = ["map.ply", "map.png"];

/// Rows of the table.
const ROWS: usize = 12;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Folder for the map, `map.ply` and `map.png`, and for what was sent, `result.mcap`
    #[arg(long, default_value = "cfodi-demo")]
    out: PathBuf,
    /// How long the robot drives [s]
    #[arg(long, default_value_t = 30, allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=3600))]
    seconds: u32,
    /// Decides the sensor's noise
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
}

pub(crate) fn demo(setup: &Setup, options: &Options, lines: Lines) -> anyhow::Result<()> {
    if setup.is_given("sensors") {
        let text = "sensors was given, and the simulated robot has one sensor, on the topic `points`";
        return Err(Wrong(text.to_owned()).into());
    }
    check_home(std::slice::from_ref(&options.out))?;
    match setup.rmw().map_err(ProcessError::from)? {
        Rmw::Dds => {
            let over_dds = carries_clouds(setup).map_err(ProcessError::from)?;
            drive::<Dds>(setup, options, lines, over_dds, |setup| Robot::open(setup).map(Some))
        }
        #[cfg(feature = "zenoh")]
        Rmw::Zenoh => {
            info!("scans are handed over inside the process, results go out over Zenoh");
            drive::<Zenoh>(setup, options, lines, false, |_| Ok(None))
        }
    }
}

/// Whether clouds can cross DDS; where not, it is said why.
fn carries_clouds(setup: &Setup) -> Result<bool, OpenError> {
    // Clouds at 30 Hz take more encrypting than a core has, in both participants of this process.
    let secured = matches!(setup.security()?, Security::Keys(_));
    let has_room = receive_buffer(setup) >= ENOUGH;
    if secured {
        info!("with DDS Security: scans are handed over inside the process, results go out over DDS");
    } else if !has_room {
        info!(
            "the socket buffer is below four clouds ({ENOUGH} bytes): scans are handed over inside the process, \
             results go out over DDS"
        );
    }
    Ok(has_room && !secured)
}

/// `over_network` says whether clouds cross it, by what `open_robot` gives.
fn drive<T: Middleware>(
    setup: &Setup,
    options: &Options,
    lines: Lines,
    over_network: bool,
    open_robot: impl FnOnce(&Setup) -> Result<Option<Robot>, OpenError>,
) -> anyhow::Result<()> {
    // Before a map is set aside for a node that cannot start.
    check_names(setup).map_err(ProcessError::from)?;
    T::check(setup).map_err(ProcessError::from)?;
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make {}", options.out.display()))?;
    say_left_behind(&[RESULT, PICTURES[0], PICTURES[1]].map(|name| options.out.join(name)));
    let (record, recorder) = Record::create(&options.out.join(RESULT), &output_topics(setup)?)?;
    let pictures = Pictures::create(&options.out)?;
    let mut travelling: Option<JoinHandle<Result<bool, String>>> = None;
    let over = Arc::new(AtomicBool::new(false));
    let (arrived, arrival) = oneshot::channel::<()>();
    let (engine, _lock) = begin(setup.config(), false).map_err(ProcessError::from)?;
    let map = live_node::<T, anyhow::Error>(
        setup,
        engine,
        Some(recorder.clone()),
        lines,
        |events: Adding<T>| {
            let journey = Journey {
                robot: open_robot(setup).map_err(ProcessError::from)?,
                drive: Drive::new(Scene::room(), options.seed, now()),
                steps: options.seconds * SCANS_PER_SECOND,
                recorder: recorder.clone(),
                inside: (!over_network).then_some(events),
                over: Arc::clone(&over),
            };
            let robot = Builder::new().name("cfodi-robot".to_owned()).spawn(move || {
                // It has arrived when its thread ends, however that ends.
                let _arrived = arrived;
                journey.travel()
            });
            travelling = Some(robot.context("cannot start the simulated robot")?);
            info!("the simulated robot drives for {} s", options.seconds);
            Ok(())
        },
        async { drop(arrival.await) },
    );
    over.store(true, Ordering::Release);
    let travelled = travelling.map(JoinHandle::join);
    let map = map?;
    let has_arrived = came_home(travelled)?;
    // What can be written is, whatever becomes of the others.
    let [ply, png] = pictures.names();
    first_of(record.finish().err().into_iter().chain(pictures.complete(&map)))?;
    let result = options.out.join(RESULT);
    let files =
        format!("the map: {} and {}; all that was sent: {}", ply.display(), png.display(), result.display());
    tell(format_args!("{}\n{files}", table(&map)))?;
    if has_arrived && map.sequence == 0 {
        anyhow::bail!(
            "no scan was taken in: the simulated robot sends clouds on `points`, and transforms from `odom` on"
        );
    }
    Ok(())
}

/// What became of the robot's thread: whether the robot has gone all its way.
fn came_home(travelled: Option<std::thread::Result<Result<bool, String>>>) -> anyhow::Result<bool> {
    match travelled {
        Some(Ok(Err(text))) => anyhow::bail!("the simulated robot stopped: {text}"),
        Some(Err(_)) => anyhow::bail!("the simulated robot's thread has died"),
        Some(Ok(Ok(has_arrived))) => Ok(has_arrived),
        None => Ok(false),
    }
}

/// The robot's thread: what its driver would do.
struct Journey<R> {
    /// Publishes what a driver would, where the middleware has one for it.
    robot: Option<Robot>,
    drive: Drive,
    steps: u32,
    /// Gets the transforms.
    recorder: Recorder,
    /// Where clouds go that the network cannot carry.
    inside: Option<Sender<Event<R>>>,
    /// Set when the node has ended.
    over: Arc<AtomicBool>,
}

impl<R> Journey<R> {
    /// Whether it has gone all its way.
    fn travel(&self) -> Result<bool, String> {
        let begin = Instant::now();
        self.transforms(self.drive.static_transforms(), true)?;
        for index in 0..self.steps {
            let due = Duration::from_secs_f64(f64::from(index) / f64::from(SCANS_PER_SECOND));
            if let Some(early) = due.checked_sub(begin.elapsed()) {
                std::thread::sleep(early);
            }
            if self.over.load(Ordering::Acquire) {
                return Ok(false);
            }
            let step = self.drive.step(index);
            self.transforms(step.tf, false)?;
            match (&self.inside, &self.robot) {
                (Some(events), _) => {
                    self.hand_over(events, Event::Handed(Form::Points.of(0), Box::new(step.cloud)));
                }
                (None, Some(robot)) => robot.send_cloud(step.cloud).map_err(|failure| failure.to_string())?,
                (None, None) => {}
            }
        }
        // Time for the last clouds on their way.
        std::thread::sleep(Duration::from_millis(300));
        Ok(true)
    }

    fn transforms(&self, message: TfMessage, is_static: bool) -> Result<(), String> {
        self.recorder.transforms(&message, is_static);
        if let Some(events) = &self.inside {
            let message = message.clone();
            self.hand_over(events, Event::Transforms { message, is_static, publisher: None });
        }
        let Some(robot) = &self.robot else { return Ok(()) };
        robot.send_transforms(message, is_static).map_err(|failure| failure.to_string())
    }

    /// A node that has ended takes nothing more, and that ends the journey too.
    fn hand_over(&self, events: &Sender<Event<R>>, event: Event<R>) {
        if events.blocking_send(event).is_err() {
            self.over.store(true, Ordering::Release);
        }
    }
}

fn table(map: &Snapshot) -> String {
    let mut clusters: Vec<_> = map.clusters.iter().collect();
    clusters.sort_by_key(|cluster| (std::cmp::Reverse(cluster.voxel_count), cluster.id));
    let mut lines = vec![format!(
        "{}: {}, {}; the largest:\n{:>6} {:>7}  {:^21}  {:^18}  state",
        count_of(map.sequence, "scan"),
        count_of(map.voxels.len(), "dense voxel"),
        count_of(clusters.len(), "cluster"),
        "id",
        "voxels",
        "normal",
        "size [m]"
    )];
    lines.extend(clusters.iter().take(ROWS).map(|cluster| {
        let (n, s) = (cluster.normal.map(thousandths), cluster.size);
        format!(
            "{:>6} {:>7}  {:>6.3} {:>6.3} {:>6.3}  {:>5.2}x{:>5.2}x{:>5.2}   {:?}",
            cluster.id.get(),
            cluster.voxel_count,
            n.x,
            n.y,
            n.z,
            s.x,
            s.y,
            s.z,
            cluster.state
        )
    }));
    lines.join("\n")
}

/// To three digits; what is nothing then has no minus.
fn thousandths(number: f64) -> f64 {
    (number * 1000.0).round() / 1000.0 + 0.0
}

/// The files of the map, begun before the drive: what cannot be written is known before it.
struct Pictures {
    ply: WholeFile,
    png: WholeFile,
}

impl Pictures {
    fn create(folder: &Path) -> Result<Self, WriteError> {
        let [ply, png] = PICTURES.map(|name| WholeFile::create(&folder.join(name)));
        Ok(Self { ply: ply?, png: png? })
    }

    fn names(&self) -> [PathBuf; 2] {
        [&self.ply, &self.png].map(|file| file.path().to_owned())
    }

    /// Gives the errors of those that cannot be written.
    fn complete(self, map: &Snapshot) -> impl Iterator<Item = WriteError> + use<> {
        let ply = self.ply.complete(|out| write_ply(out, map));
        let png = self.png.complete(|out| draw(map, &View::default()).write_png(out));
        [ply, png].into_iter().filter_map(Result::err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_rounded_to_nothing_has_no_minus() {
        let told = [-0.0004, 0.0004, -0.0006, 1.0].map(|number| format!("{:>6.3}", thousandths(number)));
        assert_eq!(told, [" 0.000", " 0.000", "-0.001", " 1.000"]);
    }
}
