//! Random streams: after every scan the consistent engine equals its definition from scratch, and its updates add up to its
//! snapshots, whatever appears, is taken away or is forgotten.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

#[path = "fuzz_bodies/reader.rs"]
mod reader;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

use cfodi::engine::consistent::Consistent;
use cfodi::engine::{
    Cluster, DenseVoxel, Depths, Engine, Isometry3, Mode, NoiseModel, Params, Partition, Points, Rays, Scan,
    Snapshot, Stamp, VoxelKey, canonical,
};
use nalgebra::{Matrix3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use reader::Reader;

const VOXEL: f64 = 0.25;

/// A box that is there for a while.
#[derive(Clone, Debug)]
struct Solid {
    middle: Isometry3<f64>,
    half: Vector3<f64>,
    there: Range<usize>,
}

impl Solid {
    /// Where a ray enters it, in multiples of its direction.
    fn meets(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let origin = self.middle.inverse_transform_point(origin);
        let direction = self.middle.inverse_transform_vector(direction);
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let ends = [-1.0, 1.0].map(|end| (end * self.half[axis] - origin[axis]) / direction[axis]);
            enter = enter.max(ends[0].min(ends[1]));
            leave = leave.min(ends[0].max(ends[1]));
        }
        (enter < leave && enter > 0.0).then_some(enter)
    }
}

/// What is done to a map.
#[derive(Clone, Debug)]
struct Stream {
    solids: Vec<Solid>,
    /// Where the sensor is in each scan, z forward.
    poses: Vec<Isometry3<f64>>,
    /// Scans without a point, and before which scan they come: a while in which blocks go to rest.
    blind: (usize, usize),
    seed: u64,
}

/// Looks along x and somewhat down.
fn pose(place: Vector3<f64>, yaw: f64) -> Isometry3<f64> {
    let optical =
        UnitQuaternion::from_euler_angles(-std::f64::consts::FRAC_PI_2, 0.0, -std::f64::consts::FRAC_PI_2);
    let down = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.25);
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
    Isometry3::from_parts(Translation3::from(place), yaw * down * optical)
}

fn solid(scans: usize) -> impl Strategy<Value = Solid> {
    let place = [1.5..5.0, -1.2..1.2, -0.2..1.2];
    // Plates, necks, posts and blocks.
    let half = prop::array::uniform3(prop_oneof![0.02..0.1, 0.1..0.4, 0.4..1.2]);
    let turn = prop_oneof![Just(0.0), -0.8..0.8];
    (place, half, turn, 0..scans, 1..scans).prop_map(|(place, half, turn, from, length)| Solid {
        middle: Isometry3::from_parts(
            Translation3::from(Vector3::from(place)),
            UnitQuaternion::from_euler_angles(0.3 * turn, 0.2 * turn, turn),
        ),
        half: Vector3::from(half),
        there: from..from + length,
    })
}

fn stream(scans: usize) -> impl Strategy<Value = Stream> {
    let step = (prop::array::uniform3(-0.06..0.06), -0.04..0.04);
    let walls = (4.0..6.5, 0.0..0.3);
    let blind = (prop_oneof![Just(0), 60..80_usize], 1..scans);
    let solids = prop::collection::vec(solid(scans), 1..7);
    (solids, prop::collection::vec(step, scans), walls, blind, any::<u64>()).prop_map(
        move |(mut solids, steps, (wall, turn), blind, seed)| {
            let always = |middle, half| Solid { middle, half, there: 0..scans };
            let floor = Isometry3::translation(5.0, 0.0, -1.03);
            solids.push(always(floor, Vector3::new(9.0, 9.0, 1.0)));
            let wall = Isometry3::new(Vector3::new(wall + 1.0, 0.0, 0.0), Vector3::z() * turn);
            solids.push(always(wall, Vector3::new(1.0, 9.0, 9.0)));
            let (mut place, mut yaw) = (Vector3::new(0.0, 0.0, 1.1), 0.0);
            let poses = steps.into_iter().map(|(by, turn)| {
                place += Vector3::from(by);
                yaw += turn;
                pose(place, yaw)
            });
            Stream { solids, poses: poses.collect(), blind, seed }
        },
    )
}

/// A number between 0 and 1, the same for the same index (splitmix64).
fn uniform(index: u64) -> f64 {
    let mut bits = index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// x or y of a ray at z = 1, of the pixel `i` of so many in a row or column.
fn tangent(i: usize, count: usize) -> f64 {
    (i as f64 - 0.5 * (count - 1) as f64) * 0.0073
}

/// Columns and rows of an image: at least one ray in each direction that the engine tells apart.
const IMAGE: [usize; 2] = [96, 72];

impl Stream {
    /// All scans, the blind ones among them.
    fn scans(&self) -> impl Iterator<Item = Scan> {
        let (count, before) = self.blind;
        (0..self.poses.len()).flat_map(move |number| {
            let scan = self.scan(number);
            let blind = Scan { points: Points::F32(Vec::new()), ..scan.clone() };
            let blind = std::iter::repeat_n(blind, if number == before { count } else { 0 });
            blind.chain([scan])
        })
    }

    /// All scans as a depth camera has them, with what lies beyond this range (m).
    fn images(&self, range: f64) -> impl Iterator<Item = Scan> {
        let by_row = |count| (0..count).map(|i| tangent(i, count) as f32).collect();
        let rays = Arc::new(Rays { x: by_row(IMAGE[0]), y: by_row(IMAGE[1]) });
        (0..self.poses.len()).map(move |number| {
            let mut depths = vec![f32::INFINITY; IMAGE[0] * IMAGE[1]];
            for (pixel, _, depth) in self.seen(number) {
                depths[pixel] = if depth > range { -depth } else { depth } as f32;
            }
            let depths = Depths::new(Arc::clone(&rays), depths).unwrap();
            Scan { points: Points::Depths(depths), ..self.scan(number) }
        })
    }

    fn scan(&self, number: usize) -> Scan {
        let points = self.seen(number).map(|(_, ray, depth)| (ray * depth).map(|c| c as f32).into());
        let stamp = Stamp::from_nanos(number as i64 * 33_333_333);
        Scan { stamp, fixed_from_sensor: self.poses[number], points: Points::F32(points.collect()) }
    }

    /// The pixels that see something, each with its ray and the depth there.
    fn seen(&self, number: usize) -> impl Iterator<Item = (usize, Vector3<f64>, f64)> {
        let pose = self.poses[number];
        let origin = Point3::from(pose.translation.vector);
        let there: Vec<_> = self.solids.iter().filter(|solid| solid.there.contains(&number)).collect();
        (0..IMAGE[0] * IMAGE[1]).filter_map(move |pixel| {
            let [x, y] = [(pixel % IMAGE[0], IMAGE[0]), (pixel / IMAGE[0], IMAGE[1])]
                .map(|(i, count)| tangent(i, count));
            let ray = Vector3::new(x, y, 1.0);
            let direction = pose * ray;
            let depths = there.iter().filter_map(|solid| solid.meets(&origin, &direction));
            let depth = depths.min_by(f64::total_cmp)?;
            let index = (number * IMAGE[0] * IMAGE[1] + pixel) as u64;
            let noise = 0.004 * depth * (uniform(self.seed ^ (index << 8)) - 0.5);
            Some((pixel, ray, depth + noise))
        })
    }
}

fn shuffled(scan: &Scan, seed: u64) -> Scan {
    let Points::F32(points) = &scan.points else { panic!("made in single precision") };
    let mut numbered: Vec<_> = points.iter().copied().enumerate().collect();
    numbered.sort_by_key(|(number, _)| uniform(seed ^ (*number as u64) << 20).to_bits());
    let points = numbered.into_iter().map(|(_, point)| point).collect();
    Scan { points: Points::F32(points), ..scan.clone() }
}

fn params() -> impl Strategy<Value = Params> {
    let noise = prop_oneof![Just(NoiseModel::KinectV1), Just(NoiseModel::None)];
    let bound = prop_oneof![2 => Just(0), 1 => 20..400_i64];
    let radius = prop_oneof![2 => Just(0.0), 1 => 2.0..5.0];
    let poses = prop_oneof![2 => Just(0.0), 1 => 0.0..VOXEL];
    let all = (1..6_i64, noise, any::<bool>(), bound, radius, poses);
    all.prop_map(|(points, noise, clearing, bound, radius, poses)| {
        let params = Params::default().with_voxel_size(VOXEL).and_then(|p| p.with_min_points(points));
        let params = params.and_then(|p| p.with_max_voxels(bound)).and_then(|p| p.with_keep_radius(radius));
        let params = params.and_then(|p| p.with_pose_sigma(poses));
        params.unwrap().with_noise_model(noise).with_clearing(clearing)
    })
}

/// A partition up to names, its keys moved by whole blocks.
fn moved_back(partition: Partition, moved: [i32; 3]) -> Vec<([i32; 3], Option<u32>)> {
    let back = |key: VoxelKey| [0, 1, 2].map(|i| key.indices()[i] - 8 * moved[i]);
    canonical(partition).into_iter().map(|(key, number)| (back(key), number)).collect()
}

/// Two maps are the same, `there` moved by these blocks: places to 1e-5 m (a coordinate at 10 km has 2e-12 m, an offset in a
/// voxel, where it rounds the other way, 6e-5 m by the number of points), directions to 1e-5 rad.
fn same_but_moved(
    here: &Snapshot,
    there: &Snapshot,
    blocks: [i32; 3],
    by: &Vector3<f64>,
) -> Result<(), TestCaseError> {
    let keys = |map: &Snapshot, blocks: [i32; 3]| {
        let moved = |voxel: &DenseVoxel| {
            let key = voxel.key.indices();
            ([0, 1, 2].map(|i| key[i] - 8 * blocks[i]), voxel.count, voxel.cluster)
        };
        map.voxels.iter().map(moved).collect::<Vec<_>>()
    };
    prop_assert_eq!(keys(here, [0; 3]), keys(there, blocks));
    for (a, b) in here.voxels.iter().zip(&there.voxels) {
        prop_assert!((a.centre + by - b.centre).norm() < 1e-5, "{:?} and {:?}", a, b);
        let turn = a.normal.zip(b.normal).map_or(0.0, |(a, b)| a.angle(&b));
        prop_assert!(a.normal.is_some() == b.normal.is_some() && turn < 1e-5, "{:?} and {:?}", a, b);
    }
    prop_assert_eq!(here.clusters.len(), there.clusters.len());
    for (a, b) in here.clusters.iter().zip(&there.clusters) {
        prop_assert_eq!((a.id, a.voxel_count), (b.id, b.voxel_count));
        // What lies right between two classes is told so.
        let sure = a.class_confidence.max(b.class_confidence) >= 0.5;
        prop_assert!(a.class == b.class || !sure, "{:?} and {:?}", a, b);
        prop_assert!((a.centroid + by - b.centroid).norm() < 1e-5, "{:?} and {:?}", a, b);
        prop_assert!(a.normal.angle(&b.normal) < 1e-5, "{:?} and {:?}", a, b);
        // The plane passes the same side of its own centroid.
        let off = |cluster: &Cluster| cluster.normal.dot(&cluster.centroid.coords) + cluster.offset;
        prop_assert!((off(a) - off(b)).abs() < 1e-5, "{} and {}", off(a), off(b));
        prop_assert!((a.covariance - b.covariance).norm() < 1e-5, "{:?} and {:?}", a, b);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn a_map_equals_its_definition_and_its_updates_add_up_to_it(params in params(), stream in stream(24)) {
        let is_image = stream.seed % 2 == 1;
        let scans: Vec<_> = if is_image { stream.images(4.5).collect() } else { stream.scans().collect() };
        let (mut map, mut reader) = (Consistent::new(params), Reader::default());
        for scan in scans {
            let update = map.insert(&scan);
            prop_assert_eq!(canonical(map.partition()), canonical(map.scratch()));
            reader.apply(&update);
            reader.agrees(&update, &map.snapshot());
            let bound = params.max_voxels();
            prop_assert!(bound == 0 || map.voxel_count() as u64 <= bound);
        }
    }

    #[test]
    fn the_order_of_points_within_a_scan_does_not_matter(params in params(), stream in stream(18)) {
        let (mut a, mut b) = (Consistent::new(params), Consistent::new(params));
        for number in 0..stream.poses.len() {
            let scan = stream.scan(number);
            let updates = [a.insert(&scan), b.insert(&shuffled(&scan, stream.seed))];
            prop_assert_eq!(format!("{:?}", updates[0]), format!("{:?}", updates[1]));
            prop_assert_eq!(format!("{:?}", a.snapshot()), format!("{:?}", b.snapshot()));
        }
    }

    #[test]
    fn a_map_that_was_saved_and_restored_goes_on_as_if_it_had_not_stopped(
        params in params(), stream in stream(24), paper in any::<bool>(), stops in prop::collection::vec(0..100_usize, 1..6),
    ) {
        let params = if paper { params.with_mode(Mode::Paper) } else { params };
        let (mut unbroken, mut resumed) = (Engine::new(params), Engine::new(params));
        for (number, scan) in stream.scans().enumerate() {
            if stops.contains(&number) {
                let saved = resumed.freeze().save();
                resumed = Engine::restore(params, saved.clone()).unwrap();
                prop_assert_eq!(saved, resumed.freeze().save());
                prop_assert_eq!(format!("{:?}", unbroken.snapshot()), format!("{:?}", resumed.snapshot()));
            }
            let updates = [unbroken.insert(&scan), resumed.insert(&scan)];
            prop_assert_eq!(format!("{:?}", updates[0]), format!("{:?}", updates[1]));
        }
        prop_assert_eq!(format!("{:?}", unbroken.snapshot()), format!("{:?}", resumed.snapshot()));
        prop_assert_eq!(unbroken.freeze().save(), resumed.freeze().save());
    }

    #[test]
    fn a_map_moved_by_whole_blocks_has_the_same_partition(
        params in params(), stream in stream(18), moved in prop::array::uniform3(-40..40_i32),
    ) {
        let [x, y, z] = moved;
        // Which blocks are looked at in which scan goes by the sum of their coordinates, in turns of three.
        let moved = [x, y, z - (x + y + z) % 3];
        let (mut here, mut there) = (Consistent::new(params), Consistent::new(params));
        let by = Translation3::from(Vector3::from(moved).map(|i| f64::from(8 * i) * VOXEL));
        for number in 0..stream.poses.len() {
            let scan = stream.scan(number);
            here.insert(&scan);
            there.insert(&Scan { fixed_from_sensor: by * scan.fixed_from_sensor, ..scan });
            prop_assert_eq!(moved_back(here.partition(), [0; 3]), moved_back(there.partition(), moved));
        }
    }

    #[test]
    fn ten_kilometres_away_centres_normals_and_planes_are_as_good_as_at_the_origin(
        params in params(), stream in stream(12), paper in any::<bool>(), far in prop::array::uniform3(-1..2_i32),
    ) {
        let params = if paper { params.with_mode(Mode::Paper) } else { params };
        // 5,001 blocks of 2 m: a multiple of three, as above.
        let blocks = far.map(|sign| 5001 * sign);
        let by = Vector3::from(blocks).map(|i| f64::from(8 * i) * VOXEL);
        let (mut here, mut there) = (Engine::new(params), Engine::new(params));
        for number in 0..stream.poses.len() {
            let scan = stream.scan(number);
            here.insert(&scan);
            there.insert(&Scan { fixed_from_sensor: Translation3::from(by) * scan.fixed_from_sensor, ..scan });
        }
        same_but_moved(&here.snapshot(), &there.snapshot(), blocks, &by)?;
    }

    #[test]
    fn voxels_hold_the_points_that_fell_into_them(stream in stream(8), least in 1..6_i64, none in any::<bool>()) {
        let noise = if none { NoiseModel::None } else { NoiseModel::KinectV1 };
        let params = Params::default().with_voxel_size(VOXEL).and_then(|p| p.with_min_points(least)).unwrap();
        let mut map = Consistent::new(params.with_clearing(false).with_noise_model(noise));
        let mut voxels = BTreeMap::<[i32; 3], (u32, Vector3<f64>)>::new();
        for scan in stream.scans() {
            map.insert(&scan);
            let Points::F32(points) = &scan.points else { panic!("made in single precision") };
            for point in points {
                let point = scan.fixed_from_sensor * Point3::from(point.map(f64::from));
                let (count, sum) = voxels.entry([0, 1, 2].map(|i| (point[i] / VOXEL).floor() as i32)).or_default();
                *count += 1;
                *sum += point.coords;
            }
        }
        let snapshot = map.snapshot();
        let found: BTreeSet<_> = snapshot.voxels.iter().map(|voxel| (voxel.key.indices(), voxel.count)).collect();
        let dense = voxels.iter().filter(|(_, (count, _))| i64::from(*count) >= least);
        prop_assert_eq!(found, dense.map(|(key, (count, _))| (*key, *count)).collect());
        prop_assert_eq!(map.voxel_count(), voxels.len());
        for voxel in snapshot.voxels.iter().filter(|_| none) {
            let (count, sum) = voxels[&voxel.key.indices()];
            let off = (voxel.centre.coords - sum / f64::from(count)).norm();
            prop_assert!(off < 1e-3 * VOXEL, "{:?} is off by {}", voxel, off);
        }
    }
}

/// What stood in the middle of the view and is taken away leaves the map: the streams above do see through things.
#[test]
fn a_block_that_is_taken_away_is_cleared() {
    let block = Solid {
        middle: Isometry3::translation(2.5, 0.0, 0.5),
        half: Vector3::new(0.2, 0.3, 0.2),
        there: 0..6,
    };
    let wall = Solid {
        middle: Isometry3::translation(6.0, 0.0, 0.0),
        half: Vector3::new(1.0, 9.0, 9.0),
        there: 0..100,
    };
    let poses = vec![pose(Vector3::new(0.0, 0.0, 1.1), 0.0); 48];
    let stream = Stream { solids: vec![block, wall], poses, blind: (0, 0), seed: 1 };
    let params = Params::default().with_voxel_size(VOXEL).unwrap();
    let near = |map: &Consistent| map.snapshot().voxels.iter().any(|voxel| voxel.centre.x < 4.0);
    // Sensors take turns at one map: others, in rooms of their own, may send one, two or more scans in between.
    for (clearing, others) in [(true, 0), (true, 1), (true, 2), (true, 5), (false, 0)] {
        let mut map = Consistent::new(params.with_clearing(clearing));
        let mut insert = |numbers: Range<usize>| {
            for number in numbers {
                let scan = stream.scan(number);
                let blind = Scan { points: Points::F32(Vec::new()), ..scan.clone() };
                map.insert(&scan);
                (0..others).for_each(|_| drop(map.insert(&blind)));
            }
            near(&map)
        };
        assert!(insert(0..6));
        // 18 scans of a sensor that is alone; beside others it has its turns by chance.
        assert_eq!(
            insert(6..if others == 0 { 24 } else { 48 }),
            !clearing,
            "clearing: {clearing}, {others} others"
        );
    }
}

#[test]
fn points_of_one_place_have_a_curvature_where_there_is_a_normal() {
    let params = Params::default().with_voxel_size(VOXEL).unwrap().with_min_points(1).unwrap();
    let floor = (0..25).map(|i| [(i / 5) as f32, (i % 5) as f32, 0.0].map(|at| (at + 0.5) * VOXEL as f32));
    let mut map = Consistent::new(params);
    map.insert(&Scan {
        stamp: Stamp::from_nanos(0),
        fixed_from_sensor: Isometry3::translation(0.0, 0.0, 2.0),
        points: Points::F32(floor.map(|[x, y, z]| [x, y, z - 2.0]).collect()),
    });
    let voxels = map.snapshot().voxels;
    assert!(voxels.len() == 25 && voxels.iter().all(|voxel| voxel.normal.is_some()));
    assert!(voxels.iter().all(|voxel| (0.0..1e-12).contains(&voxel.curvature)), "{voxels:?}");
}

#[test]
fn a_curvature_is_the_least_eigenvalue_s_part_of_the_fit_that_gave_the_normal() {
    let params = Params::default().with_voxel_size(VOXEL).unwrap().with_min_points(1).unwrap();
    // A floor whose voxels lie higher and lower by turns, and in each a column of points: along the normal its own vary alone.
    for height in [0.0, 0.05, 0.1] {
        let columns = (0..25).flat_map(|i| {
            let middle = 0.5 + if i % 2 == 0 { height } else { -height };
            let column = [-0.1, 0.1].map(|up| [f64::from(i / 5) + 0.5, f64::from(i % 5) + 0.5, middle + up]);
            column.map(|at| at.map(|along| (VOXEL * along) as f32))
        });
        let mut map = Consistent::new(params.with_noise_model(NoiseModel::None));
        map.insert(&Scan {
            stamp: Stamp::from_nanos(0),
            fixed_from_sensor: Isometry3::translation(0.0, 0.0, 2.0),
            points: Points::F32(columns.map(|[x, y, z]| [x, y, z - 2.0]).collect()),
        });
        let voxels = map.snapshot().voxels;
        assert!(voxels.len() == 25 && voxels.iter().all(|voxel| voxel.cluster.is_some()), "{voxels:?}");
        let mean = voxels.iter().map(|voxel| voxel.centre.coords).sum::<Vector3<f64>>() / 25.0;
        let covariance = voxels.iter().map(|voxel| voxel.centre.coords - mean).map(|d| d * d.transpose());
        let covariance = covariance.sum::<Matrix3<f64>>();
        let expected = covariance.symmetric_eigenvalues().min() / covariance.trace();
        for voxel in voxels {
            let off = f64::from(voxel.curvature) - expected;
            assert!(off.abs() <= 1e-6 + 1e-3 * expected, "{} instead of {expected}", voxel.curvature);
        }
    }
}

#[test]
fn a_row_of_voxels_that_lies_level_and_sags_is_no_confident_wall() {
    let size = 0.05;
    let params = Params::default().with_voxel_size(size).unwrap().with_noise_model(NoiseModel::None);
    // The edge of a long board that faces up, seen from above: not quite as broad as a voxel, and lower in the middle by half of
    // one.
    let points = (0..48 * 20 * 12).map(|i| [i / 12, i % 12].map(|at| f64::from(at) + 0.5));
    let points = points.map(|[along, over]| {
        let (x, y) = (along / 20.0, 0.05 + 0.075 * over);
        [x, y, 0.2 + 0.06 * ((x - 24.0) / 8.0).powi(2)].map(|at| size * at)
    });
    let points: Vec<_> = points.map(|[x, y, z]| [x - 1.2, y, z - 1.5].map(|at| at as f32)).collect();
    let mut map = Consistent::new(params);
    for number in 0..20 {
        map.insert(&Scan {
            stamp: Stamp::from_nanos(100_000_000 * number),
            fixed_from_sensor: Isometry3::translation(1.2, 0.0, 1.5),
            points: Points::F32(points.clone()),
        });
    }
    let Snapshot { clusters, voxels, .. } = map.snapshot();
    assert_eq!(clusters.len(), 1, "{voxels:?}");
    let normals: Vec<_> = voxels.iter().filter_map(|voxel| voxel.normal).collect();
    assert!(normals.len() == 48 && normals.iter().all(|normal| normal.z > 0.9), "{normals:?}");
    let cluster = &clusters[0];
    assert!(cluster.normal.z.abs() < 0.1, "what this is about: {}", cluster.normal.z);
    let tilt = cluster.plane_covariance.unwrap()[(0, 0)].sqrt();
    assert!(tilt < 0.1, "what is known of its turn does not say so: {tilt}");
    assert!(cluster.class_confidence < 0.05, "{:?} {}", cluster.class, cluster.class_confidence);
}

#[test]
fn the_covariance_of_a_thin_surface_at_a_slant_has_no_direction_of_a_variance_below_none() {
    let params = Params::default().with_voxel_size(VOXEL).unwrap();
    let mut raised = 0;
    for (slope_x, slope_y) in [(0.1, 0.0), (0.3, 0.1), (0.37, 0.29), (0.71, 0.13), (0.9, 0.8)] {
        // A plane without noise and without a thickness, 2 x 2 m.
        let points = (0..160_000).map(|i| [i / 400, i % 400].map(|at| f64::from(at) * 0.005 + 0.001));
        let points = points.map(|[x, y]| [x, y, slope_x * x + slope_y * y - 4.0].map(|at| at as f32));
        let mut map = Consistent::new(params);
        map.insert(&Scan {
            stamp: Stamp::from_nanos(0),
            fixed_from_sensor: Isometry3::translation(0.0, 0.0, 4.0),
            points: Points::F32(points.collect()),
        });
        let clusters = map.snapshot().clusters;
        assert!(!clusters.is_empty());
        for cluster in clusters {
            let least = cluster.covariance.symmetric_eigenvalues().min();
            assert!(
                least >= 0.0 && cluster.covariance.cholesky().is_some(),
                "{least} m^2 of {}",
                cluster.voxel_count
            );
            raised += u32::from(least < 1e-14 * cluster.covariance.trace());
        }
    }
    assert!(raised > 0, "rounding has left none of them a variance below none");
}

/// The laboratory for 40 s, every 6th scan: what is in the map stays within its bounds and its updates add up to it.
#[cfg(feature = "sim")]
fn drive_the_laboratory(params: Params, holds: impl Fn(&Consistent, &Snapshot, &Scan)) {
    use cfodi::sim::{Drive, Scene};
    let drive = Drive::new(Scene::named("lab").unwrap(), 3, Stamp::from_nanos(0)).with_max_range(6.0);
    let (mut map, mut late, mut removed) = (Consistent::new(params), None::<Reader>, 0);
    for number in 0..200 {
        let scan = drive.labelled_scan(6 * number).scan;
        let update = map.insert(&scan);
        removed += update.removed.len();
        let snapshot = map.snapshot();
        assert!(snapshot.clusters.iter().all(|cluster| !update.removed.contains(&cluster.id)));
        match &mut late {
            Some(reader) => reader.apply(&update),
            // One that comes late begins with a snapshot.
            None => late = (number == 9).then(|| Reader::of(&snapshot)),
        }
        holds(&map, &snapshot, &scan);
        if let Some(reader) = &late
            && number % 10 == 9
        {
            reader.agrees(&update, &snapshot);
            assert_eq!(canonical(map.partition()), canonical(map.scratch()));
        }
    }
    assert!(removed > 20);
}

#[cfg(feature = "sim")]
#[test]
fn no_more_voxels_are_kept_than_max_voxels_says() {
    let params = Params::default().with_max_voxels(5000).unwrap();
    drive_the_laboratory(params, |map, _, _| assert!(map.voxel_count() <= 5000, "{}", map.voxel_count()));
}

#[cfg(feature = "sim")]
#[test]
fn nothing_is_kept_beyond_keep_radius() {
    let params = Params::default().with_keep_radius(3.0).unwrap();
    drive_the_laboratory(params, |_, snapshot, scan| {
        let edge = 8.0 * params.voxel_size();
        for voxel in &snapshot.voxels {
            let low = Vector3::from(voxel.key.indices().map(|i| f64::from(i.div_euclid(8)) * edge));
            let sensor = scan.sensor_origin().coords;
            let distance = (sensor.sup(&low).inf(&low.add_scalar(edge)) - sensor).norm();
            // All blocks of so small a map have their turn in every scan.
            assert!(distance <= 3.0 + 1e-9, "{:?} is kept at {distance} m", voxel.key);
        }
    });
}

#[test]
fn what_splits_off_was_seen_when_the_whole_was() {
    // A floor like a U, whose bend is forgotten once the sensor has gone back.
    let strip = |x: Range<i32>, y: Range<i32>| x.flat_map(move |x| y.clone().map(move |y| [x, y]));
    let cells = strip(50..600, 50..100).chain(strip(50..600, -100..-50)).chain(strip(600..650, -100..100));
    let floor: Vec<_> = cells.map(|cell| cell.map(|at| 0.01 * f64::from(at))).collect();
    let mut map = Consistent::new(Params::default().with_keep_radius(8.0).unwrap());
    let mut look = |second: i64, x: f64, floor: &[[f64; 2]]| {
        let fixed_from_sensor = pose(Vector3::new(x, 0.0, 1.5), 0.0);
        let sensed =
            |[x, y]: &[f64; 2]| (fixed_from_sensor.inverse() * Point3::new(*x, *y, 0.02)).coords.into();
        let points = Points::F64(floor.iter().map(sensed).collect());
        map.insert(&Scan { stamp: Stamp::from_nanos(1_000_000_000 * second), fixed_from_sensor, points });
        map.snapshot()
    };
    let whole = (1..=20).map(|second| look(second, 0.0, &floor)).last().unwrap();
    assert_eq!(whole.clusters.len(), 1);
    let parts = (101..=140).map(|second| look(second, -3.0, &[])).last().unwrap();
    assert_eq!(parts.clusters.len(), 2);
    for part in parts.clusters {
        let seen = [part.first_seen, part.last_seen];
        assert_eq!(
            seen,
            [1, 20].map(|second| Stamp::from_nanos(1_000_000_000 * second)),
            "{}",
            part.id.get()
        );
    }
}

/// In voxels far smaller than the noise some patches lose all their voxels to broader ones: what hangs on them has no plane,
/// and was never told of.
#[cfg(feature = "sim")]
#[test]
fn updates_add_up_to_the_map_where_voxels_are_smaller_than_the_noise() {
    use cfodi::sim::{Drive, Scene};
    let drive = Drive::new(Scene::named("room").unwrap(), 1, Stamp::from_nanos(0));
    let params =
        Params::default().with_voxel_size(0.02).and_then(|params| params.with_max_voxels(200_000)).unwrap();
    let (mut map, mut reader) = (Consistent::new(params), Reader::default());
    for number in 0..120 {
        let update = map.insert(&drive.labelled_scan(2 * number).scan);
        reader.apply(&update);
        if number % 10 == 9 {
            reader.agrees(&update, &map.snapshot());
        }
    }
}
