//! What the log says of a node on a middleware made of channels.

use super::reports::{by_hand, driven};
use super::*;
use crate::cloud::Camera;
use crate::msg::ros::CameraInfo;

/// Two sensors of all forms.
pub(super) fn two() -> Fake {
    let mut fake = Fake::default();
    let mut rear = fake.inputs[0].clone();
    rear.name = "rear".to_owned();
    rear.points.as_mut().unwrap().resolved = "/rear".to_owned();
    let depth = rear.depth.as_mut().unwrap();
    depth.image.resolved = "/rear/image".to_owned();
    depth.camera_info.resolved = "/rear/camera_info".to_owned();
    fake.inputs.push(rear);
    fake
}

fn distorted_camera() -> Camera {
    let k = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0];
    let info = CameraInfo { width: 640, height: 480, d: vec![0.1], k, ..CameraInfo::default() };
    Camera::from_info(&info).unwrap()
}

#[test]
fn what_is_wrong_with_one_sensor_does_not_hide_it_of_another() {
    let later = new_session(0) as f64 / 1e9 + 60.0;
    let hardly_used = || match cloud(at(later), "camera") {
        Event::Cloud(_, Ok(cloud)) => Cloud { total: 1000, invalid: 980, ..cloud },
        other => panic!("{other:?}"),
    };
    let events = (0..2).flat_map(|sensor| {
        [
            Event::Camera(sensor, Ok(distorted_camera()), String::new()),
            Event::Cloud(Form::Points.of(sensor), Err(CloudError::EmptyFrameId)),
            Event::Cloud(Form::Points.of(sensor), Ok(hardly_used())),
            Event::Cloud(Form::Depth.of(sensor), Ok(hardly_used())),
        ]
    });
    let (_, said) = heard(|| reported(two(), events.collect()));
    for [name, points, image, info] in [
        ["points", "/points", "/depth/image", "/depth/camera_info"],
        ["rear", "/rear", "/rear/image", "/rear/camera_info"],
    ] {
        for start in [
            format!("{info} tells of lens distortion"),
            format!("a scan of {points} was skipped: header frame_id is empty"),
            format!("{points}: of 1000 points only 20 can be used"),
            format!("{image} is skipped, for {points} was first"),
            format!("the stamps of the sensor {name} are "),
        ] {
            let lines = said.iter().filter(|(level, line)| *level == 30 && line.starts_with(&start));
            assert_eq!(lines.count(), 1, "{start}: {said:?}");
        }
    }
}

#[test]
fn intrinsics_of_another_frame_than_the_images_are_said_once() {
    for (frame, of, times) in [
        ("camera", Form::Depth, 0),
        ("", Form::Depth, 0),
        ("colour", Form::Depth, 1),
        ("colour", Form::Points, 0),
    ] {
        let image = |seconds| match cloud(at(seconds), "camera") {
            Event::Cloud(_, cloud) => Event::Cloud(of.of(0), cloud),
            other => panic!("{other:?}"),
        };
        let begin = new_session(0) as f64 / 1e9;
        let camera = Event::Camera(0, Ok(distorted_camera()), frame.to_owned());
        let (_, said) =
            heard(|| reported(Fake::default(), vec![camera, image(begin + 60.0), image(begin + 60.1)]));
        let words = "images of /depth/image are in frame `camera`, their intrinsics on /depth/camera_info in `colour`";
        assert_eq!(
            said.iter().filter(|(_, line)| line.starts_with(words)).count(),
            times,
            "{frame}: {said:?}"
        );
    }
}

#[test]
fn distortion_is_said_of_an_image_that_is_not_rectified_by_its_name() {
    for (image, times) in [("/depth/image", 1), ("/depth/image_rect_raw", 0), ("/rectified/image", 1)] {
        let mut fake = Fake::default();
        fake.inputs[0].depth.as_mut().unwrap().image.resolved = image.to_owned();
        let (_, said) =
            heard(|| reported(fake, vec![Event::Camera(0, Ok(distorted_camera()), String::new())]));
        let words =
            format!("/depth/camera_info tells of lens distortion: images of {image} are taken as rectified");
        assert_eq!(said.iter().filter(|(_, line)| line.starts_with(&words)).count(), times, "{said:?}");
    }
}

#[test]
fn a_sensor_that_sends_nothing_but_empty_clouds_for_a_while_is_warned_of() {
    let sent = |seconds, total| {
        let (stamp, frame_id) = (at(seconds), "camera".to_owned());
        let points = Points::F32(vec![[0.0, 0.0, 1.0]; total as usize]);
        let cloud = Cloud { stamp, frame_id, points, total, invalid: 0, out_of_range: 0 };
        Event::Cloud(Form::Points.of(0), Ok(cloud))
    };
    let drive = async |live: &mut Live<Fake>| {
        live.event(sent(10.0, 0)).await;
        live.event(sent(10.1, 20)).await;
        assert_eq!(live.intakes[0].empty_since, None);
        live.event(sent(10.2, 0)).await;
        live.intakes[0].empty_since = Instant::now().checked_sub(QUIET);
        for seconds in [10.3, 10.4] {
            live.event(sent(seconds, 0)).await;
        }
    };
    let (_, said) = driven(Fake::default(), drive);
    let begins =
        |(level, line): &&(u8, String)| *level == 30 && line.starts_with("/points: no cloud has had a");
    assert_eq!(said.iter().filter(begins).count(), 1, "{said:?}");
}

#[test]
fn what_does_not_fit_is_said_when_it_begins_and_when_it_is_over() {
    let line = "/tf: a publisher offers less";
    let mismatches = vec![("/tf".to_owned(), "a publisher offers less".to_owned())];
    let unfit = NetworkState { mismatches, ..NetworkState::default() };
    let (_, said) = driven(Fake::default(), async |live: &mut Live<Fake>| {
        for network in [&unfit, &unfit, &NetworkState::default(), &NetworkState::default()] {
            live.say_network(network);
        }
    });
    let said: Vec<_> = said.iter().filter(|(_, said)| said.contains(line)).cloned().collect();
    assert_eq!(said, [(30, line.to_owned()), (20, format!("it is over: {line}"))]);
}

/// A sensor that is faster than a Kinect, and transforms that come later than eight of its clouds.
#[test]
fn of_a_cloud_that_is_pushed_out_tf_timeout_is_said_to_help_where_it_lets_more_wait_and_not_elsewhere() {
    let said_in = |frame: &str, tf_timeout: f64, clouds: u16| {
        let config = Config::new([("tf_timeout".to_owned(), Value::Double(tf_timeout))]).unwrap();
        let runtime = Builder::new_current_thread().enable_time().build().unwrap();
        let run = async {
            let (mut live, _reported) = by_hand(&config, Fake::default());
            for second in [9.9, 10.0] {
                live.event(transform(at(second), false)).await;
            }
            for number in 1..=clouds {
                live.event(cloud(at(10.0 + f64::from(number) / 90.0), frame)).await;
            }
        };
        let ((), said) = heard(|| runtime.block_on(run));
        let pushed_out = said.into_iter().find(|(_, line)| line.contains("it made place for a newer one"));
        pushed_out.map(|(_, line)| line.split_once("a newer one: ").unwrap().1.to_owned())
    };
    let said = |tf_timeout, clouds| said_in("camera", tf_timeout, clouds);
    let clock = "whether one clock stamps both clouds and transforms";
    let more = "8 clouds may wait, of all sensors together, and up to 64 with a larger tf_timeout";
    assert_eq!([said(0.2, 8), said(0.2, 9)], [None, Some(format!("{more}; see tf_timeout, and {clock}"))]);
    assert_eq!(said(1.0, 9), None, "the larger one has places for it");
    let no_way = said_in("nowhere", 0.2, 9).unwrap();
    assert!(no_way.starts_with("8 clouds may wait, of all sensors together; frames seen"), "{no_way}");
    let no_more = "64 clouds may wait, of all sensors together, whatever tf_timeout is";
    assert_eq!(said(60.0, 65), Some(format!("{no_more}; see {clock}")));
}
