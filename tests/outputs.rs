//! What becomes of the files that `cfodi replay` and `cfodi experiment` are to write, wherever they are to go.
#![cfg(all(feature = "node", target_os = "linux"))]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/bags.rs"]
mod bags;
#[path = "support/program.rs"]
mod program;

use std::fs::{self, File};
use std::io::Write as _;
use std::process::Command;

use bags::{BagWriter, Layout, drive, late_odom};
use program::{Folder, command, said};

/// A folder of the test's own with a bag in it.
fn with_bag(bag: &[u8]) -> Folder {
    Folder::with("a.mcap", bag)
}

/// A replay of the bag within the folder.
fn replay(folder: &Folder, more: &[&str]) -> Command {
    let mut command = command(&["replay", "a.mcap"]);
    command.current_dir(folder.path()).args(more);
    command
}

/// Whether it is said once that there is no space left for this file.
fn is_said(errors: &str, name: &str) -> bool {
    let start = format!("cfodi: cannot write {name}: ");
    errors.lines().filter(|line| line.starts_with(&start) && line.contains("No space left")).count() == 1
}

#[test]
fn standard_output_that_is_appended_to_a_file_leaves_what_is_in_it() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    fs::write(folder.join("all.json"), "earlier\n").unwrap();
    let all = File::options().append(true).open(folder.join("all.json")).unwrap();
    let ended = replay(&folder, &["--clusters", "/dev/stdout"]).stdout(all).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(0), "{errors}");
    let text = fs::read_to_string(folder.join("all.json")).unwrap();
    let clusters = text.strip_prefix("earlier\n").unwrap_or_else(|| panic!("{text}"));
    serde_json::from_str::<serde_json::Value>(clusters).unwrap();
}

/// As `{ echo header; cfodi replay ...; echo footer; } > f` does it.
#[test]
fn standard_output_is_written_where_it_stands_and_gone_on_with_behind() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    let mut file = File::create(folder.join("f")).unwrap();
    file.write_all(b"header\n").unwrap();
    let out = file.try_clone().unwrap();
    let ended = replay(&folder, &["--summary", "/dev/stdout"]).stdout(out).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(0), "{errors}");
    file.write_all(b"footer\n").unwrap();
    let text = fs::read_to_string(folder.join("f")).unwrap();
    let summary = text.strip_prefix("header\n").and_then(|text| text.strip_suffix("footer\n"));
    let summary = summary.unwrap_or_else(|| panic!("{text}"));
    assert_eq!(serde_json::from_str::<serde_json::Value>(summary).unwrap()["scans"], 2);
}

#[test]
fn a_result_bag_that_cannot_be_written_takes_no_other_output_with_it() {
    // The one fails at its end, the other long before.
    for scans in [1, 100] {
        let folder = with_bag(&drive(BagWriter::new(Layout::Plain), scans));
        let others = ["--voxels", "v.csv", "--summary", "s.json", "--report", "report"];
        let arguments = [&["--with-input", "--out", "/dev/full"], &others[..]].concat();
        let (status, errors) = said(&replay(&folder, &arguments).output().unwrap());
        assert_eq!(status, Some(1), "{errors}");
        let last = errors.lines().last().unwrap();
        let is_told = last.starts_with("cfodi: cannot write /dev/full") && last.contains("No space left");
        assert!(is_told, "{errors}");
        let summary = fs::read(folder.join("s.json")).unwrap();
        assert_eq!(serde_json::from_slice::<serde_json::Value>(&summary).unwrap()["scans"], scans);
        assert!(folder.join("v.csv").exists() && folder.join("report/index.html").exists(), "{errors}");
    }
}

#[test]
fn each_output_that_cannot_be_written_is_named_on_a_line_of_its_own() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    let names = ["out", "voxels", "clusters", "ply", "summary"];
    let mut arguments = Vec::new();
    for (name, option) in names.iter().zip(["--out", "--voxels", "--clusters", "--ply", "--summary"]) {
        std::os::unix::fs::symlink("/dev/full", folder.path().join(name)).unwrap();
        arguments.extend([option, name]);
    }
    let (status, errors) = said(&replay(&folder, &arguments).output().unwrap());
    assert_eq!(status, Some(1), "{errors}");
    assert!(names.iter().all(|name| is_said(&errors, name)), "{errors}");
}

#[test]
fn each_file_of_an_experiment_that_cannot_be_written_is_named_and_the_others_are_there() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    fs::create_dir(folder.join("figures")).unwrap();
    let names = ["scans.csv", "summary.json", "figure3a.svg", "figure2_a.png", "index.html"];
    for name in names {
        std::os::unix::fs::symlink("/dev/full", folder.join("figures").join(name)).unwrap();
    }
    let mut experiment = command(&["experiment", "a.mcap", "--no-effects", "--out", "figures"]);
    let ended = experiment.current_dir(folder.path()).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(1), "{errors}");
    assert!(names.iter().all(|name| is_said(&errors, &format!("figures/{name}"))), "{errors}");
    assert!(folder.join("figures/throughput.csv").exists() && !ended.stdout.is_empty(), "{errors}");
}

/// As `cfodi ... 2>&1 | tee log` has it.
#[test]
fn what_is_said_and_what_is_told_come_in_their_order_to_who_reads_both() {
    let bag = drive(BagWriter::new(Layout::Plain), 2);
    let folder = with_bag(&bag[..bag.len() - 10]);
    let all = File::create(folder.join("all")).unwrap();
    let mut experiment = command(&["experiment", "a.mcap", "--no-effects", "--out", "figures"]);
    experiment.current_dir(folder.path()).stdout(all.try_clone().unwrap()).stderr(all);
    assert_eq!(experiment.status().unwrap().code(), Some(1));
    let text = fs::read_to_string(folder.join("all")).unwrap();
    let place = |start: &str| text.lines().position(|line| line.starts_with(start)).expect(&text);
    let places = ["reading ", "method ", "cfodi: ", "figures and tables: "].map(place);
    assert!(places.is_sorted(), "{text}");
}

#[test]
fn what_killed_experiments_have_left_in_their_folder_is_named() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    fs::create_dir(folder.join("figures")).unwrap();
    // No process has an id above 2^22 (proc(5), pid_max).
    let left =
        ["index.html", "summary.json", "quality.md"].map(|name| format!("figures/.{name}.8388608-1.part"));
    left.iter().for_each(|name| drop(folder.put(name, b"half of")));
    let on_recording = ["a.mcap", "--no-effects"];
    let in_a_scene = ["--scene", "room", "--seeds", "1", "--seconds", "0.1"];
    for experiment in [&on_recording[..], &in_a_scene] {
        let mut command = command(&[&["experiment", "--out", "figures"], experiment].concat());
        let (status, errors) = said(&command.current_dir(folder.path()).output().unwrap());
        assert_eq!(status, Some(0), "{errors}");
        for name in &left {
            let place = folder.path().canonicalize().unwrap().join(name);
            let line = format!("a process that has been killed left {}: it can be removed", place.display());
            assert!(errors.lines().any(|said| said == line), "{errors}");
            assert!(place.exists());
        }
    }
}

/// As `ulimit -f` and `LimitFSIZE=` set it: SIGXFSZ would end the program without a word.
#[test]
fn a_file_that_may_not_become_as_large_is_named_and_nothing_is_left_of_it() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 4));
    let within = |arguments: &[&str]| {
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -f 8; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_cfodi")]).args(arguments);
        said(&command.current_dir(folder.path()).output().unwrap())
    };
    let replay = ["--out", "out.mcap", "--voxels", "v.csv", "--ply", "p.ply", "--summary", "s.json"];
    let simulate = ["simulate", "--scene=room", "--seconds=0.2", "--out", "room.mcap"];
    let experiment = ["experiment", "a.mcap", "--no-effects", "--out", "figures"];
    for (arguments, too_large) in [
        (&[&["replay", "a.mcap"], &replay[..]].concat()[..], &["out.mcap", "v.csv", "p.ply"][..]),
        (&simulate, &["room.mcap"]),
        (&experiment, &["figures/index.html"]),
    ] {
        let (status, errors) = within(arguments);
        assert_eq!(status, Some(1), "{errors}");
        for name in too_large {
            let said = |line: &&str| line.contains(name) && line.ends_with("File too large (os error 27)");
            assert_eq!(errors.lines().filter(said).count(), 1, "{name}: {errors}");
            assert!(!folder.join(name).exists(), "{name}");
        }
    }
    assert!(folder.join("s.json").exists(), "it is small");
}

#[test]
fn a_result_bag_that_is_all_there_is_ends_the_replay_where_it_cannot_be_written() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 100));
    let (status, errors) = said(&replay(&folder, &["--with-input", "--out", "/dev/full"]).output().unwrap());
    assert_eq!(status, Some(1), "{errors}");
    assert!(errors.contains("cannot write /dev/full") && !errors.contains("100 scans in"), "{errors}");
}

#[test]
fn a_result_bag_on_standard_output_is_not_begun_again_and_the_frame_to_give_is_named() {
    let folder = with_bag(&late_odom());
    let out = File::create(folder.join("out.mcap")).unwrap();
    let ended = replay(&folder, &["--out", "/dev/stdout"]).stdout(out).output().unwrap();
    let (status, errors) = said(&ended);
    assert_eq!(status, Some(1), "{errors}");
    assert!(errors.contains("--out cannot be begun again: -p fixed_frame:=odom"), "{errors}");
}

#[test]
fn an_output_with_the_name_of_a_folder_is_refused_before_the_bag_is_read() {
    let folder = with_bag(&drive(BagWriter::new(Layout::Plain), 2));
    for output in ["--out", "--clusters"] {
        let (status, errors) =
            said(&replay(&folder, &[output, "nd/", "--voxels", "v.csv"]).output().unwrap());
        assert_eq!(status, Some(1), "{errors}");
        assert!(errors.contains("cfodi: cannot write nd/: not a file name"), "{errors}");
        assert!(!errors.contains("2 scans in"), "{errors}");
        assert_eq!(folder.names(), ["a.mcap"]);
    }
}
