//! Which scans a node on a middleware made of channels takes.

use super::reports::{by_hand, driven, part, value};
use super::*;
use crate::node::heard::SILENT;

#[test]
fn the_first_input_that_sends_a_good_scan_is_the_only_one_taken() {
    let of = |input, seconds| match cloud(at(seconds), "camera") {
        Event::Cloud(_, cloud) => Event::Cloud(input, cloud),
        other => other,
    };
    let events = vec![
        transform(at(0.0), true),
        Event::Cloud(Form::Depth.of(0), Err(CloudError::NoCameraInfo)),
        Event::Camera(
            0,
            Err(CloudError::BadIntrinsics { fx: 0.0, fy: 0.0, cx: 0.0, cy: 0.0 }),
            String::new(),
        ),
        of(Form::CompressedDepth.of(0), 10.0),
        of(Form::Depth.of(0), 10.0),
        Event::Cloud(Form::Points.of(0), Err(CloudError::EmptyFrameId)),
        of(Form::CompressedDepth.of(0), 10.1),
        of(Form::Points.of(0), 10.1),
        Event::Lost(Form::Points.of(0), 2),
    ];
    let (_, counts, _) = node(Fake::default(), events, 2);
    assert_eq!((counts.received, counts.taken_in, counts.lost), (6, 2, 2));
    assert_eq!(by_key(counts), [("no_camera_info", 1), ("other_input", 3)]);
}

#[test]
fn a_scan_without_a_stamp_is_refused_but_where_time_may_begin_at_zero() {
    for (simulated, taken_in, skipped) in [(false, 1, vec![("no_stamp", 1)]), (true, 2, vec![])] {
        let given = [("use_sim_time".to_owned(), Value::Boolean(simulated))];
        let events = vec![transform(at(0.0), true), cloud(at(0.0), "camera"), cloud(at(0.1), "camera")];
        let (_, counts, _) = node_with(&Config::new(given).unwrap(), Fake::default(), events, taken_in);
        assert_eq!((counts.received, counts.taken_in), (2, taken_in));
        assert_eq!(by_key(counts), skipped);
    }
}

#[test]
fn a_scan_without_points_is_taken_in_and_chooses_no_input() {
    let of = |input, seconds, used: usize| {
        let (stamp, frame_id, points) =
            (at(seconds), "camera".to_owned(), Points::F32(vec![[0.0, 0.0, 1.0]; used]));
        let total = used as u32;
        Event::Cloud(input, Ok(Cloud { stamp, frame_id, points, total, invalid: 0, out_of_range: 0 }))
    };
    let (cloud, image) = (Form::Points.of(0), Form::Depth.of(0));
    let events = vec![
        transform(at(0.0), true),
        of(cloud, 10.0, 0),
        of(image, 10.1, 20),
        of(cloud, 10.2, 20),
        of(image, 10.3, 0),
    ];
    let (_, counts, _) = node(Fake::default(), events, 3);
    assert_eq!((counts.received, counts.taken_in), (4, 3));
    assert_eq!(by_key(counts), [("other_input", 1)]);
}

/// A network too slow for raw images, through which one gets.
#[test]
fn where_the_chosen_form_has_been_silent_for_a_minute_another_that_is_offered_takes_its_place() {
    let image = Source { topic: "/depth/image".to_owned(), type_name: "sensor_msgs/msg/Image".to_owned() };
    let compressed = Source {
        topic: "/depth/image/compressedDepth".to_owned(),
        type_name: "sensor_msgs/msg/CompressedImage".to_owned(),
    };
    let (alone, both) = (vec![image.clone()], vec![image, compressed]);
    for (silence, sources, is_forgotten) in
        [(SILENT / 2, &both, false), (SILENT, &alone, false), (SILENT, &both, true)]
    {
        let fake = Fake { sources: sources.clone(), ..Fake::default() };
        let (report, said) = driven(fake, async |live| {
            live.intakes[0].chosen = Some(Form::Depth);
            live.intakes[0].since = Instant::now().checked_sub(silence).unwrap();
        });
        let line = "nothing has come on /depth/image for 60 s: whichever form of the sensor points comes first is taken";
        assert_eq!(said.contains(&(20, line.to_owned())), is_forgotten, "{said:?}");
        let topic = if is_forgotten { "/points, or /depth/image or " } else { "/depth/image" };
        let sensor = part(&report, "sensor points");
        assert!(value(&sensor, "topic").starts_with(topic), "{sensor:?}");
    }
}

/// A driver that is started again in another form.
#[test]
fn where_nobody_sends_the_chosen_form_any_more_the_next_that_comes_is_taken() {
    let of = |form: Form, seconds| match cloud(at(seconds), "camera") {
        Event::Cloud(_, cloud) => Event::Cloud(form.of(0), cloud),
        other => other,
    };
    let image = [Source { topic: "/depth/image".to_owned(), type_name: "sensor_msgs/msg/Image".to_owned() }];
    let other = [Source { topic: "/tf".to_owned(), type_name: "tf2_msgs/msg/TFMessage".to_owned() }];
    let chosen = Builder::new_current_thread().enable_time().build().unwrap().block_on(async {
        let (mut live, _reported) = by_hand(&Config::new([]).unwrap(), Fake::default());
        live.event(of(Form::Depth, 10.0)).await;
        let mut chosen = Vec::new();
        // Where nobody at all is known, it cannot be known who has gone.
        for (quiet, sources, knows_all) in [
            (Duration::ZERO, &other[..], true),
            (QUIET, &image, true),
            (QUIET, &[], false),
            (QUIET, &[], true),
        ] {
            live.intakes[0].since = Instant::now().checked_sub(quiet).unwrap();
            live.transport.knows_all.set(knows_all);
            live.forget_gone(sources);
            chosen.push(live.intakes[0].chosen);
        }
        live.event(of(Form::CompressedDepth, 11.0)).await;
        chosen.push(live.intakes[0].chosen);
        chosen
    });
    let depth = Some(Form::Depth);
    assert_eq!(chosen, [depth, depth, depth, None, Some(Form::CompressedDepth)]);
}
