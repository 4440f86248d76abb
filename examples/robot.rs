//! A simulated robot to try a node with: clouds on `/points`, `/tf` and `/tf_static`, with ROS arguments and DDS Security as
//! the node has them: `cargo run --release --example robot -- --ros-args --enclave /driver`. An argument is how many
//! clouds it sends in a second (2).

use std::error::Error;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use cfodi::engine::Stamp;
use cfodi::node::Setup;
use cfodi::node::args::Environment;
use cfodi::node::dds::Robot;
use cfodi::sim::drive::SCANS_PER_SECOND;
use cfodi::sim::{Drive, Scene};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let (setup, rest) = Setup::parse(&args, &Environment::of_process(), "robot")?;
    let in_a_second: u32 = rest.get(1).map_or(Ok(2), |text| text.parse())?;
    let every = (SCANS_PER_SECOND / in_a_second.clamp(1, SCANS_PER_SECOND)).max(1);
    let robot = Robot::open(&setup)?;
    let start = i64::try_from(SystemTime::now().duration_since(UNIX_EPOCH)?.as_nanos())?;
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(start));
    for index in (0..).step_by(every as usize) {
        let step = drive.step(index);
        robot.send_transforms(drive.static_transforms(), true)?;
        robot.send_transforms(step.tf, false)?;
        robot.send_cloud(step.cloud)?;
        std::thread::sleep(Duration::from_secs(1) * every / SCANS_PER_SECOND);
    }
    Ok(())
}
