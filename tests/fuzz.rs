//! What the fuzzer runs, without the fuzzer: each target on its seeds, and on so many changes of them and random bytes, the
//! same on every run. Without nightly this is what CI has of it; what cargo-fuzz has found stands by name where it was mended.
#![cfg(feature = "node")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/bags.rs"]
mod bags;
mod fuzz_bodies;
#[path = "support/mcap_bytes.rs"]
mod mcap_bytes;
#[path = "support/seeds.rs"]
mod seeds;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

use fuzz_bodies::{cloud, depth, engine, mcap, params, snapshot};

type Body = fn(&[u8]);

/// Every target: its name, its body, and how many random inputs it gets here.
const TARGETS: [(&str, Body, u32); 6] = [
    ("cloud", cloud::run, 100_000),
    ("depth", depth::run, 100_000),
    ("mcap", mcap::run, 6_000),
    ("params", params::run, 30_000),
    ("engine", engine::run, 600),
    ("snapshot", snapshot::run, 20_000),
];

fn folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target)
}

/// The seeds of a target, by name.
fn committed(target: &str) -> Vec<(String, Vec<u8>)> {
    let entries = fs::read_dir(folder(target)).unwrap().map(|entry| entry.unwrap());
    let mut seeds: Vec<_> = entries
        .map(|entry| (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap()))
        .collect();
    seeds.sort();
    seeds
}

/// One change of an input.
#[derive(Clone, Debug)]
enum Change {
    Set(prop::sample::Index, u8),
    Put(prop::sample::Index, Vec<u8>),
    Cut(prop::sample::Index, usize),
    Number(prop::sample::Index, u64, usize),
    Splice(prop::sample::Index, prop::sample::Index),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<prop::sample::Index>;
    let ends =
        prop::sample::select(vec![0, 1, 0x7f, 0xff, 0xffff, 1 << 31, u64::from(u32::MAX), 1 << 63, u64::MAX]);
    prop_oneof![
        4 => (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        1 => (at(), prop::collection::vec(any::<u8>(), 1..9)).prop_map(|(at, bytes)| Change::Put(at, bytes)),
        1 => (at(), 1..40_usize).prop_map(|(at, length)| Change::Cut(at, length)),
        2 => (at(), ends, prop::sample::select(vec![1, 2, 4, 8])).prop_map(|(at, n, size)| Change::Number(at, n, size)),
        1 => (at(), at()).prop_map(|(at, from)| Change::Splice(at, from)),
    ]
}

fn changed(mut bytes: Vec<u8>, changes: Vec<Change>) -> Vec<u8> {
    for change in changes {
        let place = |at: prop::sample::Index| at.index(bytes.len().max(1)).min(bytes.len());
        match change {
            Change::Set(at, byte) => {
                let at = place(at);
                bytes.splice(at..(at + 1).min(bytes.len()), [byte]);
            }
            Change::Put(at, more) => {
                let at = place(at);
                bytes.splice(at..at, more);
            }
            Change::Cut(at, length) => {
                let at = place(at);
                bytes.drain(at..(at + length).min(bytes.len()));
            }
            Change::Number(at, number, size) => {
                let at = place(at);
                let end = (at + size).min(bytes.len());
                bytes.splice(at..end, number.to_le_bytes()[..size].iter().copied());
            }
            Change::Splice(at, from) => {
                let (at, from) = (place(at), place(from));
                let copied: Vec<_> = bytes[from..(from + 64).min(bytes.len())].to_vec();
                bytes.splice(at..at, copied);
            }
        }
    }
    bytes
}

/// Runs a target's body on its seeds, then on changes of them and on random bytes.
fn bounded(target: &str) {
    let (_, body, cases) = TARGETS.into_iter().find(|(name, ..)| *name == target).unwrap();
    let seeds: Vec<_> = committed(target).into_iter().map(|(_, bytes)| bytes).collect();
    assert!(seeds.len() >= 3);
    seeds.iter().for_each(|seed| body(seed));
    let altered = (prop::sample::select(seeds), prop::collection::vec(change(), 1..8));
    let any_bytes = prop_oneof![
        4 => altered.prop_map(|(seed, changes)| changed(seed, changes)),
        1 => prop::collection::vec(any::<u8>(), 0..600),
    ];
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let ended = runner.run(&any_bytes, |bytes| {
        body(&bytes);
        Ok(())
    });
    ended.unwrap_or_else(|failure| panic!("{target}: {failure}"));
}

#[test]
fn clouds_of_any_bytes() {
    bounded("cloud");
}

#[test]
fn depth_images_of_any_bytes() {
    bounded("depth");
}

#[test]
fn bags_of_any_bytes() {
    bounded("mcap");
}

#[test]
fn parameters_of_any_text() {
    bounded("params");
}

#[test]
fn scans_of_any_bytes() {
    bounded("engine");
}

#[test]
fn saved_maps_of_any_bytes() {
    bounded("snapshot");
}

#[test]
fn the_seeds_are_small_and_each_has_a_target() {
    let folders =
        fs::read_dir(folder("")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = folders.collect();
    names.sort();
    let mut targets = TARGETS.map(|(name, ..)| name);
    targets.sort_unstable();
    assert_eq!(names, targets);
    for target in targets {
        assert!(
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("fuzz/fuzz_targets/{target}.rs")).is_file()
        );
        let seeds = committed(target);
        assert!(seeds.len() <= 40, "{target} has {} seeds", seeds.len());
        assert!(seeds.iter().all(|(name, bytes)| bytes.len() <= 8192 && !name.starts_with('.')));
    }
}

/// `CFODI_BLESS=1` writes them anew. Seeds that the fuzzer has found are kept beside them, as `found_*`.
#[test]
fn the_committed_seeds_are_those_that_are_made() {
    let blesses = std::env::var_os("CFODI_BLESS").is_some();
    let mut made = BTreeSet::new();
    for (target, name, bytes) in seeds::all() {
        let file = folder(target).join(&name);
        if blesses {
            fs::create_dir_all(folder(target)).unwrap();
            fs::write(&file, &bytes).unwrap();
        }
        let committed = fs::read(&file).unwrap_or_default();
        assert!(committed == bytes, "{target}/{name} is another seed; CFODI_BLESS=1 writes it anew");
        made.insert(file);
    }
    for (target, ..) in TARGETS {
        for (name, _) in committed(target) {
            let known = name.starts_with("found_") || made.contains(&folder(target).join(&name));
            assert!(known, "{target}/{name} is made by nothing");
        }
    }
}
