//! `cfodi simulate` as a program: a recording with its truth, and what a replay makes of it.
#![cfg(feature = "node")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "support/program.rs"]
mod program;

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use byteorder::LittleEndian;
use cfodi::engine::Stamp;
use cfodi::msg::ros::PointCloud2;
use cfodi::sim::{Drive, Scene};
use nalgebra::{Point3, Vector2, Vector3};
use program::{Folder, Running, cfodi, listens};
use serde_json::Value;

fn json(path: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn clouds(path: &str) -> Vec<PointCloud2> {
    let bytes = fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let clouds = messages.filter(|message| message.channel.topic == "/camera/depth/points");
    clouds.map(|message| cdr_encoding::from_bytes::<_, LittleEndian>(&message.data[4..]).unwrap().0).collect()
}

#[test]
fn a_simulated_drive_is_replayed_and_its_labels_are_those_of_the_truth() {
    let folder = Folder::new();
    let [bag, truth, summary] = ["lab.mcap", "truth.json", "summary.json"].map(|name| folder.argument(name));
    let seed = "9007199254740993";
    let made = cfodi(&["simulate", "--out", &bag, "--seconds", "0.5", "--seed", seed, "--truth", &truth]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(folder.names(), ["lab.mcap", "truth.json"]);

    let replayed = cfodi(&["replay", &bag, "--summary", &summary]);
    assert_eq!(replayed.status.code(), Some(0), "{}", String::from_utf8_lossy(&replayed.stderr));
    assert_eq!(json(&summary)["scans"], 15);

    let truth = json(&truth);
    assert_eq!(
        (&truth["scene"], &truth["seed"], &truth["seconds"]),
        (&"lab".into(), &seed.into(), &0.5.into())
    );
    let surfaces = truth["surfaces"].as_array().unwrap();
    let (start, scene) = (Stamp::from_nanos(1_700_000_000_000_000_000), Scene::named("lab").unwrap());
    let drive = Drive::new(scene, seed.parse().unwrap(), start);
    let clouds = clouds(&bag);
    assert_eq!(clouds.len(), 15);
    assert!(clouds[7] == drive.step(7).cloud);
    let pose = drive.fixed_from_optical(7);
    let mut on_planes = 0;
    for point in clouds[7].data.chunks_exact(16) {
        let [x, y, z] =
            [0, 4, 8].map(|at| f64::from(f32::from_le_bytes(point[at..at + 4].try_into().unwrap())));
        let label = u32::from_le_bytes(point[12..].try_into().unwrap()) as usize;
        assert_eq!(label == 0, z.is_nan());
        let Some(surface) = label.checked_sub(1).map(|index| &surfaces[index]) else { continue };
        assert_eq!(surface["label"], label);
        let Some(plane) = surface["plane"].as_array() else { continue };
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| plane[i].as_f64().unwrap());
        let off = Vector3::new(a, b, c).dot(&(pose * Point3::new(x, y, z)).coords) + d;
        assert!(off.abs() < 0.012 * z * z + 0.01, "{off} m off {}", surface["name"]);
        on_planes += 1;
    }
    assert!(on_planes > 150_000, "{on_planes}");
}

#[test]
fn a_replay_in_a_frame_that_rides_on_the_robot_is_warned_of() {
    let folder = Folder::new();
    let [bag, summary] = ["lab.mcap", "summary.json"].map(|name| folder.argument(name));
    let made = cfodi(&["simulate", "--out", &bag, "--seconds", "2"]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let words = "the fixed frame `base_link` moves in `odom` and takes the sensor with it";
    for (frame, is_warned) in [("odom", false), ("base_link", true)] {
        let fixed_frame = format!("fixed_frame:={frame}");
        let replayed = cfodi(&["replay", &bag, "--summary", &summary, "--ros-args", "-p", &fixed_frame]);
        let errors = String::from_utf8_lossy(&replayed.stderr);
        assert!(replayed.status.success() && errors.contains(words) == is_warned, "{frame}: {errors}");
        let remarks = json(&summary)["remarks"].to_string();
        assert_eq!(remarks.contains(words), is_warned, "{frame}: {remarks}");
    }
}

#[test]
fn outlines_lie_in_their_planes_and_moving_things_tell_their_times() {
    let folder = Folder::new();
    let [bag, truth] = ["m.mcap", "t.json"].map(|name| folder.argument(name));
    let arguments = ["--scene", "moving", "--seconds", "0.05", "--pose-noise", "0.02,0.005"];
    let made = cfodi(&[&["simulate", "--out", &bag, "--truth", &truth][..], &arguments].concat());
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    assert_eq!(clouds(&bag).len(), 2);
    let truth = json(&truth);
    let mut kinds = Vec::new();
    for surface in truth["surfaces"].as_array().unwrap() {
        kinds.extend(surface["motion"]["kind"].as_str());
        let Some(plane) = surface["plane"].as_array() else {
            assert!(surface["shape"]["radius"].as_f64().unwrap() > 0.0);
            continue;
        };
        let [a, b, c, d] = [0, 1, 2, 3].map(|i| plane[i].as_f64().unwrap());
        let outline = surface["polygon"].as_array().unwrap();
        let corners = outline.iter().map(|p| Vector3::from([0, 1, 2].map(|i| p[i].as_f64().unwrap())));
        let corners: Vec<_> = corners.collect();
        let normal = Vector3::new(a, b, c);
        let area: Vector3<f64> =
            (0..corners.len()).map(|i| corners[i].cross(&corners[(i + 1) % corners.len()])).sum();
        assert!(area.dot(&normal) > 0.0, "{} is counter-clockwise", surface["name"]);
        assert!(corners.iter().all(|corner| (normal.dot(corner) + d).abs() < 1e-9), "{}", surface["name"]);
    }
    kinds.dedup();
    assert_eq!(kinds, ["walk", "swing", "taken_away"]);
    let away = truth["surfaces"].as_array().unwrap().iter().find(|surface| surface["name"] == "box/top");
    assert_eq!(away.unwrap()["motion"]["at"], 12.0);
}

/// Numbers of an array.
fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| value[i].as_f64().unwrap())
}

#[test]
fn the_truth_alone_says_where_who_walks_is_and_at_which_edge_a_door_hangs() {
    let folder = Folder::new();
    let [bag, truth] = ["m.mcap", "t.json"].map(|name| folder.argument(name));
    let made =
        cfodi(&["simulate", "--out", &bag, "--truth", &truth, "--scene", "moving", "--seconds", "0.05"]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let truth = json(&truth);
    let named =
        |name: &str| truth["surfaces"].as_array().unwrap().iter().find(|s| s["name"] == name).unwrap();

    let (trunk, seconds) = (named("person/side"), 3.0);
    let walk = &trunk["motion"];
    let [first, second] = [0, 1].map(|i| Vector2::from(numbers(&walk["corners"][i])));
    let [rounding, speed] = ["radius", "speed"].map(|name| walk[name].as_f64().unwrap());
    // At a right angle the arc ends its radius from the corner.
    let place = |seconds: f64| first + (second - first).normalize() * (rounding + speed * seconds);
    let [x, y, _] = numbers(&trunk["shape"]["middle"]);
    assert!((place(0.0) - Vector2::new(x, y)).norm() < 1e-9, "at the start");
    assert!(speed * seconds < (second - first).norm() - 2.0 * rounding, "still on the first stretch");

    let drive = Drive::new(Scene::named("moving").unwrap(), 1, Stamp::from_nanos(0));
    let (pose, middle) = (drive.fixed_from_optical(90), place(seconds));
    let mut seen = 0;
    for point in drive.step(90).cloud.data.chunks_exact(16) {
        let [x, y, depth] =
            [0, 4, 8].map(|at| f64::from(f32::from_le_bytes(point[at..at + 4].try_into().unwrap())));
        if trunk["label"] != u32::from_le_bytes(point[12..].try_into().unwrap()) {
            continue;
        }
        let from_axis = (pose * Point3::new(x, y, depth)).xy().coords - middle;
        let off = from_axis.norm() - trunk["shape"]["radius"].as_f64().unwrap();
        assert!(off.abs() < 0.012 * depth * depth + 0.01, "{off} m off");
        seen += 1;
    }
    assert!(seen > 5_000, "{seen} points of the trunk");

    let door = named("door/left");
    let hinge = Vector2::from(numbers(&door["motion"]["hinge"]));
    let corners = door["polygon"].as_array().unwrap().iter().map(|corner| Vector2::from(numbers(corner)));
    assert!(
        corners.map(|corner| (corner - hinge).norm()).fold(f64::MAX, f64::min) < 0.05,
        "at the door's edge"
    );
}

#[test]
fn the_same_arguments_give_the_same_bytes() {
    let folder = Folder::new();
    let paths = ["a.mcap", "b.mcap"].map(|name| folder.argument(name));
    for path in &paths {
        let made = cfodi(&["simulate", "--out", path, "--scene", "clutter", "--seconds", "0.1"]);
        assert_eq!(made.status.code(), Some(0));
    }
    assert!(fs::read(&paths[0]).unwrap() == fs::read(&paths[1]).unwrap());
}

#[test]
fn after_a_signal_the_scans_so_far_can_be_read_and_the_status_is_1() {
    for signal in ["INT", "TERM"] {
        let folder = Folder::new();
        let [bag, truth] = ["a.mcap", "t.json"].map(|name| folder.argument(name));
        let arguments = ["simulate", "--out", &bag, "--seconds", "3600", "--truth", &truth];
        let mut drive = Running::start(&arguments);
        // With the first chunk there are scans, and the listener to signals has stood for long.
        let patience = Instant::now() + Duration::from_secs(120);
        while folder.largest() < 1_000_000 {
            assert!(drive.0.try_wait().unwrap().is_none(), "it has ended by itself");
            assert!(Instant::now() < patience, "no chunk yet, in {:?}", folder.names());
            std::thread::sleep(Duration::from_millis(20));
        }
        let sent = Command::new("kill").args(["-s", signal, &drive.0.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let (code, errors) = drive.end();
        assert_eq!(code, Some(1), "{errors}");
        assert!(errors.contains("stopped by a signal before the end of the drive"), "{errors}");
        assert_eq!(folder.names(), ["a.mcap", "t.json"]);
        let clouds = clouds(&bag).len();
        assert!(clouds > 0 && errors.contains(&format!("{clouds} scans of scene lab")), "{clouds}: {errors}");
        let seconds = json(&truth)["seconds"].as_f64().unwrap();
        assert!((seconds * 30.0 - clouds as f64).abs() < 1e-6, "{seconds}");
    }
}

#[test]
fn wrong_arguments_of_the_laboratory_are_named_with_status_2_and_leave_no_file() {
    let folder = Folder::new();
    let out = folder.argument("lab");
    let parameters = ["mode:=paper", "depth:=3", "voxel_size:=0.2", "max_range:=0.5", "front.kind:=cloud"];
    let parameters = parameters.map(|parameter| ["-p", parameter]).concat();
    let parameters = [&["--ros-args", "-p", "sensors:=[front]"], &parameters[..]].concat();
    let poses = ["--voxel-size", "0.08", "--voxel-size", "0.05", "--ros-args", "-p", "pose_sigma:=0.07"];
    let wrong: [(&[&str], &str); 7] = [
        (&parameters, "--scene does not use front.kind, max_range, mode, sensors, voxel_size: all methods"),
        (&["--voxel-size", "0.05", "--voxel-size", "0.08", "--voxel-size", "0.050"], "0.05 is given twice"),
        (&["--voxel-size", "0"], "voxel_size is 0 m"),
        (&poses, "--voxel-size 0.05 is less than pose_sigma, which is 0.07 m"),
        (&["--seeds", "0"], "0 is not in 1..=1000"),
        (&["--pose-noise", "0.1"], "two numbers are meant"),
        (&["--pose-noise", "-0.1,0"], "-0.1 is not from 0 to 1"),
    ];
    for (arguments, said) in wrong {
        let ended = cfodi(&[&["experiment", "--scene", "room", "--out", &out], arguments].concat());
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(said), "{arguments:?}: {errors}");
        assert!(folder.names().is_empty());
    }
}

#[test]
fn parameters_of_the_methods_are_taken_by_the_laboratory() {
    let folder = Folder::new();
    let csv = |out: &str, parameters: &[&str]| {
        let out = folder.argument(out);
        let arguments = ["experiment", "--scene", "room", "--seconds", "0.2", "--seeds", "1", "--out", &out];
        let ended = cfodi(&[&arguments, parameters].concat());
        assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
        fs::read_to_string(format!("{out}/quality.csv")).unwrap()
    };
    let given = csv("given", &["--ros-args", "-p", "max_normal_angle:=0.1", "-p", "clearing:=false"]);
    assert_ne!(csv("plain", &[]), given);
}

#[test]
fn the_laboratory_tells_poses_wrong_if_it_is_asked_to_and_its_tables_say_so() {
    let folder = Folder::new();
    let arguments = ["--scene", "room", "--seconds", "0.2", "--seeds", "1", "--voxel-size", "0.16"];
    let [noise, out] = [["--pose-noise", "0.05,0.01"], ["--out", &folder.argument("")]];
    let ended = cfodi(&[&["experiment"], &arguments[..], &noise, &out].concat());
    assert_eq!(ended.status.code(), Some(0), "{}", String::from_utf8_lossy(&ended.stderr));
    let page = fs::read_to_string(folder.argument("quality.md")).unwrap();
    let heading = "## Voxels of 16 cm, 1 run, poses wrong by 0.05 m and 0.01 rad\n";
    assert!(page.contains(heading) && page.contains("\n- **poses wrong by**: "), "{page}");
    assert!(String::from_utf8_lossy(&ended.stdout).starts_with(heading));
    let csv = fs::read_to_string(folder.argument("quality.csv")).unwrap();
    assert!(csv.starts_with("voxel_size_m,") && csv.contains(",pose_noise_m,pose_noise_rad\n"), "{csv}");

    let bag = folder.argument("a.mcap");
    let ended = cfodi(&[&["experiment", &bag], &noise[..], &["--out", &folder.argument("figures")]].concat());
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(2), "{errors}");
    assert!(errors.contains("'[INPUT]' cannot be used with '--pose-noise <M,RAD>'"), "{errors}");
}

#[test]
fn the_laboratory_scores_on_the_way_if_it_is_asked_to() {
    let folder = Folder::new();
    let out = folder.argument("");
    let laboratory = |more: &[&str]| {
        let arguments =
            ["experiment", "--scene", "room", "--seconds", "0.5", "--seeds", "2", "--scan-step", "3"];
        let ended = cfodi(&[&arguments[..], &["--voxel-size", "0.16", "--out", &out], more].concat());
        (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
    };
    // Of half a second the last third scan is that at 12 / 30 s.
    let (status, errors) = laboratory(&["--score-every", "0.5"]);
    assert_eq!(status, Some(2), "{errors}");
    assert!(errors.contains("--score-every 0.5: the last scan is taken at 0.400 s"), "{errors}");
    assert!(folder.names().is_empty());
    let (status, errors) = laboratory(&["--score-every", "0.2"]);
    assert_eq!(status, Some(0), "{errors}");
    assert_eq!(folder.names(), ["on_the_way.csv", "quality.csv", "quality.md"]);
    let page = fs::read_to_string(folder.argument("quality.md")).unwrap();
    assert!(
        page.contains("\n## On the way, voxels of 16 cm\n") && page.contains("\nOn the way a cell"),
        "{page}"
    );
    let csv = fs::read_to_string(folder.argument("on_the_way.csv")).unwrap();
    let at: Vec<_> =
        csv.lines().skip(1).map(|line| line.split(',').take(4).collect::<Vec<_>>().join(" ")).collect();
    let moments = ["1 0.200", "1 0.400", "2 0.200", "2 0.400"];
    let methods = ["CFODI", "STATIC", "consistent"];
    let expected: Vec<_> = moments
        .iter()
        .flat_map(|moment| methods.iter().map(move |method| format!("{moment} 0.16 {method}")))
        .collect();
    assert_eq!(at, expected);
    assert_eq!(laboratory(&[]), (Some(0), String::new()));
    assert_eq!(folder.names(), ["quality.csv", "quality.md"], "what is not of this run is gone");
}

#[cfg(target_os = "linux")]
#[test]
fn a_signal_within_the_first_run_of_the_laboratory_leaves_the_tables_of_an_earlier_one() {
    let folder = Folder::new();
    let out = folder.argument("");
    let page = folder.put("quality.md", b"earlier");
    let arguments = ["experiment", "--scene", "room", "--seconds", "3600", "--seeds", "1", "--out", &out];
    let mut laboratory = Running::start(&arguments);
    while !listens(laboratory.0.id()) && laboratory.0.try_wait().unwrap().is_none() {
        std::thread::yield_now();
    }
    laboratory.interrupt();
    let (status, errors) = laboratory.end();
    assert_eq!(status, Some(1), "{errors}");
    assert!(errors.contains("before the first run was made: nothing is written"), "{errors}");
    assert_eq!(fs::read_to_string(page).unwrap(), "earlier");
    assert_eq!(folder.names(), ["quality.md"]);
}

#[test]
fn a_file_of_the_laboratory_that_cannot_be_written_is_named_before_the_runs() {
    let folder = Folder::new();
    let (out, inside) = (folder.argument("lab"), folder.argument("lab/quality.csv"));
    fs::create_dir_all(&inside).unwrap();
    let arguments = ["--seconds", "0.1", "--seeds", "1", "--voxel-size", "0.16", "--out", &out];
    let ended = cfodi(&[&["experiment", "--scene", "room"], &arguments[..]].concat());
    let errors = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{errors}");
    assert!(errors.contains("cannot write") && errors.contains("quality.csv"), "{errors}");
    let left: Vec<_> = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left, ["quality.csv"], "quality.md is written after the runs");
}

#[test]
fn wrong_arguments_are_named_with_status_2_and_leave_no_file() {
    let folder = Folder::new();
    let out = folder.argument("a.mcap");
    let wrong: [(&[&str], &str); 8] = [
        (&["--ros-args", "-p", "voxel_size:=0.05"], "takes no parameters and no other names"),
        (&["--ros-args", "-r", "points:=/a"], "takes no parameters and no other names"),
        (&["--scene", "kitchen"], "room, lab, corridor, stairs, clutter, moving"),
        (&["--seconds", "0"], "0 is not above 0"),
        (&["--seconds", "-1"], "-1 is not above 0"),
        (&["--pose-noise", "0.1"], "two numbers are meant"),
        (&["--pose-noise", "0.1,-2"], "-2 is not from 0 to 1"),
        (&["--truth", &out], "two outputs"),
    ];
    for (arguments, said) in wrong {
        let ended = cfodi(&[&["simulate", "--out", &out], arguments].concat());
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(said), "{arguments:?}: {errors}");
        assert!(folder.names().is_empty());
    }
    let ended = cfodi(&["simulate", "--out", "/nowhere/at/all.mcap"]);
    assert_eq!(ended.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&ended.stderr).contains("/nowhere/at/all.mcap"));
}
