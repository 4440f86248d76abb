//! The addresses of this machine, as RustDDS finds them.
//!
//! RustDDS 0.15.1 tells others of those that it finds when the network is joined, and listens for news by these alone: under one
//! that comes later the node is not heard, and hears nobody. One that goes is no reason to join anew: nothing is heard by it
//! either way, and what is heard by the others must not rest for that.

use std::collections::BTreeSet;
use std::net::Ipv4Addr;
use std::thread::Builder;
use std::time::{Duration, Instant};

use netdev::prelude::Ipv4Net;

use super::STAY;
use crate::node::own_thread::on_own_thread;

/// Time between two looks. Two that find the same are enough: an address may come and go while a network is set up.
const LOOK: Duration = Duration::from_secs(1);

pub(super) type Set = BTreeSet<Ipv4Addr>;

/// Those of `only` that the machine has; where that is empty, all.
pub(super) fn read(only: &[Ipv4Addr]) -> Set {
    let interfaces = netdev::get_interfaces();
    let all = interfaces.iter().flat_map(|interface| &interface.ipv4).map(Ipv4Net::addr);
    all.filter(|address| only.is_empty() || only.contains(address)).collect()
}

/// Those that a network was joined with.
pub(super) struct Addresses {
    only: Vec<Ipv4Addr>,
    joined: Set,
    at: Instant,
}

impl Addresses {
    /// Before the network is joined: what comes meanwhile is then joined for anew.
    pub(super) fn at_joining(only: &[Ipv4Addr]) -> Self {
        Self { only: only.to_vec(), joined: read(only), at: Instant::now() }
    }

    /// All of them.
    pub(super) fn joined(&self) -> Vec<Ipv4Addr> {
        self.joined.iter().copied().collect()
    }

    /// Resolves when one has come by which nothing is heard, with what has changed.
    pub(super) async fn have_changed(&self) -> String {
        let mut looks = Looks::new(self.joined.clone());
        loop {
            tokio::time::sleep(LOOK).await;
            let only = self.only.clone();
            // Some drivers of network cards take their time to tell of them.
            let thread = Builder::new().name("cfodi-addresses".to_owned());
            let Ok(now) = on_own_thread(thread, move || read(&only)).await else { continue };
            let change = looks.change(now);
            if let Some(change) = change.filter(|_| self.at.elapsed() >= STAY) {
                return format!("the addresses of this machine have changed ({change})");
            }
        }
    }
}

/// What was found in a row.
struct Looks {
    joined: Set,
    /// Those of them that were there at every look.
    kept: Set,
    last: Set,
}

impl Looks {
    fn new(joined: Set) -> Self {
        Self { kept: joined.clone(), last: joined.clone(), joined }
    }

    /// What has come and gone, where something has come, perhaps back, and it was so at the look before.
    fn change(&mut self, now: Set) -> Option<String> {
        self.kept.retain(|address| now.contains(address));
        let is_settled = self.last == now;
        self.last = now;
        let listed = |addresses: Vec<&Ipv4Addr>, what: &str| {
            let texts: Vec<_> = addresses.iter().map(ToString::to_string).collect();
            (!texts.is_empty()).then(|| format!("{what}: {}", texts.join(", ")))
        };
        let came = listed(self.last.difference(&self.kept).collect(), "new").filter(|_| is_settled)?;
        let went = listed(self.joined.difference(&self.last).collect(), "gone");
        Some([Some(came), went].into_iter().flatten().collect::<Vec<_>>().join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(last_bytes: &[u8]) -> Set {
        last_bytes.iter().map(|byte| Ipv4Addr::new(10, 0, 0, *byte)).collect()
    }

    /// What is said after each of these looks.
    fn said(joined: &[u8], looks: &[&[u8]]) -> Vec<Option<String>> {
        let mut so_far = Looks::new(set(joined));
        looks.iter().map(|found| so_far.change(set(found))).collect()
    }

    #[test]
    fn another_address_is_told_once_it_is_found_twice() {
        let change = || Some("new: 10.0.0.7; gone: 10.0.0.1".to_owned());
        assert_eq!(said(&[1], &[&[1], &[7], &[7], &[7]]), [None, None, change(), change()]);
        assert_eq!(said(&[1], &[&[], &[], &[7], &[7]]), [None, None, None, change()]);
        let more = Some("new: 10.0.0.7, 10.0.0.8".to_owned());
        assert_eq!(said(&[1], &[&[1, 7], &[1, 7, 8], &[1, 7, 8]]), [None, None, more]);
        assert_eq!(said(&[], &[&[], &[7], &[7]])[2].as_deref(), Some("new: 10.0.0.7"));
    }

    #[test]
    fn one_that_goes_is_no_change_until_it_comes_back_and_one_that_is_seen_once_is_none() {
        assert_eq!(said(&[1, 2], &[&[1], &[1], &[1]]), [None, None, None]);
        let back = Some("new: 10.0.0.2".to_owned());
        assert_eq!(said(&[1, 2], &[&[1], &[1, 2], &[1, 2]]), [None, None, back]);
        assert_eq!(said(&[1], &[&[1, 7], &[1], &[1, 7], &[1], &[1]]), vec![None; 5]);
    }

    #[test]
    fn only_those_count_that_the_node_is_bound_to() {
        let own = read(&[]);
        assert!(read(&own.iter().copied().take(1).collect::<Vec<_>>()).len() <= 1);
        assert!(read(&[Ipv4Addr::new(192, 0, 2, 1)]).is_empty());
    }
}
