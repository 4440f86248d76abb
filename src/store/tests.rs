use tempfile::tempdir;

use super::aside::keep_aside_by;
use super::*;
use crate::engine::{ClusterState, Engine, Isometry3, Params, Points, Scan, Stamp};

/// A floor of 0.8 x 0.8 m after `scans` scans.
fn engine(params: Params, scans: usize) -> Engine {
    let points = (0..6400).map(|i| [(i % 80) as f32 * 0.01 + 0.001, (i / 80) as f32 * 0.01 + 0.001, -0.99]);
    let points = Points::F32(points.collect());
    let fixed_from_sensor = Isometry3::translation(0.0, 0.0, 1.0);
    let mut engine = Engine::new(params);
    for number in 0..scans as i64 {
        let stamp = Stamp::from_nanos(number * 33_333_333);
        engine.insert(&Scan { stamp, fixed_from_sensor, points: points.clone() });
    }
    engine
}

fn stored(engine: &Engine) -> Stored {
    Stored { frame_id: "odom".to_owned(), map: engine.freeze().save() }
}

fn packed() -> Vec<u8> {
    pack("odom", &engine(Params::default(), 2).freeze()).unwrap()
}

fn damage(bytes: &[u8]) -> String {
    match unpack(bytes) {
        Err(Flaw::Damaged(what)) => what,
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_read_is_what_was_written() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    for params in [Params::default(), Params::paper()] {
        for scans in [0, 1, 5] {
            let engine = engine(params, scans);
            let bytes = write(&path, "odom", engine.freeze()).unwrap();
            assert_eq!(bytes, path.metadata().unwrap().len());
            let read = read(&path).unwrap();
            assert_eq!((&read, read.map.sequence()), (&stored(&engine), scans as u64));
            let restored = Engine::restore(params, read.map).unwrap();
            assert_eq!(format!("{:?}", restored.snapshot()), format!("{:?}", engine.snapshot()));
        }
    }
    assert_eq!(folder.path().read_dir().unwrap().count(), 1, "nothing beside the map");
}

#[test]
fn where_a_file_system_brings_no_folder_to_the_disk_that_is_no_failure_and_any_other_is() {
    use io::ErrorKind::{InvalidInput, PermissionDenied, StorageFull, Unsupported};

    const EIO: i32 = 5;
    const EINVAL: i32 = 22;
    let refused = [InvalidInput.into(), Unsupported.into(), io::Error::from_raw_os_error(EINVAL)];
    assert!(refused.into_iter().all(|error| synced(Err(error)).is_ok()) && synced(Ok(())).is_ok());
    let failed = [StorageFull.into(), PermissionDenied.into(), io::Error::from_raw_os_error(EIO)];
    assert!(failed.into_iter().all(|error| synced(Err(error)).is_err()));
}

#[test]
fn each_byte_that_is_another_and_each_cut_is_refused() {
    let whole = packed();
    assert!(unpack(&whole).is_ok());
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        assert!(unpack(&bytes).is_err(), "byte {at}");
        assert!(unpack(&whole[..at]).is_err(), "cut at {at}");
    }
    assert!(unpack(&[&whole[..], b"x"].concat()).is_err());
}

#[test]
fn a_file_of_another_version_is_told_from_a_damaged_one() {
    let mut bytes = packed();
    for version in (0..VERSION).chain([VERSION + 1, 99]) {
        bytes[8] = version as u8;
        assert_eq!(unpack(&bytes).unwrap_err(), Flaw::OtherVersion(version));
    }
    assert_eq!(damage(&bytes[..31]), "31 bytes, fewer than the 32 of its header");
    assert_eq!(damage(&[b'x'; 99]), "it does not begin with `cfodimap`");
}

/// The header of a map that claims these lengths, with a checksum that holds.
fn claiming(plain: u64, packed: &[u8]) -> Vec<u8> {
    let mut bytes = [&MAGIC[..], &VERSION.to_le_bytes(), &plain.to_le_bytes()].concat();
    bytes.extend((packed.len() as u64).to_le_bytes());
    bytes.extend(checksum(&bytes, packed).to_le_bytes());
    bytes.extend(packed);
    bytes
}

#[test]
fn lengths_that_the_file_does_not_bear_out_are_refused_before_anything_is_allocated() {
    assert_eq!(damage(&claiming(u64::MAX, b"small")), format!("5 bytes that claim to be {}", u64::MAX));
    let bomb = zstd::encode_all(&vec![0; 1 << 24][..], 1).unwrap();
    assert!(damage(&claiming(1000, &bomb)).starts_with("1001 bytes of map or more"));
    let honest = claiming(1 << 24, &bomb);
    assert_eq!(damage(&honest), format!("{} bytes that claim to be {}", bomb.len(), 1 << 24));
    let long = plain(&packed()).unwrap();
    let trailing = [&long[..], &[0; 3]].concat();
    let packed = zstd::encode_all(&trailing[..], 1).unwrap();
    assert_eq!(damage(&claiming(trailing.len() as u64, &packed)), "3 bytes after the map");
}

/// What is checked is in memory by then.
#[test]
fn a_list_that_claims_millions_takes_some_times_its_bytes_and_is_refused() {
    const ELEMENTS: usize = 1 << 18;
    let [consistent, paper] = [Params::default(), Params::paper()];
    // Of each list where its length stands in a map without a scan, bytes from the end; what is before it and behind it where it is
    // in an element of another; and the least that an element of it can be.
    let lists: [(_, _, usize, [&[u8]; 3]); 11] = [
        ("blocks", consistent, 65, [&[], &[], &[0; 12]]),
        ("states of a block", consistent, 65, [&[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], &[], &[0; 3]]),
        ("nodes by block", consistent, 64, [&[], &[], &[0]]),
        ("free nodes", consistent, 63, [&[], &[], &[0]]),
        ("nodes by component", consistent, 62, [&[], &[], &[0]]),
        ("free components", consistent, 61, [&[], &[], &[0]]),
        ("clusters", consistent, 60, [&[], &[], &[0; 10]]),
        ("ids that a cluster has taken in", consistent, 60, [&[1, 0, 0, 0, 0, 0, 0, 0], &[0, 0], &[1]]),
        ("voxels", paper, 27, [&[], &[], &[0; 10]]),
        ("clusters of mode paper", paper, 26, [&[], &[], &[0; 30]]),
        ("what they were merged into", paper, 25, [&[], &[], &[0]]),
    ];
    for (name, params, from_end, [before, behind, element]) in lists {
        let empty = plain(&pack("odom", &Engine::new(params).freeze()).unwrap()).unwrap();
        let (start, end) = empty.split_at(empty.len() - from_end);
        let length = postcard::to_stdvec(&ELEMENTS).unwrap();
        let claiming = [start, before, &length, &element.repeat(ELEMENTS), behind, &end[1..]].concat();
        let mut read = None;
        let memory = allocation_counter::measure(|| read = Some(decode(&claiming).unwrap()));
        let times = memory.bytes_max as f64 / claiming.len() as f64;
        eprintln!("{name}: {times:.1} times its bytes");
        assert!(times < 24.0, "{name}: {times:.1} times its bytes");
        let refused = Engine::restore(params, read.unwrap().map).unwrap_err();
        assert!(matches!(refused, RestoreError::Contradiction(_)), "{name}: {refused}");
    }
}

#[test]
fn a_map_of_other_parameters_is_refused_by_name_and_values() {
    let map = engine(Params::default(), 2).freeze().save();
    let other = Params::default().with_voxel_size(0.05).unwrap();
    let error = Engine::restore(other, map.clone()).unwrap_err();
    assert_eq!(error.to_string(), "the map was made with voxel_size 0.08, now it is 0.05");
    let error = Engine::restore(Params::paper(), map.clone()).unwrap_err();
    assert_eq!(error.to_string(), "the map was made with mode consistent, now it is paper");
    let wandering = Params::default().with_pose_sigma(0.02).unwrap();
    let error = Engine::restore(wandering, map.clone()).unwrap_err();
    assert_eq!(error.to_string(), "the map was made with pose_sigma 0, now it is 0.02");
    let to_the_letter = engine(Params::paper(), 2).freeze().save();
    assert!(
        Engine::restore(Params::paper().with_pose_sigma(0.02).unwrap(), to_the_letter).is_ok(),
        "it asks for none"
    );
    let bounded = Params::default().with_max_voxels(1000).unwrap().with_clearing(false);
    assert!(Engine::restore(bounded, map).is_ok(), "bounds and clearing may be others");
}

#[test]
fn where_a_map_cannot_be_written_the_one_before_stays() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    let before = engine(Params::default(), 1);
    write(&path, "odom", before.freeze()).unwrap();
    // In the way of what is written beside it.
    std::fs::create_dir(folder.path().join("map.part")).unwrap();
    let error = write(&path, "odom", engine(Params::default(), 2).freeze()).unwrap_err();
    assert!(error.to_string().contains("map: "), "{error}");
    assert_eq!(read(&path).unwrap(), stored(&before));
    assert!(read(&folder.path().join("none")).unwrap_err().is_missing());
}

#[test]
fn what_is_beside_a_map_is_not_followed_and_what_a_killed_process_has_left_there_is_replaced() {
    let no_links = |_: &Path, _: &Path| Err(io::ErrorKind::PermissionDenied.into());
    let folder = tempdir().unwrap();
    let [path, part, lock_file, other, missing] =
        ["map", "map.part", "map.lock", "other", "missing"].map(|name| folder.path().join(name));
    std::fs::write(&other, "somebody's").unwrap();
    let map = engine(Params::default(), 1).freeze();
    for to in [&other, &missing] {
        std::os::unix::fs::symlink(to, &part).unwrap();
        write(&path, "odom", &map).unwrap();
        std::os::unix::fs::symlink(to, &part).unwrap();
        assert!(keep_aside_by(no_links, &path, Kept::Before).unwrap().is_some());
        assert!(part.symlink_metadata().is_err() && !missing.exists());
    }
    std::fs::write(&part, "x".repeat(1 << 20)).unwrap();
    write(&path, "odom", &map).unwrap();
    assert!(!part.exists());
    assert_eq!(read(&path).unwrap().map, map.save());
    std::os::unix::fs::symlink(&other, &lock_file).unwrap();
    let _lock = lock(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&other).unwrap(), "somebody's");
}

#[test]
fn who_may_read_a_map_may_read_its_copy_and_nobody_else() {
    use std::os::unix::fs::PermissionsExt as _;

    let no_links = |_: &Path, _: &Path| Err(io::ErrorKind::PermissionDenied.into());
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    std::fs::write(&path, "a").unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
    let kept = keep_aside_by(no_links, &path, Kept::Before).unwrap().unwrap();
    assert_eq!(kept.metadata().unwrap().permissions().mode() & 0o777, 0o600);
}

#[test]
fn what_is_set_aside_takes_no_name_that_is_taken() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    for number in 1..=3 {
        std::fs::write(&path, number.to_string()).unwrap();
        let aside = set_aside(&path, Kept::Refused).unwrap();
        assert_eq!(aside, folder.path().join(format!("map.refused-{number}")));
        assert_eq!(std::fs::read_to_string(aside).unwrap(), number.to_string());
        assert!(!path.exists());
    }
    assert!(set_aside(&path, Kept::Refused).is_err());
}

#[test]
fn what_is_kept_beside_its_name_keeps_its_name_too_where_files_can_be_linked_and_where_not() {
    let no_links = |_: &Path, _: &Path| Err(io::ErrorKind::PermissionDenied.into());
    for links in [true, false] {
        let folder = tempdir().unwrap();
        let path = folder.path().join("map");
        let keep = || {
            if links { keep_aside(&path, Kept::Before) } else { keep_aside_by(no_links, &path, Kept::Before) }
        };
        assert_eq!(keep().unwrap(), None, "there is nothing yet");
        for number in 1..=3 {
            let map = engine(Params::default(), number);
            let before = stored(&map);
            write(&path, "odom", map.freeze()).unwrap();
            let kept = keep().unwrap().unwrap();
            assert_eq!(kept, folder.path().join(format!("map.before-{number}")));
            assert_eq!(read(&path).unwrap(), before, "there was a moment without a map");
            write(&path, "odom", engine(Params::default(), 0).freeze()).unwrap();
            assert_eq!(read(&kept).unwrap(), before);
        }
        assert_eq!(folder.path().read_dir().unwrap().count(), 4, "nothing beside the maps");
        std::fs::create_dir(folder.path().join("map.part")).unwrap();
        assert_eq!(keep().is_ok(), links, "no room for a copy");
        assert!(path.exists() && folder.path().join("map.before-4").exists() == links);
    }
}

#[test]
fn a_file_that_is_kept_beside_its_name_already_is_not_kept_again() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    for (number, contents) in [(1, "a"), (2, "b")] {
        std::fs::remove_file(&path).ok();
        std::fs::write(&path, contents).unwrap();
        let kept = keep_aside(&path, Kept::Before).unwrap();
        assert_eq!(kept, Some(folder.path().join(format!("map.before-{number}"))));
        assert_eq!([(); 3].map(|()| keep_aside(&path, Kept::Before).unwrap()), [const { None }; 3]);
    }
    assert!(keep_aside(&path, Kept::Refused).unwrap().is_some(), "another kind");
}

#[test]
fn what_is_set_aside_later_has_a_greater_number_though_smaller_ones_are_free() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    let named = |number: u32| folder.path().join(format!("map.before-{number}"));
    std::fs::write(named(9), "").unwrap();
    std::fs::write(&path, "").unwrap();
    assert_eq!(set_aside(&path, Kept::Before).unwrap(), named(10));
    std::fs::write(named(u32::MAX), "the last").unwrap();
    std::fs::write(&path, "").unwrap();
    assert!(set_aside(&path, Kept::Before).is_err() && path.exists());
    assert_eq!(std::fs::read_to_string(named(u32::MAX)).unwrap(), "the last");
}

#[test]
fn of_what_is_set_aside_the_oldest_beyond_eight_are_too_many_and_nobody_else_s_files_are() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    let ends = ["", "0", "01", "+1", " 1", "1.bak", "1x", "-1", "99999999999"]
        .map(|end| format!("map.before-{end}"));
    let others =
        ["map", "map.lock", "map.part", "map.before", "map.refused-1", "map.before.1", "map2.before-1"];
    for other in ends.iter().map(String::as_str).chain(others) {
        std::fs::write(folder.path().join(other), "").unwrap();
    }
    let named = |number: u32| folder.path().join(format!("map.before-{number}"));
    // By number, not by the letters of the name: 10 comes after 9. A folder is nobody's map.
    (2..=10).for_each(|number| std::fs::write(named(number), "").unwrap());
    std::fs::create_dir(named(1)).unwrap();
    assert_eq!(too_many_aside(&path, Kept::Before).unwrap(), [named(2)]);
    std::fs::write(named(11), "").unwrap();
    assert_eq!(too_many_aside(&path, Kept::Before).unwrap(), [named(2), named(3)]);
    assert!(too_many_aside(&path, Kept::Refused).unwrap().is_empty());
}

#[test]
fn one_process_at_a_time_may_save_under_a_name() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("map");
    let held = lock(&path).unwrap();
    let error = lock(&path).unwrap_err().to_string();
    assert_eq!(error, format!("{} is in use by another process", path.display()));
    assert!(lock(&folder.path().join("other")).is_ok());
    drop(held);
    assert!(lock(&path).is_ok());
}

#[test]
fn what_is_no_file_is_not_opened_and_no_more_is_read_than_the_header_says() {
    let folder = tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    assert!(read(&pipe).unwrap_err().to_string().ends_with("holds no whole map: it is no file"));
    // As long as a disk, and nearly all of it a hole.
    let path = folder.path().join("map");
    std::fs::write(&path, packed()).unwrap();
    File::options().write(true).open(&path).unwrap().set_len(1 << 40).unwrap();
    let error = read(&path).unwrap_err().to_string();
    let length = packed().len() - HEADER;
    assert!(
        error.contains(&format!("{length} bytes after the header, and there are {}", length + 1)),
        "{error}"
    );
}

/// Nothing packs better than a map that was large and is not any more: its free places remain.
#[test]
fn a_map_of_which_nearly_all_was_forgotten_can_be_read() {
    let params = Params::default().with_keep_radius(5.0).unwrap();
    let mut engine = Engine::new(params);
    let scan = |number: i64, x: f64, points| Scan {
        stamp: Stamp::from_nanos(number * 33_333_333),
        fixed_from_sensor: Isometry3::translation(x, 0.0, 0.0),
        points: Points::F32(points),
    };
    // A block each.
    let far = (0..20_000).map(|i| [i % 27, i / 27 % 27, i / 729].map(|steps| steps as f32 * 0.7));
    engine.insert(&scan(0, 0.0, far.collect()));
    for number in 1..1000 {
        engine.insert(&scan(number, 1000.0, vec![[0.0, 0.0, 1.0]]));
        if engine.voxel_count() == 1 {
            break;
        }
    }
    assert_eq!(engine.voxel_count(), 1);
    let bytes = pack("odom", &engine.freeze()).unwrap();
    assert!(bytes.len() < 1000, "{} bytes: what was forgotten has left something in it", bytes.len());
    assert_eq!(unpack(&bytes).unwrap(), stored(&engine));
}

#[test]
fn to_pack_a_map_takes_less_memory_than_it_has_unpacked() {
    let mut engine = Engine::new(Params::default());
    // A block each.
    let points = (0..20_000).map(|i| [i % 27, i / 27 % 27, i / 729].map(|steps| steps as f32 * 0.7));
    let points = Points::F32(points.collect());
    engine.insert(&Scan { stamp: Stamp::default(), fixed_from_sensor: Isometry3::identity(), points });
    let (map, mut bytes) = (engine.freeze(), Vec::new());
    let memory = allocation_counter::measure(|| bytes = pack("odom", &map).unwrap());
    let unpacked = number(&bytes[12..20]);
    eprintln!("{unpacked} bytes are packed into {}, with {} at once", bytes.len(), memory.bytes_max);
    assert!(unpacked > 1 << 20 && memory.bytes_max < unpacked, "{memory:?}");
    assert_eq!(unpack(&bytes).unwrap(), stored(&engine));
}

#[test]
fn what_is_restored_is_not_in_memory_beside_all_that_it_is_restored_from() {
    let params = Params::default();
    let mut engine = Engine::new(params);
    // Blocks that are full, as on a surface.
    let points = (0..400_000).map(|i| [i % 800, i / 800, 0].map(|steps| steps as f32 * 0.02 + 0.001));
    let points = Points::F32(points.collect());
    for number in 0..3 {
        let stamp = Stamp::from_nanos(number);
        engine.insert(&Scan { stamp, fixed_from_sensor: Isometry3::identity(), points: points.clone() });
    }
    let mut saved = None;
    let of_saved = allocation_counter::measure(|| saved = Some(engine.freeze().save()));
    let (map, mut restored) = (saved.unwrap(), None);
    let restoring = allocation_counter::measure(|| restored = Some(Engine::restore(params, map).unwrap()));
    eprintln!("{of_saved:?} is taken in: {restoring:?}");
    assert_eq!(restored.unwrap().freeze().save(), engine.freeze().save());
    let beside = restoring.bytes_max as i64 - restoring.bytes_current;
    assert!(of_saved.bytes_current > 1 << 20 && beside < of_saved.bytes_current / 4, "{beside} bytes");
}

#[test]
fn a_symbolic_link_stays_and_what_it_leads_to_is_replaced_locked_and_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let [link, second, real] = ["link", "second", "disk/map"].map(|name| folder.path().join(name));
    fs::create_dir(folder.path().join("disk")).unwrap();
    std::os::unix::fs::symlink("disk/map", &link).unwrap();
    std::os::unix::fs::symlink("link", &second).unwrap();
    let engine = engine(Params::default(), 1);
    for written in 1..3 {
        write(&second, "odom", engine.freeze()).unwrap();
        assert!(fs::symlink_metadata(&real).unwrap().is_file() && link.is_symlink() && second.is_symlink());
        assert_eq!(
            set_aside(&link, Kept::Before).unwrap(),
            folder.path().join(format!("disk/map.before-{written}"))
        );
    }
    let _lock = lock(&link).unwrap();
    let circle = folder.path().join("circle");
    std::os::unix::fs::symlink("circle", &circle).unwrap();
    assert!(
        write(&circle, "odom", engine.freeze()).is_err() && lock(&circle).is_err() && circle.is_symlink()
    );
    assert!(matches!(lock(&real).unwrap_err(), StoreError::InUse { .. }));
}

/// A robot without a clock of its own begins in 1970 at each start.
#[test]
fn under_an_earlier_clock_what_was_known_stays_known() {
    for params in [Params::default(), Params::paper()] {
        let before = engine(params, 30);
        assert!(before.snapshot().clusters.iter().all(|cluster| cluster.state != ClusterState::Tentative));
        let mut restored = Engine::restore(params, before.freeze().save()).unwrap();
        let earlier = Stamp::from_nanos(-1_000_000_000_000);
        let points = (0..6400).map(|i| [(i % 80) as f32 * 0.01, (i / 80) as f32 * 0.01, -0.99]);
        restored.insert(&Scan {
            stamp: earlier,
            fixed_from_sensor: Isometry3::translation(0.0, 0.0, 1.0),
            points: Points::F32(points.collect()),
        });
        let clusters = restored.snapshot().clusters;
        assert!(!clusters.is_empty());
        for cluster in &clusters {
            assert_ne!(cluster.state, ClusterState::Tentative, "{cluster:?}");
        }
    }
}
