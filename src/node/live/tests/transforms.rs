//! What is reported of transforms.

use super::reports::{driven, part, value};
use super::*;
use crate::msg::reports::DiagnosticStatus;
use crate::msg::types::TRANSFORMS;

/// A transform whose quaternion has zeros alone, as of odometry that was never initialised.
fn of_norm_0(stamp: Stamp) -> Event<()> {
    let mut event = transform(stamp, false);
    if let Event::Transforms { message, .. } = &mut event {
        message.transforms[0].transform.rotation.w = 0.0;
    }
    event
}

/// What is reported where a good transform at 10 s and four that are refused come before a scan of this time, which waits in vain
/// where it is later.
fn reported_with_refused(seconds: f64) -> DiagnosticStatus {
    let (report, _) = driven(Fake::default(), async |live| {
        live.event(transform(at(10.0), false)).await;
        for number in 1..=4 {
            live.event(of_norm_0(at(10.0 + f64::from(number) / 30.0))).await;
        }
        live.event(cloud(at(seconds), "camera")).await;
        for waited in live.join.give_up(Duration::from_secs(9).into()) {
            live.skip(&waited, GivenUp::TimedOut);
        }
    });
    part(&report, "transforms")
}

#[test]
fn what_helps_where_a_scan_got_no_transform_is_reported_as_it_is_logged() {
    let nobody = "no frame odom has been seen; no transform has come at all: nobody publishes on /mine/tf and /tf_static; transforms \
                  are on others: use -r /tf:=/robot1/tf -r /tf_static:=/robot1/tf_static";
    let seen = "no frame nowhere has been seen; frames seen: camera, odom";
    for (has_transforms, words) in [(false, nobody), (true, seen)] {
        let mut fake = Fake::default();
        fake.transforms.changing = "/mine/tf".to_owned();
        fake.sources.push(Source { topic: "/robot1/tf".to_owned(), type_name: TRANSFORMS.to_owned() });
        let (report, said) = driven(fake, async |live| {
            if has_transforms {
                live.event(transform(at(10.0), true)).await;
            }
            live.event(cloud(at(10.0), "nowhere")).await;
            for waited in live.join.give_up(Duration::from_secs(9).into()) {
                live.skip(&waited, GivenUp::TimedOut);
            }
            // What comes before the report was not there when the cloud was given up.
            live.event(transform(at(11.0), true)).await;
        });
        let transforms = part(&report, "transforms");
        assert!(transforms.message.contains(words), "{transforms:?}");
        assert!(said.contains(&(30, transforms.message.clone())), "{transforms:?}: {said:?}");
        let sensor = part(&report, "sensor points");
        assert!(sensor.message.ends_with(&format!("; why one is not: {}", transforms.message)), "{sensor:?}");
    }
}

/// A simulator that is paused gives no scan up.
#[test]
fn what_helps_is_reported_too_where_a_scan_waits_on_for_the_simulated_clock_is_halted() {
    let (report, _) = driven(Fake::default(), async |live| {
        live.event(transform(at(10.0), true)).await;
        live.event(cloud(at(10.0), "nowhere")).await;
        live.clocks = Clocks::new(Instant::now().checked_sub(3 * QUIET).unwrap(), true);
    });
    let transforms = part(&report, "transforms");
    let words = "no frame nowhere has been seen; frames seen: camera, odom; nobody says where `nowhere` is";
    assert!(transforms.level == 1 && transforms.message.starts_with("no /clock has come"), "{transforms:?}");
    assert!(transforms.message.contains(words), "{transforms:?}");
}

const REFUSED: &str = "transforms refused: 4; the last: transform camera to odom has a quaternion of \
                       norm 0, must be 1 within 0.01";

#[test]
fn transforms_that_are_refused_are_a_warning_with_their_number_and_the_reason_of_the_last() {
    let transforms = reported_with_refused(10.0);
    assert_eq!((transforms.level, transforms.message.as_str()), (1, REFUSED));
    assert_eq!(["refused", "given up"].map(|key| value(&transforms, key)), ["4", "0"]);
}

#[test]
fn where_scans_are_given_up_for_transforms_that_were_refused_both_are_said() {
    let transforms = reported_with_refused(10.1);
    assert_eq!(transforms.level, 2, "none was taken in: {transforms:?}");
    let both = transforms.message.strip_prefix(REFUSED).and_then(|rest| rest.strip_prefix("; "));
    let why = both.unwrap_or_else(|| panic!("{transforms:?}"));
    assert!(why.starts_with("a cloud was skipped") && why.contains("s after the range covered by"), "{why}");
    assert_eq!(["refused", "given up"].map(|key| value(&transforms, key)), ["4", "1"]);
}

#[test]
fn a_static_transform_that_another_one_contradicts_is_a_warning_and_a_line() {
    let (report, said) = driven(Fake::default(), async |live| {
        live.event(transform(at(10.0), true)).await;
        live.event(cloud(at(10.0), "camera")).await;
        for x in [0.0, 0.0, 1.0] {
            let mut event = transform(at(10.0), true);
            if let Event::Transforms { message, .. } = &mut event {
                message.transforms[0].transform.translation.x = x;
            }
            live.event(event).await;
        }
    });
    let transforms = part(&report, "transforms");
    let words = "the static transform of camera below odom is another than before, by 1.000 m and 0.000 rad";
    assert!(transforms.level == 1 && transforms.message.starts_with(words), "{transforms:?}");
    assert_eq!(said.iter().filter(|(_, line)| *line == transforms.message).count(), 1, "{said:?}");
}

#[test]
fn a_static_transform_by_which_no_scan_is_placed_is_no_warning_wherever_it_goes() {
    let (report, said) = driven(Fake::default(), async |live| {
        live.event(transform(at(10.0), true)).await;
        live.event(cloud(at(10.0), "camera")).await;
        for x in [0.0, 1.0] {
            let mut event = transform(at(10.0), true);
            let Event::Transforms { message, .. } = &mut event else { unreachable!() };
            message.transforms[0].child_frame_id = "dock".to_owned();
            message.transforms[0].transform.translation.x = x;
            live.event(event).await;
        }
    });
    assert_eq!(part(&report, "transforms").level, 0, "{report:?}");
    assert!(said.iter().any(|(_, line)| line.contains("dock below odom is another than before")), "{said:?}");
}

/// Wheel odometry and a filter over it; what happens to a wheel is of no interest.
#[test]
fn two_publishers_that_place_a_frame_on_the_sensors_way_differently_are_a_warning_and_a_line() {
    let (report, said) = driven(Fake::default(), async |live| {
        let begin = Instant::now();
        for step in 0..25 {
            let seconds = 0.1 * f64::from(step);
            for (number, x) in [(1, 0.0), (2, 0.4)] {
                let event = transform(at(10.0 + seconds), false);
                let Event::Transforms { message, .. } = &event else { unreachable!() };
                let mut camera = message.transforms[0].clone();
                live.event(event).await;
                camera.transform.translation.x = x;
                let wheel = TransformStamped { child_frame_id: "wheel".to_owned(), ..camera.clone() };
                for frame in [camera, wheel] {
                    live.look_for_rivals([number; 16], &frame, begin + Duration::from_secs_f64(seconds));
                }
            }
            live.event(cloud(at(10.0 + seconds), "camera")).await;
        }
    });
    let transforms = part(&report, "transforms");
    let line = "two publishers place camera below odom by turns, 0.40 m and 0.00 rad apart";
    assert!(transforms.level == 1 && transforms.message.starts_with(line), "{transforms:?}");
    let lines: Vec<_> = said.iter().filter(|(_, line)| line.contains("publishers")).collect();
    assert!(lines.len() == 1 && lines[0].0 == 30 && lines[0].1.starts_with(line), "{lines:?}");
}

#[test]
fn a_fixed_frame_that_takes_the_sensor_with_it_is_a_warning_and_said_once() {
    let (report, said) = driven(Fake::default(), async |live| {
        live.fixed_frame = "camera".to_owned();
        for second in 0..5 {
            let mut event = transform(at(f64::from(second)), false);
            if let Event::Transforms { message, .. } = &mut event {
                message.transforms[0].transform.translation.x = f64::from(second);
            }
            live.event(event).await;
            live.event(cloud(at(f64::from(second)), "camera")).await;
            live.look_for_riding();
        }
    });
    let transforms = part(&report, "transforms");
    let words = "the fixed frame `camera` moves in `odom` and takes the sensor with it";
    assert!(transforms.level == 1 && transforms.message.starts_with(words), "{transforms:?}");
    assert_eq!(said.iter().filter(|(level, line)| *level == 30 && *line == transforms.message).count(), 1);
}
