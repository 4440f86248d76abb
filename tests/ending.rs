//! A node ends when it is asked to, or when it is asked again, whatever those do who read from it.
#![cfg(all(feature = "node", target_os = "linux"))]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/program.rs"]
mod program;

use std::fs::File;
use std::io::{PipeReader, PipeWriter, Read as _, Write as _, pipe};
use std::process::{Command, Stdio};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use program::{Folder, Running, command, listens};

/// How long a test waits for what must come.
const PATIENCE: Duration = Duration::from_secs(60);

/// Waits until this holds.
fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}");
        sleep(Duration::from_millis(20));
    }
}

/// The tests that start a node, each of which has a domain of its own, be they threads of one process or processes.
#[derive(Clone, Copy)]
enum Of {
    EndWithoutReader,
    LateReader,
    Demo,
    DemoThatSaves,
}

/// The program with these arguments, as a node that no other test hears.
fn node(test: Of, arguments: &[&str]) -> Command {
    // Of another process's tests those of the same kind alone may have it. Above 101 the ports of a domain are those that Linux
    // gives to others.
    let domain = 4 * (std::process::id() % 25) + test as u32;
    let mut command = command(arguments);
    command.args(["--ros-args", "-p", "network_interfaces:=[\"127.0.0.1\"]"]);
    command.env("ROS_DOMAIN_ID", domain.to_string()).env_remove("RUST_LOG");
    command
}

/// In the process that panics, and is then aborted.
const PANICS: &str = "CFODI_PANICS";

/// The test starts itself anew.
#[test]
fn what_was_said_before_a_panic_comes_out_before_its_words_though_the_process_is_aborted() {
    const THIS: &str =
        "what_was_said_before_a_panic_comes_out_before_its_words_though_the_process_is_aborted";
    const LINES: usize = 5000;
    if std::env::var_os(PANICS).is_some() {
        cfodi::say::start();
        (0..LINES).for_each(|number| cfodi::say::say(format_args!("line {number}")));
        drop(std::panic::catch_unwind(|| panic!("no room")));
        std::process::abort();
    }
    let mut itself = Command::new(std::env::current_exe().unwrap());
    let ended = itself.args(["--exact", THIS]).env(PANICS, "1").output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    let mut lines = said.lines();
    assert!((0..LINES).all(|number| lines.next() == Some(&format!("line {number}"))), "{said}");
    let rest: Vec<_> = lines.take(3).collect();
    assert!(rest[1].starts_with(&format!("thread '{THIS}' panicked at tests/ending.rs:")), "{rest:?}");
    assert_eq!([rest[0], rest[2]], ["", "no room"]);
    assert!(!ended.status.success());
}

/// What fills a pipe, and goes on for a while when it is read.
const FILLER: u8 = 0;

/// A pipe that is full.
fn full_pipe() -> (PipeReader, PipeWriter, JoinHandle<()>) {
    let (reader, writer) = pipe().unwrap();
    let mut filling = writer.try_clone().unwrap();
    let filler = spawn(move || {
        // Until nobody can read it any more, or all of it was read.
        let _ended = filling.write_all(&vec![FILLER; 1 << 20]);
    });
    (reader, writer, filler)
}

/// A node that runs, and whose log nobody has read so far.
fn unread(test: Of) -> (Running, PipeReader, JoinHandle<()>) {
    let (reader, writer, filler) = full_pipe();
    let node = Running(node(test, &["run"]).stderr(writer).spawn().unwrap());
    until("a node that listens to signals", || listens(node.0.id()));
    // Long enough, also on a busy machine, for what it says after three seconds without a cloud.
    sleep(Duration::from_secs(10));
    (node, reader, filler)
}

#[test]
fn a_node_whose_log_nobody_reads_ends_when_it_is_asked_to() {
    let (mut node, reader, filler) = unread(Of::EndWithoutReader);
    node.interrupt();
    until("its end", || node.0.try_wait().unwrap().is_some());
    assert!(node.0.wait().unwrap().success());
    drop(reader);
    filler.join().unwrap();
}

#[test]
fn a_reader_of_the_log_who_comes_late_gets_all_of_it_in_its_order() {
    let (mut node, mut reader, filler) = unread(Of::LateReader);
    let reading = spawn(move || {
        let mut said = Vec::new();
        reader.read_to_end(&mut said).unwrap();
        said.retain(|&byte| byte != FILLER);
        String::from_utf8(said).unwrap()
    });
    filler.join().unwrap();
    node.interrupt();
    until("its end", || node.0.try_wait().unwrap().is_some());
    let said = reading.join().unwrap();
    let place = |words: &str| said.lines().position(|line| line.contains(words)).expect(&said);
    assert!(place("ready: /cfodi reads") < place("nobody publishes on"), "{said}");
    assert!(said.lines().last().is_some_and(|line| line.starts_with("counts ")), "{said}");
}

/// The reader of a pipe who has opened it and reads nothing.
fn result_that_nobody_reads(folder: &Folder) -> JoinHandle<File> {
    let pipe = folder.argument("result.mcap");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    spawn(move || File::open(pipe).unwrap())
}

/// How many signals, a second and more apart, it takes to end a demo with these parameters whose result nobody reads.
fn signals_that_end_a_demo(test: Of, folder: &Folder, parameters: &[&str]) -> usize {
    let reader = result_that_nobody_reads(folder);
    let mut demo = node(test, &["demo", "--seconds", "3600", "--out", &folder.argument("")]);
    demo.args(parameters).stdout(Stdio::null()).stderr(Stdio::null());
    let mut demo = Running(demo.spawn().unwrap());
    let _pipe = reader.join().unwrap();
    until("a demo that listens to signals", || listens(demo.0.id()));
    // Long enough for more than the pipe and the memory before it take.
    sleep(Duration::from_secs(4));
    let mut signals = 0;
    until("its end", || {
        demo.interrupt();
        signals += 1;
        let begin = Instant::now();
        // Long enough for what it does before it ends, and for the first signal to be noticed well before the second.
        while demo.0.try_wait().unwrap().is_none() && begin.elapsed() < Duration::from_secs(8) {
            sleep(Duration::from_millis(20));
        }
        demo.0.try_wait().unwrap().is_some()
    });
    assert_eq!(demo.0.wait().unwrap().code(), Some(1));
    signals
}

#[test]
fn a_second_signal_ends_a_demo_whose_result_nobody_reads_and_leaves_nothing() {
    let folder = Folder::new();
    assert_eq!(signals_that_end_a_demo(Of::Demo, &folder, &[]), 2);
    assert_eq!(folder.names(), ["result.mcap"]);
}

#[test]
fn a_demo_that_saves_its_map_ends_as_well_where_nobody_reads_its_result() {
    let folder = Folder::new();
    let path = format!("snapshot_path:={}", folder.argument("map"));
    signals_that_end_a_demo(Of::DemoThatSaves, &folder, &["-p", &path]);
}
