mod sides;
mod slots;

use std::f64::consts::PI;

use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::engine::now::Now;
use crate::engine::scan::Stamp;
use crate::engine::{ChangedCluster, Cluster, ClusterState, Engine, Isometry3, Points, SurfaceClass};
use crate::sim::{Drive, Scene};

/// Drives through a scene and checks after every scan that what clusters are judged by is found as by a scan of all,
/// and that they face the side that their patches do.
fn drive_and_check(scene: &str, params: Params, scans: impl Iterator<Item = u32>) {
    let drive = Drive::new(Scene::named(scene).unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut engine = Consistent::new(params);
    let (mut removed, mut neighbours) = (0, 0);
    for index in scans {
        removed += engine.insert(&drive.labelled_scan(index).scan).removed.len();
        neighbours += engine.surfaces.check_landmarks();
        engine.surfaces.check_sides();
    }
    assert!(removed > 10 && neighbours > 100, "{removed} removed, {neighbours} neighbours");
}

#[test]
fn floor_and_neighbours_are_those_of_all_clusters_while_things_come_and_go() {
    drive_and_check("moving", Params::default(), (0..720).step_by(18));
}

#[test]
fn floor_and_neighbours_are_those_of_all_clusters_where_what_is_far_is_forgotten() {
    let params = Params::default().with_keep_radius(3.0).unwrap();
    drive_and_check("lab", params, (0..1600).step_by(40));
}

/// The clusters of this class after a drive past the ramp of 18 degrees in the scene of the stairs.
fn past_the_ramp(voxel_size: f64, class: SurfaceClass) -> Vec<Cluster> {
    let drive = Drive::new(Scene::named("stairs").unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut engine = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
    (0..2400).step_by(20).for_each(|index| drop(engine.insert(&drive.labelled_scan(index).scan)));
    let mut clusters = engine.snapshot().clusters;
    clusters.retain(|cluster| cluster.class == class);
    clusters
}

#[test]
fn a_ramp_and_the_floor_that_it_rises_from_are_two_surfaces() {
    for voxel_size in [0.05, 0.08] {
        let [floor, ramp] =
            [SurfaceClass::Floor, SurfaceClass::Slope].map(|class| past_the_ramp(voxel_size, class));
        assert!(floor.len() == 1 && floor[0].rms_error < 0.01, "{voxel_size}: {floor:?}");
        let tilt = |cluster: &Cluster| cluster.normal.z.acos().to_degrees();
        let is_whole = ramp
            .iter()
            .any(|ramp| (tilt(ramp) - 18.0).abs() < 0.5 && ramp.area.is_some_and(|area| area > 3.5));
        assert!(
            is_whole,
            "{voxel_size}: {:?}",
            ramp.iter().map(|ramp| (tilt(ramp), ramp.area)).collect::<Vec<_>>()
        );
    }
}

/// Drives towards the ramp, and says how far the floor's voxels are off its plane at most (m), from the scan `from` on.
fn floor_before_the_ramp(voxel_size: f64, from: u32, scans: impl Iterator<Item = u32>) -> f64 {
    let drive = Drive::new(Scene::named("stairs").unwrap(), 1, Stamp::from_nanos(0));
    let mut engine = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
    let mut worst = 0.0_f64;
    for index in scans {
        engine.insert(&drive.labelled_scan(index).scan);
        if index >= from && index % 10 == 0 {
            let clusters = engine.snapshot().clusters;
            let level = clusters.iter().filter(|cluster| cluster.normal.z > 0.9);
            let floor = level.max_by_key(|cluster| cluster.voxel_count).unwrap();
            assert_eq!(floor.class, SurfaceClass::Floor, "{voxel_size}, scan {index}: {}", floor.rms_error);
            assert!(floor.voxel_count > 5000, "{voxel_size}, scan {index}: {}", floor.voxel_count);
            worst = worst.max(floor.rms_error);
        }
    }
    worst
}

/// Seen from 5 m the ramp's foot is as noisy as it is high, and its patches have planes between those of ramp and floor.
#[test]
fn a_ramp_seen_from_afar_is_no_part_of_the_floor() {
    let worst = floor_before_the_ramp(0.08, 150, 0..260);
    assert!(worst < 0.01, "{worst}");
}

/// In voxels of 5 cm the points of its foot scatter over two layers.
#[test]
fn a_ramp_whose_foot_scatters_over_two_layers_is_no_part_of_the_floor() {
    let worst = floor_before_the_ramp(0.05, 300, (0..480).step_by(2));
    assert!(worst < 0.01, "{worst}");
}

/// Where a floor lies at the border of two layers of blocks, and a ramp begins at one of their columns, a block has a row or two of the
/// floor, whose plane may be that of the ramp as well.
#[test]
fn a_ramp_that_begins_where_blocks_end_is_no_part_of_the_floor() {
    let params = Params::default().with_voxel_size(0.05).unwrap();
    let is_floor = |cluster: &Cluster| {
        cluster.class == SurfaceClass::Floor && cluster.area.is_some_and(|area| area > 1.5)
    };
    for degrees in [10.5, 14.0, 18.0] {
        let drive = Drive::new(Scene::ramp(degrees, 0.0), 1, Stamp::from_nanos(0));
        let mut engine = Consistent::new(params);
        let without = (0..200).step_by(2).filter(|&index| {
            engine.insert(&drive.labelled_scan(index).scan);
            index >= 20 && !engine.snapshot().clusters.iter().any(is_floor)
        });
        assert_eq!(without.count(), 0, "{degrees}");
    }
}

/// A plate so far before a sensor that stands still (m).
fn plate(index: u32, distance: f32) -> Scan {
    let places = (-40..=40).flat_map(|x| (-40..=40).map(move |y| [x, y].map(|at: i16| 0.01 * f32::from(at))));
    let points = places.map(|[x, y]| [x, y, distance]).collect();
    Scan {
        stamp: Stamp::from_nanos(i64::from(index) * 33_000_000),
        fixed_from_sensor: Isometry3::identity(),
        points: Points::F32(points),
    }
}

/// None of its voxels is seen through, and all go on getting points.
#[test]
fn what_moves_within_its_voxels_before_a_sensor_that_stands_still_is_told_of_where_it_is() {
    let mut engine = Consistent::new(Params::default());
    let mut told = |scans: std::ops::Range<u32>, distance: f32| {
        scans.for_each(|index| drop(engine.insert(&plate(index, distance))));
        let clusters = engine.snapshot().clusters;
        clusters.iter().max_by_key(|cluster| cluster.voxel_count).unwrap().pose.translation.vector.z
    };
    assert!((told(0..30, 1.45) - 1.45).abs() < 0.001);
    let moved = told(30..630, 1.48);
    assert!((moved - 1.48).abs() < 0.01, "{moved}");
}

/// The far wall of the room is 6.5 m away when the drive begins. Its points scatter by more than a voxel, and some are out of
/// range.
#[test]
fn a_wall_seen_from_afar_is_flat_and_as_uncertain_as_it_is_wrong() {
    for (voxel_size, max_range) in [(0.05, 6.0), (0.08, 6.0), (0.08, 7.5)] {
        let drive =
            Drive::new(Scene::named("room").unwrap(), 1, Stamp::from_nanos(0)).with_max_range(max_range);
        let mut engine = Consistent::new(Params::default().with_voxel_size(voxel_size).unwrap());
        (0..120).step_by(4).for_each(|index| drop(engine.insert(&drive.labelled_scan(index).scan)));
        let clusters = engine.snapshot().clusters;
        let wall = clusters
            .iter()
            .filter(|cluster| cluster.normal.x < -0.99)
            .max_by_key(|cluster| cluster.voxel_count);
        let wall = wall.unwrap();
        assert_eq!(wall.class, SurfaceClass::Wall, "{wall:?}");
        let error = wall.pose.translation.vector.x - 6.5;
        let sigma = wall.plane_covariance.unwrap()[(2, 2)].sqrt();
        assert!(error.abs() < 3.0 * sigma && sigma < 0.02, "{voxel_size}: {error} +- {sigma}");
    }
}

#[test]
fn a_floor_that_waves_by_the_bias_of_its_sensor_is_a_floor_in_voxels_of_a_centimetre() {
    let params = Params::default().with_voxel_size(0.01).unwrap().with_clearing(false);
    let mut engine = Consistent::new(params);
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let fixed_from_sensor = Translation3::new(0.0, 0.0, 1.2) * down;
    let point = |x: f64, y: f64| {
        let on_floor = Point3::new(x, y, 0.04 + 0.009 * (PI * x).cos());
        fixed_from_sensor.inverse_transform_point(&on_floor).cast::<f32>().into()
    };
    // 2 m by 1 m, four points a voxel.
    let [xs, ys] = [200, 100].map(|half| (-half..half).map(|i| 0.005 * (f64::from(i) + 0.5)));
    let points: Vec<[f32; 3]> =
        xs.flat_map(|x| ys.clone().map(move |y| (x, y))).map(|(x, y)| point(x, y)).collect();
    for number in 1..=6 {
        let points = Points::F32(points.clone());
        engine.insert(&Scan { stamp: Stamp::from_nanos(number), fixed_from_sensor, points });
    }
    let Snapshot { clusters, unclustered_voxels, .. } = engine.snapshot();
    let largest = clusters.iter().max_by_key(|cluster| cluster.voxel_count).unwrap();
    assert_eq!(largest.class, SurfaceClass::Floor, "{largest:?}");
    let dense = engine.dense_count() as u32;
    assert!(dense > 19_000 && unclustered_voxels < dense / 50, "{unclustered_voxels} of {dense}");
}

/// One scan of a drive through the laboratory after the other.
fn laboratory() -> impl FnMut() -> Scan {
    let drive = Drive::new(Scene::named("lab").unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut indices = (0..).step_by(20);
    move || drive.labelled_scan(indices.next().unwrap()).scan
}

#[test]
fn a_map_that_is_tuned_goes_on_as_one_that_was_saved_and_restored_with_the_other_parameters() {
    let mut next = laboratory();
    let of =
        |voxels, radius| Params::default().with_max_voxels(voxels).unwrap().with_keep_radius(radius).unwrap();
    let stages = [
        of(3000, 0.0),
        of(1500, 0.0),
        of(0, 2.5),
        of(0, 0.0).with_clearing(false),
        of(2000, 3.0).with_clearing(true),
        of(0, 0.0),
    ];
    let mut tuned = Engine::new(Params::default());
    (0..8).for_each(|_| drop(tuned.insert(&next())));
    for params in stages {
        let mut restored = Engine::restore(params, tuned.freeze().save()).unwrap();
        tuned.tune(&params);
        assert_eq!(tuned.params(), &params);
        for _ in 0..6 {
            let scan = next();
            tuned.insert(&scan);
            restored.insert(&scan);
            assert_eq!(tuned.freeze().save(), restored.freeze().save());
        }
        assert!(params.max_voxels() == 0 || tuned.voxel_count() as u64 <= params.max_voxels());
    }
}

/// Publishes these blocks once more, and describes what that changed.
fn publish_anew(engine: &mut Consistent, blocks: &[BlockIndex]) -> Vec<ChangedCluster> {
    let now = engine.taken.now();
    engine.surfaces.begin();
    engine.surfaces.publish(&engine.grid, blocks, std::iter::empty(), now);
    engine.surfaces.describe(&engine.params, 1.0, now)
}

#[test]
fn clusters_whose_blocks_are_published_as_they_were_have_not_changed() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default());
    (0..20).for_each(|_| drop(engine.insert(&next())));
    let blocks: Vec<_> = engine.grid.blocks().map(|(slot, _)| slot).collect();
    // What waits is published, and what that says of others is told of.
    (0..2).for_each(|_| drop(publish_anew(&mut engine, &blocks)));
    let before = engine.snapshot().clusters;
    assert!(before.len() > 20, "{}", before.len());
    let each = blocks.iter().map(std::slice::from_ref).chain([&blocks[..]]);
    for some in each {
        let changed = publish_anew(&mut engine, some);
        let changed: Vec<_> = changed.iter().map(|it| it.cluster.id).collect();
        assert!(changed.is_empty() && engine.surfaces.removed().is_empty(), "{some:?}: {changed:?}");
    }
    assert_eq!(engine.snapshot().clusters, before);
}

/// Blocks with dense voxels that are at rest, and that are not.
fn at_rest(engine: &Consistent) -> [usize; 2] {
    let dense = engine.grid.blocks().filter(|(_, block)| block.dense > 0);
    let (rest, awake): (Vec<_>, Vec<_>) = dense.partition(|(_, block)| block.is_at_rest());
    [rest.len(), awake.len()]
}

#[test]
fn what_the_sensor_has_left_is_kept_once_and_is_the_same() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default());
    let scans: Vec<_> = (0..20).map(|_| next()).collect();
    scans.iter().for_each(|scan| drop(engine.insert(scan)));
    let (before, [rest, blocks]) = (engine.snapshot(), at_rest(&engine));
    assert!(rest == 0 && blocks > 100, "{rest} and {blocks}");
    let blind = Scan { points: Points::F32(Vec::new()), ..scans[19].clone() };
    (0..200).for_each(|_| drop(engine.insert(&blind)));
    assert_eq!(at_rest(&engine), [blocks, 0]);
    let after = engine.snapshot();
    assert_eq!(before.voxels.len(), after.voxels.len());
    for (a, b) in before.voxels.iter().zip(&after.voxels) {
        assert!((a.key, a.count) == (b.key, b.count) && (a.centre - b.centre).norm() < 3e-5 * 0.08);
    }
    engine.insert(&scans[0]);
    let [rest, awake] = at_rest(&engine);
    assert!(rest > 10 && awake > 10, "{rest} and {awake}");
}

#[test]
fn what_shapes_a_map_is_not_tuned_and_the_letter_keeps_its_own() {
    let other = Params::default().with_voxel_size(0.3).unwrap().with_expansion_interval(3).unwrap();
    let mut engine = Engine::new(Params::default());
    engine.tune(&other);
    assert_eq!(engine.params(), &Params::default().with_expansion_interval(3).unwrap());
    let mut letter = Engine::new(Params::paper());
    letter.tune(&other);
    assert_eq!(letter.params(), &Params::paper());
}

#[test]
fn a_shorter_expansion_interval_completes_what_has_not_grown_for_so_long() {
    let mut next = laboratory();
    let mut engine = Engine::new(Params::default().with_expansion_interval(0).unwrap());
    (0..20).for_each(|_| drop(engine.insert(&next())));
    let mut stamp = 0;
    let mut rest = |engine: &mut Engine| {
        for _ in 0..300 {
            stamp += 1_000_000_000_000;
            let points = Points::F32(Vec::new());
            let fixed_from_sensor = Isometry3::identity();
            engine.insert(&Scan { stamp: Stamp::from_nanos(stamp), fixed_from_sensor, points });
        }
        let states = engine.snapshot().clusters.into_iter().map(|cluster| cluster.state);
        states.filter(|state| *state == ClusterState::Active).count()
    };
    assert!(rest(&mut engine) > 3);
    engine.tune(&Params::default().with_expansion_interval(5).unwrap());
    assert_eq!(rest(&mut engine), 0);
}

#[test]
fn what_a_moving_sensor_leaves_to_later_scans_is_published_soon_after_it_stands() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default().with_voxel_size(0.05).unwrap());
    let waiting = |engine: &Consistent| {
        let timing = Timing { scan: engine.taken.sequence, still_since: engine.standpoint.since() };
        engine.due.overdue(&engine.grid, timing)
    };
    let mut most = 0;
    for _ in 0..40 {
        engine.insert(&next());
        most = most.max(waiting(&engine));
    }
    assert!(most > 10, "{most} blocks waited at most");
    let last = next();
    (0..40).for_each(|_| drop(engine.insert(&last)));
    assert_eq!(waiting(&engine), 0);
}

#[test]
fn a_lift_makes_another_floor_and_ceiling_and_leaves_those_below_what_they_were() {
    let mut next = laboratory();
    let mut engine = Engine::new(Params::default());
    let scans: Vec<_> = (0..40).map(|_| next()).collect();
    let large = |engine: &Engine, class: SurfaceClass| {
        let clusters = engine.snapshot().clusters.into_iter();
        let large =
            clusters.filter(|cluster| cluster.class == class && cluster.area.is_some_and(|area| area >= 1.0));
        large.map(|cluster| cluster.id).collect::<Vec<_>>()
    };
    scans.iter().for_each(|scan| drop(engine.insert(scan)));
    let [floors, ceilings] = [SurfaceClass::Floor, SurfaceClass::Ceiling].map(|class| large(&engine, class));
    assert!(floors.len() == 1 && !ceilings.is_empty(), "{floors:?} {ceilings:?}");
    for scan in &scans {
        let fixed_from_sensor = Translation3::new(0.0, 0.0, 3.0) * scan.fixed_from_sensor;
        engine.insert(&Scan { fixed_from_sensor, ..scan.clone() });
    }
    let [both, all] = [SurfaceClass::Floor, SurfaceClass::Ceiling].map(|class| large(&engine, class));
    assert!(both.len() == 2 && both.contains(&floors[0]), "{floors:?} {both:?}");
    assert!(all.len() > ceilings.len() && ceilings.iter().all(|id| all.contains(id)), "{ceilings:?} {all:?}");
}

#[test]
fn a_state_is_told_in_the_scan_in_which_it_becomes_another_though_nothing_else_does() {
    let drive = Drive::new(Scene::room(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let mut engine = Consistent::new(Params::default());
    let insert = |engine: &mut Consistent, scan: &Scan| {
        engine.insert(scan);
        let late = engine.surfaces.check_waiting(&engine.params, engine.taken.now());
        assert_eq!(late, 0, "after scan {}", engine.taken.sequence);
    };
    let scans: Vec<_> = (0..60).step_by(6).map(|index| drive.labelled_scan(index).scan).collect();
    scans.iter().for_each(|scan| insert(&mut engine, scan));
    let in_state = |engine: &Consistent, state| {
        engine.snapshot().clusters.iter().filter(|cluster| cluster.state == state).count()
    };
    assert!(in_state(&engine, ClusterState::Active) > 0);
    for number in 1..=25 {
        let stamp = Stamp::from_nanos(scans[9].stamp.nanos() + number * 200_000_000);
        insert(&mut engine, &Scan { stamp, points: Points::F32(Vec::new()), ..scans[9].clone() });
    }
    assert!(in_state(&engine, ClusterState::Complete) > 0);
}

#[test]
fn what_is_in_view_is_told_of_within_a_round_however_many_slots_are_free() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default());
    (0..20).for_each(|_| drop(engine.insert(&next())));
    engine.surfaces.add_free_slots(5000);
    let last = next();
    let mut behind = Vec::new();
    for number in 0..60 {
        let stamp = Stamp::from_nanos(last.stamp.nanos() + number * 1_000_000_000);
        engine.insert(&Scan { stamp, ..last.clone() });
        behind.push(engine.surfaces.most_behind());
    }
    let most = behind.into_iter().skip(30).fold(0.0, f64::max);
    assert!((1.0..30.0).contains(&most), "{most} s");
}

#[test]
fn a_cluster_is_seen_where_it_reaches_into_a_block_by_loose_voxels_alone() {
    let mut next = laboratory();
    let mut engine = Consistent::new(Params::default());
    (0..20).for_each(|_| drop(engine.insert(&next())));
    let blocks: Vec<_> = engine.grid.blocks().map(|(slot, _)| slot).collect();
    let frozen = engine.surfaces.freeze();
    let faces = frozen.faces();
    let mut alone = 0;
    for (number, block) in (1..).zip(blocks) {
        let now = Now { sequence: 20, stamp: Stamp::from_nanos(number * 1_000_000_000_000) };
        engine.surfaces.note_seen(&[block], now);
        let components: Vec<_> =
            frozen.voxels(block, &faces).into_iter().filter_map(|(_, face)| Some(face?.component)).collect();
        for &component in &components {
            let cluster = engine.surfaces.cluster(component).unwrap();
            assert_eq!(cluster.identity.last_seen, now.stamp, "{block:?}, {component:?}");
        }
        let patches = engine.surfaces.segmented().get(block).map_or(0, |here| here.patches.len());
        alone += usize::from(patches == 0 && !components.is_empty());
    }
    assert!(alone > 0);
}

/// As of a registration that has failed.
#[test]
fn a_scan_that_lies_nowhere_is_counted_and_does_what_an_empty_one_does_where_the_sensor_stood() {
    let drive = Drive::new(Scene::named("lab").unwrap(), 1, Stamp::from_nanos(0)).with_max_range(6.0);
    let params = Params::default().with_keep_radius(20.0).unwrap();
    let scan = |index| drive.labelled_scan(index).scan;
    let [mut engine, mut twin] = [(); 2].map(|()| {
        let mut engine = Engine::new(params);
        (0..60).step_by(20).for_each(|index| drop(engine.insert(&scan(index))));
        engine
    });
    let at = |along: f64| Translation3::new(along, 0.0, along) * UnitQuaternion::identity();
    let not_turned = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let poses =
        [at(f64::NAN), at(f64::INFINITY), Isometry3::from_parts(Translation3::identity(), not_turned)];
    for fixed_from_sensor in poses {
        let nowhere = Scan { fixed_from_sensor, ..scan(80) };
        let update = engine.insert(&nowhere);
        assert_eq!((update.points_beyond_grid as usize, update.newly_dense), (nowhere.points.len(), 0));
        twin.insert(&Scan { stamp: nowhere.stamp, points: Points::F32(Vec::new()), ..scan(40) });
    }
    let known = |engine: &Engine| {
        let Snapshot { voxels, clusters, .. } = engine.snapshot();
        let voxels: Vec<_> = voxels.iter().map(|voxel| (voxel.key, voxel.count, voxel.cluster)).collect();
        (voxels, clusters.iter().map(|cluster| (cluster.id, cluster.class)).collect::<Vec<_>>())
    };
    assert!(known(&engine) == known(&twin));
    Engine::restore(params, engine.freeze().save()).unwrap();
}
