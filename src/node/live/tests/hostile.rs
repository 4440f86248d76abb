//! What may come over the network in any order and number: the node takes the next good cloud, and counts the rest.

use super::*;
use crate::msg::ros::Time;
use crate::node::counts::WAITING_QUEUE_FULL;
use crate::reason::SESSION_ENDED;

/// The events, then a good transform and a good cloud at `seconds`; gives how the node ended and what it counted.
fn survives(hostile: Vec<Event<()>>, seconds: f64, taken_in: u64) -> (Counts, Rc<Fake>) {
    let mut events = hostile;
    events.extend([transform(at(seconds), false), cloud(at(seconds), "camera")]);
    let (ended, counts, transport) = node(Fake::default(), events, taken_in);
    ended.unwrap();
    assert_eq!(counts.taken_in, taken_in, "{counts}");
    (counts, transport)
}

fn bad_cloud(error: CloudError) -> Event<()> {
    Event::Cloud(Form::Points.of(0), Err(error))
}

fn changed(change: impl FnOnce(&mut TransformStamped)) -> Event<()> {
    let mut event = transform(at(9.0), false);
    if let Event::Transforms { message, .. } = &mut event {
        change(&mut message.transforms[0]);
    }
    event
}

#[test]
fn refused_transforms_cost_themselves_and_the_next_good_one_counts() {
    let quaternion = |w| Quaternion { x: 0.0, y: 0.0, z: 0.0, w };
    let hostile = vec![
        changed(|t| t.child_frame_id = "x".repeat(1 << 20)),
        changed(|t| t.child_frame_id.clear()),
        changed(|t| t.header.frame_id = "camera".to_owned()),
        changed(|t| t.transform.rotation = quaternion(0.0)),
        changed(|t| t.transform.rotation = quaternion(f64::NAN)),
        changed(|t| t.transform.translation.x = f64::INFINITY),
        changed(|t| t.header.stamp = Time { sec: 9, nanosec: u32::MAX }),
        changed(|t| (t.header.frame_id, t.child_frame_id) = ("a".into(), "b".into())),
        changed(|t| (t.header.frame_id, t.child_frame_id) = ("b".into(), "a".into())),
        Event::Transforms { message: TfMessage::default(), is_static: true, publisher: None },
    ];
    let (counts, _) = survives(hostile, 10.0, 1);
    assert!(counts.skipped.is_empty(), "{counts}");
}

#[test]
fn a_refused_transform_costs_no_other_of_its_message() {
    let mut event = changed(|_| ());
    if let Event::Transforms { message: TfMessage { transforms }, .. } = &mut event {
        let mut refused = transforms[0].clone();
        refused.transform.translation.x = f64::NAN;
        transforms.insert(0, refused);
    }
    let (ended, counts, _) = node(Fake::default(), vec![event, cloud(at(9.0), "camera")], 1);
    ended.unwrap();
    assert_eq!((counts.taken_in, counts.skipped.len()), (1, 0));
}

#[test]
fn a_message_of_thousands_of_transforms_is_taken_in_pieces_that_fit() {
    let one = TransformStamped {
        header: Header { stamp: at(9.0).into(), frame_id: "odom".to_owned() },
        ..TransformStamped::default()
    };
    let many = |i| TransformStamped { child_frame_id: format!("f{i}"), ..one.clone() };
    let mut message = TfMessage { transforms: (0..30_000).map(many).collect() };
    message.transforms[9_000].child_frame_id = "camera".to_owned();
    let hostile =
        vec![Event::Transforms { message, is_static: false, publisher: None }, cloud(at(9.0), "camera")];
    // The tree is full of frames of this time until they are out of date.
    let (counts, _) = survives(hostile, 20.0, 2);
    assert!(counts.skipped.is_empty(), "{counts}");
}

#[test]
fn clouds_of_ever_new_frames_are_bounded_by_the_queue_and_counted() {
    let strangers = (0..60).map(|i| cloud(at(10.0), &format!("stranger{i}")));
    let (counts, _) = survives(strangers.collect(), 10.0, 1);
    let skipped: u64 = counts.skipped.values().sum();
    assert_eq!((counts.received, skipped), (61, 60), "{counts}");
    assert!(counts.skipped[&WAITING_QUEUE_FULL] > 0, "{counts}");
}

#[test]
fn stamps_at_both_ends_of_the_wire_are_scans_like_any_and_the_next_good_one_is_taken_in() {
    let stamp = |sec, nanosec| Time { sec, nanosec }.stamp().unwrap();
    let (first, last) = (stamp(i32::MIN, 0), stamp(i32::MAX, 999_999_999));
    let hostile =
        vec![transform(first, false), cloud(first, "camera"), transform(last, false), cloud(last, "camera")];
    let good = [transform(at(1.7e9), false), cloud(at(1.7e9), "camera")];
    let (ended, counts, transport) = node(Fake::default(), hostile.into_iter().chain(good).collect(), 1);
    ended.unwrap();
    // The stamps jump back by years: what still waits of the session before is given up.
    let ended = counts.skipped.get(&SESSION_ENDED).copied().unwrap_or(0);
    assert_eq!((counts.received, counts.taken_in + ended), (3, 3), "{counts}");
    let deltas = transport.deltas.borrow();
    assert_eq!(deltas.last().unwrap().header.stamp, at(1.7e9).into());
}

#[test]
fn a_clock_that_jumps_to_and_fro_begins_sessions_and_nothing_else() {
    let clock = |sec| Event::Clock(Time { sec, nanosec: 0 }.stamp().unwrap());
    let garbled = || Event::Garbled { topic: "/clock".into(), text: "4294967295 ns in a second".to_owned() };
    let hostile = (0..20).flat_map(|_| [clock(i32::MAX), clock(i32::MIN), clock(0), garbled()]).collect();
    survives(hostile, 10.0, 1);
}

#[test]
fn a_flood_of_calls_is_answered_one_by_one_and_the_next_cloud_is_taken_in() {
    let (_, transport) = survives((0..90).map(|_| Event::Call(Service::Reset, ())).collect(), 10.0, 1);
    let replies = transport.replies.borrow();
    assert!(replies.len() == 90 && replies.iter().all(|reply| reply.success));
}

#[test]
fn losses_by_made_up_numbers_do_not_overflow() {
    let lost = || Event::Lost(Form::Points.of(0), i64::MAX as u64);
    let (counts, _) = survives(vec![lost(), lost(), lost()], 10.0, 1);
    assert_eq!(counts.lost, u64::MAX);
}

#[test]
fn a_flood_of_bad_clouds_is_counted_by_reason_and_the_next_good_one_is_taken_in() {
    let bad = (0..80).map(|i| match i % 3 {
        0 => bad_cloud(CloudError::ZeroPointStep),
        1 => bad_cloud(CloudError::Undecodable("x".repeat(1 << 16))),
        _ => bad_cloud(CloudError::LongFrameId { bytes: 1 << 20, max: 256 }),
    });
    let (counts, _) = survives(bad.collect(), 10.0, 1);
    assert_eq!(by_key(counts), [("long_frame_id", 26), ("undecodable", 27), ("zero_point_step", 27)]);
}

#[test]
fn points_at_the_ends_of_numbers_are_left_out_by_point() {
    let (most, least) = (f32::MAX, f32::from_bits(1));
    let ends = vec![[most, most, 1.0], [-most, 0.0, 1.0], [least, -least, 1.0], [0.0, 0.0, 1.0]];
    let mut event = cloud(at(9.5), "camera");
    if let Event::Cloud(_, Ok(cloud)) = &mut event {
        (cloud.points, cloud.total) = (Points::F32(ends), 4);
    }
    survives(vec![transform(at(9.5), false), event], 10.0, 2);
}

#[test]
fn a_pose_at_the_ends_of_numbers_leaves_out_its_points_and_not_the_next_scan() {
    let far = |x: f64| {
        let mut event = transform(at(9.5), false);
        if let Event::Transforms { message, .. } = &mut event {
            message.transforms[0].transform.translation = Vector3 { x, y: -x, z: x };
        }
        event
    };
    for x in [1e300, f64::MAX, -1e12, f64::MIN_POSITIVE / 2.0] {
        survives(vec![far(x), cloud(at(9.5), "camera")], 20.0, 2);
    }
}
