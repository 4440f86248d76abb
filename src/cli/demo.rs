//! `cfodi demo`: a simulated robot drives through a room while the live node clusters what its Kinect sees.
//!
//! Clouds and transforms cross DDS like those of a real driver. Where the system's socket buffer is too small to carry
//! clouds, they are handed to the node inside the process instead; the results go out over DDS in both cases.
#![expect(clippy::print_stdout, reason = "the table is what the demo is for")]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context as _;
use cfodi::cloud::{CloudFilter, decode};
use cfodi::engine::{Snapshot, Stamp};
use cfodi::export::{View, draw, write_ply, write_whole};
use cfodi::msg::ros::TfMessage;
use cfodi::node::Setup;
use cfodi::node::dds::{Events, Robot};
use cfodi::node::transport::Event;
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::{Drive, Scene};
use tracing::{error, info};

use super::{live_node, receive_buffer, signalled};

/// Below four clouds of 640 x 480 x 16 bytes a socket buffer loses clouds.
const ENOUGH: usize = 4 * 640 * 480 * 16;

/// Rows of the table.
const ROWS: usize = 12;

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Folder for the map: `map.ply` and `map.png`
    #[arg(long, default_value = "cfodi-demo")]
    out: PathBuf,
    /// How long the robot drives (s)
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=3600))]
    seconds: u32,
    /// Decides the sensor's noise
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn demo(setup: &Setup, options: &Options) -> anyhow::Result<()> {
    std::fs::create_dir_all(&options.out)
        .with_context(|| format!("cannot make {}", options.out.display()))?;
    let over_dds = receive_buffer(setup) >= ENOUGH;
    if !over_dds {
        info!(
            "the socket buffer is below four clouds ({ENOUGH} bytes): scans are handed over inside the process, \
             results go out over DDS"
        );
    }
    let arrived = Arc::new(AtomicBool::new(false));
    let begin = |events| {
        let robot = Robot::open(setup).context("the simulated robot cannot join the ROS network")?;
        let journey = Journey {
            robot,
            drive: Drive::new(Scene::room(), options.seed, now()),
            steps: options.seconds * SCANS_PER_SECOND,
            inside: (!over_dds).then_some((events, setup.config.filter)),
        };
        let arrived = Arc::clone(&arrived);
        std::thread::Builder::new().name("simulated-robot".to_owned()).spawn(move || {
            journey.travel();
            arrived.store(true, Ordering::Release);
        })?;
        info!("the simulated robot drives for {} s", options.seconds);
        Ok(())
    };
    let over = async {
        tokio::select! {
            () = signalled() => {}
            () = until(&arrived) => {}
        }
    };
    let map = live_node(setup, begin, over)?;
    println!("{}", table(&map));
    leave(&map, options)
}

fn now() -> Stamp {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX))
}

async fn until(arrived: &AtomicBool) {
    while !arrived.load(Ordering::Acquire) {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    // Time for the last clouds on their way.
    tokio::time::sleep(Duration::from_millis(300)).await;
}

/// The robot's thread: what its driver would do.
struct Journey {
    robot: Robot,
    drive: Drive,
    steps: u32,
    /// Where clouds go that DDS cannot carry.
    inside: Option<(Events, CloudFilter)>,
}

impl Journey {
    fn travel(&self) {
        let begin = Instant::now();
        self.transforms(self.drive.static_transforms(), true);
        for index in 0..self.steps {
            let due = Duration::from_secs_f64(f64::from(index) / f64::from(SCANS_PER_SECOND));
            if let Some(early) = due.checked_sub(begin.elapsed()) {
                std::thread::sleep(early);
            }
            let step = self.drive.step(index);
            self.transforms(step.tf, false);
            let sent = match &self.inside {
                Some((events, filter)) => events
                    .blocking_send(Event::Cloud(decode(&step.cloud, filter)))
                    .map_err(|_| "the node has ended".to_owned()),
                None => self.robot.send_cloud(step.cloud).map_err(|failure| failure.to_string()),
            };
            if let Err(text) = sent {
                error!("the simulated robot stops: {text}");
                return;
            }
        }
    }

    fn transforms(&self, message: TfMessage, is_static: bool) {
        if let Some((events, _)) = &self.inside {
            // A node that has ended needs no transforms.
            drop(events.blocking_send(Event::Transforms { message: message.clone(), is_static }));
        }
        if let Err(failure) = self.robot.send_transforms(message, is_static) {
            error!("transforms could not be sent: {failure}");
        }
    }
}

fn table(map: &Snapshot) -> String {
    let mut clusters: Vec<_> = map.clusters.iter().collect();
    clusters.sort_by_key(|cluster| (std::cmp::Reverse(cluster.voxel_count), cluster.id));
    let mut lines = vec![format!(
        "{} scans: {} dense voxels, {} clusters; the largest:\n{:>6} {:>7}  {:^21}  {:^18}  state",
        map.sequence,
        map.voxels.len(),
        clusters.len(),
        "id",
        "voxels",
        "normal",
        "size [m]"
    )];
    lines.extend(clusters.iter().take(ROWS).map(|cluster| {
        let (n, s) = (cluster.normal, cluster.size);
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

fn leave(map: &Snapshot, options: &Options) -> anyhow::Result<()> {
    let (ply, png) = (options.out.join("map.ply"), options.out.join("map.png"));
    write_whole(&ply, |mut out| write_ply(&mut out, map))?;
    write_whole(&png, |out| draw(map, &View::default()).write_png(out))?;
    println!("the map: {} and {}", ply.display(), png.display());
    Ok(())
}
