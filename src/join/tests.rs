mod laps;

use super::*;
use crate::engine::Points;
use crate::msg::ros::{Header, Transform};

fn at(seconds: f64) -> Stamp {
    Stamp::from_nanos((seconds * 1e9) as i64)
}

fn cloud(seconds: f64) -> Cloud {
    let (stamp, points) = (at(seconds), Points::F32(vec![[0.0, 0.0, 1.0]]));
    Cloud { stamp, frame_id: "camera".into(), points, total: 2, invalid: 1, out_of_range: 0 }
}

fn joined_with_static_camera() -> Join {
    let mut join = Join::new(4);
    let header = Header { stamp: at(0.0).into(), frame_id: "map".into() };
    let child_frame_id = "camera".to_owned();
    let transform = TransformStamped { header, child_frame_id, transform: Transform::default() };
    join.transform(&transform, true).unwrap();
    join
}

fn back(join: &mut Join, seconds: f64) -> Vec<Option<f64>> {
    assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
    let jumps = join.ready("map").into_iter().map(|joined| joined.jumped_back);
    jumps.map(|jump| jump.map(|jump| jump.seconds)).collect()
}

#[test]
fn a_stamp_of_zero_is_none_but_of_a_simulated_clock() {
    assert_eq!(with_stamp(cloud(0.0), || false), Err(CloudError::NoStamp));
    for (seconds, is_simulated) in [(0.0, true), (1e-9, false), (-1.0, false)] {
        assert_eq!(with_stamp(cloud(seconds), || is_simulated), Ok(cloud(seconds)));
    }
}

#[test]
fn with_a_clock_that_jumps_back_what_is_from_before_it_goes_and_what_is_from_after_it_waits_on() {
    let mut join = Join::new(4);
    let stamps = |waited: &[Waited]| waited.iter().map(|waited| waited.cloud.stamp).collect::<Vec<_>>();
    for (sensor, seconds) in [(0, 20.0), (1, 20.0), (1, 1.0)] {
        assert_eq!(join.cloud(sensor, cloud(seconds), Moment::default()), None);
    }
    assert_eq!(stamps(&join.clock_jumped_back(at(1.1), Moment::default())), [at(20.0); 2]);
    assert_eq!(stamps(&join.begin_session(Moment::default())), [at(1.0)]);
}

/// As `/clock` does it that comes before the transforms and the clouds of its lap.
#[test]
fn with_a_clock_that_jumps_back_no_scan_is_placed_by_transforms_from_before_it() {
    let mut join = Join::new(4);
    [11.9, 12.1, 20.0].iter().for_each(|seconds| odometry(&mut join, *seconds, 0.0));
    assert!(join.cloud(0, cloud(20.0), Moment::default()).is_none());
    assert_eq!(places(&mut join), (vec![(at(20.0), 0.0)], 0));
    assert!(join.clock_jumped_back(at(12.0), Moment::default()).is_empty());
    assert!(join.cloud(0, cloud(12.05), Moment::default()).is_none());
    assert_eq!(places(&mut join), (Vec::new(), 0));
    odometry(&mut join, 12.0, 20.0);
    assert_eq!(places(&mut join), (Vec::new(), 0));
    odometry(&mut join, 12.1, 20.0);
    assert_eq!(places(&mut join), (vec![(at(12.05), 20.0)], 0));
}

#[test]
fn clouds_of_ever_new_frames_leave_no_more_sensors_than_there_is_room_for() {
    let mut join = Join::new(4);
    for number in 0..10 * SENSORS {
        let frame = format!("camera{number}");
        let cloud = Cloud { frame_id: frame.clone(), ..cloud(1.0) };
        assert!(join.cloud(0, cloud, Moment::default()).is_none());
        assert_eq!(join.ready(&frame).len(), 1);
        let kept = [join.sensors.len(), join.laps.sensors().count()];
        assert!(kept.iter().all(|kept| *kept <= SENSORS), "{kept:?} of {}", number + 1);
    }
}

#[test]
fn a_step_back_of_a_second_is_a_jump_and_less_is_not() {
    let mut join = joined_with_static_camera();
    assert_eq!(back(&mut join, 10.0), [None]);
    assert_eq!(back(&mut join, 9.1), [None]);
    assert_eq!(back(&mut join, 8.75), [Some(1.25)]);
    assert_eq!(back(&mut join, 9.0), [None]);
    assert!(join.begin_session(Moment::default()).is_empty());
    assert_eq!(back(&mut join, 1.0), [None]);
}

#[test]
fn a_cloud_waits_for_its_transform_and_knows_what_it_lacks() {
    let mut join = Join::new(1);
    assert!(join.cloud(0, cloud(1.0), Moment::default()).is_none());
    assert!(join.ready("map").is_empty());
    let (frame, lacks) = join.oldest().unwrap();
    assert!(frame == "camera" && lacks.is_some_and(|error| matches!(error.lack, Lack::UnknownFrame { .. })));
    let pushed_out = join.cloud(0, cloud(2.0), Moment::default()).unwrap();
    assert_eq!((pushed_out.cloud.stamp, join.waiting()), (at(1.0), 1));
    let joined = join.ready("camera");
    assert_eq!((joined.len(), joined[0].scan.stamp), (1, at(2.0)));
    assert_eq!((joined[0].total, joined[0].invalid), (2, 1));
}

fn static_camera(join: &mut Join, name: &str) {
    let header = Header { stamp: at(0.0).into(), frame_id: "map".into() };
    let transform =
        TransformStamped { header, child_frame_id: name.to_owned(), transform: Transform::default() };
    join.transform(&transform, true).unwrap();
}

#[test]
fn a_sensor_that_is_late_or_whose_clock_is_off_is_no_jump() {
    let mut join = joined_with_static_camera();
    static_camera(&mut join, "other");
    for seconds in [10.0, 10.1, 10.2] {
        assert_eq!(back(&mut join, seconds), [None]);
        let late = Cloud { frame_id: "other".into(), ..cloud(seconds - 5.0) };
        assert!(join.cloud(0, late, Moment::default()).is_none());
        assert_eq!(join.ready("map")[0].jumped_back, None);
    }
}

#[test]
fn two_sensors_in_one_frame_are_held_against_themselves() {
    let mut join = joined_with_static_camera();
    let jumps = [(0, 10.0), (1, 8.0), (0, 10.1), (1, 8.1), (0, 10.2), (1, 7.0)].map(|(sensor, seconds)| {
        assert!(join.cloud(sensor, cloud(seconds), Moment::default()).is_none());
        join.ready("map")[0].jumped_back.is_some()
    });
    assert_eq!(jumps, [false, false, false, false, false, true]);
}

#[test]
fn clouds_of_two_laps_that_wait_together_stay_apart_and_the_rest_of_the_first_is_given_up() {
    let mut join = Join::new(8);
    let lost = Cloud { frame_id: "lost".into(), ..cloud(11.0) };
    let laps = [cloud(10.0), cloud(10.5), lost, cloud(5.0), cloud(5.5)];
    assert!(laps.into_iter().all(|cloud| join.cloud(0, cloud, Moment::default()).is_none()));
    static_camera(&mut join, "camera");
    let ready = join.ready("map");
    let stamps: Vec<_> = ready.iter().map(|joined| joined.scan.stamp).collect();
    assert_eq!(stamps, [10.0, 10.5, 5.0, 5.5].map(at));
    let jumps: Vec<_> = ready.iter().map(|joined| joined.jumped_back).collect();
    assert_eq!(jumps, [None, None, Some(Jump { seconds: 5.5, given_up: 1 }), None]);
    assert_eq!(join.waiting(), 0);
}

/// Takes in where the camera is at this time.
fn odometry(join: &mut Join, seconds: f64, x: f64) {
    let header = Header { stamp: at(seconds).into(), frame_id: "odom".into() };
    let mut transform = Transform::default();
    transform.translation.x = x;
    join.transform(&TransformStamped { header, child_frame_id: "camera".into(), transform }, false).unwrap();
}

/// Stamp and x of the scans that are ready, and how many of them begin a session.
fn places(join: &mut Join) -> (Vec<(Stamp, f64)>, usize) {
    let ready = join.ready("odom");
    let jumps = ready.iter().filter(|joined| joined.jumped_back.is_some()).count();
    let place = |joined: &Joined| (joined.scan.stamp, joined.scan.fixed_from_sensor.translation.x);
    (ready.iter().map(place).collect(), jumps)
}

#[test]
fn a_waiting_cloud_leaves_when_its_transform_comes_or_when_it_has_waited_too_long() {
    let mut join = Join::new(8);
    odometry(&mut join, 2.0, 4.0);
    assert!(join.cloud(0, cloud(2.5), Moment::default()).is_none());
    assert_eq!(places(&mut join), (Vec::new(), 0));
    odometry(&mut join, 3.0, 6.0);
    assert_eq!(places(&mut join), (vec![(at(2.5), 5.0)], 0));

    assert!(join.cloud(0, cloud(9.0), Moment::default()).is_none());
    assert_eq!(places(&mut join), (Vec::new(), 0));
    let [early, late] = [199, 200].map(|ms| Moment::from(Duration::from_millis(ms)));
    assert!(join.expired(early, late.wall).is_empty());
    let expired = join.expired(late, late.wall);
    assert_eq!(expired[0].lacks.as_ref().unwrap().reason().key, "tf_too_late");
}

#[test]
fn after_a_jump_back_the_transforms_of_before_count_no_more() {
    let mut join = Join::new(8);
    for tenth in 0..50 {
        assert!(join.cloud(0, cloud(f64::from(tenth) * 0.1), Moment::default()).is_none());
        odometry(&mut join, f64::from(tenth) * 0.1, 0.0);
        assert_eq!(places(&mut join).0.len(), 1);
    }
    // The robot is elsewhere, and its clouds come before their transforms.
    for tenth in 20..25 {
        let seconds = f64::from(tenth) * 0.1;
        assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
        assert_eq!(places(&mut join), (Vec::new(), 0), "at {seconds} s");
        odometry(&mut join, seconds, 20.0);
        assert_eq!(places(&mut join), (vec![(at(seconds), 20.0)], usize::from(tenth == 20)));
    }
}

/// As localization does it, so that its transforms count until the next.
#[test]
fn transforms_that_are_dated_ahead_have_jumped_back_too() {
    let mut join = Join::new(8);
    let mut sessions = Vec::new();
    for seconds in [8.0, 8.1, 8.2, 8.3, 3.0, 3.1, 3.2, 3.3] {
        odometry(&mut join, seconds, 0.0);
        let header = Header { stamp: at(seconds + 1.5).into(), frame_id: "map".into() };
        let (child_frame_id, transform) = ("odom".to_owned(), Transform::default());
        join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
        assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
        let ready = join.ready("odom").into_iter();
        sessions.extend(ready.map(|joined| joined.jumped_back.is_some()));
    }
    assert_eq!(sessions, [false, false, false, false, true, false, false, false]);
}

#[test]
fn a_scan_that_comes_again_late_begins_no_session_and_costs_no_other() {
    let mut join = Join::new(8);
    let mut taken = 0;
    for tenth in 0..100 {
        let seconds = f64::from(tenth) * 0.1;
        odometry(&mut join, seconds, 0.0);
        assert!(join.cloud(0, cloud(seconds), Moment::default()).is_none());
        if tenth == 50 {
            assert!(join.cloud(0, cloud(2.0), Moment::default()).is_none());
        }
        let (places, jumps) = places(&mut join);
        assert_eq!(jumps, 0);
        taken += places.len();
    }
    assert_eq!((taken, join.waiting()), (100, 1));
    let why = join.oldest().unwrap().1.unwrap().to_string();
    assert!(
        why.contains("7.800 s before that of the newest scan, and the transforms have not jumped back"),
        "{why}"
    );
}

/// A bag in a loop beside a robot that moves.
#[test]
fn transforms_that_do_not_move_a_sensor_do_not_keep_its_session_from_beginning() {
    let mut join = joined_with_static_camera();
    let mut now = 1000.0;
    let laps = [0, 1].map(|_| {
        let lap = (0..40).map(|tenth| {
            now += 0.1;
            let header = Header { stamp: at(now).into(), frame_id: "base_link".into() };
            let (child_frame_id, transform) = ("wheel".to_owned(), Transform::default());
            join.transform(&TransformStamped { header, child_frame_id, transform }, false).unwrap();
            back(&mut join, 10.0 + f64::from(tenth) * 0.1)
        });
        lap.collect::<Vec<_>>()
    });
    assert!(laps.iter().flatten().all(|ready| ready.len() == 1), "{laps:?}");
    let sessions = laps.map(|lap| lap.iter().flatten().flatten().count());
    assert_eq!(sessions, [0, 1]);
}

#[test]
fn a_stray_stamp_without_a_transform_wipes_nothing() {
    let mut join = joined_with_static_camera();
    assert_eq!(back(&mut join, 10.0), [None]);
    let stray = Cloud { frame_id: "lost".into(), ..cloud(9_000.0) };
    assert!(join.cloud(0, stray, Moment::default()).is_none());
    assert_eq!(back(&mut join, 10.1), [None]);
}
