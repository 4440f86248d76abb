//! Each rule of the adapter by name, and lookups against composition by hand.

mod hostile;
mod jumps;

use nalgebra::{Point3, Translation3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::msg::ros::{self, Header, Transform as WireTransform};

/// Seconds since the epoch at which the tests play.
const START: f64 = 1_700_000_000.0;

fn at(seconds: f64) -> Stamp {
    Stamp::from_nanos(((START + seconds) * 1e3).round() as i64 * 1_000_000)
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> ros::Quaternion {
    ros::Quaternion { x: rotation.i, y: rotation.j, z: rotation.k, w: rotation.w }
}

fn message(parent: &str, child: &str, seconds: f64, pose: &Isometry3<f64>) -> TransformStamped {
    let t = pose.translation.vector;
    TransformStamped {
        header: Header { stamp: at(seconds).into(), frame_id: parent.into() },
        child_frame_id: child.into(),
        transform: WireTransform {
            translation: ros::Vector3 { x: t.x, y: t.y, z: t.z },
            rotation: quaternion(&pose.rotation),
        },
    }
}

fn shift(x: f64) -> Isometry3<f64> {
    Isometry3::translation(x, 0.0, 0.0)
}

impl Frames {
    fn dynamic(&mut self, parent: &str, child: &str, seconds: f64, x: f64) -> Inserted {
        let inserted = self.insert(&message(parent, child, seconds, &shift(x)), false).unwrap();
        self.sanity_check();
        inserted
    }

    fn fixed(&mut self, parent: &str, child: &str, x: f64) -> Inserted {
        let inserted = self.insert(&message(parent, child, 0.0, &shift(x)), true).unwrap();
        self.sanity_check();
        inserted
    }

    fn x(&self, fixed: &str, sensor: &str, seconds: f64) -> Result<f64, &'static str> {
        let found = self.lookup(fixed, sensor, at(seconds));
        found.map(|pose| pose.translation.x).map_err(|error| error.reason().key)
    }

    /// Our edges and the registry's are the same.
    fn sanity_check(&self) {
        for (child, edge) in &self.edges {
            let stamp = edge.newest().unwrap_or_default();
            assert!(self.registry.get_transform(&edge.parent, child, instant(stamp)).is_ok(), "{child}");
        }
        assert_eq!(self.samples, self.edges.values().map(Edge::samples).sum::<usize>());
        assert!(self.newest >= self.edges.values().filter_map(Edge::newest).max());
        let mut parents = BTreeMap::<_, usize>::new();
        self.edges.values().for_each(|edge| *parents.entry(edge.parent.clone()).or_default() += 1);
        assert_eq!(self.parents, parents);
    }

    /// As [`Frames::root_of`], by a walk over all edges.
    fn plain_root_of<'a>(&'a self, frame: &'a str) -> Option<&'a str> {
        let above =
            |frame: &str| self.edges.iter().find(|(child, _)| *child == frame).map(|(_, edge)| &*edge.parent);
        let is_parent = || self.edges.values().any(|edge| edge.parent == frame);
        let last = std::iter::successors(above(frame), |frame| above(frame)).last();
        last.or_else(|| is_parent().then_some(frame))
    }
}

/// map -> odom -> `base_link` (dynamic) -> camera (static), seconds 0 to 2.
fn robot() -> Frames {
    let mut frames = Frames::new();
    frames.fixed("base_link", "camera", 0.5);
    for (seconds, x) in [(0.0, 1.0), (1.0, 2.0), (2.0, 4.0)] {
        frames.dynamic("map", "odom", seconds, 100.0 * x);
        frames.dynamic("odom", "base_link", seconds, x);
    }
    frames
}

#[test]
fn a_chain_is_composed_at_the_stamp_and_interpolated_between_two() {
    let frames = robot();
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.5));
    assert_eq!(frames.x("odom", "camera", 1.5), Ok(3.5));
    assert_eq!(frames.x("map", "camera", 1.5), Ok(303.5));
    assert_eq!(frames.x("camera", "odom", 1.0), Ok(-2.5));
}

#[test]
fn rotations_are_interpolated_along_the_shorter_arc() {
    let mut frames = Frames::new();
    let turned = |angle: f64| Isometry3::rotation(Vector3::z() * angle);
    frames.insert(&message("odom", "camera", 0.0, &turned(0.2)), false).unwrap();
    let mut end = message("odom", "camera", 1.0, &turned(0.6));
    // The same rotation by the opposite quaternion.
    let q = end.transform.rotation;
    end.transform.rotation = ros::Quaternion { x: -q.x, y: -q.y, z: -q.z, w: -q.w };
    frames.insert(&end, false).unwrap();
    let between = frames.lookup("odom", "camera", at(0.25)).unwrap();
    assert!(between.rotation.angle_to(&turned(0.3).rotation) < 1e-12);
}

#[test]
fn nothing_is_extrapolated_and_the_error_tells_the_covered_range() {
    let frames = robot();
    let late = frames.lookup("odom", "camera", at(2.05)).unwrap_err();
    let covered = Span { from: at(0.0), until: at(2.0) };
    let (fixed, sensor, frame) = ("odom".to_owned(), "camera".to_owned(), "base_link".to_owned());
    let lack = Lack::TooLate { frame, covered };
    assert_eq!(late, LookupError { fixed, sensor, at: at(2.05), lack });
    assert_eq!(
        late.to_string(),
        "no transform from camera into odom at 1700000002.050000 s: 0.050000 s after the range covered by \
         base_link, 1700000000.000000 s to 1700000002.000000 s"
    );
    let rounded = Stamp::from_nanos(at(2.0).nanos() + 1);
    let late = frames.lookup("odom", "camera", rounded).unwrap_err().to_string();
    assert!(late.contains(": 1 ns after the range covered by base_link"), "{late}");
    assert_eq!(frames.x("odom", "camera", -0.1), Err("tf_too_early"));
    assert_eq!(frames.x("base_link", "camera", 99.0), Ok(0.5), "a static edge covers all time");
}

#[test]
fn an_unknown_frame_is_told_from_one_that_is_not_connected() {
    let mut frames = robot();
    frames.fixed("arm", "gripper", 1.0);
    let unknown = frames.lookup("odom", "kinect_depth", at(1.0)).unwrap_err();
    assert!(matches!(&unknown.lack, Lack::UnknownFrame { frame } if frame == "kinect_depth"), "{unknown}");
    let unknown = frames.lookup("world", "camera", at(1.0)).unwrap_err();
    assert!(matches!(&unknown.lack, Lack::UnknownFrame { frame } if frame == "world"), "{unknown}");
    let apart = frames.lookup("odom", "gripper", at(99.0)).unwrap_err();
    assert_eq!(
        apart.to_string(),
        "no transform from gripper into odom at 1700000099.000000 s: gripper hangs below arm, odom below map, and \
         nothing connects the two"
    );
}

#[test]
fn a_frame_against_itself_is_the_identity_even_before_any_transform() {
    assert_eq!(Frames::new().lookup("camera", "camera", at(0.0)), Ok(Isometry3::identity()));
}

#[test]
fn frames_are_listed_by_name_and_know_their_root() {
    let frames = robot();
    assert_eq!(frames.frame_names(), ["base_link", "camera", "map", "odom"]);
    assert_eq!(frames.root_of("camera"), Some("map"));
    assert_eq!(["camera", "map", "world"].map(|frame| frames.is_placed(frame)), [true, false, false]);
    assert_eq!(frames.root_of("map"), Some("map"));
    assert_eq!(frames.root_of("world"), None);
}

#[test]
fn quaternions_are_normalised_within_the_tolerance_of_tf2() {
    let scaled = |norm: f64| {
        let mut message = message("odom", "camera", 0.0, &Isometry3::rotation(Vector3::x() * 0.3));
        let q = &mut message.transform.rotation;
        (q.x, q.y, q.z, q.w) = (q.x * norm, q.y * norm, q.z * norm, q.w * norm);
        let mut frames = Frames::new();
        frames.insert(&message, false).map(|_| frames.lookup("odom", "camera", at(0.0)).unwrap())
    };
    for norm in [1.0, 1.000_002, 0.991, 1.009] {
        let pose = scaled(norm).unwrap();
        assert!((pose.rotation.angle() - 0.3).abs() < 1e-12 && (pose.rotation.norm() - 1.0).abs() < 1e-15);
    }
    for bad in [1.2, 0.98, 0.0] {
        let error = scaled(bad).unwrap_err();
        let FrameError::BadNorm { norm, .. } = error else { panic!("{error}") };
        assert!((norm - bad).abs() < 1e-12);
    }
}

#[test]
fn a_refused_transform_names_its_frames_and_changes_nothing() {
    let refused = |change: fn(&mut TransformStamped)| {
        let mut frames = robot();
        let mut message = message("odom", "base_link", 1.5, &shift(9.0));
        change(&mut message);
        let error = frames.insert(&message, false).unwrap_err();
        assert_eq!(frames.x("map", "camera", 1.5), Ok(303.5), "{error}");
        frames.sanity_check();
        (error.reason().key, error.to_string())
    };
    let (reason, text) = refused(|m| m.header.frame_id.clear());
    assert_eq!((reason, text.contains("child `base_link`")), ("empty_name", true));
    let (reason, text) = refused(|m| m.header.frame_id = "base_link".into());
    assert_eq!((reason, text.as_str()), ("self_transform", "frame base_link cannot be its own parent"));
    let (reason, text) = refused(|m| m.header.frame_id = "camera".into());
    assert_eq!((reason, text.contains("base_link cannot be put under camera")), ("cycle", true));
    let (reason, text) = refused(|m| m.transform.translation.y = f64::NAN);
    assert_eq!((reason, text.contains("[9.0, NaN, 0.0]")), ("non_finite", true));
    assert_eq!(refused(|m| m.transform.rotation.w = f64::INFINITY).0, "non_finite");
    let (reason, text) = refused(|m| m.header.stamp.nanosec = 2_000_000_000);
    assert_eq!((reason, text.contains("2000000000")), ("bad_stamp", true));
    let (reason, text) = refused(|m| m.child_frame_id = "x".repeat(257));
    assert_eq!((reason, text.contains("257 bytes")), ("long_name", true));
}

#[test]
fn a_chain_that_overflows_is_an_error_of_the_lookup() {
    let mut frames = Frames::new();
    frames.fixed("odom", "a", f64::MAX);
    frames.fixed("a", "b", f64::MAX);
    assert_eq!(frames.x("odom", "b", 0.0), Err("tf_numeric"));
    assert_eq!(frames.x("b", "odom", 0.0), Err("tf_numeric"));
}

#[test]
fn re_sent_statics_replace_the_transform_and_add_nothing() {
    let mut frames = robot();
    for _ in 0..1000 {
        assert_eq!(frames.fixed("base_link", "camera", 0.5), Inserted::Stored);
    }
    frames.fixed("base_link", "camera", 0.25);
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.25));
    assert_eq!(frames.edges.len(), 3);
}

/// Two publishers that latch a place of one frame each, or one that has calibrated it anew.
#[test]
fn a_static_transform_that_comes_with_another_place_counts_and_is_told_unless_it_is_rounded() {
    let mut frames = robot();
    let moved = |by| Inserted::StaticMoved { by, turned: 0.0 };
    assert_eq!(frames.fixed("base_link", "camera", 1.5), moved(1.0));
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(3.5));
    assert_eq!(frames.fixed("base_link", "camera", 0.5), moved(1.0), "each time");
    let turn = |angle: f64| {
        let pose = Isometry3::new(Vector3::new(0.5, 0.0, 0.0), Vector3::new(0.0, 0.0, angle));
        message("base_link", "camera", 0.0, &pose)
    };
    let turned = frames.insert(&turn(1.57), true).unwrap();
    assert!(matches!(turned, Inserted::StaticMoved { by: 0.0, turned } if (turned - 1.57).abs() < 1e-9));
    let told = turned.about(&turn(1.57)).unwrap();
    let words =
        "the static transform of camera below base_link is another than before, by 0.000 m and 1.570 rad";
    assert!(told.starts_with(words), "{told}");
    // Half turns and quarters by two decimals and by all, as robots' descriptions and drivers have them.
    for quarters in [[-1.0, 0.0, -1.0], [2.0, 0.0, 1.0], [2.0, 0.0, 2.0]] {
        let turns = quarters.map(|quarters: f64| quarters * std::f64::consts::FRAC_PI_2);
        let rounded = turns.map(|turn: f64| (100.0 * turn).round() / 100.0);
        let [rounded, exact] = [rounded, turns].map(|[roll, pitch, yaw]| {
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            message("base_link", "camera", 0.0, &Isometry3::from_parts(Translation3::identity(), rotation))
        });
        frames.insert(&rounded, true).unwrap();
        assert_eq!(frames.insert(&exact, true), Ok(Inserted::Stored), "{quarters:?}");
    }
    frames.insert(&turn(1.57), true).unwrap();
    // A quarter turn with more digits, and the same rotation by the opposite quaternion.
    let mut opposite = turn(std::f64::consts::FRAC_PI_2);
    assert_eq!(frames.insert(&opposite, true), Ok(Inserted::Stored));
    let r = &mut opposite.transform.rotation;
    (r.x, r.y, r.z, r.w) = (-r.x, -r.y, -r.z, -r.w);
    assert_eq!(frames.insert(&opposite, true), Ok(Inserted::Stored));
    assert_eq!(frames.x("odom", "camera", 1.5), Ok(3.5), "the past of what moves stays");
    frames.sanity_check();
}

#[test]
fn a_static_stamp_is_not_looked_at() {
    let mut frames = robot();
    let mut message = message("base_link", "camera", -1e6, &shift(0.5));
    message.header.stamp.nanosec = u32::MAX;
    assert_eq!(frames.insert(&message, true), Ok(Inserted::Stored));
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.5));
}

#[test]
fn a_frame_can_move_under_another_parent_and_loses_its_past() {
    let mut frames = robot();
    let from = |before: &str| Inserted::Reparented { before: before.to_owned() };
    assert_eq!(frames.dynamic("map", "base_link", 2.0, 7.0), from("odom"));
    assert_eq!(frames.x("map", "camera", 2.0), Ok(7.5));
    assert_eq!(frames.x("map", "camera", 1.0), Err("tf_too_early"));
    let told = from("odom").about(&message("map", "base_link", 2.0, &shift(7.0))).unwrap();
    assert!(told.starts_with("base_link was below odom and is now below map"), "{told}");
    assert_eq!(frames.fixed("odom", "camera", 3.0), from("base_link"));
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(3.0));
}

#[test]
fn a_static_frame_that_comes_as_dynamic_is_released_and_the_other_way_round() {
    let mut frames = robot();
    assert_eq!(frames.dynamic("base_link", "camera", 1.0, 0.75), Inserted::KindChanged);
    assert_eq!(frames.x("odom", "camera", 1.0), Ok(2.75));
    assert_eq!(frames.x("odom", "camera", 1.5), Err("tf_too_late"));
    assert_eq!(frames.fixed("base_link", "camera", 0.5), Inserted::KindChanged);
    assert_eq!(frames.x("odom", "camera", 1.5), Ok(3.5));
}

#[test]
fn an_overtaken_transform_of_the_time_before_a_jump_back_is_of_no_use() {
    let of_use = |frames: &Frames, child: &str, seconds: f64| {
        frames.is_of_use(&message("odom", child, seconds, &shift(0.0)))
    };
    for other in [None, Some(1000.0)] {
        let mut frames = Frames::new();
        frames.dynamic("odom", "camera", 100.0, 0.0);
        assert_eq!(frames.dynamic("odom", "camera", 0.0, 0.0), Inserted::JumpedBack);
        assert!(of_use(&frames, "wheel", 0.9) && !of_use(&frames, "wheel", 99.9));
        // Of another robot, or by another clock.
        other.map(|seconds| frames.dynamic("earth", "other", seconds, 0.0));
        assert!(of_use(&frames, "camera", 0.9) && !of_use(&frames, "camera", 99.9), "beside {other:?}");
        frames.sanity_check();
    }
}

#[test]
fn an_overtaken_transform_of_a_frame_that_comes_seldom_is_of_use() {
    let mut frames = Frames::new();
    let of_use = |frames: &Frames, seconds: f64| {
        frames.is_of_use(&message("base_link", "gripper", seconds, &shift(0.0)))
    };
    assert!(of_use(&frames, 0.0), "nothing is known");
    frames.dynamic("base_link", "gripper", 0.0, 0.0);
    frames.dynamic("odom", "base_link", 5.1, 0.0);
    assert!(of_use(&frames, 5.0) && !of_use(&frames, 6.2));
    frames.clear_dynamic();
    assert!(of_use(&frames, 6.2));
}

#[test]
fn a_way_reaches_as_far_as_its_own_transforms() {
    let mut frames = robot();
    frames.dynamic("base_link", "wheel", 9.0, 0.0);
    frames.fixed("odom", "post", 0.0);
    let reaches = |fixed: &str, sensor: &str, seconds: f64| {
        let reaches = frames.way_reaches_beyond(fixed, sensor, at(seconds));
        assert_eq!(frames.way_reaches_beyond(sensor, fixed, at(seconds)), reaches, "{fixed} {sensor}");
        reaches
    };
    assert!(reaches("odom", "camera", 0.5) && !reaches("odom", "camera", 1.0));
    assert!(reaches("wheel", "camera", 7.5) && !reaches("map", "camera", 7.5));
    assert!(!reaches("odom", "post", -99.0) && reaches("map", "post", -99.0));
    assert!(!reaches("base_link", "camera", -99.0) && !reaches("odom", "odom", -99.0));
    assert!(!reaches("unknown", "odom", 2.0) && !reaches("unknown", "nobody", -99.0));
}

proptest! {
    #[test]
    fn an_edge_is_on_the_way_where_one_end_alone_lies_below_it(
        edges in prop::collection::vec((any::<prop::sample::Index>(), prop::option::of(0..10_u8)), 1..20),
        ends in any::<[prop::sample::Index; 2]>(),
    ) {
        let (mut frames, mut parents) = (Frames::new(), Vec::new());
        for (child, (parent, seconds)) in (1..).zip(&edges) {
            let parent = parent.index(child);
            parents.push(parent);
            let names = [parent, child].map(|frame| format!("f{frame}"));
            match seconds {
                Some(seconds) => frames.dynamic(&names[0], &names[1], f64::from(*seconds), 0.0),
                None => frames.fixed(&names[0], &names[1], 0.0),
            };
        }
        let is_below = |mut frame: usize, top: usize| {
            while frame > top {
                frame = parents[frame - 1];
            }
            frame == top
        };
        let ends = ends.map(|end| end.index(edges.len() + 1));
        let on_the_way = |child: usize| is_below(ends[0], child) != is_below(ends[1], child);
        let newest = (1..).zip(&edges).filter(|(child, _)| on_the_way(*child)).filter_map(|(_, edge)| edge.1).max();
        let names = ends.map(|end| format!("f{end}"));
        let found = frames.way_reaches_beyond(&names[0], &names[1], at(3.5));
        prop_assert_eq!(found, newest.is_some_and(|newest| newest >= 5));
    }
}

#[test]
fn the_past_reaches_back_ten_seconds() {
    let mut frames = Frames::new();
    for second in 0..100 {
        frames.dynamic("odom", "camera", f64::from(second), f64::from(second));
    }
    assert_eq!(frames.x("odom", "camera", 89.0), Ok(89.0));
    assert_eq!(frames.x("odom", "camera", 88.9), Err("tf_too_early"));
}

/// As in tf2, which keeps as long.
#[test]
fn a_gap_is_crossed_in_a_straight_line_up_to_what_is_kept() {
    for (gap, between) in [(9.9, Ok(0.5)), (10.1, Err("tf_too_early"))] {
        let mut frames = Frames::new();
        frames.dynamic("odom", "camera", 0.0, 0.0);
        let mut refused = message("odom", "camera", 0.5 * gap, &shift(7.0));
        refused.transform.rotation.w = 0.0;
        assert_eq!(frames.insert(&refused, false).unwrap_err().reason().key, "bad_norm");
        frames.dynamic("odom", "camera", gap, 1.0);
        assert_eq!(frames.x("odom", "camera", 0.5 * gap), between);
    }
}

#[test]
fn the_number_of_frames_is_bounded_and_known_ones_still_update() {
    let mut frames = Frames::new();
    for number in 0..MAX_FRAMES {
        frames.insert(&message("odom", &format!("f{number}"), 0.0, &shift(1.0)), true).unwrap();
    }
    let refused = frames.insert(&message("odom", "one_more", 0.0, &shift(1.0)), true);
    assert_eq!(refused, Err(FrameError::TooManyFrames { child: "one_more".into(), max: 10_000 }));
    frames.insert(&message("odom", "f7", 0.0, &shift(2.0)), true).unwrap();
    assert_eq!(frames.x("odom", "f7", 0.0), Ok(2.0));
}

#[test]
fn stamps_before_1970_keep_their_order() {
    let mut frames = Frames::new();
    frames.dynamic("odom", "camera", -START - 1.0, 1.0);
    frames.dynamic("odom", "camera", -START + 1.0, 3.0);
    assert_eq!(frames.x("odom", "camera", -START), Ok(2.0));
    for nanos in [i64::MIN, -1, 0, 1, i64::MAX] {
        assert_eq!(stamp_of(instant(Stamp::from_nanos(nanos))).nanos(), nanos);
    }
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    let vector = prop::array::uniform3(-3.0..3.0_f64).prop_map(Vector3::from);
    (vector.clone(), vector).prop_map(|(translation, turn)| Isometry3::new(translation, turn))
}

/// Two poses less than half a turn apart: opposite rotations have no shorter arc between them.
fn leg() -> impl Strategy<Value = [Isometry3<f64>; 2]> {
    let turn = prop::array::uniform3(-1.7..1.7_f64).prop_map(Vector3::from);
    (pose(), pose(), turn).prop_map(|(from, to, turn)| {
        let rotation = from.rotation * UnitQuaternion::new(turn);
        [from, Isometry3::from_parts(to.translation, rotation)]
    })
}

/// The pose at `share` of the way from `a` to `b`.
fn between(a: &Isometry3<f64>, b: &Isometry3<f64>, share: f64) -> Isometry3<f64> {
    let translation = a.translation.vector.lerp(&b.translation.vector, share);
    Isometry3::from_parts(Translation3::from(translation), a.rotation.slerp(&b.rotation, share))
}

proptest! {
    #[test]
    fn a_lookup_equals_composition_by_hand(
        odom in leg(), base in leg(), mount in pose(),
        asked in 0..=1000_u32, point in prop::array::uniform3(-5.0..5.0_f64),
    ) {
        let mut frames = Frames::new();
        frames.insert(&message("base_link", "camera", 0.0, &mount), true).unwrap();
        for (seconds, index) in [(0.0, 0), (1.0, 1)] {
            frames.insert(&message("map", "odom", seconds, &odom[index]), false).unwrap();
            frames.insert(&message("odom", "base_link", seconds, &base[index]), false).unwrap();
        }
        let share = f64::from(asked) * 1e-3;
        let by_hand = between(&odom[0], &odom[1], share) * between(&base[0], &base[1], share) * mount;
        let found = frames.lookup("map", "camera", at(share)).unwrap();
        let point = Point3::from(point);
        prop_assert!((found * point - by_hand * point).norm() < 1e-9, "{found} but {by_hand}");
        let back = frames.lookup("camera", "map", at(share)).unwrap();
        prop_assert!((back * (found * point) - point).norm() < 1e-9);
    }

    #[test]
    fn no_order_of_insertions_breaks_the_tree(
        steps in prop::collection::vec((0..5_usize, 0..5_usize, 0..40_u32, any::<bool>()), 0..60),
    ) {
        let names = ["a", "b", "c", "d", "e"];
        let mut frames = Frames::new();
        for (parent, child, tenths, is_static) in steps {
            let seconds = f64::from(tenths) * 0.1;
            let message = message(names[parent], names[child], seconds, &shift(1.0));
            let inserted = frames.insert(&message, is_static);
            let refused = matches!(inserted, Err(FrameError::SelfTransform { .. } | FrameError::Cycle { .. }));
            prop_assert!(inserted.is_ok() || refused, "{inserted:?}");
            frames.sanity_check();
            if inserted.is_ok() {
                prop_assert!(frames.lookup(names[parent], names[child], at(seconds)).is_ok());
            }
            for name in names {
                prop_assert_eq!(frames.root_of(name), frames.plain_root_of(name));
            }
        }
    }
}
