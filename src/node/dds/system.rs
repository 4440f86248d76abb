//! What the log says, before the network is joined, of what the system gives the node for it.

use std::net::Ipv4Addr;

use socket2::{Domain, Socket, Type};
use tracing::{Level, info, warn};

use super::addresses::{Set, read};
use crate::args::Setup;

/// Says all of it.
pub(super) fn say_system(setup: &Setup) {
    say_receive_buffer(setup);
    say_discovery(setup);
    say_addresses(setup);
}

/// Bytes of the receive buffer that the node's sockets have: the system cuts a larger wish short without a word, so a
/// socket is asked. (Linux reports twice what it has set.)
pub fn receive_buffer(setup: &Setup) -> usize {
    let wish = setup.config().receive_buffer;
    let got = Socket::new(Domain::IPV4, Type::DGRAM, None).and_then(|socket| {
        socket.set_recv_buffer_size(wish)?;
        socket.recv_buffer_size()
    });
    let twice = if cfg!(target_os = "linux") { 2 } else { 1 };
    // Where no socket can be had, opening the node says why.
    got.map_or(wish, |got| wish.min(got / twice))
}

/// A buffer of fewer bytes does not hold the ten datagrams of such an image, which are sent faster than they are read.
const RAW_DEPTH_IMAGE: usize = 400_000;

fn say_receive_buffer(setup: &Setup) {
    let (wish, got) = (setup.config().receive_buffer, receive_buffer(setup));
    if got < wish {
        let what = if got < RAW_DEPTH_IMAGE {
            "clouds and raw depth images of 640x480 (their compressedDepth is smaller)"
        } else {
            "large clouds"
        };
        warn!(
            "socket receive buffer: {got} bytes instead of {wish}, too few for {what}; raise it with: \
             sudo sysctl -w net.core.rmem_max={wish}"
        );
    } else {
        info!("socket receive buffer: {got} bytes");
    }
}

/// Says which variables of the environment do not count that would change who finds whom.
fn say_discovery(setup: &Setup) {
    for (name, value) in setup.discovery() {
        match without_effect(name, value) {
            (Level::WARN, line) => warn!("{line}"),
            (_, line) => info!("{line}"),
        }
    }
}

/// What is to be said of a variable, and how loud: who sets up the middleware of a whole robot by it means no single node.
fn without_effect(name: &str, value: &str) -> (Level, String) {
    let so = match name {
        "FASTDDS_BUILTIN_TRANSPORTS"
            if ["SHM", "LARGE_DATA"].iter().any(|other| value.starts_with(other)) =>
        {
            "it speaks UDP alone, and who is set so does not find it (unset it for all nodes, or set UDPv4)"
        }
        "CYCLONEDDS_URI"
        | "FASTDDS_BUILTIN_TRANSPORTS"
        | "FASTDDS_DEFAULT_PROFILES_FILE"
        | "FASTRTPS_DEFAULT_PROFILES_FILE" => {
            let line = format!(
                "{name} has no effect on this node, which has a DDS of its own: network_interfaces and receive_buffer are its settings"
            );
            return (Level::INFO, line);
        }
        "ROS_DISCOVERY_SERVER" => {
            "it knows no Discovery Server, and who uses one neither finds it nor is found (unset it for all nodes, or: \
                 docs/zenoh.md)"
        }
        "ROS_STATIC_PEERS" => "it looks for peers by multicast alone (across routers: docs/zenoh.md)",
        _ => {
            "it hears, and is heard by, all that reach its ports (keep others out by a firewall, ROS_DOMAIN_ID, or keys)"
        }
    };
    (Level::WARN, format!("{name} is {value:?}, which has no effect on this node: {so}"))
}

/// Says where nobody on another machine can be heard, unless that is meant.
fn say_addresses(setup: &Setup) {
    let is_local = |name: &str| ["ROS_LOCALHOST_ONLY", "ROS_AUTOMATIC_DISCOVERY_RANGE"].contains(&name);
    let is_meant = !setup.config().network_interfaces.is_empty()
        || setup.discovery().iter().any(|(name, _)| is_local(name));
    if let Some(line) = lack(&read(&[])).filter(|_| !is_meant) {
        warn!("{line}");
    }
}

/// What is to be said of a machine that reaches no other.
fn lack(addresses: &Set) -> Option<&'static str> {
    if addresses.is_empty() {
        return Some(
            "no network is up, not even loopback: nobody can be heard until one is; the node then joins it",
        );
    }
    addresses.iter().all(Ipv4Addr::is_loopback).then_some(
        "no network but loopback is up: who is on another machine cannot be heard until one is; the node then joins it",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_another_dds_are_told_in_passing_and_what_would_change_who_is_found_is_a_warning() {
        let (level, line) = without_effect("CYCLONEDDS_URI", "<CycloneDDS/>");
        assert_eq!(
            (level, line.as_str()),
            (
                Level::INFO,
                "CYCLONEDDS_URI has no effect on this node, which has a DDS of its own: network_interfaces and receive_buffer \
                 are its settings"
            )
        );
        assert_eq!(without_effect("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4").0, Level::INFO);
        for (name, value) in [("ROS_STATIC_PEERS", "10.0.0.1"), ("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA")]
        {
            let (level, line) = without_effect(name, value);
            let begin = format!("{name} is {value:?}, which has no effect");
            assert!(level == Level::WARN && line.starts_with(&begin), "{line}");
        }
    }

    #[test]
    fn a_machine_that_reaches_no_other_is_told_of() {
        let [loopback, other] = [Ipv4Addr::LOCALHOST, Ipv4Addr::new(10, 0, 0, 1)].map(|own| Set::from([own]));
        assert!(lack(&Set::new()).is_some_and(|line| line.contains("not even loopback")));
        assert!(lack(&loopback).is_some_and(|line| line.contains("no network but loopback")));
        assert_eq!(lack(&other), None);
        assert_eq!(lack(&loopback.union(&other).copied().collect()), None);
    }
}
