//! Which files are written, and which are not.

use std::fs;

use crate::bags::{self, BagWriter, Layout, OPTICAL, POINTS, drive, stamp};
use crate::{Folder, cfodi, program, replay};

#[test]
fn an_output_that_cannot_be_written_is_named_and_nothing_is_left() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let found = replay(&bag, &["--out", "/nowhere/out.mcap"]);
    assert!(found.status == 1 && found.errors.contains("/nowhere/out.mcap"), "{}", found.errors);
    assert!(found.summary.is_none());
    let cut = folder.put("b.mcap", &drive(BagWriter::new(Layout::Plain), 2)[..30_000]);
    let out = folder.join("out.mcap");
    assert_eq!(replay(&cut, &["--out", out.to_str().unwrap()]).status, 1);
    let result = mcap::Summary::read(&fs::read(&out).unwrap()).unwrap().unwrap();
    assert_eq!(result.channels.len(), 7);
    let names: Vec<_> =
        fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(!names.iter().any(|name| name.to_string_lossy().contains(".part")), "{names:?}");
}

#[test]
fn a_result_in_the_folder_of_its_recording_is_no_part_of_it_and_may_be_replaced() {
    let folder = Folder::new();
    folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 10));
    let out = folder.join("result.mcap");
    for is_there in [false, true, true] {
        let found = replay(folder.path(), &["--out", out.to_str().unwrap(), "--with-input"]);
        assert_eq!(
            (found.status, found.number("scans"), found.number("sessions")),
            (0, 10, 1),
            "{}",
            found.errors
        );
        let said = "not read, as a replay has written them: result.mcap\n";
        assert_eq!(found.errors.contains(said), is_there, "{}", found.errors);
    }
    // Alone it is a recording like any other.
    assert_eq!(replay(&out, &[]).number("scans"), 10);
}

#[test]
fn no_output_replaces_a_part_of_the_input_and_none_is_begun_when_one_cannot_be_made() {
    let folder = Folder::new();
    folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let text = "rosbag2_bagfile_information: {storage_identifier: mcap, relative_file_paths: [a.mcap]}";
    let metadata = folder.put("metadata.yaml", text.as_bytes());
    let found = replay(folder.path(), &["--ply", metadata.to_str().unwrap()]);
    assert_eq!(
        (found.status, fs::read_to_string(&metadata).unwrap().as_str()),
        (2, text),
        "{}",
        found.errors
    );
    let out = folder.join("out.mcap");
    let found = replay(folder.path(), &["--out", out.to_str().unwrap(), "--clusters", "/nowhere/c.json"]);
    assert!(found.status == 1 && found.errors.contains("/nowhere/c.json"), "{}", found.errors);
    assert!(found.summary.is_none() && !out.exists());
}

#[test]
fn no_output_replaces_the_parameters() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let text = "/**: {ros__parameters: {voxel_size: 0.1}}";
    let parameters = folder.put("p.yaml", text.as_bytes());
    let [bag, parameters] = [&bag, &parameters].map(|path| path.to_str().unwrap());
    for option in ["--out", "--summary", "--voxels", "--clusters", "--ply"] {
        let ended = cfodi(&["replay", bag, option, parameters, "--ros-args", "--params-file", parameters]);
        let (status, said) = program::said(&ended);
        assert!(status == Some(2) && said.contains("would replace the input"), "{option}: {said}");
        assert_eq!(fs::read_to_string(parameters).unwrap(), text, "{option}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn what_was_not_read_is_said_where_an_output_cannot_be_written() {
    let folder = Folder::new();
    let cut = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 5)[..70_000]);
    let found = replay(&cut, &["--clusters", "/dev/full"]);
    assert_eq!((found.status, found.number("scans")), (1, 3), "{}", found.errors);
    let said = ["not all of the bag was read", "cannot write /dev/full"];
    assert!(said.iter().all(|said| found.errors.contains(said)), "{}", found.errors);
}

#[test]
fn a_replay_of_empty_clouds_says_so() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    for i in 0..3 {
        writer.tf("/tf", stamp(i), "map", OPTICAL, 0.0);
        writer.put(POINTS, "sensor_msgs/msg/PointCloud2", stamp(i), &bags::cloud(stamp(i), OPTICAL, &[]));
    }
    let found = replay(&folder.put("empty.mcap", &writer.finish()), &[]);
    assert_eq!((found.status, found.number("scans")), (0, 3), "{}", found.errors);
    assert!(found.errors.contains("no scan has a point, of 3 scans"), "{}", found.errors);
}

#[test]
fn voxels_that_are_given_in_another_unit_are_told_of_once_and_in_the_account() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let found = replay(&bag, &["--ros-args", "-p", "voxel_size:=8.0"]);
    let line = "voxel_size is 8 m and max_range 6 m: less than four voxels, and both are in metres";
    assert_eq!((found.status, found.errors.matches(line).count()), (0, 1), "{}", found.errors);
    assert_eq!(found.summary.unwrap()["remarks"].as_array().unwrap().last().unwrap(), line);
    let usual = replay(&bag, &[]);
    assert!(!usual.errors.contains("less than four voxels"), "{}", usual.errors);
}

#[test]
fn points_beyond_the_grid_are_said_and_counted() {
    let folder = Folder::new();
    let mut writer = BagWriter::new(Layout::Plain);
    // The grid of 8 cm reaches 83 km.
    writer.tf("/tf_static", stamp(0), "map", OPTICAL, 100_000.0);
    (0..2).for_each(|i| writer.scan(i));
    let report = folder.join("report");
    let found = replay(&folder.put("far.mcap", &writer.finish()), &["--report", report.to_str().unwrap()]);
    assert_eq!((found.status, found.number("points_beyond_grid"), found.number("voxels")), (0, 3200, 0));
    let line = "points beyond the grid, which reaches 83886 m from the origin of `map`, are left out, 3200 of 3200: take a fixed_frame";
    assert_eq!(found.errors.matches(line).count(), 1, "{}", found.errors);
    let account = "0 of 3200 points used (3200 beyond the grid)";
    assert!(found.errors.contains(account), "{}", found.errors);
    let page = fs::read_to_string(report.join("index.html")).unwrap();
    assert!(page.contains("Points beyond the grid, which reaches 83886 m"), "{page}");
}

#[test]
fn an_output_goes_through_a_link_to_what_is_not_there_yet_and_two_do_not_go_to_one_file() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 2));
    let [link, target] = ["link.json", "c.json"].map(|name| folder.join(name));
    std::os::unix::fs::symlink("c.json", &link).unwrap();
    let [link_text, target_text] = [&link, &target].map(|path| path.to_str().unwrap());
    let both = replay(&bag, &["--clusters", link_text, "--ply", target_text]);
    assert_eq!((both.status, target.exists()), (2, false), "{}", both.errors);
    assert!(both.errors.contains("two outputs would be written to"), "{}", both.errors);
    assert_eq!(replay(&bag, &["--clusters", link_text]).status, 0);
    assert!(link.is_symlink() && fs::symlink_metadata(&target).unwrap().is_file());
}

#[test]
fn a_dash_is_refused_with_the_name_of_what_it_stands_for_elsewhere() {
    let folder = Folder::new();
    let bag = folder.put("a.mcap", &drive(BagWriter::new(Layout::Plain), 3));
    let bag = bag.to_str().unwrap();
    for (arguments, instead) in [
        (&["replay", "-"][..], "/dev/stdin"),
        (&["replay", bag, "--summary", "-"], "/dev/stdout"),
        (&["replay", bag, "--out", "-"], "/dev/stdout"),
        (&["simulate", "--out", "-"], "/dev/stdout"),
    ] {
        let ended = cfodi(arguments);
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code() == Some(2) && errors.contains(instead), "{arguments:?}: {errors}");
    }
}
