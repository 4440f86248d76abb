//! A map is saved whole or not at all, whenever its process is killed.
//!
//! The test starts itself anew as the process that saves; `CFODI_KILLS` is how often it is killed (300).
#![cfg(feature = "store")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test that cannot go on has failed"
)]

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::time::Duration;

use cfodi::engine::{Engine, Isometry3, Params, Points, Scan, Stamp};
use cfodi::store::{self, Stored};

/// In the process that saves: the file of the map.
const CHILD: &str = "CFODI_SAVES_INTO";

/// The name of the test, which starts itself anew.
const THIS: &str = "whenever_it_is_killed_the_map_is_the_one_before_or_the_one_after_and_ids_go_on";

/// A wall at x = 2 m that grows along y with each scan, and each fifth scan a plate before it.
fn scan(number: u64) -> Scan {
    let (first, plate) = (number as f32 * 0.05, number.is_multiple_of(5));
    let wall = (0..4000).map(|i| [2.003, first + (i % 50) as f32 * 0.01, (i / 50) as f32 * 0.01]);
    let plate = (0..if plate { 900 } else { 0 })
        .map(|i| [1.2, first + (i % 30) as f32 * 0.01, (i / 30) as f32 * 0.01]);
    Scan {
        stamp: Stamp::from_nanos(number as i64 * 33_333_333),
        fixed_from_sensor: Isometry3::identity(),
        points: Points::F32(wall.chain(plate).collect()),
    }
}

fn resumed(path: &Path) -> Engine {
    match store::read(path) {
        Ok(Stored { map, .. }) => Engine::restore(Params::default(), map).unwrap(),
        Err(error) if error.is_missing() => Engine::new(Params::default()),
        Err(error) => panic!("{error}"),
    }
}

/// Goes on with the map for ever: says which scan it is about to save, and that it has.
fn save_until_killed(path: &Path) -> ! {
    let mut engine = resumed(path);
    let mut out = std::io::stdout();
    loop {
        let sequence = engine.freeze().save().sequence();
        engine.insert(&scan(sequence));
        writeln!(out, "\nbegin {}", sequence + 1).unwrap();
        store::write(path, "odom", engine.freeze()).unwrap();
        writeln!(out, "\nsaved {}", sequence + 1).unwrap();
    }
}

/// The newest scan that it was about to save and the newest that it had saved, 0 for none; `begins` hears each of the first.
fn last_words(out: impl std::io::Read, begins: &Sender<()>) -> [u64; 2] {
    let mut last = [0; 2];
    for line in BufReader::new(out).lines().map_while(Result::ok) {
        if line.starts_with("begin ") {
            begins.send(()).ok();
        }
        for (word, last) in ["begin ", "saved "].iter().zip(&mut last) {
            *last = line.strip_prefix(word).and_then(|number| number.parse().ok()).unwrap_or(*last);
        }
    }
    last
}

#[test]
fn whenever_it_is_killed_the_map_is_the_one_before_or_the_one_after_and_ids_go_on() {
    if let Some(path) = std::env::var_os(CHILD) {
        save_until_killed(path.as_ref());
    }
    let kills: u64 = std::env::var("CFODI_KILLS").map_or(300, |kills| kills.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map");
    // The same scans without a stop.
    let mut unbroken = Engine::new(Params::default());
    let (mut before, mut in_between) = (0, 0);
    for kill in 0..kills {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", THIS, "--nocapture"])
            .env(CHILD, &path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let out = child.stdout.take().unwrap();
        let (begins, begun) = channel();
        let listening = std::thread::spawn(move || last_words(out, &begins));
        // From the first saving to some maps later, at other moments of saving each time. How long it takes to start is the
        // machine's matter.
        begun.recv().unwrap();
        std::thread::sleep(Duration::from_micros(kill * 7_919 % 40_000));
        child.kill().unwrap();
        child.wait().unwrap();
        let [begun, saved] = listening.join().unwrap();
        let engine = resumed(&path);
        let sequence = engine.freeze().save().sequence();
        let least = saved.max(before);
        assert!((least..=begun.max(least)).contains(&sequence), "{sequence} of {saved} saved, {begun} begun");
        in_between += u64::from(begun > saved);
        // Ids too: those that are given next are the same.
        (before..sequence).for_each(|number| drop(unbroken.insert(&scan(number))));
        assert_eq!(engine.freeze().save(), unbroken.freeze().save());
        before = sequence;
    }
    println!("{kills} kills, {in_between} of them while a map was being saved, {before} scans");
    assert!(in_between > 0, "no kill fell into a saving");
}
