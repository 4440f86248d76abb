//! Prints what a node publishes on its map, with ROS arguments and DDS Security as the node has them:
//! `cargo run --example clusters -- --ros-args -r /cfodi/clusters:=/robot/eyes/clusters --enclave /planner`
#![expect(clippy::print_stdout, reason = "that is what it is for")]

use std::error::Error;

use cfodi::count::count_of;
use cfodi::node::Setup;
use cfodi::node::args::Environment;
use cfodi::node::dds::SnapshotReader;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let (setup, _) = Setup::parse(&args, &Environment::of_process(), "map_reader")?;
    let reader = SnapshotReader::open(&setup)?;
    println!("reading");
    let runtime = tokio::runtime::Builder::new_current_thread().build()?;
    runtime.block_on(async {
        loop {
            let map = reader.next().await?;
            println!("version {} of the map: {}", map.sequence, count_of(map.clusters.len(), "cluster"));
        }
    })
}
