//! A simulated robot to try a node with: clouds on `/points`, `/tf` and `/tf_static`, with ROS arguments and DDS Security as
//! the node has them: `cargo run --release --example robot -- --ros-args --enclave /driver`. An argument is how many
//! clouds it sends in a second (2): a number that divides 30. Where it cannot make so many, it leaves some out.

use std::error::Error;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use cfodi::engine::Stamp;
use cfodi::node::Setup;
use cfodi::node::args::Environment;
use cfodi::node::dds::Robot;
use cfodi::sim::drive::{SCANS_PER_SECOND, steps_apart};
use cfodi::sim::{Drive, Scene};

/// Two clouds a second.
const STEPS_APART: u32 = SCANS_PER_SECOND / 2;

/// By how many steps the clouds lie apart of which so many are asked for in a second.
fn parsed(text: &str) -> Result<u32, String> {
    let every = text.parse().ok().and_then(steps_apart);
    every.ok_or_else(|| {
        format!("{text} clouds a second are asked for: it must be a number that divides {SCANS_PER_SECOND}")
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let (setup, rest) = Setup::parse(&args, &Environment::of_process(), "robot")?;
    let every = rest.get(1).map_or(Ok(STEPS_APART), |text| parsed(text))?;
    let robot = Robot::open(&setup)?;
    let start = i64::try_from(SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos())?;
    let (begun, between) = (Instant::now(), Duration::from_secs(1) * every / SCANS_PER_SECOND);
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(start));
    for index in (0..).step_by(every as usize) {
        let due = Duration::from_secs(1) * index / SCANS_PER_SECOND;
        // Its stamp would be behind the clock, and all after it.
        if begun.elapsed() > due + between {
            continue;
        }
        std::thread::sleep(due.saturating_sub(begun.elapsed()));
        let step = drive.step(index);
        robot.send_transforms(drive.static_transforms(), true)?;
        robot.send_transforms(step.tf, false)?;
        robot.send_cloud(step.cloud)?;
    }
    Ok(())
}
